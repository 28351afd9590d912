"""From a table to a performance and back: what the formats in columns share."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from facegen.animation.performance import Performance
from facegen.animation.streams.formats import Wish
from facegen.animation.streams.times import counted, in_order
from facegen.errors import FileError, InputError, nearest
from facegen.facs.units import Catalogue, load_catalogue
from facegen.fileio.table import Table
from facegen.fileio.textfile import whole_file

Array = NDArray[np.float64]

_UNIT = re.compile(r"AU_?0*([0-9]{1,2})", re.ASCII | re.IGNORECASE)
# A number that is written again as it stood if it differs by no more than this from what it says now: rounding.
_SAME = 1e-9
# Digits behind the point of numbers that are worked out, because none of the recorders gives more.
_DIGITS = 10


def number_of(column: str) -> str | None:
    """Return the number of the unit that a column such as AU01, AU1 or au_1 is about, or None."""
    found = _UNIT.fullmatch(column.strip())
    return found[1] if found else None


def column_of(table: Table, *names: str) -> Array | None:
    """Return the numbers of the first of several columns that a table has, or None."""
    for name in names:
        found = table.find(name)
        if found is not None and found in table.numbers:
            return table.numbers[found]
    return None


def stack(table: Table, names: Sequence[str]) -> Array | None:
    """Return columns (n, k) together, or None if one is missing."""
    found = [column_of(table, name) for name in names]
    return None if any(one is None for one in found) else np.column_stack(found)


def the_person(path: Path, people: Sequence[str], wish: Wish) -> tuple[NDArray[np.bool_], str, list[str]]:
    """Return which rows are of the face that is wished for, its name, and what is to be said.

    people: the face of each row. Without a wish the one that is there most often. InputError for one that is not.
    """
    names, counts = np.unique(np.asarray(people), return_counts=True)
    if wish.person is not None:
        if wish.person not in names:
            raise InputError(f"person: {path} has no face '{wish.person}'{nearest(wish.person, names)}; it has "
                             f"{', '.join(names[:10])}{' and more' if len(names) > 10 else ''}")
        chosen, said = wish.person, []
    else:
        chosen = str(names[counts.argmax()])
        said = [] if len(names) == 1 else [
            f"{len(names)} faces (" + ", ".join(f"'{name}' in {count} frames" for name, count in
                                                list(zip(names, counts.tolist(), strict=True))[:5])
            + f"{' ...' if len(names) > 5 else ''}); took '{chosen}': say which person for another"]
    return np.asarray(people) == chosen, chosen, said


def seconds(table: Table, wish: Wish, times: Array | None, frames: Array | None) -> Array:
    """Return the time (n,) of each row: from the file, or by ``wish.fps``. FileError if neither says."""
    if wish.fps is not None:
        return counted(frames, len(table), wish.fps)
    if times is None:
        raise FileError(f"{table.path}: has no times{'' if frames is None else ', only numbers of frames'}; "
                        f"say how many frames a second it has (fps)")
    return times


def performance(table: Table, kind: str, vocabulary: str, weights: Mapping[str, Array], times: Array, *,
                rows: NDArray[np.bool_] | None = None, person: str = "", said: Sequence[str] = (), **parts: Array | None
                ) -> Performance:
    """Return the performance of a table's rows. parts: head, place and gaze. Every column is kept as it stands."""
    rows = np.flatnonzero(np.ones(len(table), bool) if rows is None else rows)
    order, odd = in_order(table.path, np.asarray(times)[rows], table.lines[rows])
    rows = rows[order]
    extra = {name: table.numbers[name][rows] if name in table.numbers else
             np.array([table.texts[name][k] for k in rows], dtype=object) for name in table.columns}
    matrix = np.column_stack([one[rows] for one in weights.values()]) if weights else np.empty((len(rows), 0))
    about = {"format": kind, "path": str(table.path)} | ({"person": person} if person else {})
    said = dict.fromkeys((*table.warnings, *said, *odd))
    return Performance(times[rows], tuple(weights), matrix, vocabulary,
                       **{name: None if one is None else one[rows] for name, one in parts.items()},
                       extra=extra, about=about, warnings=tuple(f"{table.path}: {one}" for one in said))


def known_units(table: Table, columns: Mapping[str, Array], said: list[str]) -> dict[str, Array]:
    """Return code -> column for those that are units; the others are told."""
    catalogue = load_catalogue()
    strange = [code for code in columns if not known_unit(catalogue, code)]
    if strange:
        said.append(f"{', '.join('AU' + code for code in strange)}: no units of this face; not among the weights")
    return {code: column for code, column in columns.items() if code not in strange}


def known_unit(catalogue: Catalogue, code: str) -> bool:
    """Return whether a number is a unit's that needs no side."""
    return code in catalogue.units and code in catalogue.units[code].codes


def outside(table: Table, columns: Mapping[str, Array], high: float, said: list[str]) -> None:
    """Tell of values outside 0..high: they are kept."""
    for name, column in columns.items():
        bad = np.flatnonzero((column < 0.0) | (column > high))
        if len(bad):
            said.append(f"{name}: {len(bad)} value{'s' if len(bad) > 1 else ''} outside 0..{high:g}, the first in line "
                        f"{int(table.lines[bad[0]])} ({column[bad[0]]:g}); kept as they are")


def units_with(one: Performance, usual: Sequence[str]) -> dict[str, Array]:
    """Return unit's number -> weights (n,), in order; units that are usual and were not recorded rest."""
    rest = np.where(one.found, 0.0, np.nan)
    found = dict.fromkeys(usual, rest) | dict(zip(one.names, one.weights.T, strict=True))
    return {number: found[number] for number in sorted(found, key=int)}


def original(one: Performance, kind: str) -> dict[str, NDArray]:
    """Return the columns as they stood in the file, if it was of this format."""
    return dict(one.extra) if one.about.get("format") == kind else {}


def again(name: str, now: Array, before: Mapping[str, NDArray], tolerance: float = _SAME) -> Array:
    """Return a column: what stood in the file where it says the same, or where nothing is known now."""
    now = np.round(np.asarray(now, dtype=float), _DIGITS) + 0.0         # + 0.0: no minus zero
    old = before.get(name)
    if old is None or old.dtype == object or old.dtype.kind in "US":
        return now
    return np.where(np.isnan(now) | (np.abs(now - old) <= tolerance * np.maximum(1.0, np.abs(old))), old, now)


def spelt(name: str, before: Mapping[str, NDArray]) -> str:
    """Return a column's name as the file spelt it."""
    want = name.casefold()
    return next((one for one in before if "".join(one.split()).casefold() == want), name)


def save_table(path: Path, columns: Mapping[str, NDArray], *, formats: Mapping[str, str] | None = None,
               separator: str = ",") -> None:
    """Write columns of one length as a table, whole or not at all. formats: column -> how its numbers are written."""
    texts = [_texts(column, (formats or {}).get(name)) for name, column in columns.items()]
    with whole_file(path) as draft, draft.open("w", encoding="utf-8", newline="\n") as file:
        file.write(separator.join(map(_quoted, columns)) + "\n")
        for row in zip(*texts, strict=True):
            file.write(separator.join(row) + "\n")


def _texts(column: NDArray, form: str | None) -> list[str]:
    if column.dtype.kind in "OUS":
        return [_quoted(str(value)) for value in column]
    if form is not None:
        return ["" if value != value else format(value, form) for value in column.tolist()]
    return ["" if value != value else str(int(value)) if value.is_integer() and abs(value) < 1e15 else repr(value)
            for value in column.astype(float).tolist()]


def _quoted(text: str) -> str:
    return '"' + text.replace('"', '""') + '"' if any(mark in text for mark in ',"\r\n;\t') else text

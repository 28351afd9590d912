"""py-feat CSV (J. Cheong et al., "Py-Feat", 2023): AU01 ... in 0..1, a row a face a frame, no times.

Head as its version 2 gives it: radians, pitch up, yaw to the subject's right, roll to the subject's right; older ones
wrote degrees, which are known by being larger than any radian is.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from facegen.animation.performance import Performance
from facegen.animation.streams import tabular
from facegen.animation.streams.formats import Format, Sample, Wish
from facegen.errors import FileError
from facegen.fileio.table import Table, read_table

Array = NDArray[np.float64]

NAME = "pyfeat"
UNITS = ("1", "2", "4", "5", "6", "7", "9", "10", "11", "12", "14", "15", "17", "20", "23", "24", "25", "26", "28",
         "43")
"""The units that py-feat tells of."""

_HEAD = ("Yaw", "Pitch", "Roll")
_SIGNS = np.array([-1.0, 1.0, -1.0])
_SIGN_COLUMNS = frozenset(("facescore", "facerectx", "approx_time", "input", "pitch", "happiness"))


def knows(sample: Sample) -> bool:
    """Return whether a file has units without endings, and columns that py-feat writes beside them."""
    return any(map(tabular.number_of, sample.columns)) and bool(_SIGN_COLUMNS & sample.columns)


def read(path: Path, wish: Wish) -> Performance:
    """Return the performance of a file. FileError, InputError."""
    table = read_table(path)
    found = {tabular.number_of(name): table.column(name) for name in table.columns if tabular.number_of(name)}
    if not found:
        raise FileError(f"{path}: expected columns such as AU01 (action units in 0..1)")
    said: list[str] = []
    missing = [f"AU{int(number):02d}" for number in UNITS if number not in found]
    if missing:
        said.append(f"columns that are missing: {', '.join(missing)}")
    tabular.outside(table, {f"AU{int(code):02d}": one for code, one in found.items()}, 1.0, said)
    frames = tabular.column_of(table, "frame")
    rows, person, more = tabular.the_person(path, _people(table, frames), wish)
    times = tabular.seconds(table, wish, tabular.column_of(table, "timestamp", "time"), frames)
    head, gaze = tabular.stack(table, _HEAD), tabular.stack(table, ("gaze_yaw", "gaze_pitch"))
    if head is not None:
        head = head * _SIGNS * _unit(head)
    if gaze is not None:
        eye = np.degrees(gaze) * _SIGNS[:2]
        gaze = np.hstack([eye, eye])
    return tabular.performance(table, NAME, "units", tabular.known_units(table, found, said), times, rows=rows,
                               person=person, said=[*said, *more], head=head, gaze=gaze)


def write(one: Performance, path: Path) -> None:
    """Write units as py-feat does, with the time in a column more. What a file of its own had is kept."""
    before = tabular.original(one, NAME)
    columns: dict[str, Array] = {}
    if one.head is not None:
        scale = _unit(np.column_stack([before[name] for name in _HEAD])) if set(_HEAD) <= set(before) else 0.0
        head = one.head * _SIGNS / (scale or np.degrees(1.0))
        columns |= {name: head[:, k] for name, k in (("Pitch", 1), ("Roll", 2), ("Yaw", 0))}
    columns |= {f"AU{int(code):02d}": weights
                for code, weights in tabular.units_with(one, () if before else UNITS).items()}
    if one.gaze is not None:
        eye = np.radians((one.gaze[:, :2] + one.gaze[:, 2:]) / 2) * _SIGNS[:2]
        columns |= {"gaze_pitch": eye[:, 1], "gaze_yaw": eye[:, 0]}
    if not before:
        columns |= {"frame": np.arange(float(len(one))), "time": one.times, "FaceScore": one.found.astype(float)}
    made = {tabular.spelt(name, before): now for name, now in columns.items()}
    tabular.save_table(path, before | {name: tabular.again(name, now, before) for name, now in made.items()})


def _unit(head: Array) -> float:
    """Return how many degrees a unit of the file's angles is."""
    largest = np.nanmax(np.abs(head), initial=0.0)
    return 1.0 if largest > np.pi else float(np.degrees(1.0))


def _people(table: Table, frames: Array | None) -> list[str]:
    """Return the face of each row: by name if py-feat knew them, else by which row of its frame it is."""
    name = table.find("Identity")
    if name is not None:
        return table.texts[name] if name in table.texts else [f"{one:g}" for one in table.numbers[name]]
    if frames is None:
        return ["0"] * len(table)
    source = table.find("input")
    inputs = table.texts[source] if source in table.texts else [""] * len(table)
    seen: dict[tuple[str, float], int] = {}
    people = []
    for key in zip(inputs, frames.tolist(), strict=True):
        seen[key] = seen.get(key, -1) + 1
        people.append(str(seen[key]))
    return people


PYFEAT = Format(NAME, "py-feat: AU01 0..1, head in radians, frames without times (CSV)", (".csv",), knows, read, write,
                "units", sides=False, parts=("head", "gaze"))

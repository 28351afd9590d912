"""facegen's own CSV: `time` in seconds and a column a shape, with head, place and gaze (docs/streams.md).

Any vocabulary: units as AU12 or AU12_L, every other shape by its name. The vocabulary is the one that the names are of.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

from numpy.typing import NDArray

from facegen.animation.performance import Performance
from facegen.animation.streams import tabular
from facegen.animation.streams.formats import Format, Sample, Wish
from facegen.blendshapes.names import match, member_of, shape_of
from facegen.blendshapes.recipes import SETS, shape_set
from facegen.errors import FileError
from facegen.facs.units import load_catalogue
from facegen.fileio.table import read_table

NAME = "csv"
TIME = "time"
PARTS = {"head": ("head_yaw", "head_pitch", "head_roll"), "place": ("head_x", "head_y", "head_z"),
         "gaze": ("gaze_yaw_L", "gaze_pitch_L", "gaze_yaw_R", "gaze_pitch_R")}
_TIMES = (TIME, "seconds", "t")
_COUNTS = ("frame", "frame_idx", "index", "")
_ASIDE = frozenset(name.casefold() for names in (_TIMES, _COUNTS, *PARTS.values()) for name in names)


def knows(sample: Sample) -> bool:
    """Return whether a file has a time, or mostly names of shapes that are known."""
    if TIME in sample.columns and len(sample.columns) > 1:
        return True
    shapes = sorted(sample.columns - _ASIDE)
    return bool(shapes) and _vocabulary(shapes) is not None


def read(path: Path, wish: Wish) -> Performance:
    """Return the performance of a file. FileError, InputError."""
    table = read_table(path)
    shapes = [name for name in table.columns if name.casefold() not in _ASIDE and name in table.numbers]
    if not shapes:
        raise FileError(f"{path}: expected a column for each shape, such as jawOpen or AU12, beside '{TIME}'")
    vocabulary = _vocabulary(shapes) or "shapes"
    said: list[str] = []
    spelt = _names(shapes, vocabulary)
    strange = [name for name in shapes if name not in spelt]
    if strange:
        more = " ..." if len(strange) > 5 else ""
        said.append(f"no shapes of {vocabulary}, kept aside: {', '.join(strange[:5])}{more}")
    weights = {shape: table.numbers[name] for name, shape in spelt.items()}
    tabular.outside(table, weights, 1.0, said)
    tabular.the_person(path, ["0"] * len(table), wish)
    times = tabular.seconds(table, wish, tabular.column_of(table, *_TIMES), tabular.column_of(table, *_COUNTS))
    return tabular.performance(table, NAME, vocabulary, weights, times, said=said,
                               **{part: tabular.stack(table, names) for part, names in PARTS.items()})


def write(one: Performance, path: Path) -> None:
    """Write any performance. Numbers are exact."""
    before = tabular.original(one, NAME)
    made: dict[str, NDArray] = {TIME: one.times}
    for name, column in zip(one.names, one.weights.T, strict=True):
        made[shape_of(name) if one.vocabulary == "units" else name] = column
    for part, names in PARTS.items():
        values = getattr(one, part)
        if values is not None:
            made |= {name: values[:, k] for k, name in enumerate(names)}
    aside = {name: column for name, column in before.items() if name not in made and name not in _names(
        list(before), one.vocabulary) and name.casefold() not in _TIMES}
    tabular.save_table(path, made | aside)


def _names(columns: list[str], vocabulary: str) -> dict[str, str]:
    """Return column -> shape for those that are of a vocabulary."""
    if vocabulary == "shapes":
        return {name: name for name in columns}
    if vocabulary != "units":
        return match(columns, _known(vocabulary))
    codes, found = set(load_catalogue().codes), {}
    for name in columns:
        code = member_of(name.strip().upper())
        if code in codes and code not in found.values():
            found[name] = code
    return found


@cache
def _known(vocabulary: str) -> dict[str, tuple[str, ...]]:
    """Return the shapes of a vocabulary and what others call them."""
    return {shape: recipe.also for shape, recipe in shape_set(vocabulary).items()}


def _vocabulary(columns: list[str]) -> str | None:
    """Return the vocabulary that most of the names are of, or None."""
    counts = {name: len(_names(columns, name)) for name in SETS}
    best = max(counts, key=lambda name: counts[name])
    return best if 2 * counts[best] >= len(columns) and counts[best] else None


OWN = Format(NAME, "facegen's own: time, a column a shape of any vocabulary, head and gaze (CSV)", (".csv",), knows,
             read, write)

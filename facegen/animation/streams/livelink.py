"""Apple Live Link Face CSV (Epic's application for iPhones): a timecode, 52 shapes, head and eyes.

Columns are found by name (JawRight stands before JawLeft). Turns are radians: yaw to the subject's right, pitch down,
roll to the subject's left shoulder. A row whose BlendShapeCount is 0 is a frame without a face.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from facegen.animation.performance import Performance
from facegen.animation.streams import tabular
from facegen.animation.streams.formats import Format, Sample, Wish
from facegen.animation.streams.looks import gaze_of
from facegen.animation.streams.timecode import USUAL, parsed, rate_of, seconds_of, timecodes
from facegen.blendshapes.names import match
from facegen.blendshapes.recipes import shape_set
from facegen.errors import FileError
from facegen.fileio.table import read_table

Array = NDArray[np.float64]

NAME = "livelink"
_HEAD = ("HeadYaw", "HeadPitch", "HeadRoll")
_EYES = ("LeftEyeYaw", "LeftEyePitch", "RightEyeYaw", "RightEyePitch")
_ROLLS = ("LeftEyeRoll", "RightEyeRoll")
_TURNS = (*_HEAD, "LeftEyeYaw", "LeftEyePitch", "LeftEyeRoll", "RightEyeYaw", "RightEyePitch", "RightEyeRoll")
_HEAD_SIGNS, _EYE_SIGNS = np.array([-1.0, -1.0, 1.0]), np.array([-1.0, -1.0, -1.0, -1.0])
# The order of the application's columns, where it is not Apple's.
_SWAPPED = {"JawLeft": "JawRight", "JawRight": "JawLeft", "MouthLeft": "MouthRight", "MouthRight": "MouthLeft"}
_SHARE_OF_SHAPES = 0.5              # fewer of the 52 names than this are no such file
_MATCHES_TIME = 1e-3                # seconds


def knows(sample: Sample) -> bool:
    """Return whether a file has a timecode or a count of blendshapes, and a shape of ARKit."""
    return bool({"timecode", "blendshapecount"} & sample.columns) and "jawopen" in sample.columns


def columns() -> list[str]:
    """Return the 52 shapes as the application spells and orders them."""
    names = [name[0].upper() + name[1:] for name in shape_set("arkit")]
    return [_SWAPPED.get(name, name) for name in names]


def read(path: Path, wish: Wish) -> Performance:
    """Return the performance of a file. FileError, InputError."""
    table = read_table(path, short=_is_no_face)
    found = match(table.columns, dict.fromkeys(shape_set("arkit"), ()))
    if len(found) < _SHARE_OF_SHAPES * len(shape_set("arkit")):
        raise FileError(f"{path}: expected the shapes of ARKit by name (EyeBlinkLeft, ...), got {len(found)} of 52")
    weights = {shape: table.column(name) for name, shape in found.items()}
    said: list[str] = []
    missing = [name for name in shape_set("arkit") if name not in weights]
    if missing:
        said.append(f"columns that are missing: {', '.join(missing)}")
    count = tabular.column_of(table, "BlendShapeCount")
    lost = np.zeros(len(table), bool) if count is None else count == 0.0
    if lost.any():
        said.append(f"{int(lost.sum())} of {len(table)} frames without a face (BlendShapeCount is 0), "
                    f"the first in line {int(table.lines[lost.argmax()])}")
        weights = {name: np.where(lost, np.nan, one) for name, one in weights.items()}
    tabular.outside(table, weights, 1.0, said)
    tabular.the_person(path, ["0"] * len(table), wish)
    head, gaze = tabular.stack(table, _HEAD), tabular.stack(table, _EYES)
    order = {name: weights[name] for name in shape_set("arkit") if name in weights}
    times, rate = _times(path, table, wish, said)
    one = tabular.performance(
        table, NAME, "arkit", order, times, said=said,
        head=None if head is None else _seen(np.degrees(head) * _HEAD_SIGNS, lost),
        gaze=None if gaze is None else _seen(np.degrees(gaze) * _EYE_SIGNS, lost))
    return Performance(one.times, one.names, one.weights, one.vocabulary, one.head, one.place, one.gaze, one.extra,
                       {**one.about, "timecode_rate": f"{rate:g}"}, one.warnings)


def write(one: Performance, path: Path) -> None:
    """Write ARKit's shapes, head and eyes as the application does. What a file of its own had is kept."""
    before = tabular.original(one, NAME)
    rate = float(one.about.get("timecode_rate", USUAL))
    found = one.found
    empty = np.where(found, 0.0, np.nan)                # a shape that was not recorded rests
    made: dict[str, NDArray] = {
        "Timecode": _codes(one, before, rate), "BlendShapeCount": np.where(found, 52.0 + len(_TURNS), 0.0)}
    for name in columns():
        shape = name[0].lower() + name[1:]
        made[name] = one.column(shape) if shape in one.names else empty
    head = np.zeros((len(one), 3)) if one.head is None else one.head
    made |= {name: np.radians(head * _HEAD_SIGNS)[:, k] for k, name in enumerate(_HEAD)}
    looks = gaze_of(one)
    gaze = np.zeros((len(one), 4)) if looks is None else looks
    made |= {name: np.radians(gaze * _EYE_SIGNS)[:, k] for k, name in enumerate(_EYES)}
    made |= dict.fromkeys(_ROLLS, empty)
    kept = (*_ROLLS, "BlendShapeCount")
    result: dict[str, NDArray] = dict(before)
    for name in ("Timecode", "BlendShapeCount", *columns(), *_TURNS):
        as_spelt = tabular.spelt(name, before)
        if name == "Timecode":
            result[as_spelt] = made[name]
        elif name in kept and as_spelt in before:
            continue
        elif not before or as_spelt in before or (name not in (*_TURNS, "BlendShapeCount") \
                and name[0].lower() + name[1:] in one.names):
            result[as_spelt] = tabular.again(name, made[name], {name: before[as_spelt]} if as_spelt in before else {})
    shapes = {name: ".10f" for name in result if name.casefold() != "blendshapecount"}
    tabular.save_table(path, result, formats=shapes)


def _times(path: Path, table, wish: Wish, said: list[str]) -> tuple[Array, float]:
    name = table.find("Timecode")
    if name is None:
        return tabular.seconds(table, wish, None, None), wish.fps or USUAL
    if name in table.numbers:                           # numbers of frames, as some programs write
        return tabular.seconds(table, wish, None, table.numbers[name]), wish.fps or USUAL
    parts = parsed(table.texts[name])
    if not np.isfinite(parts).all(axis=1).any():
        raise FileError(f"{path}: line {int(table.lines[0])}: Timecode: expected HH:MM:SS:FF.sub, "
                        f"got {table.texts[name][0]!r}")
    rate, shown = rate_of(parts)
    if wish.fps is not None:
        rate = wish.fps
    elif not shown:
        said.append(f"its timecodes do not show how many frames a second they count in; took {rate:g}: "
                    f"say the frames a second (fps) if that is wrong")
    return seconds_of(parts, rate), rate


def _codes(one: Performance, before: dict[str, NDArray], rate: float) -> NDArray:
    """Return the timecodes: those of the file as far as they tell the times, or new ones from 0."""
    old = before.get(tabular.spelt("Timecode", before))
    if old is not None and old.dtype == object:
        times = seconds_of(parsed([str(code) for code in old]), rate)
        if np.allclose(times - times[0], one.times - one.times[0], rtol=0.0, atol=_MATCHES_TIME):
            return old
    return np.array(timecodes(one.times - min(0.0, one.times[0]), rate), dtype=object)


def _is_no_face(cells: list[str]) -> bool:
    """Return whether a row that is too short is a frame without a face: a timecode and the count 0."""
    return len(cells) >= 2 and cells[1].strip() in ("0", "0.0") and not any(cell.strip() for cell in cells[2:])


def _seen(values: Array, lost: NDArray[np.bool_]) -> Array:
    values = values.copy()
    values[lost] = np.nan
    return values


LIVELINK = Format(NAME, "Apple Live Link Face: timecode, 52 shapes, head and eyes (CSV)", (".csv",), knows, read, write,
                  "arkit", parts=("head", "gaze"))

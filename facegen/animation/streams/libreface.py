"""LibreFace CSV (D. Chang et al., "LibreFace", 2024): au_1_intensity 0..5, au_1 presence, head in degrees.

A row a frame with `frame_time_in_ms`. Head as its program draws it: pitch up, yaw to the subject's left. Units whose
intensity it does not estimate (7, 10, 14, 23, 24) are only present or absent.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from facegen.animation.performance import Performance
from facegen.animation.streams import tabular
from facegen.animation.streams.formats import Format, Sample, Wish
from facegen.animation.streams.openface import intensities_of, presence, weights_of
from facegen.errors import FileError
from facegen.fileio.table import read_table

Array = NDArray[np.float64]

NAME = "libreface"
UNITS = ("1", "2", "4", "5", "6", "9", "12", "15", "17", "20", "25", "26")
"""The units whose intensity LibreFace estimates."""

_STRONG = re.compile(r"au_?0*([0-9]{1,2})_intensity", re.ASCII | re.IGNORECASE)
_HEAD = ("yaw", "pitch", "roll")


def knows(sample: Sample) -> bool:
    """Return whether a file has columns such as au_1_intensity."""
    return any(map(_STRONG.fullmatch, sample.columns))


def read(path: Path, wish: Wish) -> Performance:
    """Return the performance of a file. FileError, InputError."""
    table = read_table(path)
    strong = {found[1]: table.column(name) for name in table.columns if (found := _STRONG.fullmatch(name))}
    if not strong:
        raise FileError(f"{path}: expected columns such as au_1_intensity (action units in 0..5)")
    there = {tabular.number_of(name): table.column(name) for name in table.columns if tabular.number_of(name)}
    said: list[str] = []
    missing = [f"au_{number}_intensity" for number in UNITS if number not in strong]
    if missing:
        said.append(f"columns that are missing: {', '.join(missing)}")
    tabular.outside(table, {f"au_{code}_intensity": one for code, one in strong.items()}, 5.0, said)
    weights = {code: weights_of(one) for code, one in tabular.known_units(table, strong, said).items()}
    weights |= presence(table, there, weights, wish, said)
    ids = tabular.column_of(table, "face_id")
    rows, person, more = tabular.the_person(
        path, ["0"] * len(table) if ids is None else [f"{one:g}" for one in ids.tolist()], wish)
    milliseconds = tabular.column_of(table, "frame_time_in_ms")
    times = tabular.seconds(table, wish, None if milliseconds is None else milliseconds / 1000.0,
                            tabular.column_of(table, "frame_idx"))
    gaze = tabular.stack(table, ("gaze_yaw", "gaze_pitch"))
    return tabular.performance(table, NAME, "units", weights, times, rows=rows,
                               person=person if ids is not None else "", said=[*said, *more],
                               head=tabular.stack(table, _HEAD), gaze=None if gaze is None else np.hstack([gaze, gaze]))


def write(one: Performance, path: Path) -> None:
    """Write units as LibreFace does; presence is intensity 1 (A) or more. What a file of its own had is kept."""
    before = tabular.original(one, NAME)
    columns: dict[str, Array] = {"frame_idx": np.arange(float(len(one))), "frame_time_in_ms": one.times * 1000.0}
    if one.head is not None:
        columns |= {name: one.head[:, k] for k, name in enumerate(_HEAD)}
    if one.gaze is not None:
        eye = (one.gaze[:, :2] + one.gaze[:, 2:]) / 2
        columns |= {"gaze_yaw": eye[:, 0], "gaze_pitch": eye[:, 1]}
    for code, weights in tabular.units_with(one, () if before else UNITS).items():
        now = intensities_of(weights)
        if before and f"au_{code}_intensity" not in before and f"au_{code}" in before:
            continue                                    # of this one the file has the presence only
        if not before:
            columns[f"au_{code}"] = np.where(np.isnan(now), np.nan, (now >= 1.0).astype(float))
        columns[f"au_{code}_intensity"] = now
    made = {tabular.spelt(name, before): now for name, now in columns.items()}
    result = before | {name: tabular.again(name, now, before) for name, now in made.items()}
    if "frame_idx" in before:
        result["frame_idx"] = before["frame_idx"]
    tabular.save_table(path, result)


LIBREFACE = Format(NAME, "LibreFace: au_1_intensity 0..5, au_1, head in degrees (CSV)", (".csv",), knows, read, write,
                   "units", sides=False, parts=("head", "gaze"))

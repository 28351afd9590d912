"""OpenFace 2 CSV (T. Baltrusaitis et al., "OpenFace 2.0", 2018; its wiki, "Output Format").

Intensities AU01_r in 0..5, which are A to E; presence AU01_c; one row a face a frame. A frame whose `success` is not 1
has no weights. Eye 0 is the leftmost in the picture: the subject's right one. Pose: R = Rx Ry Rz in radians and
millimetres in the camera's axes.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from facegen.animation.performance import Performance
from facegen.animation.streams import tabular
from facegen.animation.streams.formats import Format, Sample, Wish
from facegen.animation.streams.turns import camera_of_gaze, camera_of_head, gaze_of_camera, head_of_camera
from facegen.errors import FileError
from facegen.facs.units import LETTERS, load_catalogue
from facegen.fileio.table import Table, read_table

Array = NDArray[np.float64]

NAME = "openface"
UNITS = ("1", "2", "4", "5", "6", "7", "9", "10", "12", "14", "15", "17", "20", "23", "25", "26", "45")
"""The units that OpenFace gives the intensity of; of 28 only the presence."""

# Small letters only: in our own files AU12_R is the right side.
_COLUMN = re.compile(r"AU_?0*([0-9]{1,2})_([rc])", re.ASCII)
_EYES = tuple(tuple(f"gaze_{eye}_{axis}" for axis in "xyz") for eye in (0, 1))
_ANGLES = ("gaze_angle_x", "gaze_angle_y")
_PLACE, _TURN = ("pose_Tx", "pose_Ty", "pose_Tz"), ("pose_Rx", "pose_Ry", "pose_Rz")
_MIRROR = np.array([1.0, -1.0, -1.0])           # a camera's axes are ours turned half round about x
# Directions are written with three digits or more, and are only roughly of length 1.
_ROUGH = 2e-3


def knows(sample: Sample) -> bool:
    """Return whether a file has columns such as AU01_r or AU01_c."""
    return any(map(_COLUMN.fullmatch, sample.names))


def weights_of(intensities: Array) -> Array:
    """Return the weights of intensities 0..5: 1..5 are A..E, decimals lie between, what lies beyond goes on."""
    return _through(intensities, *_knots())


def intensities_of(weights: Array) -> Array:
    """Return the intensities that `weights_of` makes weights of."""
    return _through(weights, *_knots()[::-1])


def read(path: Path, wish: Wish) -> Performance:
    """Return the performance of a file. FileError, InputError."""
    table = read_table(path)
    strong, there = _units(table, "r"), _units(table, "c")
    said = [] if strong else [f"no intensities (AU01_r ...){'; only presence' if there else ''}"]
    if not strong and not there:
        raise FileError(f"{path}: expected columns such as AU01_r (the intensities of action units); "
                        f"run OpenFace with -aus")
    missing = [f"AU{int(number):02d}_r" for number in UNITS if number not in strong]
    if strong and missing:
        said.append(f"columns that are missing: {', '.join(missing)}")
    ids = tabular.column_of(table, "face_id")
    people = [str(int(one)) if one == one else "" for one in ids.tolist()] if ids is not None else ["0"] * len(table)
    rows, person, more = tabular.the_person(path, people, wish)
    success = tabular.column_of(table, "success")
    lost = np.zeros(len(table), bool) if success is None else success != 1.0
    if (lost & rows).any():
        said.append(f"{int((lost & rows).sum())} of {int(rows.sum())} frames without a face (success is not 1), "
                    f"the first in line {int(table.lines[(lost & rows).argmax()])}")
    tabular.outside(table, {f"AU{int(code):02d}_r": one for code, one in strong.items()}, 5.0, said)
    weights = {code: weights_of(one) for code, one in tabular.known_units(table, strong, said).items()}
    weights |= presence(table, there, weights, wish, said)
    turn, place = tabular.stack(table, _TURN), tabular.stack(table, _PLACE)
    head = None if turn is None else _without(head_of_camera(turn), lost)
    frames = tabular.column_of(table, "frame")
    times = tabular.seconds(table, wish, tabular.column_of(table, "timestamp", "time"), frames)
    return tabular.performance(
        table, NAME, "units", {code: _without(one, lost) for code, one in weights.items()}, times, rows=rows,
        person=person if ids is not None else "", said=[*said, *more], head=head,
        place=None if place is None else _without(place * _MIRROR, lost), gaze=_gaze(table, head, lost))


def write(one: Performance, path: Path) -> None:
    """Write units as OpenFace does: AU01_r and, from A upward, AU01_c. What a file of its own had is kept."""
    before = tabular.original(one, NAME)
    found = one.found
    columns: dict[str, Array] = {"frame": np.arange(1, len(one) + 1.0), "timestamp": one.times,
                                 "confidence": found.astype(float), "success": found.astype(float)}
    head = one.head
    if one.gaze is not None:
        right, left = camera_of_gaze(one.gaze, np.zeros((len(one), 3)) if head is None else head)
        columns |= {name: way[:, k] for names, way in zip(_EYES, (right, left), strict=True)
                    for k, name in enumerate(names)}
        middle = right + left
        columns |= {name: np.arctan2(middle[:, k], -middle[:, 2]) for k, name in enumerate(_ANGLES)}
    if one.place is not None:
        columns |= {name: (one.place * _MIRROR)[:, k] for k, name in enumerate(_PLACE)}
    if head is not None:
        columns |= {name: camera_of_head(head)[:, k] for k, name in enumerate(_TURN)}
    strong = {f"AU{int(code):02d}_r": intensities_of(weights)
              for code, weights in tabular.units_with(one, () if before else UNITS).items()}
    columns |= strong
    if not before:
        columns |= {f"{name[:-2]}_c": np.where(np.isnan(now), np.nan, (now >= 1.0).astype(float))
                    for name, now in strong.items()}
    made = {tabular.spelt(name, before): now for name, now in columns.items()}
    result = dict(before)
    for name, now in made.items():
        kept = before.get(name) if name in ("frame", "confidence", "success") else None
        result[name] = kept if kept is not None else tabular.again(
            name, now, before, _ROUGH if name.casefold().startswith("gaze") else 1e-9)
    tabular.save_table(path, result)


def presence(table: Table, there: dict[str, Array], weights: dict[str, Array], wish: Wish, said: list[str]
             ) -> dict[str, Array]:
    """Return the weights of units of which only the presence is known: the one that is wished for, or none."""
    only = tabular.known_units(table, {code: one for code, one in there.items() if code not in weights}, said)
    if not only:
        return {}
    names = ", ".join(only)
    if wish.presence is None:
        said.append(f"units {names} are called present or absent only; not among the weights "
                    f"(say which weight presence counts as)")
        return {}
    return {code: np.where(np.isnan(one), np.nan, np.where(one > 0.0, wish.presence, 0.0))
            for code, one in only.items()}


def _units(table: Table, ending: str) -> dict[str, Array]:
    found = {}
    for name in table.columns:
        match = _COLUMN.fullmatch(name)
        if match and match[2] == ending and match[1] not in found:
            found[match[1]] = table.column(name)
    return found


def _gaze(table: Table, head: Array | None, lost: NDArray[np.bool_]) -> Array | None:
    eyes = [tabular.stack(table, names) for names in _EYES]
    if any(eye is None for eye in eyes):
        return None
    held = np.zeros((len(table), 3)) if head is None else head
    empty = lost | (np.linalg.norm(np.hstack(eyes), axis=1) < 0.5)      # no eyes found: zeros
    return _without(gaze_of_camera(*eyes, held), empty)


def _without(values: Array, lost: NDArray[np.bool_]) -> Array:
    values = values.copy()
    values[lost] = np.nan
    return values


def _knots() -> tuple[Array, Array]:
    letters = load_catalogue().letters
    return np.arange(6.0), np.array([0.0, *(letters[letter] for letter in LETTERS)])


def _through(values: Array, knots: Array, heights: Array) -> Array:
    """Return heights at values, straight between the knots and on beyond them."""
    slopes = np.diff(heights) / np.diff(knots)
    at = np.clip(np.searchsorted(knots, values, side="right") - 1, 0, len(slopes) - 1)
    return heights[at] + (values - knots[at]) * slopes[at]


OPENFACE = Format(NAME, "OpenFace 2: AU01_r 0..5, AU01_c, gaze, pose (CSV)", (".csv",), knows, read, write, "units",
                  sides=False)

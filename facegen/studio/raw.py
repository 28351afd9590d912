"""Raw movements, edited: plain data in the form of a deformation file (docs/files.md), as a work keeps them.

Only what is changed is rounded, so a file that was loaded and not touched is saved as it was.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from facegen.errors import InputError
from facegen.face.face import Controls, Face
from facegen.face.reach import Grip
from facegen.facs.deformation import Deformation, deformation_from_dict, mirror_name
from facegen.facs.expression_table import Person
from facegen.studio.work import FaceWork

Array = NDArray[np.float64]
Raw = Mapping[str, Any]

# Decimals kept of what a hand did: a micrometre, a hundredth of a degree.
_DECIMALS = {"millimetre": 3, "face": 5, "paper": 5}
_OF_ANGLES, _OF_SHARES = 2, 4
_ANGLES = ("open", "yaw", "pitch", "roll", "yaw_L", "yaw_R", "pitch_L", "pitch_R")
_LENGTHS = (("jaw", "side"), ("jaw", "forward"), ("head", "forward"))
_WEAKEST = 0.02

FIRST_UNITS = "millimetre"
"""What raw data are measured in until the person says otherwise."""


def deformation_of(raw: Raw) -> Deformation:
    """Return raw data as a deformation."""
    return deformation_from_dict(raw) if raw else Deformation(units=FIRST_UNITS)


def vector_of(raw: Raw, face: Face, point: str) -> Array:
    """Return the vector (3,), mm, of a feature point of a face."""
    found = deformation_of(raw)
    one = Deformation(points={point: found.points.get(point, (0.0, 0.0, 0.0))}, units=found.units)
    return np.array(face.total(one).points.get(point, (0.0, 0.0, 0.0)))


def with_vector(raw: Raw, face: Face, point: str, vector: ArrayLike, *, mirrored: bool = False) -> Raw:
    """Return raw data with another vector (3,), mm, of a feature point; mirrored: and of that on the other side."""
    found, vector = deformation_of(raw), np.asarray(vector, np.float64)
    other = mirror_name(point)
    if mirrored and other == point:
        vector = vector * [0.0, 1.0, 1.0]
    moved = {point: vector}
    if mirrored and other != point and other in face.feature_points:
        moved[other] = vector * [-1.0, 1.0, 1.0]
    own = Deformation(points={name: tuple(one) for name, one in moved.items()}, units="millimetre")
    own = face.total(own, units=found.units)
    decimals = _DECIMALS[found.units]
    points = {**found.points, **dict.fromkeys(moved, (0.0, 0.0, 0.0))}
    points |= {name: tuple(round(x, decimals) for x in one) for name, one in own.points.items()}
    return _plain(replace(found, points=points))


def number_of(found: Deformation, face: Face | None, kind: str, key: str) -> float:
    """Return a number of jaw, lids, eyes or head of raw data: mm (on a face), degrees or a share."""
    value = getattr(found, kind).get(key, 0.0)
    if (kind, key) in _LENGTHS and face is not None and value:
        one = face.total(Deformation(**{kind: {key: value}}, units=found.units))
        return getattr(one, kind).get(key, 0.0)
    return value


def with_number(raw: Raw, face: Face | None, kind: str, key: str, value: float, *, mirrored: bool = False) -> Raw:
    """Return raw data with another number, as `number_of` gives it; mirrored: lids and eyes go in pairs."""
    found = deformation_of(raw)
    decimals = _OF_ANGLES if key in _ANGLES else _OF_SHARES
    if (kind, key) in _LENGTHS:
        decimals = _DECIMALS[found.units]
        if face is not None:
            one = face.total(Deformation(**{kind: {key: value}}, units="millimetre"), units=found.units)
            value = getattr(one, kind).get(key, 0.0)
    keys = {key, mirror_name(key)} if mirrored else {key}       # eyes look the same way: not the mirror image
    numbers = {**getattr(found, kind), **dict.fromkeys(keys, round(value, decimals))}
    return _plain(replace(found, **{kind: numbers}))


def in_units(raw: Raw, face: Face, units: str) -> Raw:
    """Return the same movements of a face in another unit of length."""
    found = deformation_of(raw)
    if found.units == units:
        return _plain(found)
    total = face.total(found, units=units)
    decimals = _DECIMALS[units]
    points = {name: tuple(round(x, decimals) for x in one) for name, one in total.points.items()}
    return _plain(replace(total, points=points))


def dragged(work: FaceWork, face: Face, person: Person | None, point: str, target: ArrayLike, *,
            mirrored: bool = False, grip: Grip | None = None) -> Raw:
    """Return the raw data with which a feature point lies at ``target`` (3,), mm, or as near as it goes.

    All else that the work shows stays as it is. InputError for a point that takes no vector. grip: made before.
    """
    if work.intensity < _WEAKEST:
        raise InputError("intensity: at 0 nothing moves; raise it on the tab Face, then drag the point")
    grip = grip or Grip(face, point, mirrored=mirrored)
    start = vector_of(work.raw, face, point) * work.intensity
    without = with_vector(work.raw, face, point, np.zeros(3), mirrored=mirrored)
    found = grip.reach(controls_of(replace(work, raw=without), face, person), target, start)
    return with_vector(work.raw, face, point, found.vector / work.intensity, mirrored=mirrored)


def controls_of(work: FaceWork, face: Face, person: Person | None) -> Controls:
    """Return the deformer's input for a work."""
    meaning = work.meaning(person, face)
    return face.controls(meaning.deformation, *meaning.more, strict=False)


def strangers(raw: Raw, face: Face) -> tuple[str, ...]:
    """Return the feature points in raw data that a face has not, or that take no vector there."""
    found = deformation_of(raw)
    return tuple(name for name in found.points if name not in face.possible(found).points)


def with_own_names(raw: Raw, face: Face) -> Raw:
    """Return raw data in which a face's points have its own names, not the paper's."""
    found, names = deformation_of(raw), {alias: name for name, alias in face.paper_names.items()}
    if not set(found.points) & set(names):
        return _plain(found)
    return _plain(replace(found, points={names.get(name, name): one for name, one in found.points.items()}))


def whole_pose(face: Face | None, *several: Deformation, units: str) -> Deformation:
    """Return a sum of movements in one unit of length, without points and folds that the face lacks.

    face: None for an avatar, which cannot convert lengths: InputError if they differ.
    """
    if face is None:
        total = several[0]
        for one in several[1:]:
            total = total + one
        return total
    return face.possible(face.total(*several, units=units))


def _plain(found: Deformation) -> dict[str, Any]:
    return found.as_dict()

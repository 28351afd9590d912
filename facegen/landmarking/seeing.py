"""What the mesh itself tells of lids and lips, wherever they are expected: eyeballs between lids, the mouth's slit."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from facegen.landmarking.eyeballs import ball_of_eye, seen_eye
from facegen.landmarking.profile import lips_in_profile
from facegen.landmarking.skin import Head
from facegen.landmarking.symmetry import Plane

Array = NDArray[np.float64]

# How far off what is seen is, mm of the base face; the inner corner is hidden by the skin that fills it.
_OFF, _INNER_OFF = 2.0, 4.0
# A brow lies within so many eye widths of the eye, has so many corners of triangles, and is this wide; it is looked at
# by shares of its width.
_BROW_NEAR, _BROW_FEWEST, _BROW_WIDE, _BROW_END = 1.8, 12, 0.4, 0.08


def seen_on(head: Head, plane: Plane, points: Mapping[str, Array], known: Mapping[str, Array]) -> dict[str, Array]:
    """Return the places (3,) that the mesh tells of landmarks that are not known.

    plane: between left and right. points: name -> where each is expected; known: where some are.
    """
    found: dict[str, Array] = {}
    for s in "LR":
        ball = ball_of_eye(head.balls, points, s, known)
        if ball is not None:
            found |= seen_eye(head.surface, head.components, ball, points, s, known, head.pupils)
    nose, chin = (known.get(name, points[name]) for name in ("nose_tip", "chin"))
    lips = lips_in_profile(head.shown_welded, plane, nose, chin)
    if lips is not None:
        found |= dict(zip(("mouth_inner_top", "mouth_inner_bottom"), lips, strict=True))
    found |= _named_brows(head, plane, {**points, **known})
    return {name: place for name, place in found.items() if name not in known and np.isfinite(place).all()}


def _named_brows(head: Head, plane: Plane, points: Mapping[str, Array]) -> dict[str, Array]:
    """Return the ends and the middles of brows that are pieces or materials of their own, as their names say."""
    found: dict[str, Array] = {}
    for s in "LR":
        ends = points[f"eye_inner_{s}"], points[f"eye_outer_{s}"]
        middle, wide = np.mean(ends, axis=0), float(np.linalg.norm(ends[0] - ends[1]))
        at = head.brows
        at = at[((at - middle) ** 2).sum(axis=1) < (_BROW_NEAR * wide) ** 2]
        side = np.sign((ends[1] - ends[0]) @ plane.normal)
        across = side * (at @ plane.normal - plane.offset)
        at, across = at[across > 0], across[across > 0]
        if len(at) < _BROW_FEWEST or np.ptp(across) < _BROW_WIDE * wide:
            continue
        low, high = across.min(), across.max()
        for name, share in (("inner", _BROW_END), ("mid", 0.5), ("outer", 1 - _BROW_END)):
            near = np.abs(across - low - share * (high - low)) < _BROW_END * (high - low)
            if near.any():
                found[f"brow_{name}_{s}"] = at[near].mean(axis=0)
    return found


def off(name: str) -> float:
    """Return how far off a place that is seen may be, mm of the base face."""
    return _INNER_OFF if name.startswith("eye_inner") else _OFF

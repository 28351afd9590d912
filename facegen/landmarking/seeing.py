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
    return {name: place for name, place in found.items() if name not in known and np.isfinite(place).all()}


def off(name: str) -> float:
    """Return how far off a place that is seen may be, mm of the base face."""
    return _INNER_OFF if name.startswith("eye_inner") else _OFF

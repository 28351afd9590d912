"""Two balls that mirror each other are probably eyes: where the face would be if they are."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from facegen.landmarking.eyeballs import Ball
from facegen.landmarking.symmetry import Plane
from facegen.transfer.alignment import Similarity

Array = NDArray[np.float64]

# Partners' sizes differ by this factor at most, and their places by this share of the radius.
_ALIKE, _OFF = 1.15, 0.5
# The middles of eyes are this many radii apart, of people and of cartoons; the base face's so many mm.
_APART = (2.05, 9.0)
_BASE_APART = 57.8
# Eyes do not tell which way up the head is: it is tried this many degrees apart.
_TURN = 30.0
# So many pairs are looked at, the largest first.
_MOST = 2


def eye_frames(balls: Sequence[Ball], planes: Sequence[Plane]) -> list[Similarity]:
    """Return from the base face's frame to the mesh's, for every pair of balls and way up."""
    frames: list[Similarity] = []
    for plane in planes:
        pairs = []
        for i, one in enumerate(balls):
            p, r = one.middle, one.radius
            for other in balls[i + 1:]:
                q, t = other.middle, other.radius
                apart = float(np.linalg.norm(p - q))
                if (max(r, t) < _ALIKE * min(r, t) and _APART[0] * r < apart < _APART[1] * r
                        and np.linalg.norm(plane.mirror(p) - q) < _OFF * r):
                    pairs.append((r, p, q))
        for _, p, q in sorted(pairs, key=lambda one: -one[0])[:_MOST]:
            frames += _all_round(p, q)
    return frames


def _all_round(p: Array, q: Array) -> list[Similarity]:
    """Return frames with two places as the middles of the eyes."""
    scale = float(np.linalg.norm(p - q)) / _BASE_APART
    x = (p - q) / np.linalg.norm(p - q)
    first = np.cross(x, np.eye(3)[np.abs(x).argmin()])
    first /= np.linalg.norm(first)
    second = np.cross(x, first)
    result = []
    for angle in np.radians(np.arange(0.0, 360.0, _TURN)):
        up = np.cos(angle) * first + np.sin(angle) * second
        for left in (x, -x):
            result.append(Similarity(scale, np.column_stack([left, up, np.cross(left, up)]), (p + q) / 2))
    return result

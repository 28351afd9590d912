"""Anybody's avatar brought to the stage: millimetres of a head of the base face's size, upright, looking forward."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from facegen.transfer.alignment import Similarity

Array = NDArray[np.float64]

AXES = ("x", "-x", "y", "-y", "z", "-z")
"""Directions of a file."""

# A bust is at most so many heads high: what is higher has a body, and its head is what matters.
_BUST = 2.6
# A head seen from the front is so much wider than high, hair and ears with it, when its chin is reached from above.
_WIDE = 0.85
_SLABS = 64


def across(up: str, front: str) -> bool:
    """Return whether two axes are at right angles, so that they say how a head stands."""
    return up in AXES and front in AXES and up[-1] != front[-1]


def axes(up: str, front: str) -> Array:
    """Return the rotation (3, 3) from a file in which a head stands ``up`` and looks to ``front``, to +y and +z."""
    y, z = _unit(up), _unit(front)
    return np.array([np.cross(y, z), y, z])


def nearest_axes(rotation: Array) -> tuple[str, str]:
    """Return the pair ``up, front`` whose rotation is nearest to one (3, 3)."""
    pairs = [(up, front) for up in AXES for front in AXES if across(up, front)]
    return max(pairs, key=lambda pair: float((axes(*pair) * rotation).sum()))


def _unit(axis: str) -> Array:
    return np.eye(3)["xyz".index(axis[-1])] * (-1.0 if axis[0] == "-" else 1.0)


def box_placement(vertices: Array, up: str = "y", front: str = "z") -> Similarity:
    """Return the similarity that brings a head (n, 3) to the base face's box; of a body, its head."""
    rotation = axes(up, front)
    low, high = head_box(vertices @ rotation.T)
    base_low, base_high = _base_box()
    size = float(np.linalg.norm(high - low))
    scale = float(np.linalg.norm(base_high - base_low)) / size if size > 0 else 1.0
    return Similarity(scale, rotation, (base_low + base_high) / 2 - scale * (low + high) / 2)


def head_box(vertices: Array) -> tuple[Array, Array]:
    """Return the corners (3,) of the box round a head, standing upright; of a body, round what is above the neck.

    Going down from the top, the first place where what lies above is higher than wide is about the chin. On a head
    alone that is most of it, and then all of it counts.
    """
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    whole = high[1] - low[1]
    for depth in np.linspace(0.0, whole, _SLABS + 1)[1:]:
        above = vertices[vertices[:, 1] >= high[1] - depth]
        wide = float(np.ptp(above[:, 0]))
        if len(above) >= 3 and 0.0 < wide < _WIDE * depth:
            if whole > _BUST * depth:
                return np.append(above.min(axis=0)[:1], [high[1] - depth, above[:, 2].min()]), above.max(axis=0)
            break
    return low, high


@cache
def _base_box() -> tuple[Array, Array]:
    from facegen.face.face import load_face

    vertices = load_face().mesh(0).vertices
    return vertices.min(axis=0), vertices.max(axis=0)

"""Corrective folds: the creases of skin that triangles moved by feature points smooth away.

A fold is a valley along a curve with a ridge beside it, a displacement along the neutral normals. Expressions
drive it by one number, so it stays linear: the field is computed once for a level of detail.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from facegen.geometry.fade import smooth_step

Array = NDArray[np.float64]

# A fold ends so many of its widths from the curve.
_REACH = 6.0


@dataclass(frozen=True, eq=False)
class Fold:
    """A valley and its ridge, in mm.

    ``along`` (k, 3): the valley's curve on the neutral face; ``width``: its half width; ``depth``: below the
    skin; ``ridge``: height of the bulge beside it, on the side that ``toward`` (3,) points to.
    """

    along: Array
    width: float
    depth: float
    ridge: float
    toward: Array


def fold_field(fold: Fold, vertices: Array, normals: Array) -> Array:
    """Return the displacement (n, 3), mm, of each vertex at amount one; it fades toward the curve's ends."""
    result = np.zeros(vertices.shape)
    reach = _REACH * fold.width
    near = ((vertices > fold.along.min(axis=0) - reach) & (vertices < fold.along.max(axis=0) + reach)).all(axis=1)
    vertices, normals = vertices[near], normals[near]
    start, step = fold.along[:-1], np.diff(fold.along, axis=0)
    length = np.linalg.norm(step, axis=1)
    run = np.concatenate([[0.0], np.cumsum(length)])
    offset = vertices[:, None] - start
    t = np.clip(np.einsum("nsi,si->ns", offset, step) / length**2, 0.0, 1.0)
    away = offset - t[..., None] * step
    distance = np.linalg.norm(away, axis=2)
    nearest = distance.argmin(axis=1)
    rows = np.arange(len(vertices))
    distance, away = distance[rows, nearest], away[rows, nearest]
    place = (run[nearest] + t[rows, nearest] * length[nearest]) / run[-1]
    fade = smooth_step(np.minimum(place, 1.0 - place) / 0.3)
    side = np.where(away @ fold.toward < 0, -distance, distance)
    u = side / fold.width
    height = -fold.depth * np.exp(-u * u) + fold.ridge * np.exp(-((u - 2.0) ** 2) / 1.4)
    height *= fade * (np.abs(u) < _REACH) * np.clip(normals[:, 2] * 4.0 + 1.0, 0.0, 1.0)
    result[near] = height[:, None] * normals
    return result

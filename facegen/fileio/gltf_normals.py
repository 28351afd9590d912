"""How normals turn when a mesh is deformed, for a file's own normals: smooth stays smooth, a crease stays a crease.

Vertices that share a place and a normal are one surface, whatever splits them (UV seams, materials). Its angle-weighted
normal (Thürmer & Wüthrich 1998) before and after gives the least rotation, and that turns the file's normal. The angles
are the neutral's throughout, so a shape costs time only where it moves something.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

# Because a smaller change of a unit normal changes no 8-bit pixel.
_UNSEEN = 1e-3
# Because exporters round: normals at one place within 8 degrees of each other are one smooth normal.
_SMOOTH = 0.99
_OPPOSITE = 1e-6                                    # 1 + cosine below which the axis of a half turn is lost in rounding
_TINY = 1e-30                                       # a length below which there is no direction


class TurningNormals:
    """The normals of one surface. points, normals: (n, 3). faces: (m, 3), counter-clockwise seen from outside."""

    def __init__(self, points: NDArray, normals: NDArray, faces: NDArray[np.int64]) -> None:
        self._points = np.asarray(points, dtype=np.float64)
        self._normals = np.asarray(normals, dtype=np.float64)
        self._group = _smooth_groups(self._points, self._normals)
        self._faces = faces
        corners = self._group[faces]                                    # (m, 3) smooth vertices
        self._count = int(self._group.max(initial=-1)) + 1
        self._neutral = _unit_normals(self._points[faces])
        triangle = np.repeat(np.arange(len(faces)), 3)
        self._spread = csr_array((_angles(self._points[faces]).ravel(), (corners.ravel(), triangle)),
                                 shape=(self._count, len(faces)))
        self._sum = self._spread @ self._neutral

    def change(self, rows: NDArray[np.int64], motion: NDArray) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Return which normals change, ascending, and by how much (k, 3), if ``rows`` move by ``motion`` (r, 3)."""
        moved = np.zeros(len(self._points), dtype=bool)
        moved[rows] = True
        a, b, c = self._faces.T
        touched = np.flatnonzero(moved[a] | moved[b] | moved[c])
        points = self._points.copy()
        points[rows] += motion
        turn = np.zeros_like(self._neutral)
        turn[touched] = _unit_normals(points[self._faces[touched]]) - self._neutral[touched]
        total = self._sum + self._spread @ turn
        surface = np.zeros(self._count, dtype=bool)
        surface[self._group[self._faces[touched].ravel()]] = True
        which = np.flatnonzero(surface[self._group])
        before, after = _unit(self._sum[self._group[which]]), _unit(total[self._group[which]])
        change = _turned(self._normals[which], before, after) - self._normals[which]
        seen = _dot(change, change) > _UNSEEN ** 2
        return which[seen], change[seen]


def _smooth_groups(points: NDArray, normals: NDArray) -> NDArray[np.int64]:
    """Return for each vertex the number of its smooth vertex: same place and, where there is a crease, same normal."""
    place = np.unique(points, axis=0, return_inverse=True)[1].ravel()
    mean = _unit(np.stack([np.bincount(place, column) for column in _unit(normals).T], axis=1))
    crease = _dot(_unit(normals), mean[place]) < _SMOOTH
    creased = np.zeros(len(mean), dtype=bool)
    creased[place[crease]] = True
    side = np.where(creased[place, None], np.round(normals, 2), 0.0) + 0.0
    return np.unique(np.column_stack([place, side]), axis=0, return_inverse=True)[1].ravel()


def _unit_normals(corners: NDArray) -> NDArray[np.float64]:
    """Return unit normals (m, 3) of triangles (m, 3 corners, 3); zero for one without area."""
    return _unit(_cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))


def _cross(a: NDArray, b: NDArray) -> NDArray[np.float64]:
    """Return the cross products of rows (m, 3): by hand, since np.cross takes three times as long."""
    result = np.empty_like(a)
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        result[:, i] = a[:, j] * b[:, k] - a[:, k] * b[:, j]
    return result


def _dot(a: NDArray, b: NDArray) -> NDArray[np.float64]:
    return np.einsum("...i,...i->...", a, b)


def _angles(corners: NDArray) -> NDArray[np.float64]:
    """Return the angle at each corner (m, 3), radians."""
    after = _unit(np.roll(corners, -1, axis=1) - corners)
    before = _unit(np.roll(corners, 1, axis=1) - corners)
    return np.arccos(np.clip(_dot(after, before), -1.0, 1.0))


def _unit(vectors: NDArray) -> NDArray[np.float64]:
    """Return vectors of length 1; one that is too short to have a direction becomes zero."""
    length = np.sqrt(_dot(vectors, vectors))
    return vectors * np.where(length > _TINY, 1.0 / np.maximum(length, _TINY), 0.0)[..., None]


def _turned(vectors: NDArray, before: NDArray, after: NDArray) -> NDArray[np.float64]:
    """Return vectors turned by the least rotation from ``before`` to ``after`` (Rodrigues); all (k, 3)."""
    axis, cosine = _cross(before, after), _dot(before, after)
    opposite = 1.0 + cosine < _OPPOSITE
    along = _dot(axis, vectors) / np.where(opposite, 1.0, 1.0 + cosine)
    turned = vectors * cosine[:, None] + _cross(axis, vectors) + axis * along[:, None]
    turned[opposite] = -vectors[opposite]           # right over: every axis across is as good
    still = (_dot(before, before) == 0) | (_dot(after, after) == 0)
    turned[still] = vectors[still]                  # the surface has no direction there: leave the file's
    return turned

"""How normals turn when a mesh is deformed, for a file's own normals: smooth stays smooth, a crease stays a crease.

Vertices that share a place and a normal are one surface, whatever splits them (UV seams, materials). Its angle-weighted
normal (Thürmer & Wüthrich 1998) before and after gives the least rotation, and that turns the file's normal. The angles
are the neutral's throughout, so a shape costs time only where it moves something.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# Because a smaller change of a unit normal changes no 8-bit pixel.
_UNSEEN = 1e-3
# Because exporters round: normals at one place within 8 degrees of each other are one smooth normal.
_SMOOTH = 0.99
_OPPOSITE = 1e-6                                    # 1 + cosine below which the axis of a half turn is lost in rounding
_TINY = 1e-30                                       # a length below which there is no direction


class TurningNormals:
    """The normals of one surface. points, normals: (n, 3). faces: (m, 3), counter-clockwise seen from outside."""

    # Inside, vectors stand in columns (3, n): NumPy is slow along short last axes.

    def __init__(self, points: NDArray, normals: NDArray, faces: NDArray[np.int64]) -> None:
        self._points, self._normals = (np.array(one, np.float64).T.copy() for one in (points, normals))
        self._group = _smooth_groups(self._points, self._normals)
        self._faces = np.ascontiguousarray(np.asarray(faces, np.intp).T)        # (3, m)
        self._corners = self._group[self._faces]                        # (3, m) smooth vertices
        self._count = int(self._group.max(initial=-1)) + 1
        places = self._points[:, self._faces]
        self._angles = _angles(places)
        self._neutral = _face_normals(places)
        self._sum = self._added(np.arange(len(faces)), self._neutral)
        self._before = _unit(self._sum)

    def change(self, rows: NDArray[np.int64], motion: NDArray) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Return which normals change, ascending, and by how much (k, 3), if ``rows`` move by ``motion`` (r, 3)."""
        moved = np.zeros(self._points.shape[1], dtype=bool)
        moved[rows] = True
        a, b, c = self._faces
        touched = np.flatnonzero(moved[a] | moved[b] | moved[c])
        points = self._points.copy()
        points[:, rows] += motion.T
        places = np.take(points, np.take(self._faces, touched, axis=1), axis=1)
        turn = _face_normals(places) - np.take(self._neutral, touched, axis=1)
        total = self._sum + self._added(touched, turn)
        surface = np.zeros(self._count, dtype=bool)
        surface[np.take(self._corners, touched, axis=1)] = True
        which = np.flatnonzero(surface[self._group])
        groups = self._group[which]
        normals = np.take(self._normals, which, axis=1)
        before, after = (np.take(one, groups, axis=1) for one in (self._before, total))
        change = _turned(normals, before, _unit(after)) - normals
        seen = _dot(change, change) > _UNSEEN ** 2
        return which[seen], change[:, seen].T

    def _added(self, triangles: NDArray[np.int64], vectors: NDArray) -> NDArray[np.float64]:
        """Return the sums (3, smooth vertices) of vectors (3, k) of triangles (k,), by the angles at their corners."""
        corners, angles = (np.take(one, triangles, axis=1) for one in (self._corners, self._angles))
        corners = corners.ravel()
        return np.stack([np.bincount(corners, (angles * axis).ravel(), self._count) for axis in vectors])


def _smooth_groups(points: NDArray, normals: NDArray) -> NDArray[np.int64]:
    """Return for each vertex the number of its smooth vertex: same place and, where there is a crease, same normal."""
    place = np.unique(points.T, axis=0, return_inverse=True)[1].ravel()
    unit = _unit(normals)
    mean = _unit(np.stack([np.bincount(place, axis) for axis in unit]))
    crease = _dot(unit, mean[:, place]) < _SMOOTH
    creased = np.zeros(mean.shape[1], dtype=bool)
    creased[place[crease]] = True
    side = np.where(creased[place], np.round(normals, 2), 0.0) + 0.0
    return np.unique(np.column_stack([place, *side]), axis=0, return_inverse=True)[1].ravel()


def _face_normals(corners: NDArray) -> NDArray[np.float64]:
    """Return unit normals (3, m) of triangles (3, 3 corners, m); zero for one without area."""
    return _unit(_cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))


def _cross(a: NDArray, b: NDArray) -> NDArray[np.float64]:
    """Return the cross products of columns (3, m)."""
    return np.stack([a[j] * b[k] - a[k] * b[j] for j, k in ((1, 2), (2, 0), (0, 1))])


def _dot(a: NDArray, b: NDArray) -> NDArray[np.float64]:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _angles(corners: NDArray) -> NDArray[np.float64]:
    """Return the angle at each corner (3, m) of triangles (3, 3 corners, m), radians."""
    after = _unit(np.roll(corners, -1, axis=1) - corners)
    before = _unit(np.roll(corners, 1, axis=1) - corners)
    return np.arccos(np.clip(_dot(after, before), -1.0, 1.0))


def _unit(vectors: NDArray) -> NDArray[np.float64]:
    """Return vectors (3, ...) of length 1; one that is too short to have a direction becomes zero."""
    length = np.sqrt(_dot(vectors, vectors))
    return vectors * np.where(length > _TINY, 1.0 / np.maximum(length, _TINY), 0.0)


def _turned(vectors: NDArray, before: NDArray, after: NDArray) -> NDArray[np.float64]:
    """Return vectors turned by the least rotation from ``before`` to ``after`` (Rodrigues); all (3, k)."""
    axis, cosine = _cross(before, after), _dot(before, after)
    opposite = 1.0 + cosine < _OPPOSITE
    along = _dot(axis, vectors) / np.where(opposite, 1.0, 1.0 + cosine)
    turned = vectors * cosine + _cross(axis, vectors) + axis * along
    turned[:, opposite] = -vectors[:, opposite]     # right over: every axis across is as good
    still = (_dot(before, before) == 0) | (_dot(after, after) == 0)
    turned[:, still] = vectors[:, still]            # the surface has no direction there: leave the file's
    return turned

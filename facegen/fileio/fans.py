"""Polygons as triangles: a fan from the first corner, or from another where that one would turn a triangle over."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def fans(vertices: NDArray[np.float64], corners: NDArray[np.int64], sizes: NDArray[np.int64]
         ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return triangles (m, 3) and the polygon that each came from (m,), in the polygons' order.

    vertices: (n, 3). corners: the vertices of all polygons one after the other. sizes: (p,) corners of each, 3 at
    least. A polygon of k corners gives k - 2 triangles and keeps its turn.
    """
    firsts = np.cumsum(sizes) - sizes
    turns = _turns(vertices, corners, sizes, firsts)
    owner = np.repeat(np.arange(len(sizes)), sizes - 2)
    step = np.arange(len(owner)) - np.repeat(np.cumsum(sizes - 2) - (sizes - 2), sizes - 2)     # 0.. within a polygon
    first, turn, size = firsts[owner], turns[owner], sizes[owner]
    rows = [first + (turn + k) % size for k in (0 * step, step + 1, step + 2)]
    return np.stack([corners[row] for row in rows], axis=1), owner


def _turns(vertices, corners, sizes, firsts) -> NDArray[np.int64]:
    """Return for each polygon the corner that its fan starts from."""
    turns = np.zeros(len(sizes), dtype=np.int64)
    for size in np.unique(sizes[sizes > 3]):
        which = np.flatnonzero(sizes == size)
        points = vertices[corners[firsts[which, None] + np.arange(size)]]           # (q, size, 3)
        points = points - points[:, :1]
        bad = _overturned(points)
        which, points = which[bad > 0], points[bad > 0]
        best = bad[bad > 0]
        for turn in range(1, size if len(which) else 1):
            worse = _overturned(np.roll(points, -turn, axis=1))
            turns[which[worse < best]] = turn
            best = np.minimum(best, worse)
    return turns


def _overturned(points) -> NDArray[np.int64]:
    """Return how many triangles of the fan from the first corner (q, k, 3) face against the polygon's area vector."""
    spokes = points[:, 1:] - points[:, :1]
    normals = np.cross(spokes[:, :-1], spokes[:, 1:])
    return (np.einsum("qki,qi->qk", normals, normals.sum(axis=1)) < 0).sum(axis=1)

"""Quads with named vertices, and their subdivision.

Based on: Catmull and Clark 1978, "Recursively generated B-spline surfaces on arbitrary topological meshes".
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix


class Cage:
    """Quads between vertices that are called by a key, such as ("grid", row, column)."""

    def __init__(self) -> None:
        self.index: dict[Hashable, int] = {}
        self.place: list[NDArray[np.float64]] = []
        self.quads: list[tuple[int, int, int, int]] = []

    def vertex(self, key: Hashable, place=(0.0, 0.0, 0.0)) -> int:
        """Return the index of a key; a new one gets ``place``."""
        if key not in self.index:
            self.index[key] = len(self.place)
            self.place.append(np.asarray(place, dtype=np.float64))
        return self.index[key]

    def move(self, key: Hashable, place) -> None:
        """Put a vertex elsewhere."""
        self.place[self.index[key]] = np.asarray(place, dtype=np.float64)

    def __getitem__(self, key: Hashable) -> NDArray[np.float64]:
        return self.place[self.index[key]]

    def quad(self, a: Hashable, b: Hashable, c: Hashable, d: Hashable) -> None:
        """Add a quad, counter-clockwise seen from outside."""
        self.quads.append(tuple(self.vertex(k) for k in (a, b, c, d)))

    def band(self, outer: Sequence[Hashable], inner: Sequence[Hashable]) -> None:
        """Fill between two closed loops that run counter-clockwise seen from outside."""
        n = len(outer)
        for i in range(n):
            j = (i + 1) % n
            self.quad(outer[i], outer[j], inner[j], inner[i])


def edges_of(quads: NDArray[np.int64]) -> tuple[NDArray, NDArray, NDArray]:
    """Return edges (e, 2) sorted, the edge of each quad side (q, 4), and how many quads each edge has (e,)."""
    sides = np.stack([quads, np.roll(quads, -1, axis=1)], axis=2).reshape(-1, 2)
    edges, inverse, count = np.unique(np.sort(sides, axis=1), axis=0, return_inverse=True, return_counts=True)
    return edges, inverse.reshape(-1, 4), count


def catmull_clark(places: NDArray[np.float64], quads: NDArray[np.int64]):
    """Return (places', quads', edges): vertex points first, then one point an edge, then one a quad.

    places: (n, k), any number of channels. A boundary is a cubic B-spline curve.
    """
    n, q = len(places), len(quads)
    edges, side, count = edges_of(quads)
    face_points = places[quads].mean(axis=1)
    middle = places[edges].mean(axis=1)
    touched = coo_matrix((np.ones(4 * q), (side.ravel(), np.repeat(np.arange(q), 4))), shape=(len(edges), q)).tocsr()
    edge_points = np.where((count == 2)[:, None], (middle + touched @ face_points / 2.0) / 2.0, middle)

    # inner vertex: (Q + 2R + (v - 3) S) / v
    corner = coo_matrix((np.ones(4 * q), (quads.ravel(), np.repeat(np.arange(q), 4))), shape=(n, q)).tocsr()
    ends = coo_matrix((np.ones(2 * len(edges)), (edges.ravel(), np.repeat(np.arange(len(edges)), 2))),
                      shape=(n, len(edges))).tocsr()
    valence = np.asarray(ends.sum(axis=1)).ravel()[:, None]
    around = np.asarray(corner.sum(axis=1)).ravel()[:, None]
    new = (corner @ face_points / around + 2.0 * (ends @ middle) / valence + (valence - 3.0) * places) / valence
    rim = edges[count == 1]
    on_rim = np.unique(rim)
    if len(on_rim):                                     # boundary vertex: (a + 6 S + b) / 8
        sums = np.zeros_like(places)
        np.add.at(sums, rim[:, 0], places[rim[:, 1]])
        np.add.at(sums, rim[:, 1], places[rim[:, 0]])
        new[on_rim] = (6.0 * places[on_rim] + sums[on_rim]) / 8.0
    centre = n + len(edges) + np.arange(q)
    after, before = n + side, n + np.roll(side, 1, axis=1)
    fine = np.stack([quads, after, np.repeat(centre[:, None], 4, axis=1), before], axis=2).reshape(-1, 4)
    return np.concatenate([new, edge_points, face_points]), fine, edges


def vertex_normals(places: NDArray[np.float64], quads: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return unit normals (n, 3): the quads' cross products of diagonals, summed."""
    p = places[quads]
    cross = np.cross(p[:, 2] - p[:, 0], p[:, 3] - p[:, 1])
    out = np.zeros_like(places)
    for k in range(4):
        np.add.at(out, quads[:, k], cross)
    return out / np.maximum(np.linalg.norm(out, axis=1, keepdims=True), 1e-12)


def best_fans(places: NDArray[np.float64], quads: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the quads, begun at the corner from which a fan of two triangles has no needles.

    Readers that want triangles split a quad from its first corner.
    """
    def worst(q):
        a, b, c, e = (places[q[:, k]] for k in range(4))
        height = []
        for u, v, w in ((a, b, c), (a, c, e)):
            longest = np.max([np.linalg.norm(v - u, axis=1), np.linalg.norm(w - v, axis=1),
                              np.linalg.norm(u - w, axis=1)], axis=0)
            height.append(np.linalg.norm(np.cross(v - u, w - u), axis=1) / longest**2)
        return np.minimum(*height)

    turned = np.roll(quads, -1, axis=1)
    return np.where((worst(turned) > 1.25 * worst(quads))[:, None], turned, quads)   # 1.25: leave near ties alone

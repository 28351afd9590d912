"""Vertices that a file lists several times, for texture or normals, made one - and no more than those."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from facegen.errors import InputError

# Odd constants of splitmix64 (Steele, Lea, Flood, "Fast splittable pseudorandom number generators", 2014).
_MIX = np.array([0x9E3779B97F4A7C15, 0xBF58476D1CE4E5B9, 0x94D049BB133111EB], np.uint64)


def weld(vertices: ArrayLike, faces: ArrayLike | None = None) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return (unique (u, 3), inverse (n,)): ``unique[inverse]`` is ``vertices``, bit for bit but for -0.0.

    Only exactly equal positions become one, in the order in which they come first. faces (m, 3): then only vertices
    on open borders do. A file that splits vertices for its texture leaves such borders along every split; closed lips
    that touch, or a sphere that touches another, have none there and stay apart. Raises InputError if a position is
    not finite.
    """
    vertices = np.asarray(vertices, float)
    if vertices.ndim != 2 or vertices.shape[1] != 3 or not np.isfinite(vertices).all():
        raise InputError(f"vertices: expected finite positions (n, 3), got shape {vertices.shape}")
    same = _positions(vertices)
    if faces is not None and len(vertices):
        alone = ~_on_border(np.asarray(faces, np.int64).reshape(-1, 3), len(vertices))
        same = np.where(alone, len(vertices) + np.arange(len(vertices)), same)
    _, first, inverse = np.unique(same, return_index=True, return_inverse=True)
    order = np.argsort(first, kind="stable")
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    return vertices[first[order]] + 0.0, rank[inverse.reshape(-1)]


def _positions(vertices: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return a number (n,) for each vertex, equal for equal positions. A hash, checked, is ten times a sort of rows."""
    bits = (vertices + 0.0).view(np.uint64)         # + 0.0: -0.0 is 0.0
    mixed = bits * _MIX
    mixed ^= mixed >> np.uint64(29)
    key = (mixed * _MIX[::-1]).sum(axis=1, dtype=np.uint64)
    _, first, inverse = np.unique(key, return_index=True, return_inverse=True)
    if np.array_equal(vertices[first][inverse], vertices):
        return inverse.reshape(-1)
    return np.unique(bits, axis=0, return_inverse=True)[1].reshape(-1)      # two positions with one hash


def _on_border(faces: NDArray[np.int64], n: int) -> NDArray[np.bool_]:
    """Return which vertices (n,) lie on an edge of one triangle only, or on none."""
    sides = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    sides = sides[sides[:, 0] != sides[:, 1]]
    keys, count = np.unique(sides[:, 0] * n + sides[:, 1], return_counts=True)
    open_sides = keys[count == 1]
    border = np.zeros(n, bool)
    border[open_sides // n] = border[open_sides % n] = True
    used = np.zeros(n, bool)
    used[faces.ravel()] = True
    return border | ~used

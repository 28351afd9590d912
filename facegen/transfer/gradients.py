"""The deformation gradient of a triangle, and triangle correspondence: the parts of the method as they are published.

Based on: Onizuka et al. (2018), eq. 2-7 and 14; R. Sumner, J. Popovic, "Deformation transfer for triangle meshes"
(2004).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from facegen.geometry.operators import Surface

# Because a triangle without an area has no plane: its gradient counts as that of one this thin.
_TINY = 1e-12
# Nearest middles tried for one with a normal within 90 degrees.
_TRIED = 16


def edge_frames(vertices: NDArray, faces: NDArray, *, root: bool = False) -> NDArray[np.float64]:
    """Return V = [v2 - v1, v3 - v1, v4 - v1] as columns, (..., m, 3, 3), of triangles (eq. 2, 5).

    v4 - v1 is the unit normal (Onizuka, eq. 2); with ``root`` the cross product divided by the square root of its
    length (Sumner & Popovic): then a uniform scale of the mesh scales all three columns alike.
    """
    a, b, c = (vertices[..., faces[:, k], :] for k in range(3))
    cross = np.cross(b - a, c - a)
    length = np.sqrt((cross**2).sum(axis=-1, keepdims=True))
    fourth = cross / np.maximum(np.sqrt(length) if root else length, _TINY)
    return np.stack([b - a, c - a, fourth], axis=-1)


def deformation_gradients(neutral: NDArray, deformed: NDArray, faces: NDArray, *,
                          root: bool = False) -> NDArray[np.float64]:
    """Return T = V~ V^-1 (..., m, 3, 3): how each triangle's neighbourhood is mapped (eq. 4, 7).

    neutral (n, 3), deformed (..., n, 3). The identity where nothing moves.
    """
    return edge_frames(deformed, faces, root=root) @ np.linalg.inv(edge_frames(neutral, faces, root=root))


def triangle_pairs(template: Surface, avatar: Surface) -> NDArray[np.int64]:
    """Return the pairs (p, 2) of template and avatar triangles, M of eq. 14; avatar: in the template's shape.

    For every triangle of the one the nearest of the other, middle to middle, whose normal lies within 90 degrees; both
    ways; each pair once.
    """
    there = _nearest(avatar, template)
    back = _nearest(template, avatar)
    t = np.flatnonzero(there >= 0)
    s = np.flatnonzero(back >= 0)
    pairs = np.concatenate([np.stack([there[t], t], axis=1), np.stack([s, back[s]], axis=1)])
    return np.unique(pairs, axis=0)


def _nearest(of: Surface, among: Surface) -> NDArray[np.int64]:
    from scipy.spatial import cKDTree

    k = min(_TRIED, len(among.faces))
    _, near = cKDTree(among.corners.mean(axis=1)).query(of.corners.mean(axis=1), k=k, workers=-1)
    near = near.reshape(len(of.faces), k)
    facing = np.einsum("mi,mki->mk", of.normals, among.normals[near]) > 0
    return np.where(facing.any(axis=1), near[np.arange(len(near)), facing.argmax(axis=1)], -1)

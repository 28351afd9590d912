"""Normals of triangles and vertices.

Based on: G. Thürmer, C. Wüthrich, "Computing vertex normals from polygonal facets", 1998: each triangle
counts by its angle at the vertex, so the result does not depend on how a polygon is split into triangles.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

# Because a zero-area triangle has no direction: it must add nothing rather than NaN.
_TINY = 1e-300


def face_normals(vertices: ArrayLike, faces: ArrayLike) -> NDArray[np.float64]:
    """Return unit normals (..., m, 3) of counter-clockwise triangles; zero where a triangle has no area.

    vertices: (..., n, 3) positions. faces: (m, 3) indices.
    """
    corners = np.asarray(vertices, dtype=np.float64)[..., np.asarray(faces), :]
    return _unit(np.cross(corners[..., 1, :] - corners[..., 0, :], corners[..., 2, :] - corners[..., 0, :]))


def vertex_normals(vertices: ArrayLike, faces: ArrayLike) -> NDArray[np.float64]:
    """Return unit normals (..., n, 3): the sum of the triangles' normals, weighted by their angle at the
    vertex.

    vertices: (..., n, 3) positions, any leading axes (frames). faces: (m, 3) indices. A vertex that no
    triangle with an area uses gets (0, 0, 0). Vertices are smoothed only across the triangles that share
    them.
    """
    vertices = np.asarray(vertices, dtype=np.float64)
    faces = np.asarray(faces)
    n = vertices.shape[-2]
    batch = vertices.reshape(-1, n, 3)
    corners = batch[:, faces]                                                 # (frames, m, 3 corners, 3)
    edges = np.roll(corners, -1, axis=2) - corners
    normals = np.cross(edges[:, :, 0], edges[:, :, 1])
    twice_area = np.sqrt(np.einsum("fmi,fmi->fm", normals, normals))
    cosines = -np.einsum("fmki,fmki->fmk", edges, np.roll(edges, 1, axis=2))    # times both edges' lengths
    angles = np.arctan2(twice_area[..., None], cosines) / np.maximum(twice_area, _TINY)[..., None]
    index = (faces.ravel() + n * np.arange(len(batch))[:, None]).ravel()
    total = np.empty((len(batch) * n, 3))
    for axis in range(3):
        weights = (angles * normals[..., axis, None]).ravel()
        total[:, axis] = np.bincount(index, weights, minlength=len(total))
    return _unit(total).reshape(vertices.shape)


def _unit(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    length = np.sqrt(np.einsum("...i,...i->...", vectors, vectors))
    return vectors / np.maximum(length, _TINY)[..., None]

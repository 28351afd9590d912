"""Parts that ride on the face: eyeballs turn, lower teeth and tongue go with the jaw, brows with the skin."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from facegen.geometry.mesh import Mesh

if TYPE_CHECKING:
    from facegen.face.deformer import Deformer
    from facegen.face.face import Controls

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Attachment:
    """A part and what carries it; whatever is None does not.

    ``skin`` (n, n_cage): weights of the cage's movement. ``jaw`` (n, 1): share of the jaw's. ``eye``: number
    of the eye it turns with, about ``centre`` (3,). ``points``: feature points (row, weights (n, 1)) that
    move it.
    """

    mesh: Mesh
    skin: sparse.csr_array | None = None
    jaw: Array | None = None
    eye: int | None = None
    centre: Array | None = None
    points: tuple[tuple[int, Array], ...] = ()

    def some(self, rows: NDArray[np.int64]) -> Attachment:
        """Return the same for some of its vertices, without triangles."""
        mesh = replace(self.mesh, vertices=self.mesh.vertices[rows], faces=self.mesh.faces[:0],
                       face_materials=self.mesh.face_materials[:0], face_parts=self.mesh.face_parts[:0], colours=None)
        return Attachment(mesh, None if self.skin is None else self.skin[rows],
                          None if self.jaw is None else self.jaw[rows], self.eye, self.centre,
                          tuple((point, weight[rows]) for point, weight in self.points))

    def move(self, moved_cage: Array, controls: Controls, deformer: Deformer) -> Array:
        """Return the part's vertices (..., n, 3), mm, before the head turns.

        ``moved_cage`` (..., n_cage, 3): the cage's movement.
        """
        rest = self.mesh.vertices
        batch = moved_cage.shape[:-2]
        out = np.broadcast_to(rest, (*batch, *rest.shape))
        if self.skin is not None:
            n_cage = moved_cage.shape[-2]
            flat = np.moveaxis(moved_cage.reshape(-1, n_cage, 3), 0, 1).reshape(n_cage, -1)
            out = out + np.moveaxis((self.skin @ flat).reshape(len(rest), -1, 3), 1, 0).reshape(out.shape)
        if self.jaw is not None and np.any(controls.jaw):
            out = out + self.jaw * deformer.jaw.movement(rest, controls.jaw)
        for row, weight in self.points:
            out = out + weight * controls.vectors[..., row, None, :]
        if self.eye is not None:
            yaw = np.radians(controls.eyes[..., 2 * self.eye])[..., None]
            pitch = np.radians(controls.eyes[..., 2 * self.eye + 1])[..., None]
            if np.any(yaw) or np.any(pitch):
                x, y, z = np.moveaxis(rest - self.centre, -1, 0)
                y, z = y * np.cos(pitch) + z * np.sin(pitch), z * np.cos(pitch) - y * np.sin(pitch)
                x, z = x * np.cos(yaw) + z * np.sin(yaw), z * np.cos(yaw) - x * np.sin(yaw)
                out = np.stack(np.broadcast_arrays(x, y, z), axis=-1) + self.centre
        return np.array(out)


BLOCK = 16
"""Triangles that follow each other lie together: two subdivisions make sixteen of each."""

BLOCKS_SEARCHED = 12
"""Blocks whose middles are nearest to a point; its nearest triangles lie in them."""


def _nearest(points: Array, centroids: Array, k: int) -> NDArray[np.intp]:
    """Return the k nearest centroids (n, k) of each point, nearest first.

    Coarse to fine, in NumPy: a tree of scipy.spatial finds the same a little sooner, but importing it takes
    longer than the whole search.
    """
    m = len(centroids)
    owner = np.minimum(np.arange(-(-m // BLOCK) * BLOCK), m - 1).reshape(-1, BLOCK)
    middles = centroids[owner].mean(axis=1)

    def squared(a: Array, b: Array) -> Array:
        return (a * a).sum(-1)[:, None] - 2.0 * (a @ b.T) + (b * b).sum(-1)

    blocks = min(BLOCKS_SEARCHED, len(middles))
    coarse = np.argpartition(squared(points, middles), blocks - 1, axis=1)[:, :blocks]
    candidates = owner[coarse].reshape(len(points), -1)
    distance = ((centroids[candidates] - points[:, None]) ** 2).sum(-1)
    repeated = np.zeros_like(distance, bool)
    if m % BLOCK:                       # the last block is filled up with its last triangle
        repeated[:] = (candidates == m - 1) & (np.cumsum(candidates == m - 1, axis=1) > 1)
    distance[repeated] = np.inf
    some = np.argpartition(distance, k - 1, axis=1)[:, :k]
    order = np.take_along_axis(some, np.take_along_axis(distance, some, axis=1).argsort(axis=1), axis=1)
    return np.take_along_axis(candidates, order, axis=1)


def attach(points: Array, surface: Array, faces: NDArray[np.int32],
           matrix: sparse.csr_array) -> sparse.csr_array:
    """Return the weights (n, n_cage) by which points (n, 3) follow the nearest triangle of a skin surface.

    ``surface`` (m, 3) = ``matrix @ cage``. The barycentric weights of the foot point are carried through
    ``matrix``, so a part follows the smooth surface at every level of detail.
    """
    centroids = surface[faces].mean(axis=1)
    near = _nearest(points, centroids, min(6, len(faces)))
    a, b, c = (surface[faces[near, i]] for i in range(3))
    e1, e2, d = b - a, c - a, points[:, None] - a
    g11, g12, g22 = ((p * q).sum(-1) for p, q in ((e1, e1), (e1, e2), (e2, e2)))
    r1, r2 = (e1 * d).sum(-1), (e2 * d).sum(-1)
    det = np.maximum(g11 * g22 - g12**2, 1e-12)
    v, w = (g22 * r1 - g12 * r2) / det, (g11 * r2 - g12 * r1) / det
    bary = np.maximum(np.stack([1 - v - w, v, w], axis=-1), 0.0)
    bary /= bary.sum(axis=-1, keepdims=True)
    foot = np.einsum("nkj,nkji->nki", bary, np.stack([a, b, c], axis=2))
    best = np.linalg.norm(foot - points[:, None], axis=2).argmin(axis=1)
    rows = np.arange(len(points))
    corners = faces[near[rows, best]].reshape(-1)
    weights = sparse.csr_array((bary[rows, best].reshape(-1), (np.repeat(rows, 3), corners)),
                               shape=(len(points), len(surface)))
    return sparse.csr_array(weights @ matrix)

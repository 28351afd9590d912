"""Differential operators on a triangle surface, as sparse matrices over its vertices.

Based on: R. Sumner, J. Popovic, "Deformation transfer for triangle meshes" (2004), whose deformation gradient is, in a
triangle's plane, the gradient of the deformed positions; M. Botsch et al., "Deformation transfer for detail-preserving
surface editing" (2006), for the equality with the Laplace system of areas and gradients. Based on these, every energy
of the transfer is a quadratic form over n vertices, not 3 n + m.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse import csgraph

# Because the gradient in a sliver is a difference divided by its altitude: an altitude below this share of the longest
# side counts as this share. Needles would else amplify a motion's noise by their aspect.
LOWEST_ALTITUDE = 0.02
# Because two vertices that all but coincide make gradients of any size: a triangle counts as having at least this share
# of the square of the typical longest side as twice its area.
_LEAST_AREA = 1e-4
# Because a triangle without an area, and a side without a length, must add nothing rather than NaN.
_TINY = 1e-300


@dataclass(frozen=True, eq=False)
class Surface:
    """Vertices (n, 3) and triangles (m, 3), and what is derived from them when asked for."""

    vertices: NDArray[np.float64]
    faces: NDArray[np.int32]

    @cached_property
    def corners(self) -> NDArray[np.float64]:
        """The triangles' corners (m, 3, 3)."""
        return self.vertices[self.faces]

    @cached_property
    def _frame(self) -> tuple[NDArray, NDArray, NDArray]:
        """Unit normals (m, 3), twice the areas (m,), twice the areas that gradients divide by (m,)."""
        a, b, c = np.moveaxis(self.corners, 1, 0)
        cross = np.cross(b - a, c - a)
        twice = np.sqrt(np.einsum("ij,ij->i", cross, cross))
        longest = np.max([((p - q) ** 2).sum(axis=1) for p, q in ((a, b), (b, c), (c, a))], axis=0)
        divisor = np.maximum(twice, LOWEST_ALTITUDE * longest)
        divisor = np.maximum(divisor, _LEAST_AREA * np.median(longest) if len(longest) else 0.0)
        return cross / np.maximum(twice, _TINY)[:, None], twice, divisor

    @property
    def normals(self) -> NDArray[np.float64]:
        """Unit normals of the triangles (m, 3); zero without an area."""
        return self._frame[0]

    @property
    def areas(self) -> NDArray[np.float64]:
        """Areas of the triangles (m,)."""
        return self._frame[1] / 2

    @cached_property
    def vertex_areas(self) -> NDArray[np.float64]:
        """A third of the areas round every vertex (n,)."""
        return np.bincount(self.faces.ravel(), np.repeat(self.areas / 3, 3), minlength=len(self.vertices))

    @cached_property
    def hat_gradients(self) -> NDArray[np.float64]:
        """Gradients (m, 3 corners, 3) of the functions that are one at a corner and linear in the triangle."""
        a, b, c = np.moveaxis(self.corners, 1, 0)
        normals, _, divisor = self._frame
        opposite = np.stack([c - b, a - c, b - a], axis=1)
        return np.cross(normals[:, None, :], opposite) / np.maximum(divisor, _TINY)[:, None, None]

    @cached_property
    def gradient(self) -> sparse.csr_array:
        """The matrix G (3 m, n): rows 3 t .. 3 t + 2 give the gradient in triangle t of a function on the vertices."""
        m = len(self.faces)
        rows = np.repeat(np.arange(3 * m), 3)
        columns = np.repeat(self.faces, 3, axis=0).ravel()
        values = np.moveaxis(self.hat_gradients, 1, 2).ravel()
        return sparse.csr_array((values, (rows, columns)), shape=(3 * m, len(self.vertices)))

    @cached_property
    def edges(self) -> tuple[NDArray[np.int32], NDArray[np.int64]]:
        """The edges (e, 2), lower vertex first, and for every side (3 m,) of the triangles its edge; side k of a
        triangle runs from its corner k to the next."""
        sides = np.sort(self.faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1).astype(np.int64)
        _keys, first, of_side = np.unique(sides[:, 0] * len(self.vertices) + sides[:, 1], return_index=True,
                                         return_inverse=True)
        return sides[first].astype(np.int32), of_side.reshape(-1)

    @cached_property
    def neighbours(self) -> sparse.csr_array:
        """The matrix (n, n) that is one where an edge joins two vertices."""
        edges, _ = self.edges
        n = len(self.vertices)
        both = edges.T.ravel(), edges[:, ::-1].T.ravel()
        return sparse.csr_array(sparse.coo_array((np.ones(2 * len(edges)), both), shape=(n, n)))

    @cached_property
    def hinges(self) -> tuple[NDArray, NDArray, NDArray]:
        """Pairs of triangles (h, 2) with a common edge, the edge (h,), and the index of the side in each (h, 2).

        An edge of more than two triangles gives a pair for every two that follow each other.
        """
        _edges, of_side = self.edges
        order = np.argsort(of_side, kind="stable")
        same = of_side[order[1:]] == of_side[order[:-1]]
        sides = np.stack([order[:-1][same], order[1:][same]], axis=1)
        return sides // 3, of_side[sides[:, 0]], sides % 3

    @cached_property
    def stretching(self) -> sparse.csc_array:
        """The `dirichlet` energy (n, n) without weights, EI (Onizuka 2018, eq. 11)."""
        return dirichlet(self)

    @cached_property
    def bending(self) -> sparse.csc_array:
        """The `hinge_energy` (n, n)."""
        return hinge_energy(self)

    def components(self) -> tuple[int, NDArray[np.int32]]:
        """Return the number of connected components and every vertex' component (n,)."""
        n = len(self.vertices)
        rows, columns = self.faces[:, [0, 1]].T.reshape(2, -1), self.faces[:, [1, 2]].T.reshape(2, -1)
        links = sparse.coo_array((np.ones(rows.size, np.int8), (rows.ravel(), columns.ravel())), shape=(n, n))
        return csgraph.connected_components(links.tocsr(), directed=False)

    @cached_property
    def border_edges(self) -> NDArray[np.bool_]:
        """Which edges (e,) belong to one triangle only."""
        edges, of_side = self.edges
        return np.bincount(of_side, minlength=len(edges)) == 1


def dirichlet(surface: Surface, weights: NDArray | None = None) -> sparse.csc_array:
    """Return G^T W G (n, n): the energy sum_t w_t area_t |grad u|^2 as a matrix. weights (m,), one without."""
    share = surface.areas if weights is None else surface.areas * weights
    hats = surface.hat_gradients
    blocks = np.einsum("tia,tja->tij", hats, hats) * share[:, None, None]
    n = len(surface.vertices)
    rows = np.repeat(surface.faces, 3, axis=1).ravel()
    columns = np.tile(surface.faces, (1, 3)).ravel()
    return sparse.csc_array(sparse.coo_array((blocks.ravel(), (rows, columns)), shape=(n, n)))


def hinge_energy(surface: Surface) -> sparse.csc_array:
    """Return the matrix (n, n) of the integral of |second derivative of u|^2: ES (Onizuka 2018, eq. 10).

    Along their common edge two triangles' gradients agree by themselves; D_b is the difference of the derivatives
    across it, each in its own triangle's plane. |edge|^2 / area of both times |D_b u|^2 makes the sum over hinges the
    integral, whatever the triangulation. u in mm: an energy without unit.
    """
    pairs, _, side = surface.hinges
    n, h = len(surface.vertices), len(pairs)
    across = []
    for k in (0, 1):
        t, s = pairs[:, k], side[:, k]
        edge = surface.corners[t, (s + 1) % 3] - surface.corners[t, s]
        away = np.cross(edge, surface.normals[t])
        away /= np.maximum(np.sqrt(np.einsum("ij,ij->i", away, away)), _TINY)[:, None]
        # the two point opposite ways: their sum is the jump
        across.append(np.einsum("hka,ha->hk", surface.hat_gradients[t], away))
    values = np.concatenate(across, axis=1)
    columns = np.concatenate([surface.faces[pairs[:, 0]], surface.faces[pairs[:, 1]]], axis=1)
    area = surface.areas[pairs[:, 0]] + surface.areas[pairs[:, 1]]
    squared = np.einsum("hi,hi->h", edge, edge)
    weight = squared / np.maximum(np.maximum(area, LOWEST_ALTITUDE * squared), _TINY)
    rows = np.repeat(np.arange(h), 6)
    difference = sparse.csr_array((values.ravel(), (rows, columns.ravel())), shape=(h, n))
    return sparse.csc_array(difference.T @ difference.multiply(weight[:, None]).tocsr())

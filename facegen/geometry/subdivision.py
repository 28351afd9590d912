"""Loop subdivision with creases, one sparse matrix a level.

Based on: C. Loop, "Smooth subdivision surfaces based on triangles" (1987), and the crease rules of H. Hoppe
et al., "Piecewise smooth surface reconstruction" (1994). The positions after a level are linear in the
positions before it, so a level is a sparse matrix S and a new list of faces: ``fine = S @ coarse``, for any
positions.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse


@dataclass(frozen=True, eq=False)
class Subdivision:
    """One refinement, or several in a row.

    ``matrix`` (n_fine, n_coarse) csr, rows sum to one; ``faces`` (m_fine, 3); ``parent_face`` (m_fine,) the
    coarse triangle each fine one lies on; ``creases`` (k, 2) the fine edges that stay sharp. The first
    n_coarse fine vertices are the coarse ones, moved.
    """

    matrix: sparse.csr_array
    faces: NDArray[np.int32]
    parent_face: NDArray[np.int32]
    creases: NDArray[np.int32]

    def then(self, finer: Subdivision) -> Subdivision:
        """Return both refinements as one."""
        return Subdivision(sparse.csr_array(finer.matrix @ self.matrix), finer.faces,
                           self.parent_face[finer.parent_face], finer.creases)


def identity(n_vertices: int, faces: NDArray[np.int32], creases: NDArray[np.int32]) -> Subdivision:
    """Return level 0: nothing is refined."""
    return Subdivision(sparse.csr_array(sparse.identity(n_vertices, format="csr")), faces,
                       np.arange(len(faces), dtype=np.int32), np.asarray(creases, np.int32).reshape(-1, 2))


def inherited_sides(sides: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return which sides (4 m, 3) of the triangles of `loop_once` lie on marked sides (m, 3) of the ones before.

    Side k of a triangle runs from its corner k to the next.
    """
    ab, bc, ca = np.asarray(sides, bool).T
    no = np.zeros_like(ab)
    return np.stack([ab, no, ca, bc, no, ab, ca, no, bc, no, no, no], axis=1).reshape(-1, 3)


def loop_levels(n_vertices: int, faces, creases, levels: int, *, corners=()) -> tuple[Subdivision, ...]:
    """Return the subdivisions from level 0 to ``levels``, each from the coarse mesh directly.

    ``faces`` (m, 3); ``creases`` (k, 2) sharp edges as vertex pairs; ``corners``: vertices that never move.
    """
    result = [identity(n_vertices, np.asarray(faces, np.int32), creases)]
    for _ in range(levels):
        last = result[-1]
        result.append(last.then(loop_once(last.matrix.shape[0], last.faces, last.creases, corners=corners)))
    return tuple(result)


def loop_once(n_vertices: int, faces: NDArray[np.int32], creases: NDArray[np.int32], *,
              corners=()) -> Subdivision:
    """Refine every triangle into four.

    An edge is sharp if it is listed in ``creases`` or does not border exactly two triangles. A vertex on
    exactly two sharp edges follows the curve rule (3/4, 1/8, 1/8); on three or more, or listed in
    ``corners``, it stays; else Loop's rule.
    """
    n, m = n_vertices, len(faces)
    sides = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    edges, side_edge, border = np.unique(sides, axis=0, return_inverse=True, return_counts=True)
    side_edge = side_edge.reshape(-1)
    sharp = border != 2
    if len(creases):
        keys = np.sort(np.asarray(creases, np.int64), axis=1)
        sharp |= np.isin(edges[:, 0].astype(np.int64) * n + edges[:, 1], keys[:, 0] * n + keys[:, 1])
    new_vertex = n + np.arange(len(edges))

    # New vertices on edges: 3/8, 3/8 and 1/8 of the two opposite corners; on sharp edges the middle.
    opposite = faces[:, [2, 0, 1]].reshape(-1)
    smooth_side = ~sharp[side_edge]
    rows = [np.repeat(new_vertex, 2), new_vertex[side_edge[smooth_side]]]
    cols = [edges.reshape(-1), opposite[smooth_side]]
    vals = [np.repeat(np.where(sharp, 1 / 2, 3 / 8), 2), np.full(smooth_side.sum(), 1 / 8)]

    # Old vertices.
    ends = np.concatenate([edges[:, 0], edges[:, 1]])
    others = np.concatenate([edges[:, 1], edges[:, 0]])
    end_sharp = np.concatenate([sharp, sharp])
    valence = np.bincount(ends, minlength=n)
    n_sharp = np.bincount(ends[end_sharp], minlength=n)
    curve, smooth = n_sharp == 2, (n_sharp < 2) & (valence > 0)
    corner = np.zeros(n, bool)
    corner[np.asarray(corners, dtype=int)] = True
    curve, smooth = curve & ~corner, smooth & ~corner
    k = np.maximum(valence, 3)
    beta = (5 / 8 - (3 / 8 + np.cos(2 * np.pi / k) / 4) ** 2) / k
    own = np.where(curve, 3 / 4, np.where(smooth, 1 - valence * beta, 1.0))
    use = smooth[ends] | (curve[ends] & end_sharp)
    rows += [np.arange(n), ends[use]]
    cols += [np.arange(n), others[use]]
    vals += [own, np.where(curve[ends], 1 / 8, beta[ends])[use]]

    matrix = sparse.csr_array(
        (np.concatenate(vals), (np.concatenate(rows), np.concatenate(cols))), shape=(n + len(edges), n))
    ab, bc, ca = new_vertex[side_edge.reshape(-1, 3)].T
    a, b, c = faces.T
    fine = np.stack([a, ab, ca, b, bc, ab, c, ca, bc, ab, bc, ca], axis=1).reshape(-1, 3)
    sharp_edges, middle = edges[sharp & (border == 2)], new_vertex[sharp & (border == 2)]
    fine_creases = np.concatenate([np.stack([sharp_edges[:, 0], middle], 1),
                                   np.stack([middle, sharp_edges[:, 1]], 1)])
    return Subdivision(matrix, fine.astype(np.int32), np.repeat(np.arange(m, dtype=np.int32), 4),
                       fine_creases.astype(np.int32))

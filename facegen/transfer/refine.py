"""A finer copy of a sparse avatar, where the template bends more than its triangles can.

Onizuka et al. (2018) leave open what happens to meshes of few polygons: a triangle that spans brow and lid has one
gradient for both. The transfer is solved on a copy whose triangles are halved where that matters; its first vertices
are the avatar's own, so the motion comes back by leaving out the rest.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from facegen.geometry.operators import Surface

# Because a triangle three times halved is as small as the template's on the sparsest of faces.
_ROUNDS = 3
# Millimetres: sides shorter than this are as fine as the template.
_SHORT = 5.0
# A side is halved where its middle would move this many millimetres otherwise than the mean of its ends.
BEND = 0.35


def refine(surface: Surface, registered: NDArray, bend: Callable[[NDArray, NDArray], NDArray]
           ) -> tuple[Surface, NDArray, sparse.csr_array]:
    """Return the finer surface, its registered vertices, and the matrix that makes its vertices of the coarse ones.

    registered (n, 3): the surface in the template's shape. bend(places, sides): for sides (e, 2) between places (n, 3)
    on the template, how far (e,) in mm the motion of their middles is from the mean of their ends', at most.
    """
    vertices, faces = surface.vertices, surface.faces
    matrix = sparse.csr_array(sparse.identity(len(vertices), format="csr"))
    asked = 0                                       # sides between the first so many vertices were looked at before
    for _ in range(_ROUNDS):
        fine = Surface(vertices, faces)
        edges, of_side = fine.edges
        a, b = registered[edges[:, 0]], registered[edges[:, 1]]
        split = np.flatnonzero((((a - b) ** 2).sum(axis=1) > _SHORT**2) & (edges[:, 1] >= asked))
        split = split[bend(registered, edges[split]) > BEND] if len(split) else split
        if not len(split):
            break
        asked = len(vertices)
        middle = np.full(len(edges), -1)
        middle[split] = len(vertices) + np.arange(len(split))
        rows = np.repeat(np.arange(len(split)), 2)
        halves = sparse.csr_array((np.full(2 * len(split), 0.5), (rows, edges[split].ravel())),
                                  shape=(len(split), len(vertices)))
        step = sparse.vstack([sparse.identity(len(vertices), format="csr"), halves], format="csr")
        vertices, registered, matrix = step @ vertices, step @ registered, sparse.csr_array(step @ matrix)
        faces = _split(faces, middle[of_side].reshape(-1, 3))
    return Surface(vertices, faces.astype(np.int32)), registered, matrix


def _split(faces: NDArray, middle: NDArray) -> NDArray:
    """Return triangles whose sides have a new vertex where middle (m, 3) is not -1; side k: corner k to the next."""
    count = (middle >= 0).sum(axis=1)
    parts = [faces[count == 0]]
    for k in range(3):                                      # one side: two triangles
        rows = (count == 1) & (middle[:, k] >= 0)
        a, b, c, x = faces[rows, k], faces[rows, (k + 1) % 3], faces[rows, (k + 2) % 3], middle[rows, k]
        parts += [np.stack([a, x, c], 1), np.stack([x, b, c], 1)]
        rows = (count == 2) & (middle[:, k] < 0)            # two sides: three; side k is whole
        a, b, c = faces[rows, k], faces[rows, (k + 1) % 3], faces[rows, (k + 2) % 3]
        y, z = middle[rows, (k + 1) % 3], middle[rows, (k + 2) % 3]
        parts += [np.stack([c, z, y], 1), np.stack([a, b, y], 1), np.stack([a, y, z], 1)]
    rows = count == 3
    a, b, c = faces[rows].T
    ab, bc, ca = middle[rows].T
    parts += [np.stack(t, 1) for t in ((a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca))]
    return np.concatenate(parts)

"""What must be true of an avatar's mesh, as a list of faults: used by hand and by the tests."""

from __future__ import annotations

from collections import Counter

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

# A triangle thinner than this share of its longest side is as good as degenerate.
_THINNEST = 0.02
# Faces that meet at a sharper fold than this are folded over.
_FOLDED = -0.9


def faults(vertices: NDArray, faces: NDArray) -> list[str]:
    """Return what is wrong with a surface: not manifold, not turned alike, slivers, folds, self-intersections."""
    out = []
    directed = Counter((int(f[i - 1]), int(f[i])) for f in faces for i in range(3))
    twice = [e for e, n in directed.items() if n > 1]
    if twice:
        out.append(f"{len(twice)} edges not manifold or not turned alike, near {vertices[twice[0][0]].round(2)}")
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    normal = np.cross(b - a, c - a)
    longest = np.sqrt(np.max([((b - a)**2).sum(1), ((c - b)**2).sum(1), ((a - c)**2).sum(1)], axis=0))
    thin = np.linalg.norm(normal, axis=1) < _THINNEST * longest**2
    if thin.any():
        out.append(f"{thin.sum()} slivers, near {vertices[faces[thin][0]].mean(axis=0).round(2)}")
    unit = normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
    owner = {e: n for n, f in enumerate(faces) for e in ((int(f[0]), int(f[1])), (int(f[1]), int(f[2])), (int(f[2]), int(f[0])))}
    folds = [n for (i, j), n in owner.items() if i < j and (j, i) in owner and unit[n] @ unit[owner[j, i]] < _FOLDED]
    if folds:
        out.append(f"{len(folds)} folded edges, near {[tuple(vertices[faces[n]].mean(axis=0).round(2)) for n in folds[:6]]}")
    fans = _pinched(faces)
    if fans:
        out.append(f"{len(fans)} vertices where the surface is pinched, near {vertices[fans[0]].round(2)}")
    crossing = intersections(vertices, faces)
    if crossing:
        out.append(f"{len(crossing)} pairs of triangles cross, near "
                   f"{[tuple(vertices[faces[i]].mean(axis=0).round(2)) for i, _ in crossing[:6]]}")
    return out


def boundary_loops(faces: NDArray) -> list[list[int]]:
    """Return the loops of edges with one triangle."""
    directed = {(int(f[i - 1]), int(f[i])) for f in faces for i in range(3)}
    after = {a: b for a, b in directed if (b, a) not in directed}
    loops = []
    while after:
        start, at = next(iter(after.items()))
        del after[start]
        loop = [start]
        while at != start and at in after:
            loop.append(at)
            at = after.pop(at)
        loops.append(loop)
    return loops


def components(faces: NDArray) -> int:
    """Return the number of connected pieces."""
    used, f = np.unique(faces, return_inverse=True)
    f = f.reshape(faces.shape)
    links = coo_matrix((np.ones(2 * len(f)), (np.r_[f[:, 0], f[:, 0]], np.r_[f[:, 1], f[:, 2]])), (len(used),) * 2)
    return connected_components(links, directed=False)[0]


def _pinched(faces: NDArray) -> list[int]:
    """Return vertices whose triangles form more than one fan."""
    edges: dict[int, list[tuple[int, int]]] = {}
    for f in faces:
        for i in range(3):
            edges.setdefault(int(f[i]), []).append((int(f[i - 2]), int(f[i - 1])))
    return [v for v, links in edges.items()
            if len({x for e in links for x in e}) - len(links) not in (0, 1)]


def intersections(vertices: NDArray, faces: NDArray) -> list[tuple[int, int]]:
    """Return pairs of triangles without a common vertex that cross: an edge of one passes through the other."""
    corners = vertices[faces]
    middle = corners.mean(axis=1)
    radius = np.linalg.norm(corners - middle[:, None], axis=2).max(axis=1)
    pairs = []
    order = np.argsort(radius)
    tree = cKDTree(middle)
    # Query by the larger of the two radii, so that every pair is found once from its larger triangle at least.
    for i in order:
        near = np.array(tree.query_ball_point(middle[i], 2 * radius[i]))
        near = near[(radius[near] < radius[i]) | ((radius[near] == radius[i]) & (near < i))]
        pairs.append(np.column_stack([np.full(len(near), i), near]))
    pairs = np.concatenate(pairs)
    low, high = corners.min(axis=1), corners.max(axis=1)
    i, j = pairs.T
    apart = (low[i] > high[j]).any(1) | (low[j] > high[i]).any(1)
    shared = (faces[i][:, :, None] == faces[j][:, None, :]).any((1, 2))
    i, j = pairs[~apart & ~shared].T
    hit = np.zeros(len(i), bool)
    for a, b in ((i, j), (j, i)):
        for k in range(3):
            hit |= _pierces(corners[a, k], corners[a, (k + 1) % 3], corners[b])
    return list(zip(i[hit].tolist(), j[hit].tolist(), strict=True))


def _pierces(p: NDArray, q: NDArray, triangle: NDArray) -> NDArray[np.bool_]:
    """Return whether segments p-q (n, 3) pass through triangles (n, 3, 3)."""
    a, b, c = triangle[:, 0], triangle[:, 1], triangle[:, 2]

    def volume(u, v, w, x):
        return np.einsum("ij,ij->i", np.cross(v - u, w - u), x - u)

    sides = volume(a, b, c, p) * volume(a, b, c, q) < 0
    around = [volume(p, q, a, b), volume(p, q, b, c), volume(p, q, c, a)]
    return sides & ((np.array(around) > 0).all(0) | (np.array(around) < 0).all(0))

"""The lips in the head's middle plane: where the way over the skin, from the nose to the chin, turns into the mouth.

The plane cuts the skin in a curve. Between lips, closed or open, the curve runs in and out again: two places on it are
near to each other while the way between them is long.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from facegen.geometry.operators import Surface
from facegen.landmarking.symmetry import Plane

Array = NDArray[np.float64]

# The way into the mouth and out again is so many times as long as the way across it, and longer than this share of the
# way from nose to chin; the mouth is open by no more than this share.
_WAY, _LEAST, _OPEN = 3.0, 0.12, 0.5
# The curve begins this near to the tip of the nose and to the chin, as a share of the way between.
_NEAR = 0.25
# Lips lie between the two by at least this share of the way.
_WITHIN = 0.03


def lips_in_profile(skin: Surface, plane: Plane, nose: Array, chin: Array) -> tuple[Array, Array] | None:
    """Return the inner edges (3,) of the upper and the lower lip in a plane; None where the curve runs into no mouth.

    nose, chin: the tip and the chin (3,), in the skin's axes and units, as the plane.
    """
    size = float(np.linalg.norm(nose - chin))
    places, first, second = cut(skin, plane, (nose + chin) / 2, 1.5 * size)
    if len(places) < 4:
        return None
    length = np.linalg.norm(places[first] - places[second], axis=1)
    graph = sparse.coo_array((np.maximum(length, 1e-12 * size), (first, second)), shape=(len(places),) * 2).tocsr()
    off, (start, end) = cKDTree(places).query(np.array([nose, chin]))
    if off.max() > _NEAR * size:
        return None
    far = dijkstra(graph, directed=False, indices=end)
    if np.isfinite(far[start]):
        found = _slit(graph, places, start, end, size)
    else:                                       # a nose of its own, or a mouth whose inside is open at its back
        lower, upper = np.isfinite(far), np.isfinite(dijkstra(graph, directed=False, indices=start))
        rows = np.flatnonzero(lower)
        begin = rows[int(((places[rows] - nose) ** 2).sum(axis=1).argmin())]
        found = _slit(graph, places, begin, end, size) or _gap(places[upper], places[lower], size)
    if found is None:
        return None
    share = [float((one - nose) @ (chin - nose)) / size**2 for one in found]
    return found if min(share) > _WITHIN and max(share) < 1 - _WITHIN else None


def _slit(graph: sparse.csr_array, places: Array, start: int, end: int, size: float) -> tuple[Array, Array] | None:
    """Return the two places on the way from one place to another between which it runs in and out again."""
    far, before = dijkstra(graph, directed=False, indices=start, return_predecessors=True)
    way = [end]
    while way[-1] != start:
        way.append(int(before[way[-1]]))
    way = np.array(way[::-1])
    along, at = far[way], places[way]
    across = np.linalg.norm(at[:, None] - at[None], axis=2)
    gain = np.triu(along[None] - along[:, None] - _WAY * across, 1)
    gain[across > _OPEN * size] = 0.0
    i, j = np.unravel_index(int(gain.argmax()), gain.shape)
    return (at[i], at[j]) if gain[i, j] > _LEAST * size else None


def _gap(upper: Array, lower: Array, size: float) -> tuple[Array, Array] | None:
    """Return the places (3,) of two curves that are nearest to each other."""
    off, near = cKDTree(lower).query(upper)
    k = int(off.argmin())
    return (upper[k], lower[near[k]]) if off[k] < _OPEN * size else None


def cut(skin: Surface, plane: Plane, middle: Array, reach: float) -> tuple[Array, NDArray, NDArray]:
    """Return the places (p, 3) where edges cross a plane near a place, and the rows (c,) and (c,) that triangles
    join."""
    edges, of_side = skin.edges
    height = skin.vertices @ plane.normal - plane.offset
    crossed = (height[edges[:, 0]] >= 0) != (height[edges[:, 1]] >= 0)
    crossed &= ((skin.vertices[edges[:, 0]] - middle) ** 2).sum(axis=1) < reach**2
    rows = np.flatnonzero(crossed)
    a, b = edges[rows].T
    share = (height[a] / (height[a] - height[b]))[:, None]
    places = skin.vertices[a] * (1 - share) + skin.vertices[b] * share
    number = np.full(len(edges), -1)
    number[rows] = np.arange(len(rows))
    sides = number[of_side.reshape(-1, 3)]
    two = (sides >= 0).sum(axis=1) == 2
    ends = np.sort(sides[two], axis=1)[:, 1:]
    return places, ends[:, 0], ends[:, 1]

"""The point of a triangle surface that is nearest to a given one - the surface, not its nearest vertex.

Based on: C. Ericson, "Real-Time Collision Detection" (2005), section 5.1.5, for the regions of a triangle.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from facegen.geometry.operators import Surface

# So many triangles with the nearest middles are tried. Because a large triangle beside small ones may hold the nearest
# point though its middle is far, large ones are in the search with several middles.
_TRIED = 12
# So many are measured for every point; of the others only those that can still be nearer.
_FIRST = 3
# Because a triangle with a side of more than this many typical sides would be missed by its middle alone.
_LARGE = 2.0
# Labels of two places contradict each other where their product is below this. Because the edges of closed lips, a
# tenth of a millimetre apart, have labels of a quarter with opposite signs, and a cheek beside them has less.
_CONTRADICTION = -0.01
# Because a foot on a side is as near on one triangle as on the other, and rounding is not to decide: squares of
# distances count as one below this share, of the square or of a typical triangle's; cosines below that difference.
_SAME, _ALIKE = 1e-9, 1e-6
# Of triangles that are as near and face alike the one farthest along this way is taken: one along which no face is
# built, so that few are as far, and the order of a file's triangles decides nothing.
_WAY = np.array([0.7391, 0.5823, 0.3382])
_TINY = 1e-300
# Because to start threads takes longer than to look for so many points.
_MANY = 3000


@dataclass(frozen=True, eq=False)
class Feet:
    """The nearest places: ``faces`` (p,) rows, -1 where nothing was allowed; ``weights`` (p, 3) of their corners;
    ``points`` (p, 3); ``distances`` (p,), infinite where nothing was allowed."""

    faces: NDArray[np.int64]
    weights: NDArray[np.float64]
    points: NDArray[np.float64]
    distances: NDArray[np.float64]

    @property
    def found(self) -> NDArray[np.bool_]:
        """Whether there is a foot (p,)."""
        return self.faces >= 0


def means(corners: NDArray, weights: NDArray, n: int) -> sparse.csr_array:
    """Return the matrix (p, n) that makes of values on n vertices those at places, whose weights (p, 3) are of corners
    (p, 3)."""
    return sparse.csr_array((weights.ravel(), corners.ravel(), np.arange(0, 3 * len(corners) + 1, 3)),
                            shape=(len(corners), n))


def means_of_motion(weights: sparse.csr_array, motion: NDArray) -> NDArray[np.float64]:
    """Return how places (p,) move, (k, p, 3), that are `means` of vertices which move by (k, n, 3): all k at once, and
    only the vertices that count."""
    used = np.unique(weights.indices)
    own = np.moveaxis(motion[:, used], 0, 1).reshape(len(used), -1)
    return np.moveaxis((weights[:, used] @ own).reshape(weights.shape[0], len(motion), 3), 1, 0)


def contradict(some: NDArray, others: NDArray) -> NDArray[np.bool_]:
    """Return whether labels (..., k) say that two places lie on different sides of a slit."""
    return (some * others <= _CONTRADICTION).any(axis=-1)


class ClosestPoints:
    """A search over one surface: built once, asked often."""

    def __init__(self, surface: Surface) -> None:
        from scipy.spatial import cKDTree

        self.surface = surface
        corners = surface.corners
        centroids = corners.mean(axis=1)
        reach = np.sqrt(((corners - centroids[:, None]) ** 2).sum(axis=2).max(axis=1))
        large = np.flatnonzero(reach > _LARGE * np.median(reach))
        more = (corners[large] + centroids[large, None]) / 2                    # towards each corner
        self._owner = np.concatenate([np.arange(len(corners)), np.repeat(large, 3)])
        self._reach, self._typical = reach, np.median(reach) if len(reach) else 0.0
        self._triangles = _planes(corners)
        self._rank = np.empty(len(corners), np.int64)
        self._rank[np.argsort(-(centroids @ _WAY), kind="stable")] = np.arange(len(corners))
        self._tree = cKDTree(np.concatenate([centroids, more.reshape(-1, 3)]))

    def __call__(self, points: NDArray, normals: NDArray | None = None, *, least_cosine: float = 0.0,
                 labels: tuple[NDArray, NDArray] | None = None) -> Feet:
        """Return the feet of points (p, 3).

        normals (p, 3): only triangles whose normal has more than ``least_cosine`` with it are allowed (Onizuka 2018,
        section 4.2: within 90 degrees, so that the two lips are not confused). labels: numbers of the points (p, k)
        and of the triangles (m, k); a triangle is allowed where no product of two is below `_CONTRADICTION`: the
        signs say on which side of a slit a place lies.
        """
        points = np.asarray(points, float)

        def some(which: slice) -> Feet:
            return self._nearest(points[which], None if normals is None else normals[which], least_cosine,
                                 None if labels is None else (labels[0][which], labels[1]))

        if len(points) <= _MANY:
            return some(slice(None))
        half = len(points) // 2                     # NumPy and SciPy let two threads work at once
        with ThreadPoolExecutor(2) as threads:
            both = list(threads.map(some, (slice(half), slice(half, None))))
        return Feet(*(np.concatenate([getattr(feet, one.name) for feet in both]) for one in fields(Feet)))

    def _nearest(self, points: NDArray, normals: NDArray | None, least_cosine: float,
                 labels: tuple[NDArray, NDArray] | None) -> Feet:
        k, rows = min(_TRIED, len(self._owner)), np.arange(len(points))
        apart, near = self._tree.query(points, k=k)
        near, apart = self._owner[near.reshape(len(points), k)], apart.reshape(len(points), k)
        facing = np.full(near.shape, 1.0 if normals is None else -np.inf)
        v, w = np.zeros((2, len(points), k))
        square = np.full((len(points), k), np.inf)              # of the distance
        columns = np.ascontiguousarray(points.T)

        def measure(p: NDArray, j: NDArray) -> None:
            """Measure those of some triangles that are allowed."""
            triangle = near[p, j]
            allowed = np.ones(len(p), bool)
            if normals is not None:
                facing[p, j] = looks = _dots(normals.T, p, self.surface.normals.T, triangle)
                allowed &= looks > least_cosine
            if labels is not None:
                for of_point, of_triangle in zip(labels[0].T, labels[1].T, strict=True):
                    allowed &= of_point.take(p) * of_triangle.take(triangle) > _CONTRADICTION
            p, j, triangle = p[allowed], j[allowed], triangle[allowed]
            v[p, j], w[p, j], square[p, j] = _feet(self._triangles.take(triangle, axis=1), columns.take(p, axis=1))

        first = min(k, _FIRST)
        measure(np.repeat(rows, first), np.tile(np.arange(first), len(rows)))
        hopeful = apart < (1 + _SAME) * (self._reach[near] + np.sqrt(square[:, :first].min(axis=1))[:, None])
        hopeful[:, :first] = False
        measure(*np.nonzero(hopeful))
        best = self._best(near, square, facing)
        found = np.isfinite(square[rows, best])
        v, w, faces = v[rows, best], w[rows, best], near[rows, best]
        weights = np.where(found[:, None], np.stack([1 - v - w, v, w], axis=1), 0.0)
        feet = np.einsum("pc,pci->pi", weights, self.surface.corners[faces])
        distances = np.where(found, np.sqrt(((feet - points) ** 2).sum(axis=1)), np.inf)
        return Feet(np.where(found, faces, -1), weights, feet, distances)

    def _best(self, near: NDArray, square: NDArray, facing: NDArray) -> NDArray[np.int64]:
        """Return which column (p,) of the triangles (p, k) is the nearest; of those as near, the one that faces the
        point's way most; of those that do alike, the farthest along a way."""
        least = square.min(axis=1)
        as_near = square <= (least + _SAME * (least + self._typical**2))[:, None]
        facing = np.where(as_near, facing, -np.inf)
        alike = facing >= facing.max(axis=1)[:, None] - _ALIKE
        return np.where(alike, self._rank[near], len(self._rank)).argmin(axis=1)


def _dots(a: NDArray, p: NDArray, b: NDArray, q: NDArray) -> NDArray[np.float64]:
    """Return the dot products of columns p of a (3, n) with columns q of b (3, m)."""
    return sum(of_a.take(p) * of_b.take(q) for of_a, of_b in zip(a, b, strict=True))


def _planes(corners: NDArray) -> NDArray[np.float64]:
    """Return what `_feet` asks of triangles (m, 3, 3), as rows (12, m): a corner a and the sides b and c from it, then
    b.b, c.c, b.c."""
    a, b, c = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    dots = [np.einsum("mi,mi->m", p, q) for p, q in ((b, b), (c, c), (b, c))]
    return np.concatenate([a.T, b.T, c.T, dots])


def _feet(triangles: NDArray, points: NDArray) -> tuple[NDArray, NDArray, NDArray]:
    """Return the weights (q,) of the second and the third corner at the nearest place of each triangle, and the square
    of the distance. triangles (12, q): `_planes`; points (3, q): one for each."""
    b, c = triangles[3:6], triangles[6:9]
    bb, cc, bc = triangles[9:]
    x, y, z = points - triangles[:3]
    d, e = b[0] * x + b[1] * y + b[2] * z, c[0] * x + c[1] * y + c[2] * z
    det = np.maximum(bb * cc - bc**2, _TINY)
    v, w = (cc * d - bc * e) / det, (bb * e - bc * d) / det
    out = np.flatnonzero((v < 0) | (w < 0) | (v + w > 1))
    v[out], w[out] = _on_sides(*(one[out] for one in (bb, cc, bc, d, e)))
    return v, w, (x - v * b[0] - w * c[0])**2 + (y - v * b[1] - w * c[1])**2 + (z - v * b[2] - w * c[2])**2


def _on_sides(bb: NDArray, cc: NDArray, bc: NDArray, d: NDArray, e: NDArray) -> tuple[NDArray, NDArray]:
    """Return the weights (q,) of the second and the third corner at the nearest place of the three sides; d, e: the
    way from the first corner, times the sides b and c."""
    first, second = (np.clip(along / np.maximum(length, _TINY), 0, 1) for along, length in ((d, bb), (e, cc)))
    third = np.clip((e - d + bb - bc) / np.maximum(bb + cc - 2 * bc, _TINY), 0, 1)      # from the second to the third
    # Squares of distances less that of the first corner: enough to compare.
    on_first, on_second = first * (first * bb - 2 * d), second * (second * cc - 2 * e)
    rest = 1 - third
    on_third = rest * (rest * bb + 2 * third * bc - 2 * d) + third * (third * cc - 2 * e)
    v, w = np.where(on_first <= on_second, first, 0.0), np.where(on_first <= on_second, 0.0, second)
    across = on_third < np.minimum(on_first, on_second)
    return np.where(across, rest, v), np.where(across, third, w)

"""The point of a triangle surface that is nearest to a given one - the surface, not its nearest vertex.

Based on: C. Ericson, "Real-Time Collision Detection" (2005), section 5.1.5, for the regions of a triangle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

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
_TINY = 1e-300


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
        self._reach = reach
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
        k, rows = min(_TRIED, len(self._owner)), np.arange(len(points))
        apart, near = self._tree.query(points, k=k, workers=-1)
        near, apart = self._owner[near.reshape(len(points), k)], apart.reshape(len(points), k)
        allowed = np.ones(near.shape, bool)
        if normals is not None:
            allowed &= np.einsum("pi,pki->pk", normals, self.surface.normals[near]) > least_cosine
        if labels is not None:
            allowed &= (labels[0][:, None, :] * labels[1][near] > _CONTRADICTION).all(axis=2)
        weights, feet = np.zeros((len(points), k, 3)), np.zeros((len(points), k, 3))
        distance = np.full((len(points), k), np.inf)

        def measure(p: NDArray, j: NDArray) -> None:
            corners = self.surface.corners[near[p, j]]
            weights[p, j] = _barycentric_of_foot(corners, points[p])
            feet[p, j] = np.einsum("pc,pci->pi", weights[p, j], corners)
            distance[p, j] = np.sqrt(((feet[p, j] - points[p]) ** 2).sum(axis=1))

        measure(*np.nonzero(allowed & (np.arange(k) < _FIRST)))
        hopeful = apart - self._reach[near] < distance[:, :_FIRST].min(axis=1)[:, None]
        measure(*np.nonzero(allowed & (np.arange(k) >= _FIRST) & hopeful))
        best = distance.argmin(axis=1)
        found = np.isfinite(distance[rows, best])
        return Feet(np.where(found, near[rows, best], -1), weights[rows, best], feet[rows, best], distance[rows, best])


def _barycentric_of_foot(corners: NDArray, points: NDArray) -> NDArray[np.float64]:
    """Return the weights (..., 3) of the corners (..., 3, 3) of the nearest place of each triangle."""
    a, b, c = np.moveaxis(corners, -2, 0)
    ab, ac, ap = b - a, c - a, points - a

    def dot(p: NDArray, q: NDArray) -> NDArray:
        return np.einsum("...i,...i->...", p, q)

    d1, d2 = dot(ab, ap), dot(ac, ap)
    ab2, ac2, abac = dot(ab, ab), dot(ac, ac), dot(ab, ac)
    det = np.maximum(ab2 * ac2 - abac**2, _TINY)
    v, w = (ac2 * d1 - abac * d2) / det, (ab2 * d2 - abac * d1) / det
    inside = (v >= 0) & (w >= 0) & (v + w <= 1)
    # outside: the nearest place of the three sides
    bc2 = ab2 + ac2 - 2 * abac
    t_ab = np.clip(d1 / np.maximum(ab2, _TINY), 0, 1)
    t_ac = np.clip(d2 / np.maximum(ac2, _TINY), 0, 1)
    t_bc = np.clip((d2 - d1 + ab2 - abac) / np.maximum(bc2, _TINY), 0, 1)
    zero = np.zeros_like(t_ab)
    sides = np.stack([np.stack([1 - t_ab, t_ab, zero], -1), np.stack([1 - t_ac, zero, t_ac], -1),
                      np.stack([zero, 1 - t_bc, t_bc], -1)], axis=-2)
    off = np.einsum("...sc,...ci->...si", sides, corners) - points[..., None, :]
    nearest = dot(off, off).argmin(axis=-1)
    side = np.take_along_axis(sides, nearest[..., None, None], axis=-2)[..., 0, :]
    return np.where(inside[..., None], np.stack([1 - v - w, v, w], -1), side)

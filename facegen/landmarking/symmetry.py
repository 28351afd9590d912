"""The planes that a mesh is its own mirror image in, best first.

Candidates are the principal planes and planes all round; each is drawn to what its mirror image is nearest to
(iterated closest points of the reflected samples), which needs no axes: a mesh that is turned gives the same planes
turned.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

Array = NDArray[np.float64]

# So many samples are enough for a plane; more cost time only.
_SAMPLES = 1500
# Directions all round that are tried, and how many of all are followed to their end.
_DIRECTIONS, _FOLLOWED = 48, 6
_ROUNDS = 12
# The share of samples that decides: an arm or a tuft of hair may be on one side only.
_DECIDES = 0.8
# Planes nearer than this to a better one are the same.
_SAME = np.cos(np.radians(12.0))
# A plane counts if what is left over is at most so many times the best one's, and this share of the size at most.
_TIMES, _MOST = 2.5, 0.06


@dataclass(frozen=True, eq=False)
class Plane:
    """normal . x = offset; ``misfit``: how far mirrored samples lie from the mesh, as a share of its size."""

    normal: Array
    offset: float
    misfit: float

    def mirror(self, places: Array) -> Array:
        """Return places (..., 3) on the other side."""
        return places - 2 * ((places @ self.normal) - self.offset)[..., None] * self.normal


def symmetry_planes(samples: Array) -> list[Plane]:
    """Return planes of symmetry of points (s, 3) spread evenly over a surface, best first; at least one."""
    some = samples[np.unique(np.linspace(0, len(samples) - 1, _SAMPLES).astype(int))]
    middle = samples.mean(axis=0)
    size = float(np.sqrt(((samples - middle) ** 2).sum(axis=1).mean())) or 1.0
    tree = cKDTree(some)
    _values, axes = np.linalg.eigh(np.cov((samples - middle).T))
    normals = np.concatenate([axes.T, _round_about(_DIRECTIONS) @ axes.T])
    starts = sorted((follow(tree, some, Plane(normal, float(normal @ middle), np.inf), size, 1) for normal in normals),
                    key=lambda plane: plane.misfit)
    found: list[Plane] = []
    for start in _different(starts)[:_FOLLOWED]:
        found.append(follow(tree, some, start, size, _ROUNDS))
    found = _different(sorted(found, key=lambda plane: plane.misfit))
    least = max(found[0].misfit, 1e-3)
    return [plane for plane in found if plane.misfit <= min(_TIMES * least, max(_MOST, least))]


def follow(tree: cKDTree, samples: Array, plane: Plane, size: float, rounds: int, share: float = _DECIDES) -> Plane:
    """Return the plane after so many rounds of drawing it to where mirrored samples (s, 3) are nearest to the tree."""
    for _ in range(rounds):
        mirrored = plane.mirror(samples)
        apart, near = tree.query(mirrored)
        limit = np.quantile(apart, share)
        kept = apart <= limit
        plane = Plane(plane.normal, plane.offset, float(np.sqrt((apart[kept] ** 2).mean())) / size)
        if rounds == 1:
            break
        better = between(samples[kept], tree.data[near[kept]], plane.normal)
        done = abs(better.normal @ plane.normal) > 1 - 1e-12
        plane = Plane(better.normal, better.offset, plane.misfit)
        if done:
            break
    return plane


def between(places: Array, partners: Array, normal: Array) -> Plane:
    """Return the plane that takes places (k, 3) nearest to partners (k, 3) by reflection, looking the way of a normal.

    With both centred the best normal is the lowest eigenvector of X^T Y + Y^T X: |x - y - 2 (n.x) n|^2 summed is least
    there.
    """
    p, q = places.mean(axis=0), partners.mean(axis=0)
    cross = (places - p).T @ (partners - q)
    found = np.linalg.eigh(cross + cross.T)[1][:, 0]
    found = found if found @ normal >= 0 else -found
    return Plane(found, float(found @ (p + q) / 2), np.inf)


def _different(planes: list[Plane]) -> list[Plane]:
    kept: list[Plane] = []
    for plane in planes:
        if all(abs(plane.normal @ other.normal) < _SAME for other in kept):
            kept.append(plane)
    return kept


def _round_about(count: int) -> Array:
    """Return directions (count, 3) evenly over half a sphere (Fibonacci's spiral)."""
    i = np.arange(count) + 0.5
    z, turn = i / count, np.pi * (1 + 5**0.5) * i
    r = np.sqrt(1 - z**2)
    return np.stack([r * np.cos(turn), r * np.sin(turn), z], axis=1)

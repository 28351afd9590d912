"""How much of the view from a place the skin blocks: what lies behind lids and lips is seen from almost nowhere.

A winding number would tell inside from outside too, but not for teeth in a mouth that is lined: they lie outside the
surface, in its deepest fold. So we look: along each direction, is there skin farther out?
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_FRONT = [(0, 0, 1), (1, 0, 1), (-1, 0, 1), (0, 1, 1), (0, -1, 1)]
_ROUND = [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0)]
# Nothing is asked of what lies behind: a face may be an open mask.
_DIRECTIONS = np.array([np.array(d) / np.linalg.norm(d) for d in (*_FRONT, *_ROUND)])
# Samples lie this much closer than the cells of the maps, so that no cell of a closed surface stays empty.
_CLOSER = 1.5
# Because a triangle the size of a head needs no finer samples than this many on a side.
_MOST_STEPS = 48
# Because skin must be this much farther out, in cells, to be in front of a place and not beside it.
_AHEAD = 0.5


def sample_surface(corners: Array, spacing: float) -> Array:
    """Return points (s, 3) on triangles (m, 3, 3), nowhere farther apart than about ``spacing``."""
    sides = corners - np.roll(corners, 1, axis=1)
    steps = np.ceil(np.sqrt((sides**2).sum(axis=2).max(axis=1)) / spacing).astype(int).clip(1, _MOST_STEPS)
    found = []
    for n in np.unique(steps):
        u, v = np.meshgrid(np.arange(n), np.arange(n), indexing="ij")
        up = np.stack([u, v], -1)[u + v < n] + 1 / 3            # middles of the n^2 small triangles
        down = np.stack([u, v], -1)[u + v < n - 1] + 2 / 3
        w = np.concatenate([up, down]) / n
        weights = np.column_stack([1.0 - w.sum(axis=1), w])
        found.append(np.einsum("sc,mci->msi", weights, corners[steps == n]).reshape(-1, 3))
    return np.concatenate(found) if found else np.empty((0, 3))


def blocked_share(points: Array, samples: Array, cell: float) -> tuple[Array, Array]:
    """Return the shares (p,) of the directions in which skin blocks the view: of five to the front, and of all nine.

    points (p, 3); samples (s, 3): points of the skin, closer together than ``cell`` / 1.5.
    """
    blocked = np.zeros((len(_DIRECTIONS), len(points)), bool)
    for k, out in enumerate(_DIRECTIONS):
        across = np.linalg.svd(out[None])[2][1:]                            # (2, 3), at right angles
        x, y = across @ samples.T
        corner = np.array([x.min(), y.min()]) if len(samples) else np.zeros(2)
        i, j = ((x - corner[0]) / cell).astype(int), ((y - corner[1]) / cell).astype(int)
        size = np.array([i.max(initial=0), j.max(initial=0)]) + 1
        farthest = np.full(size[0] * size[1], -np.inf)
        np.maximum.at(farthest, i * size[1] + j, samples @ out)
        own = np.floor((points @ across.T - corner) / cell).astype(int)
        inside = (own[:, 0] >= 0) & (own[:, 0] < size[0]) & (own[:, 1] >= 0) & (own[:, 1] < size[1])
        depth = (points @ out)[inside] + _AHEAD * cell
        blocked[k, inside] = farthest[own[inside, 0] * size[1] + own[inside, 1]] > depth
    return blocked[:len(_FRONT)].mean(axis=0), blocked.mean(axis=0)


def spacing_for(cell: float) -> float:
    """Return how close samples must lie for maps of cells of this size."""
    return cell / _CLOSER

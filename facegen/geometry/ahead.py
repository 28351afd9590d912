"""What lies ahead of places along an axis: how far the farthest of the triangles over each place is before it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# Because a triangle that the axis lies in covers nothing.
_TINY = 1e-300
# Because a triangle as large as a head among fine ones must not fill the memory: it is cut into so many cells a side.
_MOST_CELLS = 64


def ahead(places: NDArray, corners: NDArray) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return how far (p,) the farthest triangle over each place is ahead of it along z, infinite without one, and
    which (p,) it is, -1 without one. places (p, 3); corners (t, 3, 3)."""
    far, which = np.full(len(places), np.inf), np.full(len(places), -1)
    if not len(corners) or not len(places):
        return far, which
    p, t = _over(places[:, :2], corners[:, :, :2])
    a, ab, ac = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    det = ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0]
    upright = np.abs(det) > _TINY
    det = np.where(upright, det, np.inf)
    d = places[p, :2] - a[t, :2]
    v = (d[:, 0] * ac[t, 1] - d[:, 1] * ac[t, 0]) / det[t]
    w = (ab[t, 0] * d[:, 1] - ab[t, 1] * d[:, 0]) / det[t]
    over = (v >= 0) & (w >= 0) & (v + w <= 1) & upright[t]
    p, t, v, w = p[over], t[over], v[over], w[over]
    depth = a[t, 2] + v * ab[t, 2] + w * ac[t, 2] - places[p, 2]
    rising = np.argsort(depth, kind="stable")       # the farthest is written last
    far[p[rising]], which[p[rising]] = depth[rising], t[rising]
    return far, which


def _over(places: NDArray, corners: NDArray) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return pairs of places (p, 2) and triangles (t, 3, 2) whose boxes they lie in, as rows of both.

    By cells as large as a triangle's mean box: a triangle stands in the list of every cell that its box touches.
    """
    # By columns (2, t): NumPy is slow along short last axes.
    a, b, c = np.moveaxis(corners, 0, 2)
    low, high = np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)
    at = np.ascontiguousarray(places.T)
    least, most = at.min(axis=1), at.max(axis=1)
    near = np.flatnonzero((high[0] >= least[0]) & (high[1] >= least[1]) & (low[0] <= most[0]) & (low[1] <= most[1]))
    if not len(near):
        return near, near
    low, high = low[:, near], high[:, near]
    start, extent = low.min(axis=1, keepdims=True), high - low
    size = max(float(extent.mean()), float(extent.max()) / _MOST_CELLS, _TINY)
    first, last, own = (np.floor((one - start) / size).astype(np.int64) for one in (low, high, at))
    rows, spans = last[1].max() + 1, last - first + 1
    count = spans[0] * spans[1]
    t = np.repeat(np.arange(len(near)), count)
    across, up = np.divmod(np.arange(len(t)) - np.repeat(np.cumsum(count) - count, count), spans[1, t])
    cell = (first[0, t] + across) * rows + first[1, t] + up
    order = np.argsort(cell, kind="stable")
    cell = cell[order]
    inside = np.flatnonzero((own[1] >= 0) & (own[1] < rows))
    key = own[0, inside] * rows + own[1, inside]
    begin = np.searchsorted(cell, key)
    count = np.searchsorted(cell, key, side="right") - begin
    p = np.repeat(inside, count)
    t = t[order[np.arange(len(p)) - np.repeat(np.cumsum(count) - count, count) + np.repeat(begin, count)]]
    x, y = at[0, p], at[1, p]
    within = (x >= low[0, t]) & (x <= high[0, t]) & (y >= low[1, t]) & (y <= high[1, t])
    return p[within], near[t[within]]

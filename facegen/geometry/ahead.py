"""What lies ahead of places along an axis: how far the farthest of the triangles over each place is before it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# Because a triangle that the axis lies in covers nothing.
_TINY = 1e-300


def ahead(places: NDArray, corners: NDArray) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return how far (p,) the farthest triangle over each place is ahead of it along z, infinite without one, and
    which (p,) it is, -1 without one. places (p, 3); corners (t, 3, 3)."""
    far, which = np.full(len(places), np.inf), np.full(len(places), -1)
    if not len(corners) or not len(places):
        return far, which
    a, ab, ac = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    det = ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0]
    upright = np.abs(det) > _TINY
    det = np.where(upright, det, np.inf)
    b, c = corners[:, 1], corners[:, 2]
    low, high = np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)    # quicker than min(axis=1)
    # Triangles in the order of their left ends: those over a place begin at most the widest one's width before it.
    order = np.argsort(low[:, 0], kind="stable")
    starts = low[order, 0]
    first = np.searchsorted(starts, places[:, 0] - (high - low)[:, 0].max())
    count = np.searchsorted(starts, places[:, 0], side="right") - first
    p = np.repeat(np.arange(len(places)), count)
    t = order[np.arange(len(p)) - np.repeat(np.cumsum(count) - count, count) + np.repeat(first, count)]
    x, y = places[p, 0], places[p, 1]
    near = (x <= high[t, 0]) & (y >= low[t, 1]) & (y <= high[t, 1]) & upright[t]
    p, t = p[near], t[near]
    d = places[p, :2] - a[t, :2]
    v = (d[:, 0] * ac[t, 1] - d[:, 1] * ac[t, 0]) / det[t]
    w = (ab[t, 0] * d[:, 1] - ab[t, 1] * d[:, 0]) / det[t]
    over = (v >= 0) & (w >= 0) & (v + w <= 1)
    p, t, v, w = p[over], t[over], v[over], w[over]
    depth = a[t, 2] + v * ab[t, 2] + w * ac[t, 2] - places[p, 2]
    rising = np.argsort(depth, kind="stable")       # the farthest is written last
    far[p[rising]], which[p[rising]] = depth[rising], t[rising]
    return far, which

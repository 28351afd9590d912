"""A smooth curve through places: the cubic spline whose first two and last two pieces are one cubic ("not a knot").

Based on: C. de Boor, "A Practical Guide to Splines" (1978), chapter IV. SciPy's CubicSpline is the same; its package
takes a sixth of a command's start to load.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def smooth_curve(knots: NDArray, places: NDArray, at: NDArray) -> NDArray[np.float64]:
    """Return the curve's places (g, d) at parameters (g,), for places (k, d) at ascending knots (k,), k >= 3."""
    step = np.diff(knots)
    rise = np.diff(places, axis=0) / step[:, None]
    slopes = _slopes(step, rise)
    piece = np.clip(np.searchsorted(knots, at, side="right") - 1, 0, len(step) - 1)
    t, h = (at - knots[piece])[:, None], step[piece][:, None]
    second = (3 * rise[piece] - 2 * slopes[piece] - slopes[piece + 1]) / h
    third = (slopes[piece] + slopes[piece + 1] - 2 * rise[piece]) / h**2
    return places[piece] + t * (slopes[piece] + t * (second + t * third))


def _slopes(step: NDArray, rise: NDArray) -> NDArray[np.float64]:
    """Return the slopes (k, d) at the knots: equal curvature on both sides of each, and ends that are no knots."""
    k = len(step) + 1
    matrix, right = np.zeros((k, k)), np.zeros((k, rise.shape[1]))
    for i in range(1, k - 1):
        before, after = step[i - 1], step[i]
        matrix[i, i - 1:i + 2] = after, 2 * (before + after), before
        right[i] = 3 * (after * rise[i - 1] + before * rise[i])
    if k == 3:                                      # one parabola
        matrix[0, :2] = matrix[2, 1:] = 1.0
        right[0], right[2] = 2 * rise[0], 2 * rise[1]
    else:
        for row, inner, (a, b), (p, q) in ((0, 1, step[:2], rise[:2]), (k - 1, k - 2, step[:-3:-1], rise[:-3:-1])):
            matrix[row, row], matrix[row, inner] = b, a + b
            right[row] = ((a + 2 * (a + b)) * b * p + a**2 * q) / (a + b)
    return np.linalg.solve(matrix, right)

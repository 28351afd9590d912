"""The least point of a bowl within a box.

    minimise 1/2 x' H x - b' x,   low <= x <= high

Based on: D. Bertsekas, "Projected Newton methods for optimization problems with simple constraints", 1982. Every step
solves for all variables that are not held by a bound, and a search along the projected way keeps the value falling.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dposv

Array = NDArray[np.float64]

# Because the bounds held settle in a few rounds, and each round is exact for them; more means rounding.
_ROUNDS = 100
# Because a change of a weight below this is rounding.
_STILL = 1e-8
_FALL = 1e-4            # Armijo's share of the promised fall
_HALVINGS = 30


def box_minimum(hessian: Array, goal: Array, low: Array, high: Array, start: Array | None = None) -> Array:
    """Return x (k,) for H (k, k), positive definite, and b (k,); ``low`` and ``high`` (k,) may be infinite.

    start: where to begin, such as the last frame's: most of what is held then is known.
    """
    x = np.minimum(np.maximum(np.zeros(len(goal)) if start is None else start, low), high)
    solved = None                       # the free variables for which x is the least point already
    for _ in range(_ROUNDS):
        slope = hessian @ x - goal
        free = ~(((x <= low) & (slope >= 0.0)) | ((x >= high) & (slope <= 0.0)))
        if solved is not None and not (free & ~solved).any():
            return x
        rows = np.flatnonzero(free)
        if not len(rows):
            return x
        way = np.zeros(len(x))
        way[rows] = -_solve(hessian[rows].take(rows, axis=1), slope[rows])
        there = x + way
        step = np.minimum(np.maximum(there, low), high) - x
        solved = free if (x + step == there).all() else None
        if np.abs(step).max() <= _STILL:
            return x
        length = 1.0
        for _ in range(_HALVINGS):
            promised = float(slope @ step)
            if promised + 0.5 * float(step @ (hessian @ step)) <= _FALL * promised:
                break
            length, solved = length * 0.5, None
            step = np.minimum(np.maximum(x + length * way, low), high) - x
        x = x + step
    return x


def _solve(matrix: Array, right: Array) -> Array:
    """Return the solution for a positive definite matrix; for one that rounding has made none, the least squares'."""
    _, found, failed = dposv(matrix, right, lower=1)
    return np.linalg.lstsq(matrix, right, rcond=None)[0] if failed else found

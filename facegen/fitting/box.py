"""The least point of a bowl within a box.

    minimise 1/2 x' H x - b' x,   low <= x <= high

Based on: D. Bertsekas, "Projected Newton methods for optimization problems with simple constraints", 1982. Every step
solves for all variables that are not held by a bound, and is cut off at the box; where that would not fall, it ends at
the first bound on its way.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dposv, dpotrf, dtrtrs
from scipy.optimize import nnls

Array = NDArray[np.float64]

# Because the bounds held settle in a few rounds, and each round is exact for them; more means rounding.
_ROUNDS = 100
# Because a change of a weight below this is rounding.
_STILL = 1e-8
_FALL = 1e-4            # Armijo's share of the promised fall


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
        there = np.minimum(np.maximum(x + way, low), high)
        solved = free if (there == x + way).all() else None
        step = there - x
        promised = float(slope @ step)
        if promised + 0.5 * float(step @ (hessian @ step)) > _FALL * promised or np.abs(step).max() <= _STILL:
            if np.abs(way).max() <= _STILL:
                return there
            there, solved = _inside(hessian, slope, x, low, high, free), None
            if np.abs(there - x).max() <= _STILL:
                return there
        x = there
    return x


def bowl_minimum(hessian: Array, goal: Array, low: Array, high: Array, loose: int) -> Array:
    """Return the same where the first ``loose`` variables have no bounds and all others a lower one.

    Upper bounds are seldom met: without them it is a problem of non-negative numbers, for which SciPy has compiled
    code (C. Lawson, R. Hanson, "Solving least squares problems", 1974); where they are met, it is `box_minimum`.
    """
    across = hessian[:loose, loose:]
    _, solved, failed = dposv(hessian[:loose, :loose], np.column_stack([across, goal[:loose]]), lower=1)
    floor = low[loose:]
    reduced = hessian[loose:, loose:] - across.T @ solved[:, :-1]
    right = goal[loose:] - across.T @ solved[:, -1] - reduced @ floor
    root, wrong = dpotrf(reduced, lower=0)
    if not failed and not wrong:
        try:
            found = floor + nnls(np.triu(root), dtrtrs(root, right, lower=0, trans=1)[0])[0]
        except RuntimeError:            # too many rounds
            found = np.full(len(floor), np.inf)
        if (found <= high[loose:]).all():
            return np.concatenate([solved[:, -1] - solved[:, :-1] @ found, found])
    return box_minimum(hessian, goal, low, high)


def _inside(hessian: Array, slope: Array, x: Array, low: Array, high: Array, free: NDArray[np.bool_]) -> Array:
    """Return where the straight way to the least point of the free variables meets the first bound: always lower.
    Those that would leave the box at once stay."""
    free, way = free.copy(), np.zeros(len(x))
    while free.any():
        rows = np.flatnonzero(free)
        way[:] = 0.0
        way[rows] = -_solve(hessian[rows].take(rows, axis=1), slope[rows])
        out = free & (((x <= low) & (way < 0.0)) | ((x >= high) & (way > 0.0)))
        if not out.any():
            break
        free &= ~out
    bound = np.where(way > 0.0, high, low)
    room = np.full(len(x), np.inf)
    np.divide(bound - x, way, out=room, where=way != 0.0)
    first = int(room.argmin())
    there = np.minimum(np.maximum(x + min(1.0, float(room[first])) * way, low), high)
    if room[first] <= 1.0:
        there[first] = bound[first]
    return there


def _solve(matrix: Array, right: Array) -> Array:
    """Return the solution for a positive definite matrix; for one that rounding has made none, the least squares'."""
    _, found, failed = dposv(matrix, right, lower=1)
    return np.linalg.lstsq(matrix, right, rcond=None)[0] if failed else found

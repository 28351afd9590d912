"""Few weights that make a movement out of given ones: bounded least squares that do not pull against themselves.

    minimise |t - sum_i w_i s_i|^2 + (m sum_i w_i |s_i|)^2,   0 <= w_i <= u_i

The second term is for choosing only: without it a mouth would be pulled left and right at once for a tenth of a
millimetre. The chosen shapes are then fitted without it, and what hardly helps is taken out, the least first.

Based on: C. Lawson, R. Hanson, "Solving least squares problems", 1974 (non-negative), and P. Stark, R. Parker,
"Bounded-variable least squares", 1995, both as SciPy has them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

ENOUGH = 5e-3
"""A shape that takes less than this share of the movement's square off the residual's is left out."""

ALONE = 0.02
"""A single shape that leaves less than this share of the movement (not squared) is taken by itself."""

# m: because a fifth of all movement made is a fair price for saying it in few shapes.
_TAX = 0.2
# Because a weight below this is not seen, whatever the shape.
_FAINT = 2e-3


class Fit:
    """Fits movements by k shapes (k, d); prepared once, since d is much larger than k."""

    def __init__(self, shapes: NDArray[np.float64]) -> None:
        self.shapes = shapes
        self._directions, self._parts = np.linalg.qr(shapes.T)      # (d, r), (r, k)
        self._taxed = np.vstack([self._parts, _TAX * np.linalg.norm(self._parts, axis=0)])

    def weights(self, target: NDArray[np.float64], upper: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return weights (k,) in 0..upper (k,) for a movement (d,); the same input gives the same bits."""
        whole = float(target @ target)
        weights = np.zeros(len(self.shapes))
        free = np.flatnonzero((upper > _FAINT) & (np.abs(self._parts).max(axis=0, initial=0.0) > 0.0))
        if whole <= 0.0 or not len(free):
            return weights
        goal = self._directions.T @ target
        beyond = max(whole - float(goal @ goal), 0.0)               # what no shape reaches
        alone = self._alone(goal, whole, beyond, upper, free)
        if alone is not None:
            weights[alone[0]] = alone[1]
            return weights
        taxed = _bounded(self._taxed[:, free], np.append(goal, 0.0), upper[free])
        free = free[taxed > _FAINT]
        found, left = self._solved(goal, upper, free)
        while True:
            keep = free[found > _FAINT]
            if len(keep) < len(free):
                free = keep
                found, left = self._solved(goal, upper, free)
                continue
            order = np.argsort(found * np.linalg.norm(self._parts[:, free], axis=0), kind="stable")
            for k in order:
                fewer = np.delete(free, k)
                again, worse = self._solved(goal, upper, fewer)
                if worse - left <= ENOUGH * whole:
                    free, found, left = fewer, again, worse
                    break
            else:
                weights[free] = found
                return weights

    def _alone(self, goal: NDArray, whole: float, beyond: float, upper: NDArray, free: NDArray
               ) -> tuple[int, float] | None:
        """Return the first shape that does it by itself, and its weight."""
        parts = self._parts[:, free]
        size = (parts**2).sum(axis=0)
        weight = np.clip(goal @ parts / np.maximum(size, 1e-300), 0.0, upper[free])
        left = beyond + ((goal[:, None] - parts * weight) ** 2).sum(axis=0)
        best = int(left.argmin())
        return (int(free[best]), float(weight[best])) if left[best] <= ALONE**2 * whole else None

    def _solved(self, goal: NDArray, upper: NDArray, free: NDArray) -> tuple[NDArray[np.float64], float]:
        """Return the weights of the free shapes and the square of what is left of the goal."""
        if not len(free):
            return np.empty(0), float(goal @ goal)
        parts = self._parts[:, free]
        found = _bounded(parts, goal, upper[free])
        rest = goal - parts @ found
        return found, float(rest @ rest)


def _bounded(parts: NDArray[np.float64], goal: NDArray[np.float64], upper: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the least-squares weights (k,) in 0..upper (k,) of parts (r, k)."""
    from scipy.optimize import lsq_linear, nnls  # here: most commands fit nothing, and it takes a fifth of a second

    found = nnls(parts, goal)[0]
    if (found > upper).any():
        found = np.clip(lsq_linear(parts, goal, (0.0, upper), method="bvls").x, 0.0, upper)
    return found

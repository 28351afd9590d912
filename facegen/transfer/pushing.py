"""What lids and lips share when they are kept before what lies behind them: pushes that leave no dent."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from facegen.geometry.operators import Surface

Array = NDArray[np.float64]

ROUNDS = 4
"""So many rounds of pushes make sure."""
DONE = 1e-5
"""Because this share of an eye or a face is nothing."""

# So many rings of neighbours share a push.
_RINGS = 3


@dataclass(frozen=True, eq=False)
class Contact:
    """How deep something is through the skin at most, in each shape (k,), mm, beyond what is allowed and what it is at
    rest."""

    before: Array
    after: Array


def moving(motion: Array, rows: NDArray, size: float) -> NDArray[np.bool_]:
    """Return in which shapes (k,) any of the vertices moves by more than nothing of something of a size, mm."""
    return np.abs(motion[:, rows]).max(axis=(1, 2), initial=0.0) > DONE * size


class Spread:
    """Spreads pushes over the skin: at least the push itself, and less and less of it round it."""

    def __init__(self, skin: Surface) -> None:
        join = skin.neighbours
        degree = np.maximum(np.asarray(join.sum(axis=1)).reshape(-1), 1.0)
        self._mean = sparse.csr_array(join / degree[:, None])

    def __call__(self, push: Array) -> Array:
        """Return pushes (n,) that are as large or larger, and smoother."""
        for _ in range(_RINGS):
            push = np.maximum(push, self._mean @ push)
        return push

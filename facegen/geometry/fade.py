"""How an influence fades in and out without a kink."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray


def smooth_step(t: ArrayLike) -> NDArray[np.float64]:
    """Return 0 where t is 0 or less, 1 where it is 1 or more, and between them 3 t^2 - 2 t^3, level at both ends."""
    t = np.clip(t, 0.0, 1.0)
    return t * t * (3.0 - 2.0 * t)

"""Colours as screens take them (sRGB, 0..255) and as light adds up (linear, 0..1): IEC 61966-2-1."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray


def to_linear(colours: ArrayLike) -> NDArray[np.float64]:
    """Return linear 0..1 of sRGB 0..255, any shape."""
    c = np.clip(np.asarray(colours, dtype=np.float64) / 255.0, 0.0, 1.0)
    return np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)


def to_srgb(light: ArrayLike) -> NDArray[np.float64]:
    """Return sRGB 0..255 of linear 0..1, any shape."""
    c = np.clip(np.asarray(light, dtype=np.float64), 0.0, 1.0)
    return 255.0 * np.where(c <= 0.0031308, c * 12.92, 1.055 * c ** (1 / 2.4) - 0.055)

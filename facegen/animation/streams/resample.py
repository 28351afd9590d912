"""A performance at even steps of time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from facegen.animation.performance import Performance
from facegen.errors import InputError

Array = NDArray[np.float64]

MOST_FRAMES = 10_000_000
"""Because more is no recording but a mistake in its times or in the rate."""

# Across a gap longer than this, in seconds, nothing is made up: there is no frame with a face.
_LONGEST_GAP = 0.25


def resampled(one: Performance, fps: float) -> Performance:
    """Return a performance with fps frames a second from its first time on, straight between the recorded ones.

    Where either neighbour is missing, or the two lie far apart, there is nothing; a frame at the very time of a
    recorded one is that one. ``extra`` is dropped: texts have no middle. InputError for a rate outside 0.01..100000.
    """
    if isinstance(fps, bool) or not isinstance(fps, (int, float)) or not 0.01 <= fps <= 100_000.0:
        raise InputError(f"resample: expected frames a second, 0.01..100000, got {fps!r}")
    if one.duration * fps > MOST_FRAMES:
        raise InputError(f"resample: {one.duration:g} s at {fps:g} frames a second: more than {MOST_FRAMES:,} frames")
    times = one.times[0] + np.arange(int(np.floor(one.duration * fps * (1.0 + 1e-12) + 1e-9)) + 1) / fps
    parts = {name: _between(one.times, values, times) for name in ("weights", "head", "place", "gaze")
             if (values := getattr(one, name)) is not None}
    return replace(one, times=times, **parts, extra={})


def _between(times: Array, values: Array, at: Array) -> Array:
    """Return values (m, k) at times (m,) of values (n, k) at times (n,)."""
    if len(times) == 1:
        return np.repeat(values, len(at), axis=0)
    k = np.clip(np.searchsorted(times, at, side="right") - 1, 0, len(times) - 2)
    step = times[k + 1] - times[k]
    share = np.clip((at - times[k]) / step, 0.0, 1.0)[:, None]
    middle = values[k] + share * (values[k + 1] - values[k])
    middle[(step > _LONGEST_GAP) & (share[:, 0] > 0.0) & (share[:, 0] < 1.0)] = np.nan
    near = 1e-9
    return np.where(share < near, values[k], np.where(share > 1.0 - near, values[k + 1], middle))

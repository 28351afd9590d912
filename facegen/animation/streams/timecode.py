"""Timecodes HH:MM:SS:FF.sub: frames and parts of frames within the second."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

_CODE = re.compile(r"\s*(\d{1,3})[:;](\d{1,2})[:;](\d{1,2})[:;](\d{1,4})(?:\.(\d+))?\s*", re.ASCII)
_RATES = (24.0, 25.0, 30.0, 48.0, 50.0, 60.0, 90.0, 100.0, 120.0, 240.0)
USUAL = 60.0
"""Frames a second that Live Link Face counts in, unless it was told otherwise."""

_DAY = 86400.0


def parsed(codes: Sequence[str]) -> NDArray[np.float64]:
    """Return seconds and frames (n, 2) of timecodes; NaN for what is none."""
    rows = []
    for code in codes:
        found = _CODE.fullmatch(code)
        if found is None:
            rows.append((np.nan, np.nan))
            continue
        hours, minutes, whole, frames, part = found.groups()
        rows.append((3600.0 * int(hours) + 60.0 * int(minutes) + int(whole), float(f"{frames}.{part or 0}")))
    return np.array(rows, dtype=float).reshape(-1, 2)


def rate_of(parts: NDArray[np.float64]) -> tuple[float, bool]:
    """Return the frames a second that timecodes (n, 2) count in, and whether they show it.

    They show it where a second was counted through to its end: the frame before the next second is the last.
    """
    there = parts[np.isfinite(parts).all(axis=1)]
    if not len(there):
        return USUAL, False
    highest = np.floor(there[:, 1].max())
    turns = np.flatnonzero(np.diff(there[:, 0]) == 1.0)
    fits = [rate for rate in _RATES if rate > highest]
    step = float(np.median(np.diff(there[:, 1])[np.diff(there[:, 0]) == 0.0])) if len(there) > 2 and (
        np.diff(there[:, 0]) == 0.0).any() else 1.0
    for k in turns:
        # What was counted when the second turned: last + step - first of the next.
        around = there[k, 1] + step - there[k + 1, 1]
        near = min(fits, key=lambda rate: abs(rate - around), default=0.0)
        if near and abs(near - around) < 0.5 * max(step, 1.0):
            return near, True
    return (USUAL if highest < USUAL else float(min(fits, default=highest + 1.0))), highest >= 30.0


def seconds_of(parts: NDArray[np.float64], rate: float) -> NDArray[np.float64]:
    """Return the seconds (n,) of timecodes, from the first; midnight is passed, not gone back over."""
    times = parts[:, 0] + parts[:, 1] / rate
    there = np.flatnonzero(np.isfinite(times))
    if len(there):
        days = np.cumsum(np.diff(times[there], prepend=times[there[0]]) < -_DAY / 2)
        times[there] += _DAY * days
        times -= times[there[0]]
    return times


def timecodes(times: NDArray[np.float64], rate: float) -> list[str]:
    """Return the timecodes of seconds (n,), with three digits of the frame's parts."""
    codes = []
    for time in times.tolist():
        thousandths = round(time * rate * 1000.0)
        frames, part = divmod(thousandths, 1000)
        whole, frame = divmod(frames, round(rate))
        codes.append(f"{whole // 3600:02d}:{whole // 60 % 60:02d}:{whole % 60:02d}:{frame:02d}.{part:03d}")
    return codes

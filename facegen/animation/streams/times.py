"""Times of recorded frames: put in order, gaps told."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from facegen.errors import FileError, InputError

# A step this much longer than the middle one is a gap: one frame left out and a little more than jitter.
_GAP = 1.75
_TOLD = 3


def check_fps(fps: float | None) -> float | None:
    """Return frames a second, or None; InputError for what is no such number."""
    if fps is None:
        return None
    try:
        value = float(fps)
    except (TypeError, ValueError):
        value = np.nan
    if not 0.01 <= value <= 100_000.0:
        raise InputError(f"fps: expected frames a second, 0.01..100000, got {fps!r}")
    return value


def counted(frames: NDArray[np.float64] | None, count: int, fps: float) -> NDArray[np.float64]:
    """Return the seconds (count,) of frames by their numbers, from the first; one after the other without numbers."""
    if frames is None or not np.isfinite(frames).any():
        return np.arange(count) / fps
    return (frames - np.nanmin(frames)) / fps


def in_order(path: Path, times: NDArray[np.float64], lines: NDArray[np.int64]) -> tuple[NDArray[np.intp], list[str]]:
    """Return which rows are frames, in the order of time, and what was odd.

    Rows without a time are left out, rows that come too early are sorted in, of rows of one time the first counts.
    FileError if no row has a time.
    """
    warnings = []
    rows = np.flatnonzero(np.isfinite(times))
    if not len(rows):
        raise FileError(f"{path}: no row has a time")
    if lost := np.setdiff1d(np.arange(len(times)), rows).tolist():
        warnings.append(f"{places(lines[lost])}: no time; left out")
    early = rows[1:][np.diff(times[rows]) < 0]
    if len(early):
        warnings.append(f"{places(lines[early])}: earlier than the line before; put in the order of time")
        rows = rows[np.argsort(times[rows], kind="stable")]
    again = np.flatnonzero(np.diff(times[rows]) == 0) + 1
    if len(again):
        warnings.append(f"{places(lines[rows[again]])}: the time of another line; left out")
        rows = np.delete(rows, again)
    steps = np.diff(times[rows])
    gaps = np.flatnonzero(steps > _GAP * np.median(steps)) if len(steps) > 1 else []
    if len(gaps):
        said = [f"{steps[k]:.3g} s after line {lines[rows[k]]} (at {times[rows[k]] - times[rows[0]]:.3f} s)"
                for k in gaps[:_TOLD]]
        more = f" and {len(gaps) - _TOLD} more" if len(gaps) > _TOLD else ""
        warnings.append(f"gap{'s' if len(gaps) > 1 else ''} of {', '.join(said)}{more}: no frames there")
    return rows, warnings


def places(lines: Sequence[int] | NDArray[np.int64]) -> str:
    """Return line numbers in words: the first few, and how many more."""
    more = f" and {len(lines) - _TOLD} more" if len(lines) > _TOLD else ""
    return f"line{'s' if len(lines) > 1 else ''} {', '.join(str(int(line)) for line in lines[:_TOLD])}{more}"

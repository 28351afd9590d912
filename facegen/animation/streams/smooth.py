"""Smoothing as it happens: the One Euro filter, for steps of any length and frames that are missing.

    x_k = x_{k-1} + a (z_k - x_{k-1}),   a = 1 / (1 + 1 / (2 pi f dt)),   f = min + beta |dx/dt|

slow movement is smoothed much (no jitter), fast movement little (no lag).

Based on: G. Casiez, N. Roussel, D. Vogel, "1 euro filter: a simple speed-based low-pass filter for noisy input in
interactive systems", CHI 2012.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from facegen.animation.performance import Performance
from facegen.errors import InputError

Array = NDArray[np.float64]

# After a gap longer than this, in seconds, what was before says nothing of what is now: the filter starts anew.
_FORGOTTEN = 0.5
# Angles and millimetres are this many times what weights are: the speed term is made for weights a second.
PER_WEIGHT = {"weights": 1.0, "head": 30.0, "place": 100.0, "gaze": 25.0}


@dataclass(frozen=True)
class OneEuro:
    """``cutoff``: Hz of a still face: lower is calmer. ``beta``: Hz more for a weight of 1 a second: higher lags less.

    ``speed``: Hz at which the speed itself is smoothed. The defaults take most of a tracker's jitter off and leave a
    blink whole.
    """

    cutoff: float = 1.5
    beta: float = 2.0
    speed: float = 1.0

    def __post_init__(self) -> None:
        for name, low in (("cutoff", 1e-3), ("beta", 0.0), ("speed", 1e-3)):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, (int, float)) or not low <= value <= 1e4:
                raise InputError(f"smooth: {name}: expected a number in {low:g}..10000, got {value!r}")

    @classmethod
    def of(cls, value: OneEuro | str | bool | None) -> OneEuro | None:
        """Return a filter as an option says it: nothing, True for the defaults, a text, or a filter."""
        if value is None or value is False:
            return None
        if value is True:
            return cls()
        if isinstance(value, str):
            return parse_smooth(value)
        if not isinstance(value, cls):
            raise InputError(f"smooth: expected CUTOFF or CUTOFF,BETA, got {type(value).__name__}")
        return value


def parse_smooth(text: str) -> OneEuro:
    """Return the filter of a text: "on", CUTOFF, or CUTOFF,BETA. InputError."""
    if text.strip().casefold() in ("on", "yes", "true"):
        return OneEuro()
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if not 1 <= len(numbers) <= 2:
        raise InputError(f"smooth: expected on, CUTOFF or CUTOFF,BETA in Hz, such as 1.5,2, got {text!r}")
    return OneEuro(*numbers)


def smoothed(one: Performance, euro: OneEuro | None = None) -> Performance:
    """Return a performance whose weights, head, place and gaze are filtered. Missing numbers stay missing."""
    euro = euro or OneEuro()
    parts = {name: one_euro(one.times, values, euro, scale) for name, scale in PER_WEIGHT.items()
             if (values := getattr(one, name)) is not None}
    return replace(one, **parts, about={**one.about, "smooth": f"{euro.cutoff:g},{euro.beta:g}"})


def one_euro(times: Array, values: Array, euro: OneEuro, scale: float = 1.0) -> Array:
    """Return values (n, k) at times (n,) filtered, each column by itself. scale: what counts as a weight of 1."""
    result = np.array(values, dtype=float)
    state = Filter(euro, scale)
    for k, time in enumerate(times.tolist()):
        result[k] = state.push(time, result[k])
    return result


class Filter:
    """One Euro filters for k numbers that come one frame after the other."""

    def __init__(self, euro: OneEuro, scale: float = 1.0) -> None:
        self._euro, self._scale = euro, scale
        self._last: Array | None = None                 # what came out last
        self._speed = self._when = np.empty(0)

    def push(self, time: float, values: Array) -> Array:
        """Return the filtered numbers (k,) of a frame; NaN where there are none."""
        values = np.asarray(values, dtype=float)
        if self._last is None:
            self._last = np.full(values.shape, np.nan)
            self._speed, self._when = np.zeros(values.shape), np.full(values.shape, -np.inf)
        step = time - self._when
        there = np.isfinite(values)
        fresh = there & ((step > _FORGOTTEN) | np.isnan(self._last))
        going = there & ~fresh & (step > 0.0)
        safe = np.where(going, step, 1.0)
        last = np.where(going, self._last, 0.0)
        now = np.where(there, values, 0.0)
        speed = self._speed + _share(self._euro.speed, safe) * ((now - last) / safe - self._speed)
        cutoff = self._euro.cutoff + self._euro.beta * np.abs(speed) / self._scale
        moved = last + _share(cutoff, safe) * (now - last)
        self._speed = np.where(going, speed, np.where(fresh, 0.0, self._speed))
        self._last = np.where(going, moved, np.where(fresh, now, self._last))
        self._when = np.where(there, time, self._when)
        return np.where(there, self._last, np.nan)


def _share(cutoff: Array | float, step: Array) -> Array:
    """Return how much of the new a low pass of a cutoff in Hz takes after a step of seconds."""
    return 1.0 / (1.0 + 1.0 / (2.0 * np.pi * cutoff * step))

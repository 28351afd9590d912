"""What a face does when nothing happens: blinks, small eye movements, a head that is never quite still.

Every stream of events is drawn one after the other from a generator of its own, so the same seed gives the same
movements whatever the rate, the length of a clip, or which parts are switched on. Numbers: ``tables/timing.yaml``.
"""

from __future__ import annotations

import bisect
import math
import numbers
from dataclasses import dataclass
from functools import cache
from threading import Lock

import numpy as np

from facegen.animation.angles import turned
from facegen.animation.easing import eased, min_jerk
from facegen.animation.timing import load_timing
from facegen.errors import InputError

_LOCK = Lock()      # streams grow while they are read, perhaps by several threads
_BLINKS, _GAZE, _HEAD = range(3)


@dataclass(frozen=True)
class Idle:
    """The idle layer of a seed, a whole number from 0 on.

    blink, gaze, head: which parts there are. glances: whether the eyes leave what they look at; off where a script
    moves them itself.
    """

    seed: int
    blink: bool = True
    gaze: bool = True
    head: bool = True
    glances: bool = True

    def __post_init__(self) -> None:
        if isinstance(self.seed, bool) or not isinstance(self.seed, numbers.Integral) or not 0 <= self.seed < 2**63:
            raise InputError(f"idle: expected a seed, a whole number from 0 on, got {self.seed!r}")

    def at(self, t: float) -> dict[str, float]:
        """Return atom -> weight at a time in seconds."""
        atoms: dict[str, float] = {}
        if self.blink and (closed := _blinks(self.seed).at(t)):
            atoms |= {"L45": closed, "R45": closed}
        if self.gaze:
            yaw, pitch = _gaze(self.seed, self.glances).at(t)
            atoms |= turned("eyes", {"yaw": yaw, "pitch": pitch})
        if self.head:
            atoms |= turned("head", dict(zip(("yaw", "pitch", "roll"), _head(self.seed).at(t), strict=True)))
        return atoms


class _Blinks:
    """Blinks after each other: intervals log-normal, some partial, some double."""

    def __init__(self, seed: int) -> None:
        self.rng = np.random.default_rng([seed, _BLINKS])
        self.numbers = load_timing().blink
        self.shape = load_timing().kinds["blink"]
        spread = math.log1p((self.numbers["deviation"] / self.numbers["mean"]) ** 2)
        self.location, self.scale = math.log(self.numbers["mean"]) - spread / 2, math.sqrt(spread)
        self.starts: list[float] = []
        self.heights: list[float] = []
        # A clip does not begin just after a blink.
        self.free = -float(self.rng.uniform(0.0, self.numbers["mean"] / 2))

    def at(self, t: float) -> float:
        """Return how far the lids are closed, 0..1."""
        with _LOCK:
            while self.free <= t:
                self._grow()
        k = bisect.bisect_right(self.starts, t) - 1
        return self.heights[k] * self._closed(t - self.starts[k], self.heights[k]) if k >= 0 else 0.0

    def _grow(self) -> None:
        """Append one blink, or two."""
        n = self.numbers
        start = self.free + float(self.rng.lognormal(self.location, self.scale))
        complete, height, double, gap = self.rng.random(4).tolist()
        height = 1.0 if complete < n["complete"] else _within(n["partial"], height)
        self._append(max(start, 0.0), height)
        if double < n["double"]:
            self._append(self.free + _within(n["double_gap"], gap), 1.0)

    def _append(self, start: float, height: float) -> None:
        self.heights.append(height)
        self.starts.append(start)       # last: who reads meanwhile looks here first
        self.free = start + self._pace(height) * (self.shape.onset + self.shape.apex + self.shape.offset)

    @staticmethod
    def _pace(height: float) -> float:
        """Return the time a blink takes, against a whole one: smaller movements are shorter, though not in
        proportion."""
        return 0.5 + 0.5 * height

    def _closed(self, since: float, height: float) -> float:
        shape = self.shape
        since /= self._pace(height)
        if since < shape.onset:
            return eased(shape.onset_ease, since / shape.onset)
        rest = since - shape.onset - shape.apex
        return 1.0 if rest <= 0.0 else 1.0 - eased(shape.offset_ease, rest / shape.offset)


class _Gaze:
    """Fixations and the saccades between them, on the main sequence: their duration grows with their size."""

    def __init__(self, seed: int, glances: bool) -> None:
        self.rng = np.random.default_rng([seed, _GAZE])
        self.numbers, self.glances = load_timing().gaze, glances
        self.starts = [0.0]
        self.moves = [(0.0, (0.0, 0.0), (0.0, 0.0))]       # duration, from, to
        self.free = 0.0                                     # when the last drawn fixation ends
        self.away_at = _within(self.numbers["look"], self.rng.random())

    def at(self, t: float) -> tuple[float, float]:
        """Return yaw and pitch in degrees."""
        with _LOCK:
            while self.free <= t:
                self._grow()
        k = bisect.bisect_right(self.starts, t) - 1
        duration, here, there = self.moves[k]
        done = min_jerk(min(1.0, (t - self.starts[k]) / duration)) if duration else 1.0
        return tuple(a + done * (b - a) for a, b in zip(here, there, strict=True))

    def _grow(self) -> None:
        """Append one saccade and the fixation after it."""
        n = self.numbers
        across, up, hold, size, angle, look = self.rng.random(6).tolist()
        if self.free >= self.away_at:
            distance, angle = _within(n["glance"], size), 2 * math.pi * angle
            target = (distance * math.cos(angle), 0.6 * distance * math.sin(angle))     # eyes move sideways more
            stay = _within(n["away"], hold)
            self.away_at = self.free + stay + _within(n["look"], look)
        else:
            target = (n["near"] * _bell(across), n["near"] * _bell(up))
            stay = _within(n["hold"], hold)
        if not self.glances:
            target = tuple(min(max(angle, -2.0), 2.0) for angle in target)
        here = self.moves[-1][2]
        duration = n["delay"] + n["per_degree"] * math.dist(here, target)
        self.moves.append((duration, here, target))
        self.starts.append(self.free)       # last: who reads meanwhile looks here first
        self.free += duration + stay


class _Head:
    """A slow wander: a few sines of unrelated rates about each axis, and the breath."""

    RATES = ((0.05, 0.09), (0.12, 0.19), (0.23, 0.37))      # turns a second
    SHARES = (0.5, 0.32, 0.18)

    def __init__(self, seed: int) -> None:
        rng = np.random.default_rng([seed, _HEAD])
        self.numbers = load_timing().head
        self.waves = [[(2 * math.pi * _within(pace, rng.random()), 2 * math.pi * float(rng.random()), share)
                       for pace, share in zip(self.RATES, self.SHARES, strict=True)] for _ in range(3)]
        self.breath = 2 * math.pi * float(rng.random())

    def at(self, t: float) -> tuple[float, float, float]:
        """Return yaw, pitch and roll in degrees."""
        n = self.numbers
        yaw, pitch, roll = (n["sway"] * math.fsum(share * math.sin(rate * t + phase) for rate, phase, share in waves)
                            for waves in self.waves)
        return yaw, pitch + n["breath"] * math.sin(2 * math.pi * n["breaths"] * t + self.breath), roll


_blinks, _gaze, _head = cache(_Blinks), cache(_Gaze), cache(_Head)


def _within(pair: tuple[float, float], share: float) -> float:
    return float(pair[0] + share * (pair[1] - pair[0]))


def _bell(share: float) -> float:
    """Return a number of the logistic bell of deviation 1 (its inverse distribution), at most 2.5 from 0."""
    share = min(max(share, 1e-6), 1 - 1e-6)
    return min(max(math.log(share / (1 - share)) * math.sqrt(3) / math.pi, -2.5), 2.5)

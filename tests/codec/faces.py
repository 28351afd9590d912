"""Performances that the tests of streams share."""

from __future__ import annotations

import numpy as np

from facegen.animation.clip import Clip
from facegen.animation.idle import Idle
from facegen.animation.performance import Performance
from facegen.codec.sampled import clip_performance

NAMES = ("1", "4", "L12", "R12", "26", "L45", "R45")


def lively(frames: int = 100, seed: int = 0, *, lost: bool = False) -> Performance:
    """Return seven units, head and gaze in smooth random motion at 25 frames a second, with blinks."""
    dice = np.random.default_rng(seed)
    t = np.arange(frames) / 25
    phase, pace = dice.uniform(0, 6.3, 14), dice.uniform(0.5, 9, 14)
    waves = np.sin(pace * t[:, None] + phase)
    weights = np.clip(waves[:, :7] * 0.6, 0, 1)
    weights[:, 5] = weights[:, 6] = (np.arange(frames) % 60 // 3 == 5) * 1.0
    if lost:
        weights[30:41] = np.nan
        weights[60, 2] = np.nan
    return Performance(t, NAMES, weights, "units", head=15 * waves[:, 7:10], gaze=12 * waves[:, 10:])


def idle(seconds: float = 4.0) -> Performance:
    """Return a face at rest."""
    return clip_performance(Clip((), seconds, Idle(1)))

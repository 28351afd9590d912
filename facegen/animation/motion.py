"""What a film shows: anything that moves a face in time."""

from __future__ import annotations

import numbers
from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from facegen.blendshapes.recipes import Recipe
from facegen.errors import InputError
from facegen.face.avatar import AvatarFace
from facegen.face.rig import Rig

LOWEST_FPS, HIGHEST_FPS = 0.1, 1000.0
MOST_FRAMES = 99_999
"""Frames of one film: an hour at 25 a second, and what five digits number."""


class Shown(Protocol):
    """What every worker knows of a motion; small, and pickled. It decides, with the cue, what a frame shows."""

    def on(self, rig: Rig, *, detail: int = 2) -> Callable[[Any], NDArray[np.float64]]:
        """Return what makes the vertices (n, 3) of ``rig.mesh(detail)`` of a cue; prepared once."""

    def weights_on(self, avatar: AvatarFace) -> Callable[[Any], tuple[NDArray[np.float64], NDArray[np.float64]]]:
        """Return what makes, of a cue, the weights (s,) of the avatar's shapes and how the head turns (4,)."""

    @property
    def on_recipes(self) -> Shown:
        """What is left to be shown by a face that has the shapes of `recipes`."""

    def recipes(self, cues: Sequence[Any]) -> Mapping[str, Recipe]:
        """Return the shapes that the parametric face needs to show some cues as blendshapes."""


class Motion(Protocol):
    """What can be filmed: a `facegen.animation.clip.Clip`, or a recording played (`facegen.animation.playback`)."""

    duration: float
    warnings: tuple[str, ...]

    def frames(self, fps: float) -> int:
        """Return how many frames it has."""

    @property
    def shown(self) -> Shown:
        """What workers need beside the cues."""

    @property
    def corners(self) -> tuple[float, ...]:
        """Times, seconds, at which it may reach farthest."""

    def key_times(self, fps: float) -> NDArray[np.float64]:
        """Return the times, seconds, that an animation of it has keys at, if ``fps`` of them a second are wanted."""

    def cue(self, t: float) -> Any:
        """Return what ``shown`` needs for a time; small, and pickled."""

    def check(self, rig: Rig) -> tuple[str, ...]:
        """Return what to warn of on a rig; InputError if it cannot be shown at all."""


class Timed:
    """Frames of something that lasts ``duration`` seconds: frame k shows the time k / fps."""

    duration: float

    def frames(self, fps: float) -> int:
        """Return how many frames there are. InputError if there are too many."""
        if isinstance(fps, bool) or not isinstance(fps, numbers.Real) or not LOWEST_FPS <= fps <= HIGHEST_FPS:
            raise InputError(f"fps: expected frames a second, {LOWEST_FPS:g}..{HIGHEST_FPS:g}, got {fps!r}")
        count = max(1, round(Fraction(self.duration) * Fraction(fps)))
        if count > MOST_FRAMES:
            raise InputError(f"fps: {self.duration:g} s at {float(fps):g} frames a second are {count} frames; the "
                             f"limit is {MOST_FRAMES}: take fewer a second or cut the clip")
        return count

    def times(self, fps: float) -> list[float]:
        """Return the time of every frame, seconds; the same at every rate where the rates meet."""
        return [frame_time(k, fps) for k in range(self.frames(fps))]


def frame_time(k: int, fps: float) -> float:
    """Return the time of frame k, rounded once, so that frames of different rates at one time agree to the bit."""
    return float(Fraction(k) / Fraction(fps))

"""A recording played: a performance in time, without gaps, for any rig.

Between two frames everything goes in a straight line. Where a value was not recorded (NaN) between two that were, no
more than ``bridge`` seconds apart, it goes straight from the one to the other; in a longer gap the face holds what was
seen last and goes over to what comes in the last ``bridge`` seconds of the gap. Before the first and after the last
value of a shape it holds; a shape without any stays at rest. Frames that are missing altogether, as where a tracker
dropped them, are such a gap too; in a glTF file keys stand where their author wants them, so there they are none.

The recorded gaze turns the eyes unless shapes of the recording do (ARKit's eyeLook, units 61 to 66); the same holds for
the head and units 51 to 58. Where the head was in the room (``place``) is not shown: the camera stands still.
"""

from __future__ import annotations

import numbers
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from facegen.animation.driver import GAZE, HEAD, LOOKS, Driver, limits, within
from facegen.animation.meaning import Meaning
from facegen.animation.motion import Timed
from facegen.animation.performance import Performance
from facegen.blendshapes.recipes import Recipe, shape_set
from facegen.errors import InputError
from facegen.face.avatar import AvatarFace
from facegen.face.rig import Rig
from facegen.fileio.kept import content_key

Array = NDArray[np.float64]

BRIDGE = 0.5
"""Seconds of a gap that is bridged in a straight line: so long a blink or a hand before the face takes."""

# A step between frames of so many usual ones is where frames are missing: no tracker hesitates that long.
_DROPPED = 5.0
# The length of a single frame, seconds.
_MOMENT = 1 / 25
# Rounding of a weight that is 0 or 1, and of degrees, by float32 and by turning them into rotations and back.
_ROUNDING, _ROUNDING_OF_ANGLES = 1e-6, 1e-3


class Cue(NamedTuple):
    """One moment: ``weights`` (k,), and ``head`` (3,) and ``gaze`` (4,) in degrees where they are shown."""

    weights: Array
    head: Array | None
    gaze: Array | None


@dataclass(frozen=True)
class Cast:
    """What is played: shapes of a vocabulary. ``digest``: of all frames."""

    vocabulary: str
    names: tuple[str, ...]
    digest: str

    def on(self, rig: Rig, *, detail: int = 2) -> Callable[[Cue], Array]:
        """Return what makes the vertices (n, 3) of a cue."""
        driver = Driver(rig, self.vocabulary, self.names, detail=detail)
        return lambda cue: driver.vertices(*cue)

    def weights_on(self, avatar: AvatarFace) -> Callable[[Cue], tuple[Array, Array]]:
        """Return what makes, of a cue, the weights (s,) of an avatar's shapes and how its head turns (4,)."""
        driver = Driver(avatar, self.vocabulary, self.names)
        return lambda cue: driver.shape_weights(*cue)

    @property
    def on_recipes(self) -> Cast:
        """All of it."""
        return self

    def recipes(self, cues: Sequence[Cue]) -> dict[str, Recipe]:
        """Return the shapes by their owner's names; of units those that move. ARKit's glances show the gaze."""
        meaning = Meaning(self.vocabulary, self.names)
        if self.vocabulary == "units":
            amounts = np.array([meaning.coefficients(np.clip(cue.weights, 0.0, 1.0)) for cue in cues])
            moving = {part for part, moves in zip(meaning.parts, amounts.any(axis=0), strict=True) if moves}
            found = {name: one for name, one in shape_set("units").items() if set(one.members) & moving}
        else:
            known = shape_set("all" if self.vocabulary == "shapes" else self.vocabulary)
            wanted = set(meaning.shapes.values())
            wanted |= {corrected for shape in wanted if (corrected := known[shape].minus) is not None}
            found = {shape: one for shape, one in known.items() if shape in wanted}
        if any(cue.gaze is not None for cue in cues):
            found |= {name: shape_set("arkit")[name] for name in LOOKS if name not in found}
        return found


@dataclass(frozen=True, eq=False)
class Playback(Timed):
    """A performance as a motion: time runs from its first frame on. bridge: seconds, see above.

    ``moments`` and ``filled``: its own frames, without NaN. Raises InputError. ::

        facegen.save_clip(Playback(performance), "film.mp4", face="human.glb")
    """

    performance: Performance
    bridge: float = BRIDGE

    def __post_init__(self) -> None:
        if not isinstance(self.performance, Performance):
            raise InputError(f"performance: expected a Performance, got {type(self.performance).__name__}")
        if isinstance(self.bridge, bool) or not isinstance(self.bridge, numbers.Real) or not self.bridge >= 0.0:
            raise InputError(f"bridge: expected seconds, 0 or more, got {self.bridge!r}")

    @cached_property
    def duration(self) -> float:
        """Seconds: the last frame stands as long as the one before."""
        one = self.performance
        return one.duration + (one.times[-1] - one.times[-2] if len(one) > 1 else _MOMENT)

    @property
    def moments(self) -> Array:
        """The times (m,) of the recording's own frames, seconds from the first, and of ends of gaps without frames."""
        return self._frames[0]

    @cached_property
    def _frames(self) -> tuple[Array, NDArray[np.intp]]:
        """The moments, and which frame of the recording each is."""
        times = self.performance.times - self.performance.times[0]
        steps = np.diff(times)
        if not len(steps) or self.performance.about.get("format") == "gltf":
            return times, np.arange(len(times))
        before = np.flatnonzero(steps > max(self.bridge, _DROPPED * float(np.median(steps))))
        ends = (times[before + 1] - self.bridge).astype(np.float32)
        ends = np.nextafter(ends, np.float32(0.0)).astype(np.float64)       # without a bridge: just before the jump
        order = np.argsort(np.concatenate([times, ends]))
        return np.concatenate([times, ends])[order], np.concatenate([np.arange(len(times)), before])[order]

    @cached_property
    def filled(self) -> Cue:
        """All moments without gaps: ``weights`` (m, k), ``head`` (m, 3) and ``gaze`` (m, 4) or None."""
        one, meaning = self.performance, Meaning(self.performance.vocabulary, self.performance.names)
        recorded = np.isfinite(one.weights).any(axis=0)
        head = None if (recorded & meaning.columns("turns")).any() else one.head
        gaze = None if (recorded & meaning.columns("looks")).any() else one.gaze
        return Cue(self._whole(one.weights), *(None if angles is None or not np.isfinite(angles).any()
                                               else self._whole(angles) for angles in (head, gaze)))

    @cached_property
    def warnings(self) -> tuple[str, ...]:
        """What was odd in the recording, and what of it is shown otherwise on any rig."""
        return (*self.performance.warnings, *self._gaps(), *self._beyond("head", HEAD, self.filled.head),
                *self._beyond("eyes", GAZE, self.filled.gaze))

    @property
    def corners(self) -> tuple[float, ...]:
        """Times at which a shape or an angle is largest or least, seconds, each once."""
        rows = [self.filled.weights.argmax(axis=0)]
        for angles in (self.filled.head, self.filled.gaze):
            rows += [] if angles is None else [angles.argmax(axis=0), angles.argmin(axis=0)]
        return tuple(self.moments[np.unique(np.concatenate(rows))].tolist())

    @property
    def shown(self) -> Cast:
        """What workers need beside the cues."""
        parts = [one for one in self.filled if one is not None]
        return Cast(self.performance.vocabulary, self.performance.names, content_key("playback", self.moments, *parts))

    def key_times(self, fps: float) -> Array:
        """Return the times of its own frames."""
        return self.moments

    def cue(self, t: float) -> Cue:
        """Return the moment at a time in seconds; before the first frame and after the last it holds."""
        after = int(np.clip(np.searchsorted(self.moments, t, side="right"), 1, max(len(self.moments) - 1, 1)))
        if len(self.moments) == 1:
            return Cue(*(None if one is None else one[0] for one in self.filled))
        start, end = self.moments[after - 1:after + 1]
        share = min(max((t - start) / (end - start), 0.0), 1.0)
        return Cue(*(None if one is None else (1.0 - share) * one[after - 1] + share * one[after]
                     for one in self.filled))

    def on(self, rig: Rig, *, detail: int = 2) -> Callable[[float], Array]:
        """Return what makes the vertices (n, 3), mm, of ``rig.mesh(detail)`` at a time in seconds; prepared once. ::

            pose = Playback(performance).on(facegen.load_face())
            vertices = pose(1.5)
        """
        shown = self.shown.on(rig, detail=detail)
        return lambda t: shown(self.cue(t))

    def check(self, rig: Rig) -> tuple[str, ...]:
        """Return what to warn of on a rig; InputError if it can show none of the shapes."""
        driver = Driver(rig, self.performance.vocabulary, self.performance.names)
        weights = self.filled.weights[:, ~driver.direct]
        outside = (weights < -_ROUNDING) | (weights > 1.0 + _ROUNDING)
        said = []
        if outside.any():
            said.append(f"{int(outside.any(axis=1).sum())} frames have weights outside 0..1 (from {weights.min():.3g} "
                        f"to {weights.max():.3g}); they are clipped")
        moving = [name for name, moves in zip(self.performance.names, self.filled.weights.any(axis=0), strict=True)
                  if moves]
        return (*driver.check(moving, head=self.filled.head is not None, gaze=self.filled.gaze is not None), *said)

    def _whole(self, values: Array) -> Array:
        """Return values of the recording's frames (n, k) at the moments (m, k), without NaN."""
        values = values[self._frames[1]]
        for column in np.flatnonzero(np.isnan(values).any(axis=0)):
            values[:, column] = bridged(self.moments, values[:, column], self.bridge)
        return values

    def _gaps(self) -> tuple[str, ...]:
        one = self.performance
        missing = np.isnan(one.weights)
        said = []
        if never := [name for name, all_missing in zip(one.names, missing.all(axis=0), strict=True) if all_missing]:
            said.append(f"{', '.join(never)}: never recorded, so at rest")
        gaps = int(missing[:, ~missing.all(axis=0)].any(axis=1).sum())
        if gaps:
            said.append(f"{gaps} of {len(one)} frames have gaps: up to {self.bridge:g} s are bridged in a straight "
                        "line, in longer ones the face holds")
        return tuple(said)

    def _beyond(self, part: str, axes: tuple[str, ...], angles: Array | None) -> tuple[str, ...]:
        if angles is None:
            return ()
        frames = (np.abs(angles - within(part, angles)) > _ROUNDING_OF_ANGLES).any(axis=1)
        if not frames.any():
            return ()
        low, high = limits(part)
        least, most = angles.min(axis=0), angles.max(axis=0)
        which = [f"{axis} {least[i]:.0f}..{most[i]:.0f} of {low[i]:g}..{high[i]:g}" for i, axis in enumerate(axes)
                 if least[i] < low[i] - _ROUNDING_OF_ANGLES or most[i] > high[i] + _ROUNDING_OF_ANGLES]
        return (f"the {part} turn{'s' if part == 'head' else ''} beyond reach in {int(frames.sum())} frames "
                f"({', '.join(which)} degrees); they are clipped",)


def bridged(times: Array, values: Array, bridge: float) -> Array:
    """Return values (n,) at times without NaN, by the rule above; zeros if all are missing."""
    known = np.flatnonzero(np.isfinite(values))
    if not len(known):
        return np.zeros(len(values))
    knots, at = [times[known[0]]], [values[known[0]]]
    for before, after in pairwise(known):
        if after > before + 1 and times[after] - times[before] > bridge:
            knots.append(max(times[after] - bridge, times[before]))
            at.append(values[before])
        knots.append(times[after])
        at.append(values[after])
    result = np.interp(times, knots, at)
    result[known] = values[known]
    return result

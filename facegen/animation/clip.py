"""A clip: poses in time.

One rule puts tracks together. They are laid over each other from first to last, and each *adds* its weights to what
lies below; a weight ends at 1. What a track *replaces* (all, or some units) fades below it as far as the track is
present: a track of keyframes is present all the time, a track of events as far as its events are (nothing before the
onset, wholly at the apex). The idle layer adds last.

Within a track of keyframes the weights go from one keyframe to the next. Within a track of events, events that overlap
share: where their strengths sum beyond 1 they are divided by the sum, so one event hands over to the next.

Weights mix, not movements: how units combine and limit each other at any moment is for the unit table to say, as for a
still pose.
"""

from __future__ import annotations

import bisect
import math
import numbers
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray

from facegen.animation.easing import DEFAULT_EASE, EASES, eased
from facegen.animation.idle import Idle
from facegen.animation.motion import Timed
from facegen.blendshapes.recipes import Recipe, shape_set
from facegen.errors import InputError, nearest
from facegen.face.avatar import AvatarFace
from facegen.face.rig import Rig
from facegen.facs.deformation import Deformation, weighted_sum
from facegen.facs.expressions import Resolution, resolve
from facegen.facs.tables import load_units
from facegen.facs.units import split_code
from facegen.fileio.sound import Sound

if TYPE_CHECKING:
    from facegen.animation.layer import Layer

LONGEST = 86_400.0
"""Seconds: a day."""

_MIRROR = {"51": "52", "55": "56", "61": "62"}     # one-sided units whose mirror image is another unit
_MIRROR |= {b: a for a, b in _MIRROR.items()}
_TURNS = (("51", "52"), ("53", "54"), ("55", "56"), ("61", "62"))

Weights = Mapping[str, float]
_Shares = list[tuple[float, Deformation]]


@dataclass(frozen=True)
class Pose:
    """What is shown: ``atoms`` (unit by side or lip -> weight 0..1), and raw data that no unit describes."""

    atoms: Weights = field(default_factory=dict)
    raw: Deformation | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "atoms", MappingProxyType(dict(self.atoms)))

    def __reduce__(self) -> tuple:                  # mapping proxies cannot be pickled
        return Pose, (dict(self.atoms), self.raw)

    def mirrored(self) -> Pose:
        """Return the mirror image."""
        return Pose({_mirrored(atom): weight for atom, weight in self.atoms.items()},
                    None if self.raw is None else self.raw.mirrored())


@dataclass(frozen=True)
class Keyframe:
    """A pose at a time (seconds); ``ease`` says how the face gets there from the keyframe before."""

    t: float
    pose: Pose
    ease: str = DEFAULT_EASE

    def __post_init__(self) -> None:
        _check_time("t", self.t)
        _check_ease("ease", self.ease)


@dataclass(frozen=True)
class Event:
    """A pose that comes and goes: onset, apex and offset in seconds from ``at`` on."""

    at: float
    pose: Pose
    onset: float
    apex: float
    offset: float
    onset_ease: str = DEFAULT_EASE
    offset_ease: str = DEFAULT_EASE

    def __post_init__(self) -> None:
        for name in ("at", "onset", "apex", "offset"):
            _check_time(name, getattr(self, name))
        if not self.onset + self.apex + self.offset > 0.0:
            raise InputError("onset, apex, offset: expected an event that takes time, got 0 s altogether")
        _check_ease("onset_ease", self.onset_ease)
        _check_ease("offset_ease", self.offset_ease)

    @property
    def end(self) -> float:
        """When it is over, seconds."""
        return self.at + self.onset + self.apex + self.offset

    def strength(self, t: float) -> float:
        """Return how much of the pose is there, 0..1; 1 at the apex, both ends of it included."""
        since = t - self.at
        if since < 0.0:
            return 0.0
        if since < self.onset:
            return eased(self.onset_ease, since / self.onset)
        if t <= self.at + self.onset + self.apex:
            return 1.0
        if t >= self.end:
            return 0.0
        return 1.0 - eased(self.offset_ease, (since - self.onset - self.apex) / self.offset)


@dataclass(frozen=True)
class Track:
    """Keyframes or events, one of the two, and what they replace: nothing, "all", or some atoms."""

    name: str
    keyframes: tuple[Keyframe, ...] = ()
    events: tuple[Event, ...] = ()
    replaces: str | frozenset[str] = frozenset()
    optional: ClassVar[bool] = False

    def __post_init__(self) -> None:
        if bool(self.keyframes) == bool(self.events):
            raise InputError(f"track {self.name}: expected either keyframes or events")
        for before, after in zip(self.keyframes, self.keyframes[1:], strict=False):
            if after.t <= before.t:
                raise InputError(f"track {self.name}: expected keyframes in order of time, got {after.t:g} s after "
                                 f"{before.t:g} s")

    @property
    def end(self) -> float:
        """When the last keyframe stands or the last event is over, seconds."""
        return max([key.t for key in self.keyframes] + [event.end for event in self.events])

    @property
    def begins(self) -> float:
        """When the last keyframe stands or the last event begins, seconds."""
        return max([key.t for key in self.keyframes] + [event.at for event in self.events])

    @property
    def corners(self) -> tuple[float, ...]:
        """The times at which movements begin and end, seconds."""
        found = [key.t for key in self.keyframes]
        for one in self.events:
            found += (one.at, one.at + one.onset, one.at + one.onset + one.apex, one.end)
        return tuple(found)

    @property
    def poses(self) -> tuple[Pose, ...]:
        """Every pose in it."""
        return tuple(one.pose for one in (*self.keyframes, *self.events))

    @cached_property
    def _times(self) -> tuple[float, ...]:
        return tuple(key.t for key in self.keyframes)

    def mirrored(self) -> Track:
        """Return the track with left and right changed."""
        return replace(self, keyframes=tuple(replace(key, pose=key.pose.mirrored()) for key in self.keyframes),
                       events=tuple(replace(event, pose=event.pose.mirrored()) for event in self.events),
                       replaces=self.replaces if self.replaces == "all" else frozenset(map(_mirrored, self.replaces)))

    def fades(self, t: float) -> list[tuple[str | frozenset[str], float]]:
        """Return which atoms below fade at a time, or "all", and to what share."""
        return [(self.replaces, 1.0 - min(1.0, sum(share for share, _ in self.shares(t))))]

    def shares(self, t: float) -> list[tuple[float, Pose]]:
        """Return the poses that are there at a time, each with its strength 0..1."""
        if self.events:
            return [(strength, event.pose) for event in self.events if (strength := event.strength(t)) > 0.0]
        after = bisect.bisect_right(self._times, t)
        if after == 0:
            return [(1.0, self.keyframes[0].pose)]
        here = self.keyframes[after - 1]
        if after == len(self.keyframes):
            return [(1.0, here.pose)]
        there = self.keyframes[after]
        done = eased(there.ease, (t - here.t) / (there.t - here.t))
        return [(share, pose) for share, pose in ((1.0 - done, here.pose), (done, there.pose)) if share > 0.0]


@dataclass(frozen=True)
class Clip(Timed):
    """Timed poses in tracks, ``duration`` seconds long; make one with `load_clip` or `morph`.

    ``warnings``: what its poses were warned of. ``sound``: what is heard meanwhile, from the first moment on; films
    that can have sound get it. ``own``: units that the person moves otherwise, see `Resolution.own`. ::

        for pose in clip.sample(25):
            pixels = renderer.draw(pose)
    """

    tracks: tuple[Layer, ...]
    duration: float
    idle: Idle | None = None
    warnings: tuple[str, ...] = ()
    sound: Sound | None = None
    own: Mapping[str, Deformation] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if isinstance(self.duration, bool) or not isinstance(self.duration, numbers.Real) \
                or not 0.0 < self.duration <= LONGEST:
            raise InputError(f"duration: expected seconds above 0 and up to {LONGEST:g}, got {self.duration!r}")

    def units_at(self, t: float) -> dict[str, float]:
        """Return unit -> weight 0..1 at a time in seconds, in FACS order; raw data left out."""
        return load_units().catalogue.fold(self._mixed(t)[0])

    def at(self, t: float) -> Resolution:
        """Return what is shown at a time in seconds: unit weights, and the deformation they make.

        It goes wherever a pose goes: ``renderer.draw(clip.at(1.5))``. Before 0 and after the end the clip holds.
        """
        atoms, raw, optional = self._mixed(t)
        table = load_units().with_basis(self.own)
        units = table.catalogue.fold(atoms)
        total = weighted_sum([(value, table.basis[name]) for name, value in table.coefficients(units).items()])
        if not total.has_lengths:
            total = replace(total, units=table.units)
        more = []
        if raw:
            # Only a face can convert lengths, so each unit of length is summed by itself.
            of: dict[str, list[tuple[float, Deformation]]] = {table.units: [(1.0, total)] if units else []}
            for share, one in raw:
                of.setdefault(one.units if one.has_lengths else table.units, []).append((share, one))
            sums = [weighted_sum(terms) for terms in of.values() if terms]
            total, more = sums[0], sums[1:]
        return Resolution(self, "units" if units or not raw else "deformation", f"{t:.3f} s", None, units, total,
                          more=tuple(more), optional=(weighted_sum(optional),) if optional else (), own=self.own)

    def sample(self, fps: float = 25.0) -> Iterator[Resolution]:
        """Return the frames one after the other, each as `at` gives it."""
        return map(self.at, self.times(fps))

    def mirrored(self) -> Clip:
        """Return the clip with left and right changed; the idle layer is left as it is."""
        return replace(self, tracks=tuple(track.mirrored() for track in self.tracks),
                       own={_mirrored(atom): one.mirrored() for atom, one in self.own.items()})

    @property
    def raw(self) -> tuple[Deformation, ...]:
        """The raw data in its poses."""
        return tuple(pose.raw for track in self.tracks if not track.optional for pose in track.poses
                     if pose.raw is not None)

    @property
    def corners(self) -> tuple[float, ...]:
        """The times at which movements begin and end, seconds, each once."""
        found = {0.0, self.duration}
        for track in self.tracks:
            found.update(track.corners)
        return tuple(sorted(t for t in found if t <= self.duration))

    # -- as a motion to be filmed, see facegen.animation.motion -----------------------------------------------
    @property
    def shown(self) -> Clip:
        """What workers need: the clip itself, whose cues are times; without its sound, which no frame shows."""
        return self if self.sound is None else replace(self, sound=None)

    def cue(self, t: float) -> float:
        """Return the time."""
        return t

    def on(self, rig: Rig, *, detail: int = 2) -> Callable[[float], NDArray[np.float64]]:
        """Return what makes the vertices of a time, seconds."""
        return lambda t: rig.pose(self.at(t), detail=detail)

    def weights_on(self, avatar: AvatarFace
                   ) -> Callable[[float], tuple[NDArray[np.float64], NDArray[np.float64]]]:
        """Return what makes the weights (s,) of an avatar's shapes at a time, and how its head turns (4,)."""
        def at(t: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
            found = self.at(t)
            weights = avatar.shape_weights(found)
            return np.array([weights.get(name, 0.0) for name in avatar.shapes]), avatar.head_angles(found)

        return at

    @property
    def on_recipes(self) -> Clip:
        """What is left to be shown by the shapes of `recipes`, in which units are this person's already."""
        return replace(self, own={})

    def recipes(self, cues: Sequence[float]) -> dict[str, Recipe]:
        """Return the units that move at some times, or all where raw data must be made of them."""
        units = {name: replace(one, deformation=(self.own[member],)) if (member := next(iter(one.members))) in self.own
                 else one for name, one in shape_set("units").items()}
        if self.raw:
            return units
        moving = {member for t in cues for member in load_units().coefficients(self.units_at(t))}
        return {name: one for name, one in units.items() if set(one.members) & moving}

    def key_times(self, fps: float) -> NDArray[np.float64]:
        """Return the times of its frames."""
        return np.array(self.times(fps))

    def check(self, rig: Rig) -> tuple[str, ...]:
        """Return what to warn of on a rig; InputError if raw data name what it has not."""
        return tuple(dict.fromkeys(warning for raw in self.raw for warning in rig.check(resolve(raw))))

    def _mixed(self, t: float) -> tuple[dict[str, float], _Shares, _Shares]:
        """Return atom -> weight, shares of raw data, and shares of those that are optional, at a time."""
        if isinstance(t, bool) or not isinstance(t, numbers.Real) or not math.isfinite(t):
            raise InputError(f"t: expected a time in seconds, got {t!r}")
        t = min(max(float(t), 0.0), self.duration)
        atoms: dict[str, float] = {}
        raw: _Shares = []
        optional: _Shares = []
        for track in self.tracks:
            shares = track.shares(t)
            if not shares:
                continue
            for which, kept in track.fades(t):
                if which == "all":
                    atoms = {atom: weight * kept for atom, weight in atoms.items()}
                    raw, optional = ([(share * kept, one) for share, one in several if kept]
                                     for several in (raw, optional))
                else:
                    atoms.update((atom, atoms[atom] * kept) for atom in which if atom in atoms)
            mine = [(share, pose.raw) for share, pose in shares if pose.raw is not None]
            beyond = max(1.0, math.fsum(share for share, _ in mine))
            mine = [(share / beyond, one) for share, one in mine]
            if track.optional:
                optional += mine
            else:
                raw += mine
            _add(atoms, shares)
        if self.idle is not None:
            _add(atoms, [(1.0, Pose(self.idle.at(t)))])
        for one, other in _opposites():
            if one in atoms and other in atoms and not self.own.keys() & {one, other}:
                both = min(atoms[one], atoms[other])
                atoms[one], atoms[other] = atoms[one] - both, atoms[other] - both
        return {atom: weight for atom, weight in atoms.items() if weight}, raw, optional


@cache
def _opposites() -> tuple[tuple[str, str], ...]:
    """Return pairs of turns whose common part moves nothing: the weights say the turn that is left."""
    basis = load_units().basis
    return tuple((a, b) for a, b in _TURNS if basis[a] == -basis[b])


def _add(atoms: dict[str, float], shares: Sequence[tuple[float, Pose]]) -> None:
    """Add poses to weights; a weight ends at 1. Poses that move the same atom share it where they sum beyond 1."""
    present: dict[str, list[float]] = {}
    total: dict[str, list[float]] = {}
    for share, pose in shares:
        for atom, weight in pose.atoms.items():
            total.setdefault(atom, []).append(share * weight)
            present.setdefault(atom, []).append(share)
    for atom, several in total.items():
        # fsum, so that neither the order nor the side of a track changes a bit
        weight = math.fsum(several) / max(1.0, math.fsum(present[atom]))
        atoms[atom] = min(1.0, atoms.get(atom, 0.0) + weight)


def _mirrored(atom: str) -> str:
    mark, number = split_code(atom)
    return {"L": "R", "R": "L"}.get(mark, mark) + _MIRROR.get(number, number)


def _check_time(name: str, value: object) -> None:
    if isinstance(value, bool) or not isinstance(value, numbers.Real) or not 0.0 <= value <= LONGEST:
        raise InputError(f"{name}: expected seconds, 0..{LONGEST:g}, got {value!r}")


def _check_ease(name: str, value: object) -> None:
    if value not in EASES:
        raise InputError(f"{name}: unknown ease {value!r}{nearest(str(value), EASES)} (known: {', '.join(EASES)})")


def own_units(meanings: Iterable[Resolution]) -> Mapping[str, Deformation]:
    """Return the units that a person moves otherwise, of what was resolved; InputError if two people do."""
    found = [one.own for one in meanings if one.units]
    if any(one != found[0] for one in found):
        raise InputError("poses: resolved for people whose units move differently; a clip shows one person")
    return found[0] if found else {}


def pose_of(resolution: Resolution) -> Pose:
    """Return the pose of what an input means."""
    atoms = load_units().catalogue.expand(resolution.units)
    return Pose(atoms, None if resolution.units or not resolution.deformation else resolution.deformation)


def joined(poses: Iterable[Pose]) -> Pose:
    """Return poses together, such as an expression and a turn of the head; InputError if they share a unit."""
    atoms: dict[str, float] = {}
    raw = None
    for pose in poses:
        for atom, weight in pose.atoms.items():
            if atoms.setdefault(atom, weight) != weight:
                raise InputError(f"unit {atom}: given twice, as {atoms[atom]:g} and as {weight:g}")
        raw = pose.raw if raw is None else raw
    return Pose(atoms, raw)

"""Speech: sounds at times, however they came: from text, written sounds, or a recording's labels."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType

from facegen.animation.clip import LONGEST
from facegen.animation.phonemes import Sound, read_sounds
from facegen.animation.speech_table import SILENCE, Phoneme
from facegen.errors import InputError

LEAD, TAIL = 0.25, 0.4
"""Seconds of rest before and after speech whose times are our own: the mouth is ready before the first sound."""

SHORTEST = 0.001
"""Seconds: a sound that is shorter is none."""

MOST_SOUNDS = 200_000
"""Sounds of one speech: hours."""


@dataclass(frozen=True)
class TimedSound:
    """A sound from ``start`` to ``end``, seconds; ``label`` as it was written, ``stress`` as `Sound` has it."""

    start: float
    end: float
    label: str
    phoneme: Phoneme
    stress: str | None = None

    @property
    def is_pause(self) -> bool:
        """Whether nothing is said."""
        return self.phoneme.kind == "pause"


@dataclass(frozen=True)
class Speech:
    """Sounds in order of time, none over another, and how long it all lasts; seconds.

    about: where it came from ("text", "language", "path", ...). warnings: what was odd.
    """

    sounds: tuple[TimedSound, ...]
    duration: float
    about: Mapping[str, str] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "sounds", tuple(self.sounds))
        object.__setattr__(self, "about", MappingProxyType(dict(self.about)))
        if len(self.sounds) > MOST_SOUNDS:
            raise InputError(f"sounds: expected {MOST_SOUNDS} at most, got {len(self.sounds)}")
        if all(one.is_pause for one in self.sounds):
            raise InputError("sounds: nothing is said; give one sound or more")
        last = 0.0
        for k, one in enumerate(self.sounds):
            if not last <= one.start < one.end <= LONGEST:
                raise InputError(f"sounds: expected times in order from 0 s up to {LONGEST:g} s, sound {k + 1} "
                                 f"('{one.label}') goes from {one.start:g} to {one.end:g} after {last:g}")
            last = one.end
        if not last <= self.duration <= LONGEST:
            raise InputError(f"duration: expected seconds from {last:g}, where the last sound ends, to {LONGEST:g}, "
                             f"got {self.duration!r}")

    def __reduce__(self) -> tuple:                  # mapping proxies cannot be pickled
        return Speech, (self.sounds, self.duration, dict(self.about), self.warnings)

    def slower(self, factor: float) -> Speech:
        """Return the same with all times multiplied."""
        if not 0.01 <= factor <= 100.0:
            raise InputError(f"slow: expected a factor in 0.01..100, got {factor!r}")
        return replace(self, duration=self.duration * factor, sounds=tuple(
            replace(one, start=one.start * factor, end=one.end * factor) for one in self.sounds))

    def later(self, seconds: float) -> Speech:
        """Return the same, begun later."""
        return replace(self, duration=self.duration + seconds, sounds=tuple(
            replace(one, start=one.start + seconds, end=one.end + seconds) for one in self.sounds))

    @property
    def visemes(self) -> list[tuple[float, float, str, str]]:
        """(start, end, label, viseme) of every mouth, pauses left out; a diphthong has two."""
        found = []
        for one in self.sounds:
            if one.is_pause:
                continue
            for start, end, part in parts_of(one):
                viseme = one.phoneme.visemes[min(part, len(one.phoneme.visemes) - 1)]
                if viseme != SILENCE:
                    found.append((start, end, one.label, viseme))
        return found


def parts_of(sound: TimedSound) -> list[tuple[float, float, int]]:
    """Return (start, end, number) of a sound's one or two parts; the first takes a little more than half."""
    if max(len(sound.phoneme.visemes), len(sound.phoneme.tongues)) == 1:
        return [(sound.start, sound.end, 0)]
    middle = sound.start + 0.55 * (sound.end - sound.start)
    return [(sound.start, middle, 0), (middle, sound.end, 1)]


def speech_of(phonemes: str | Iterable[Sound], *, alphabet: str = "auto", speed: float = 1.0) -> Speech:
    """Return sounds one after the other, each as long as its kind lasts by itself, with rest before and after.

    phonemes: a text as `read_sounds` takes it. speed: 2 is twice as fast. Raises NotationError, InputError. ::

        speech_of("HH AH0 L OW1").duration
    """
    check_speed(speed)
    sounds = read_sounds(phonemes, alphabet) if isinstance(phonemes, str) else list(phonemes)
    if not sounds:
        raise InputError("phonemes: expected one sound or more, such as 'HH AH0 L OW1', got none")
    made, t = [], LEAD
    for one in sounds:
        end = t + one.seconds / speed
        made.append(TimedSound(t, end, one.label, one.phoneme, one.stress))
        t = end
    return Speech(tuple(made), t + TAIL, {"phonemes": phonemes} if isinstance(phonemes, str) else {})


def check_speed(speed: float) -> None:
    """Raise InputError for a speed that nobody speaks at."""
    if isinstance(speed, bool) or not isinstance(speed, (int, float)) or not 0.1 <= speed <= 10.0:
        raise InputError(f"speed: expected a factor in 0.1..10, got {speed!r}")


def spread(sounds: list[Sound], start: float, end: float) -> list[TimedSound]:
    """Return sounds that fill a stretch of time, each by how long it lasts by itself."""
    whole, t, made = sum(one.seconds for one in sounds), start, []
    for k, one in enumerate(sounds):
        stop = end if k == len(sounds) - 1 else t + (end - start) * one.seconds / whole
        if stop - t >= SHORTEST:
            made.append(TimedSound(t, stop, one.label, one.phoneme, one.stress))
            t = stop
    return made

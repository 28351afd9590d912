"""Sound as samples, and WAV files of it."""

from __future__ import annotations

import os
import wave
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from facegen.errors import FileError, InputError
from facegen.fileio.textfile import check_place, whole_file

MOST_SAMPLES = 48_000 * 3600 * 2
"""Two hours of 48 kHz."""


@dataclass(frozen=True, eq=False)
class Sound:
    """One channel. samples: (n,) int16; rate: samples a second."""

    samples: NDArray[np.int16]
    rate: int

    @property
    def duration(self) -> float:
        """Seconds."""
        return len(self.samples) / self.rate

    def after(self, seconds: float) -> Sound:
        """Return the same after silence."""
        return Sound(np.concatenate([np.zeros(round(seconds * self.rate), np.int16), self.samples]), self.rate)


def mixed(sounds: Sequence[tuple[float, Sound]]) -> Sound | None:
    """Return sounds (start in seconds, sound) as one, at the highest of their rates; None if there are none."""
    if not sounds:
        return None
    rate = max(sound.rate for _, sound in sounds)
    total = np.zeros(max(round(start * rate) + round(sound.duration * rate) for start, sound in sounds))
    for start, sound in sounds:
        samples = sound.samples.astype(np.float64)
        if sound.rate != rate:
            at = np.arange(round(sound.duration * rate)) * (sound.rate / rate)
            samples = np.interp(at, np.arange(len(samples)), samples)
        first = round(start * rate)
        total[first: first + len(samples)] += samples[: len(total) - first]
    return Sound(np.clip(np.rint(total), -32768, 32767).astype(np.int16), rate)


def read_wav(path: str | os.PathLike[str]) -> Sound:
    """Return the sound of a WAV file of 16 bits a sample, its channels mixed; FileError."""
    path = Path(path)
    try:
        with wave.open(str(path), "rb") as file:
            channels, width, rate, count = file.getnchannels(), file.getsampwidth(), file.getframerate(), \
                file.getnframes()
            if width != 2:
                raise FileError(f"{path}: expected 16 bits a sample, got {8 * width}; save it as a 16-bit WAV file")
            if not 1 <= channels <= 16 or not 1000 <= rate <= 384_000 or count > MOST_SAMPLES:
                raise FileError(f"{path}: expected up to 16 channels and two hours, got {channels} channels of {count} "
                                f"samples, {rate} a second")
            raw = file.readframes(count)
    except FileNotFoundError as error:
        raise FileError(f"{path}: there is no such file") from error
    except FileError:
        raise
    except (wave.Error, EOFError, OSError, ValueError, RuntimeError) as error:    # the last from a chunk too short
        why = "it is a folder" if path.is_dir() else str(error) or "it ends too early"
        raise FileError(f"{path}: cannot be read as a WAV file ({why}); save the sound as a 16-bit WAV file") from error
    samples = np.frombuffer(raw[: len(raw) // (2 * channels) * 2 * channels], "<i2").reshape(-1, channels)
    if not len(samples):
        raise FileError(f"{path}: has no samples")
    return Sound(samples[:, 0].copy() if channels == 1 else samples.mean(axis=1).astype(np.int16), rate)


def save_wav(sound: Sound, path: str | os.PathLike[str]) -> Path:
    """Write a sound as a WAV file, whole or not at all, and return its path; FileError."""
    path = check_place(path, (".wav",))
    if not isinstance(sound, Sound):
        raise InputError(f"sound: expected a Sound, got {type(sound).__name__}")
    with whole_file(path, "the sound ") as draft, wave.open(str(draft), "wb") as file:
        file.setnchannels(1)
        file.setsampwidth(2)
        file.setframerate(sound.rate)
        file.writeframes(sound.samples.astype("<i2").tobytes())
    return path

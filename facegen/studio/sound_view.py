"""The sound of a clip in the browser: an element that plays what is left of it, in step with the picture."""

from __future__ import annotations

import base64
import io
import itertools
import wave
from typing import Any

from facegen.fileio.sound import Sound

LONGEST = 120.0
"""Seconds that are sent at once: a message of 5 MB at the rate that espeak-ng speaks."""


def wav_bytes(sound: Sound, start: float = 0.0) -> bytes:
    """Return a sound from a time on, seconds, as a WAV file; empty if nothing of it is left."""
    samples = sound.samples[round(max(start, 0.0) * sound.rate):][:round(LONGEST * sound.rate)]
    if not len(samples):
        return b""
    out = io.BytesIO()
    with wave.open(out, "wb") as file:
        file.setnchannels(1)
        file.setsampwidth(2)
        file.setframerate(sound.rate)
        file.writeframes(samples.astype("<i2").tobytes())
    return out.getvalue()


class SoundView:
    """Nothing to see. ``on``: whether it may be heard."""

    def __init__(self, gui: Any) -> None:
        self._place = gui.add_html("")
        self._count = itertools.count()         # each playing is another element, or the browser would keep the last
        self.on = True

    def play(self, sound: Sound | None, start: float, speed: float) -> None:
        """Be heard from a time on; a voice at another speed would be another voice, so there is none."""
        data = wav_bytes(sound, start) if sound is not None and self.on and speed == 1.0 else b""
        if not data:
            self.stop()
            return
        self._place.content = (f'<audio autoplay data-number="{next(self._count)}" '
                               f'src="data:audio/wav;base64,{base64.b64encode(data).decode("ascii")}"></audio>')

    def stop(self) -> None:
        """Be silent."""
        if self._place.content:
            self._place.content = ""

"""Speech as a script or a command asks for it: a text, written sounds, or a file of timings."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from facegen.animation.clip import LONGEST, Clip, Event, Track, own_units, pose_of
from facegen.animation.coarticulation import SpeechTrack
from facegen.animation.espeak import speak
from facegen.animation.idle import Idle
from facegen.animation.layer import Layer
from facegen.animation.phonemes import ALPHABETS
from facegen.animation.speech import Speech, speech_of
from facegen.animation.speech_files import SUFFIXES, read_speech
from facegen.animation.timing import load_timing
from facegen.errors import FacegenError, InputError
from facegen.facs.expressions import Resolution
from facegen.facs.validate import Entry
from facegen.fileio.sound import Sound, read_wav

LANGUAGE = "en-us"
NO_FILES = "this script may name no files; write here what the file holds"
"""What is said where `facegen.load_clip` was told that no file may be opened."""

_WAYS = ("text", "phonemes", "timing")
_OF = {"language": "text", "speed": "text and phonemes", "alphabet": "phonemes and timing", "tier": "timing"}


@dataclass(frozen=True, eq=False)
class Said:
    """Speech with what is heard, ``at`` seconds in."""

    speech: Speech
    sound: Sound | None = None
    at: float = 0.0
    effort: float = 1.0


def say(*, text: str | None = None, phonemes: str | None = None, timing: str | Path | None = None,
        language: str = LANGUAGE, speed: float = 1.0, alphabet: str = "auto", tier: str | None = None,
        sound: str | Path | None = None) -> Said:
    """Return speech of one of text (espeak-ng), phonemes or timing (a file); sound: a WAV file that goes with it.

    Raises InputError, FileError.
    """
    if (ways := sum(one is not None for one in (text, phonemes, timing))) != 1:
        raise InputError(f"expected one of text, phonemes and timing, got {ways}")
    if text is not None:
        if sound is not None:
            raise InputError("sound: a text is spoken by espeak-ng; give sound with phonemes or timing")
        spoken = speak(text, language=language, speed=speed)
        return Said(spoken.speech, spoken.sound)
    heard = None if sound is None else read_wav(sound)
    made = read_speech(timing, tier=tier, alphabet=alphabet) if timing is not None else \
        speech_of(phonemes, alphabet=alphabet, speed=speed)
    return Said(made, heard)


def speech_clip(said: Said, *, effort: float = 1.0, expression: Resolution | None = None, idle: int | None = None
                ) -> Clip:
    """Return speech as a clip. expression: what the face shows meanwhile, from beginning to end."""
    tracks: list[Layer] = []
    length = said.at + said.speech.duration
    if said.sound is not None:
        length = max(length, said.at + said.sound.duration)
    if expression is not None:
        kind = load_timing().kind_of(expression.expression.name if expression.expression else None)
        shorter = min(1.0, 0.8 * length / (kind.onset + kind.offset))
        onset, offset = shorter * kind.onset, shorter * kind.offset
        tracks.append(Track("expression", events=(Event(
            0.0, pose_of(expression), onset, length - onset - offset, offset, kind.onset_ease, kind.offset_ease),)))
    tracks.append(SpeechTrack("speech", said.speech.later(said.at), effort))
    sound = said.sound.after(said.at) if said.sound is not None and said.at else said.sound
    return Clip(tuple(tracks), length, None if idle is None else Idle(idle), said.speech.warnings, sound,
                own_units([expression] if expression is not None else []))


def read_speech_entry(entry: Entry, folder: Path, *, files: bool = True) -> Said:
    """Return the speech of a script's entry: a file of timings beside it, a text, or a mapping. TableError.

    files: whether it may name files.
    """
    if not isinstance(entry.value, dict):
        value = entry.text()
        asked: dict[str, object] = {"timing" if Path(value).suffix.lower() in SUFFIXES else "text": value}
        fields: dict[str, Entry] = {}
    else:
        fields = entry.fields(optional=(*_WAYS, *_OF, "at", "effort", "sound"))
        if sum(key in fields for key in _WAYS) != 1:
            raise entry.fail(f"give one of {', '.join(_WAYS)}")
        for key, ways in _OF.items():
            if key in fields and not any(way in fields for way in ways.split(" and ")):
                raise fields[key].fail(f"{key} belongs to {ways}")
        asked = {key: fields[key].text() for key in (*_WAYS, "language", "tier", "sound") if key in fields}
        if "alphabet" in fields:
            asked["alphabet"] = fields["alphabet"].choice(ALPHABETS, "alphabet")
        if "speed" in fields:
            asked["speed"] = fields["speed"].number(0.1, 10.0)
    for key in ("timing", "sound"):
        if key in asked:
            if not files:
                raise fields.get(key, entry).fail(NO_FILES)
            asked[key] = folder / str(asked[key])           # files lie beside the script
    try:
        said = say(**asked)
    except FacegenError as error:
        raise entry.fail(str(error)) from error
    return Said(said.speech, said.sound, fields["at"].number(0.0, LONGEST) if "at" in fields else 0.0,
                fields["effort"].number(0.0, 2.0) if "effort" in fields else 1.0)

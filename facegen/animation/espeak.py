"""Text to sounds, times and a voice by espeak-ng, where it is installed.

espeak-ng knows rules and dictionaries of more than a hundred languages. It is a program of its own, never a part of
facegen: its library runs in another process (`espeak_library.py`) and says to the sample where each sound of its voice
begins. Where only the program is found, its IPA is spread over the length of its sound by how long sounds last by
themselves, and that is said.
"""

from __future__ import annotations

import ctypes.util
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np

from facegen.animation import espeak_library
from facegen.animation.phonemes import Sound as Phone
from facegen.animation.phonemes import read_sounds
from facegen.animation.speech import LEAD, SHORTEST, TAIL, Speech, TimedSound, check_speed, spread
from facegen.animation.speech_table import PAUSE, load_speech_table
from facegen.errors import InputError, NotationError, nearest
from facegen.fileio.sound import Sound, read_wav

WORDS_A_MINUTE = 165
"""At speed 1: a little calmer than espeak-ng's own 175."""

MOST_TEXT = 20_000
"""Characters of one text: about twenty minutes."""

_BREATH = 0.05                  # seconds; a pause that is shorter is none to the mouth
_CLOSURE = 0.09                 # seconds; the longest that a mouth is closed before a burst
_QUIET = 0.01                   # of the loudest sample: what is silent
_LONGEST_RUN = 600.0            # seconds that espeak-ng may take
_PATIENCE = 20.0                # seconds for a short answer
_HOW = ("espeak-ng, which reads text, is not installed: apt-get install espeak-ng (Debian, Ubuntu), brew install "
        "espeak-ng (macOS), winget install eSpeak-NG.eSpeak-NG (Windows); or give the sounds yourself with phonemes or "
        "a file of timings")
_FOLDERS = ("/opt/homebrew", "/usr/local", "/opt/local")
_WINDOWS = ("C:/Program Files/eSpeak NG", "C:/Program Files (x86)/eSpeak NG")


@dataclass(frozen=True, eq=False)
class Spoken:
    """What espeak-ng made of a text: sounds at times, and the voice, on one clock."""

    speech: Speech
    sound: Sound


def speak(text: str, *, language: str = "en-us", speed: float = 1.0) -> Spoken:
    """Return a text spoken by espeak-ng, with a moment of rest before and after.

    language: a language or voice of espeak-ng (``en``, ``en-us``, ``de``, ``fr``, ``es``, ``it``, ``ja``, ...).
    speed: 2 is twice as fast. Raises InputError, among others if espeak-ng is not installed. ::

        speak("Guten Morgen", language="de").speech.visemes
    """
    if not isinstance(text, str) or not text.strip():
        raise InputError(f"text: expected something to say, got {text!r}")
    if len(text) > MOST_TEXT:
        raise InputError(f"text: expected {MOST_TEXT} characters at most, got {len(text)}; speak it in parts")
    if "\0" in text:
        raise InputError("text: holds a NUL character, which nobody can say")
    check_speed(speed)
    program = _program()
    voice = _voice(language, program)
    warnings = _unreadable(text, language)
    with tempfile.TemporaryDirectory(prefix="facegen-speak-") as folder:
        wav = Path(folder) / "voice.wav"
        found = _by_library(text, voice, speed, wav)
        if found is None and program is not None:
            found = _by_program(text, voice, speed, wav, program)
            warnings += ("the library of espeak-ng was not found, only its program: the times of the sounds are "
                         "estimated from the length of what it said",)
        if found is None:
            raise InputError(_HOW)
        sound = read_wav(wav)
    sounds, odd = found
    if not sounds or all(one.is_pause for one in sounds):
        raise InputError(f"text: espeak-ng finds nothing to say in {text[:60]!r} as {language}")
    speech = Speech(tuple(sounds), max(sound.duration, sounds[-1].end) + TAIL, {
        "text": text, "language": language, "voice": "espeak-ng"}, warnings + odd)
    return Spoken(replace(speech.later(LEAD), duration=speech.duration + LEAD), sound.after(LEAD))


def installed() -> bool:
    """Return whether espeak-ng is there."""
    return _program() is not None


def languages() -> tuple[str, ...]:
    """Return what espeak-ng can be asked for, by code; InputError if it is not installed."""
    program = _program()
    if program is None:
        raise InputError(_HOW)
    return _languages(program)


def _program() -> str | None:
    for name in ("espeak-ng", *(f"{folder}/espeak-ng.exe" for folder in _WINDOWS)):
        if found := shutil.which(name):
            return found
    return None


@cache
def _languages(program: str) -> tuple[str, ...]:
    listed = _run([program, "--voices"], "").stdout.splitlines()[1:]
    found: dict[str, None] = {}
    for line in listed:                 # " 5  de   --/M  German  gmw/de  (x 5)": the second is the code
        if len(parts := line.split()) > 2:
            found[parts[1]] = None
    return tuple(found)


def _voice(language: str, program: str | None) -> str:
    """Return a language that espeak-ng has; InputError names the nearest."""
    if not isinstance(language, str):
        raise InputError(f"language: expected a code such as en, de or fr, got {language!r}")
    if program is None:
        return language
    known = {code.casefold(): code for code in _languages(program)}
    wanted = language.strip().casefold().replace("_", "-")
    if wanted in known:
        return known[wanted]
    if wanted == "en" or wanted.split("-")[0] not in {code.split("-")[0] for code in known}:
        if wanted == "en":
            return "en"
        raise InputError(f"language: espeak-ng has no '{language}'{nearest(language, known.values())} "
                         "(espeak-ng --voices lists them)")
    return wanted.split("-")[0] if wanted.split("-")[0] in known else \
        next(code for code in known.values() if code.split("-")[0] == wanted.split("-")[0])


def _unreadable(text: str, language: str) -> tuple[str, ...]:
    if language.split("-")[0] == "ja" and any("\u4e00" <= letter <= "\u9fff" for letter in text):
        return ("espeak-ng reads Japanese in kana only and spells kanji out; write the text in kana",)
    return ()


def _by_library(text: str, voice: str, speed: float, wav: Path) -> tuple[list[TimedSound], tuple[str, ...]] | None:
    """Return sounds at the times of the voice, by the library; None if it is not there or fails."""
    for library in _libraries():
        request = {"library": library, "voice": voice, "text": text, "rate": round(WORDS_A_MINUTE * speed),
                   "wav": str(wav)}
        # -I: nothing of the caller's folder or environment is imported
        done = _run([sys.executable, "-I", espeak_library.__file__], json.dumps(request), _LONGEST_RUN)
        if done.returncode == 0:
            answer = json.loads(done.stdout)
            made, said = _timed(answer["events"], answer["rate"], answer["samples"])
            return closed_before(made, read_wav(wav)), said
        if done.returncode == espeak_library.NO_VOICE:
            raise InputError(f"language: espeak-ng has no '{voice}' (espeak-ng --voices lists what it has)")
    return None


def _libraries() -> list[str]:
    names = [ctypes.util.find_library("espeak-ng"), "libespeak-ng.so.1"]
    places = [f"{folder}/lib/libespeak-ng.dylib" for folder in _FOLDERS]
    places += [f"{folder}/libespeak-ng.dll" for folder in _WINDOWS]
    return [*dict.fromkeys(name for name in names if name), *(place for place in places if os.path.exists(place))]


def _timed(events: Sequence[tuple[int, str]], rate: int, samples: int) -> tuple[list[TimedSound], tuple[str, ...]]:
    """Return sounds of events (sample, IPA); each lasts until the next begins."""
    table, made, odd = load_speech_table(), [], {}
    marks = [(max(0, sample), name) for sample, name in events]
    for k, (sample, name) in enumerate(marks):
        start, end = sample / rate, (marks[k + 1][0] if k + 1 < len(marks) else samples) / rate
        if made:
            start = max(start, made[-1].end)
        if end - start < SHORTEST:
            continue
        silent = not name.strip("_")
        if silent and made and (made[-1].is_pause or end - start < _BREATH):
            made[-1] = replace(made[-1], end=end)       # a seam between sounds, or a pause that goes on
            continue
        try:
            phones = [Phone(table.pause, PAUSE)] if silent else read_sounds(name, "ipa")
        except NotationError:
            odd[name] = None
            phones = []
        made += spread(phones, start, end)
    said = (f"espeak-ng says {', '.join(odd)}, which the table of sounds does not have: left out",) if odd else ()
    return made, said


def closed_before(sounds: Sequence[TimedSound], sound: Sound) -> list[TimedSound]:
    """Return sounds whose stops begin where the mouth closes: espeak-ng marks their burst.

    What is silent before a burst, at the end of the sound before it, is the stop's.
    """
    loud = np.abs(sound.samples.astype(np.float64))
    quiet, made = _QUIET * float(loud.max(initial=1.0)), []
    for one in sounds:
        if one.phoneme.kind in ("stop", "affricate") and "sil" not in one.phoneme.visemes[0]:
            last = round(one.start * sound.rate)
            first = max(0, last - round(_CLOSURE * sound.rate))
            heard = np.flatnonzero(loud[first:last] > quiet)
            start = max(first + (int(heard[-1]) + 1 if len(heard) else 0), 0) / sound.rate
            before = made[-1] if made else None
            if before is not None:
                start = max(start, before.start + 0.4 * (before.end - before.start))
            if start < one.start:
                if before is not None:
                    made[-1] = replace(before, end=min(before.end, start))
                one = replace(one, start=start)
        made.append(one)
    return made


def _by_program(text: str, voice: str, speed: float, wav: Path, program: str
                ) -> tuple[list[TimedSound], tuple[str, ...]]:
    """Return sounds at estimated times: the program's IPA over the length of its sound."""
    options = [program, "-v", voice, "-s", str(round(WORDS_A_MINUTE * speed)), "-b", "1", "--stdin"]
    done = _run([*options, "-q", "--ipa", "--sep=_"], text, _LONGEST_RUN)
    voiced = _run([*options, "-w", str(wav)], text, _LONGEST_RUN)
    if done.returncode or voiced.returncode or not wav.exists():
        raise InputError(f"text: espeak-ng failed: {(done.stderr or voiced.stderr).strip()[:200]}")
    phones = read_sounds(" , ".join(line.strip() for line in done.stdout.splitlines() if line.strip()), "ipa")
    return spread(phones, 0.03, read_wav(wav).duration), ()


def _run(command: list[str], text: str, seconds: float = _PATIENCE) -> subprocess.CompletedProcess[str]:
    try:
        return subprocess.run(command, input=text, capture_output=True, text=True, encoding="utf-8", errors="replace",
                              timeout=seconds, check=False)
    except subprocess.TimeoutExpired:
        raise InputError(f"espeak-ng did not answer within {seconds:g} s") from None
    except OSError as error:
        raise InputError(f"espeak-ng cannot be run: {error}") from error

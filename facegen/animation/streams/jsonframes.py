"""A JSON file as frames: a list, an object with a list, or one object a line; read as far as it goes."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, TypeVar

from facegen.animation.streams.times import places
from facegen.errors import FileError

MOST_BYTES = 1_000_000_000
"""Because the text is held in memory; an hour of blendshapes is a third of this, a quarter with landmarks all."""

Kept = TypeVar("Kept")

_LISTS = ("frames", "results", "data")
_GAP = re.compile(r"[\s,]*")
# An object that begins with plain values and a list of frames: then each frame is read by itself.
_BEGINNING = re.compile(r'\s*\{\s*(?:"[^"\\]*"\s*:\s*(?:"[^"\\]*"|[^\s",{}\[\]]+)\s*,\s*)*'
                        rf'"(?:{"|".join(_LISTS)})"\s*:\s*\[')


@dataclass(frozen=True)
class Frame:
    """One frame's value."""

    value: Any

    def get(self, *keys: str) -> Any:
        """Return the value of the first of several keys, whatever its capitals; also of an inner "results"; or None."""
        places = [self.value]
        if isinstance(self.value, dict):
            places += [self.value[key] for key in ("results", "result", "faceLandmarkerResult")
                       if isinstance(self.value.get(key), dict)]
        for place in places:
            if isinstance(place, dict):
                folded = {key.casefold(): value for key, value in place.items()}
                for key in keys:
                    if folded.get(key) is not None:
                        return folded[key]
        return None


def frames_of(path: Path, keep: Callable[[Frame], Kept]) -> tuple[list[Kept], list[int], list[str]]:
    """Return what is kept of each frame of a file, the frames' lines, and what was odd.

    keep: takes of a frame what is needed: the rest is forgotten before the next is read. FileError: no such file, too
    large, no JSON, no frames.
    """
    try:
        if path.stat().st_size > MOST_BYTES:
            raise FileError(f"{path}: larger than {MOST_BYTES // 1_000_000} MB; write one frame a line and split it")
        text = path.read_bytes().decode("utf-8-sig")
    except FileNotFoundError:
        raise FileError(f"{path}: there is no such file") from None
    except UnicodeDecodeError as error:
        raise FileError(f"{path}: not UTF-8 text (byte {error.start}); save it as UTF-8") from None
    except (OSError, ValueError) as error:
        raise FileError(f"{path}: cannot be read ({'it is a folder' if path.is_dir() else error})") from None
    reader = _Reader(path, text, keep)
    reader.read()
    if not reader.kept:
        raise FileError(f"{path}: has no frames")
    bad = [f"{places(reader.broken)}: cannot be read as JSON; left out"] if reader.broken else []
    return reader.kept, reader.lines, bad + reader.said


class _Reader(Generic[Kept]):
    """Reads one value after the other, so that what stops in the middle loses its last one only."""

    def __init__(self, path: Path, text: str, keep: Callable[[Frame], Kept]) -> None:
        self.path, self.text, self.keep = path, text, keep
        self.decoder = json.JSONDecoder(parse_constant=lambda word: None)      # NaN counts as missing
        self.counted, self.line = 0, 1
        self.kept: list[Kept] = []
        self.lines: list[int] = []
        self.said: list[str] = []
        self.broken: list[int] = []

    def read(self) -> None:
        """Read all frames."""
        start = len(self.text) - len(self.text.lstrip())
        if self.text[start:start + 1] == "[":
            return self._values(start + 1, listed=True)
        if found := _BEGINNING.match(self.text):
            return self._values(found.end(), listed=True)
        first = self._value(start)
        if first is None:
            raise self._broken(start)
        value, end = first
        inside = next((value[key] for key in _LISTS if isinstance(value.get(key), list)), None) \
            if isinstance(value, dict) else None
        if inside is None or self.text[end:].strip():   # a result by itself, or the first of one a line
            return self._values(start, listed=False)
        for one in inside:
            self._take(one, self._line(start))
        return None

    def _values(self, at: int, *, listed: bool) -> None:
        while True:
            at = _GAP.match(self.text, at).end()
            if at >= len(self.text) or self.text[at] in "]}":
                if listed and at >= len(self.text):
                    self.said.append(f"the file stops before its list ends; its {len(self.kept)} frames are kept")
                return
            found = self._value(at)
            if found is None:
                if not self.kept:
                    raise self._broken(at)
                return self._lines_from(at)
            value, at_end = found
            self._take(value, self._line(at))
            at = at_end

    def _lines_from(self, at: int) -> None:
        """Read on line by line where one could not be read. Each by itself, because an error costs all the text it is
        found in."""
        while True:
            after = self.text.find("\n{", at)
            piece, place = self.text[at:after if after >= 0 else len(self.text)], 0
            while (place := _GAP.match(piece, place).end()) < len(piece) and piece[place] not in "]}":
                line, found = self._line(at + place), self._value(place, piece)
                if found is None and after < 0:
                    self.said.append(f"line {line}: the file stops in the middle of a frame, or cannot be read from "
                                     f"here; the {len(self.kept)} frames before it are kept")
                elif found is None:
                    self.broken.append(line)
                if found is None:
                    break
                self._take(found[0], line)
                place = found[1]
            if after < 0:
                return
            at = after + 1

    def _take(self, value: Any, line: int) -> None:
        self.kept.append(self.keep(Frame(value)))
        self.lines.append(line)

    def _value(self, at: int, text: str | None = None) -> tuple[Any, int] | None:
        try:
            return self.decoder.raw_decode(self.text if text is None else text, at)
        except RecursionError:
            raise FileError(f"{self.path}: line {self._line(at)}: nested too deeply") from None
        except ValueError:                              # also an integer of thousands of digits
            return None

    def _line(self, at: int) -> int:
        self.line += self.text.count("\n", self.counted, at)
        self.counted = max(at, self.counted)
        return self.line

    def _broken(self, at: int) -> FileError:
        try:
            self.decoder.raw_decode(self.text, at)
            why = "no frames"
        except json.JSONDecodeError as error:
            why = f"line {error.lineno}, column {error.colno}: {error.msg}"
        except ValueError as error:
            why = str(error)[:80]
        return FileError(f"{self.path}: cannot be read as JSON: {why}")

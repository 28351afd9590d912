"""A JSON file as frames: a list, an object with a list, or one object a line; read as far as it goes."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from facegen.errors import FileError

MOST_BYTES = 400_000_000
"""Because parsed JSON takes up to thirty times its text, and an hour of blendshapes is a quarter of this."""

_LISTS = ("frames", "results", "data")
_GAP = re.compile(r"[\s,]*")


@dataclass(frozen=True)
class Frame:
    """One frame's value, and the line it begins in."""

    value: Any
    line: int

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


def frames_of(path: Path) -> tuple[list[Frame], list[str]]:
    """Return the frames of a file and what was odd. FileError: no such file, too large, no JSON, no frames."""
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
    frames, said = _Reader(path, text).read()
    if not frames:
        raise FileError(f"{path}: has no frames")
    return frames, said


class _Reader:
    """Reads one value after the other, so that what stops in the middle loses its last one only."""

    def __init__(self, path: Path, text: str) -> None:
        self.path, self.text = path, text
        self.decoder = json.JSONDecoder(parse_constant=lambda word: None)      # NaN counts as missing
        self.counted, self.line = 0, 1

    def read(self) -> tuple[list[Frame], list[str]]:
        start = len(self.text) - len(self.text.lstrip())
        if self.text[start:start + 1] == "[":
            return self._values(start + 1, True)
        first = self._value(start)
        if first is None:                               # an object that stops: its list may be there
            found = re.search(rf'"(?:{"|".join(_LISTS)})"\s*:\s*\[', self.text[:10_000])
            if found is None:
                raise self._broken(start)
            return self._values(found.end(), True)
        value, end = first
        if isinstance(value, dict):
            inside = next((value[key] for key in _LISTS if isinstance(value.get(key), list)), None)
            if inside is not None and not self.text[end:].strip():
                return [Frame(one, self._line(start)) for one in inside], []
            if inside is None or self.text[end:].strip():
                return self._values(start, False)
        raise FileError(f"{self.path}: expected a list of frames, or an object with one")

    def _values(self, at: int, listed: bool) -> tuple[list[Frame], list[str]]:
        frames, said = [], []
        while True:
            at = _GAP.match(self.text, at).end()
            if at >= len(self.text) or self.text[at] in "]}":
                if listed and at >= len(self.text):
                    said.append(f"the file stops before its list ends; its {len(frames)} frames are kept")
                return frames, said
            found = self._value(at)
            if found is None:
                if not frames:
                    raise self._broken(at)
                rest = self.text[at:]
                line = self._line(at)
                after = rest.find("\n{")
                if after < 0 or not rest[after:].strip():
                    said.append(f"line {line}: the file stops in the middle of a frame, or cannot be read from here; "
                                f"the {len(frames)} frames before it are kept")
                    return frames, said
                said.append(f"line {line}: cannot be read as JSON; left out")      # one result a line: go on
                at += after + 1
                continue
            value, end = found
            frames.append(Frame(value, self._line(at)))
            at = end

    def _value(self, at: int) -> tuple[Any, int] | None:
        try:
            return self.decoder.raw_decode(self.text, at)
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

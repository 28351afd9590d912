"""Praat's TextGrid, long and short form: tiers of labelled stretches of time.

Both forms are one grammar, Praat's general text file: free-standing numbers, "texts" and <flags> in a fixed order; what
else stands there is for readers (fon.hum.uva.nl/praat/manual/TextGrid_file_formats.html).
"""

from __future__ import annotations

import codecs
import math
import re
from dataclasses import dataclass
from pathlib import Path

from facegen.errors import FileError

MAX_BYTES = 16_000_000
"""Bytes of one file: days of speech."""

_TOKEN = re.compile(r'"((?:[^"]|"")*+)"|![^\n]*|(\S+)')
_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?", re.ASCII)


@dataclass(frozen=True)
class Tier:
    """A named row of intervals (start, end, label); seconds, in order of time. line: where it stands in the file."""

    name: str
    intervals: tuple[tuple[float, float, str], ...]
    line: int = 0


def read_text(path: Path, *, most: int = MAX_BYTES) -> str:
    """Return a text in UTF-8, UTF-16 (with its mark) or Latin-1, as Praat writes; FileError."""
    try:
        with path.open("rb") as file:
            raw = file.read(most + 1)
    except FileNotFoundError as error:
        raise FileError(f"{path}: there is no such file") from error
    except (OSError, ValueError) as error:
        raise FileError(f"{path}: cannot be read ({'it is a folder' if path.is_dir() else error})") from error
    if len(raw) > most:
        raise FileError(f"{path}: larger than {most // 1_000_000} MB, which no recording's labels need")
    for mark in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE):
        if raw.startswith(mark):
            try:
                return raw.decode("utf-16")
            except UnicodeDecodeError as error:
                raise FileError(f"{path}: not UTF-16 text as its mark says (byte {error.start})") from error
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        return raw.decode("latin-1")


def parse_textgrid(text: str, source: str) -> list[Tier]:
    """Return the interval tiers of a TextGrid's text; points in time are left out. ``source`` names it in errors.

    Raises FileError, which names the line.
    """
    return _Reader(text, source).tiers()


class _Reader:
    """One pass over the tokens of a file."""

    def __init__(self, text: str, source: str) -> None:
        self.source = source
        self.text = text
        self.tokens = self._tokens(text)
        self.at = 0
        self.place = 0

    def tiers(self) -> list[Tier]:
        if "ooBinaryFile" in self.text[:40]:
            raise FileError(f"{self.source}: a binary TextGrid; in Praat, save it as a text file")
        if "chronological" in self.text[:80]:
            raise FileError(f"{self.source}: a chronological TextGrid; in Praat, save it as a text file "
                            "or short text file")
        kind = self._text("the file's type")
        if kind.startswith("ooTextFile"):
            kind = self._text("what it is")
        if not kind.startswith("TextGrid"):
            raise self._error(f"expected a TextGrid, got '{kind[:40]}'")
        self._number("the start")
        self._number("the end")
        flag = next(self.tokens, None)
        if flag is None or flag[0] != "flag":
            raise self._error("expected <exists>")
        if flag[1] != "<exists>":
            raise self._error("the TextGrid has no tiers")
        found = []
        for _ in range(self._count("tiers")):
            kind, line = self._text("the kind of a tier"), self._line()
            if kind not in ("IntervalTier", "TextTier"):
                raise self._error(f"expected IntervalTier or TextTier, got '{kind[:40]}'")
            name = self._text("the tier's name")
            self._number("the tier's start")
            self._number("the tier's end")
            count = self._count(f"entries of tier '{name}'")
            if kind == "TextTier":
                for _ in range(count):
                    self._number("a point's time")
                    self._text("a point's mark")
                continue
            found.append(Tier(name, tuple(self._intervals(count)), line))
        return found

    def _intervals(self, count: int):
        last = -math.inf
        for _ in range(count):
            start, end = self._number("an interval's start"), self._number("an interval's end")
            if not start <= end or start < last - 1e-6:
                raise self._error(f"expected intervals in order of time, got {start:g} to {end:g} after {last:g}")
            last = end
            yield start, end, self._text("an interval's label")

    @staticmethod
    def _tokens(text: str):
        for found in _TOKEN.finditer(text):
            if found[1] is not None:
                yield "text", found[1].replace('""', '"'), found.start()
            elif found[2] is not None:
                if _NUMBER.fullmatch(found[2]):
                    yield "number", found[2], found.start()
                elif found[2].startswith("<") and found[2].endswith(">"):
                    yield "flag", found[2], found.start()

    def _next(self, kind: str, what: str) -> str:
        token = next(self.tokens, None)
        if token is None:
            self.place = len(self.text)
            raise self._error(f"the file ends where {what} should stand")
        self.place = token[2]
        if token[0] != kind:
            raise self._error(f"expected {what} (a {kind}), got the {token[0]} '{token[1][:40]}'")
        return token[1]

    def _text(self, what: str) -> str:
        return self._next("text", what)

    def _number(self, what: str) -> float:
        value = float(self._next("number", what))
        if not math.isfinite(value):
            raise self._error(f"expected {what} in seconds, got {value}")
        return value

    def _count(self, what: str) -> int:
        value = self._number(f"the number of {what}")
        if value < 0 or value != int(value) or value > len(self.text):
            raise self._error(f"expected a number of {what} that the file can hold, got {value:g}")
        return int(value)

    def _line(self) -> int:
        return self.text.count("\n", 0, self.place) + 1

    def _error(self, message: str) -> FileError:
        return FileError(f"{self.source}: line {self._line()}: {message}")

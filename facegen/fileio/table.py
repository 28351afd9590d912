"""Tables as text (CSV and its kin) of unknown make: columns by name, every oddity told with its line.

Read line by line, so that a broken file costs what its first broken line costs. What is understood: comma, semicolon
or tab; a decimal comma beside the latter two; quotes; UTF-8 with or without a byte-order mark, UTF-16, single lines in
Latin-1; any line ends. What cannot be understood is left out and told in `Table.warnings`: a line with another number
of fields than the header (whole), a text where a column has numbers (that cell becomes NaN).
"""

from __future__ import annotations

import csv
import math
import re
from array import array
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from facegen.errors import FileError, nearest

MOST_COLUMNS = 10_000
"""Because the widest recordings that people have (478 landmarks, three numbers each, and more) are a fifth of it."""

LONGEST_LINE = 1_000_000
"""Characters: a hundred for each of `MOST_COLUMNS`."""

MOST_CELLS = 150_000_000
"""Because each takes eight bytes or more: an hour of OpenFace with all its landmarks is half of it."""

_SNIFFED = 50                       # lines that say which columns are numbers
_TOLD = 3                           # places that a warning names before it counts
_MISSING = frozenset(("", "nan", "na", "n/a", "#n/a", "null", "none", "-nan", "nan(ind)", "-nan(ind)", "1.#qnan"))


@dataclass(frozen=True)
class Table:
    """Columns of n rows. ``lines``: (n,) where each row stands in the file, from 1.

    numbers: column -> (n,) with NaN where there is none. texts: column -> n texts. columns: all names, in order.
    cut: the file stops in the middle of a line (which is left out).
    """

    path: Path
    columns: tuple[str, ...]
    lines: NDArray[np.int64]
    numbers: dict[str, NDArray[np.float64]]
    texts: dict[str, list[str]]
    warnings: tuple[str, ...] = ()
    cut: bool = False

    def __len__(self) -> int:
        return len(self.lines)

    def find(self, name: str) -> str | None:
        """Return how the file spells a column, whatever its capitals and spaces, or None."""
        return name if name in self.numbers or name in self.texts else self._spelt.get(fold(name))

    def column(self, name: str) -> NDArray[np.float64]:
        """Return the numbers (n,) of a column; FileError if there is no such column or it holds texts."""
        found = self.find(name)
        if found is None:
            raise FileError(f"{self.path}: there is no column '{name}'{nearest(name, self.columns)}")
        if found not in self.numbers:
            raise FileError(f"{self.path}: line {int(self.lines[0])}: column '{found}': expected numbers, "
                            f"got {shown(self.texts[found][0])}")
        return self.numbers[found]

    @cached_property
    def _spelt(self) -> dict[str, str]:
        return {fold(name): name for name in reversed(self.columns)}


def fold(name: str) -> str:
    """Return a column's name without spaces and capitals."""
    return re.sub(r"\s+", "", name).casefold()


def are_numbers(names: Sequence[str]) -> bool:
    """Return whether most of what should be names are numbers: a header that is missing."""
    return 2 * sum(_number(name, ";") is not None for name in names) > len(names)


def shown(text: str) -> str:
    """Return a text as it may stand in a message: quoted, short."""
    return repr(text if len(text) <= 40 else text[:37] + "...")


def head_of(path: Path, size: int = 65536) -> bytes:
    """Return the first bytes of a file; FileError if it cannot be read or there are none."""
    try:
        with path.open("rb") as file:
            head = file.read(size)
    except FileNotFoundError:
        raise FileError(f"{path}: there is no such file") from None
    except (OSError, ValueError) as error:              # ValueError: a NUL in the path
        raise FileError(f"{path}: cannot be read ({'it is a folder' if path.is_dir() else error})") from None
    if not head.strip():
        raise FileError(f"{path}: is empty")
    return head


def header_of(head: bytes) -> tuple[str, ...]:
    """Return the names in the first line of a table's first bytes; none if it is no text."""
    encoding = _encoding(head)
    if encoding is None:
        return ()
    lines = head.decode(encoding, errors="replace").splitlines()
    while lines and (not lines[0].strip() or _is_sep(lines[0])):
        lines.pop(0)
    return _names(lines[0]) if lines and len(lines[0]) <= LONGEST_LINE else ()


def read_table(path: Path, *, short: Callable[[list[str]], bool] | None = None) -> Table:
    """Return the table of a file. ``short`` says of a row with too few fields whether it is whole nevertheless.

    FileError: no such file, no text, no header, no row that can be read, wider than `MOST_COLUMNS`, too large.
    """
    return _Reader(path, short).read()


class _Reader:
    """One pass over a file."""

    def __init__(self, path: Path, short: Callable[[list[str]], bool] | None) -> None:
        self.path, self.short = path, short
        self.told: dict[str, list[str]] = {}            # kind of oddity -> places
        self.lines = array("q")
        self.cut = False

    def read(self) -> Table:
        lines = _lines(self.path, self._tell)
        first = next(((k, text) for k, text in lines if text.strip() and not _is_sep(text)), None)
        if first is None:
            raise FileError(f"{self.path}: is empty")
        self._header(*first)
        rows = self._rows(lines)
        ahead = [row for _, row in zip(range(_SNIFFED), rows, strict=False)]
        if not ahead:
            raise FileError(f"{self.path}: no row can be read below the header in line {first[0]}"
                            + "".join(f"; {warning}" for warning in self._warnings()))
        is_text = [self._is_text([row[k] for _, row in ahead]) for k in range(self.width)]
        numeric = [k for k in range(self.width) if not is_text[k]]
        wordy = [k for k in range(self.width) if is_text[k]]
        flat, words = array("d"), {k: [] for k in wordy}
        for block in (ahead, rows):
            for line, row in block:
                flat.extend(self._numbers(line, row, numeric))
                for k in wordy:
                    words[k].append(row[k])
                self.lines.append(line)
                if len(self.lines) * self.width > MOST_CELLS:
                    raise FileError(f"{self.path}: line {line}: more than {MOST_CELLS:,} numbers; "
                                    f"split the recording, or leave out columns that are not needed")
        values = np.frombuffer(flat, dtype=np.float64).reshape(len(self.lines), len(numeric))
        return Table(self.path, self.names, np.array(self.lines, dtype=np.int64),
                     {self.names[k]: np.ascontiguousarray(values[:, i]) for i, k in enumerate(numeric)},
                     {self.names[k]: column for k, column in words.items()}, self._warnings(), self.cut)

    def _header(self, line: int, text: str) -> None:
        if len(text) > LONGEST_LINE:
            raise FileError(f"{self.path}: line {line}: longer than {LONGEST_LINE:,} characters, "
                            f"which no recording is: expected at most {MOST_COLUMNS:,} columns")
        self.delimiter = _delimiter(text)
        names = _names(text)
        if len(names) > MOST_COLUMNS:
            raise FileError(f"{self.path}: line {line}: {len(names):,} columns; expected at most {MOST_COLUMNS:,}")
        if are_numbers(names):
            raise FileError(f"{self.path}: line {line}: expected the names of the columns, got numbers "
                            f"({shown(text.strip())}): put the header back on top")
        if len(names) > 1 and not names[-1]:
            names = names[:-1]                          # a comma at the end of each line
        twice = [name for name, count in Counter(names).items() if count > 1]
        self.fields, self.keep = len(names), list(range(len(names)))
        if twice:
            seen: set[str] = set()
            self.keep = [k for k, name in enumerate(names) if not (name in seen or seen.add(name))]
            self._tell("columns given twice, of which the first counts", ", ".join(map(repr, twice[:_TOLD])))
        self.names = tuple(names[k] for k in self.keep)
        self.width = len(self.names)

    def _rows(self, lines: Iterable[tuple[int, str]]) -> Iterator[tuple[int, list[str]]]:
        """Yield the line and the cells of each row that has a cell for each name."""
        for line, text in lines:
            if len(text) > LONGEST_LINE:
                raise FileError(f"{self.path}: line {line}: longer than {LONGEST_LINE:,} characters")
            if not text.strip():
                continue
            cells = _cells(text, self.delimiter)
            if len(cells) > self.fields and not any(cell.strip() for cell in cells[self.fields:]):
                cells = cells[:self.fields]
            if len(cells) < self.fields and self.short is not None and self.short(cells):
                cells += [""] * (self.fields - len(cells))
            if len(cells) != self.fields:
                if len(cells) < self.fields and not text.endswith("\n"):
                    self.cut = True
                    self._tell("the file stops in the middle of a line, which is left out", str(line))
                else:
                    self._tell(f"left out, for they do not have the header's {self.fields} fields",
                               f"{line} ({len(cells)})")
                continue
            yield line, cells if len(self.keep) == self.fields else [cells[k] for k in self.keep]

    def _is_text(self, cells: list[str]) -> bool:
        there = [cell for cell in cells if cell.strip().casefold() not in _MISSING]
        return 2 * sum(_number(cell, self.delimiter) is None for cell in there) > len(there)

    def _numbers(self, line: int, row: list[str], numeric: list[int]) -> list[float]:
        try:
            values = [float(row[k]) for k in numeric]
            if math.isfinite(sum(values)) and not any("_" in row[k] for k in numeric):
                return values
        except ValueError:
            pass
        values = []
        for k in numeric:
            value = math.nan
            if row[k].strip().casefold() not in _MISSING:
                found = _number(row[k], self.delimiter)
                if found is None:
                    self._tell("no numbers, and counted as missing",
                               f"{shown(row[k].strip())} in line {line}, column '{self.names[k]}'")
                else:
                    value = found
            values.append(value)
        return values

    def _tell(self, kind: str, place: str) -> None:
        self.told.setdefault(kind, []).append(place)

    def _warnings(self) -> tuple[str, ...]:
        said = []
        for kind, places in self.told.items():
            more = f" and {len(places) - _TOLD} more" if len(places) > _TOLD else ""
            where = ", ".join(places[:_TOLD]) + more
            if places[0][0].isdigit():
                where = ("lines " if len(places) > 1 else "line ") + where
            said.append(f"{where}: {kind}")
        return tuple(said)


def _lines(path: Path, tell: Callable[[str, str], None]) -> Iterator[tuple[int, str]]:
    """Yield the number and the text, with its line end, of each line; one that is too long ends what is yielded."""
    encoding = _encoding(head_of(path))
    if encoding is None:
        raise FileError(f"{path}: is no text; a recording as a table (CSV) was expected")
    errors = "surrogateescape" if encoding == "utf-8-sig" else "replace"
    with path.open(encoding=encoding, errors=errors, newline=None) as file:
        line = 0
        while text := file.readline(LONGEST_LINE + 2):
            line += 1
            if not text.isascii():
                try:
                    text.encode()
                except UnicodeEncodeError:
                    text = text.encode("utf-8", "surrogateescape").decode("latin-1")
                    tell("no UTF-8, and read as Latin-1", str(line))
            yield line, text


def _encoding(head: bytes) -> str | None:
    """Return the encoding of a text by its first bytes, or None for what is no text."""
    if head[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return "utf-16"
    if b"\0" not in head:
        return "utf-8-sig"
    if len(head) > 3 and not any(head[1:64:2]):
        return "utf-16-le"
    return "utf-16-be" if len(head) > 3 and not any(head[:64:2]) else None


def _is_sep(text: str) -> bool:
    return re.fullmatch(r"\s*sep=.\s*", text) is not None


def _delimiter(text: str) -> str:
    return max(",;\t", key=text.count)


def _names(text: str) -> tuple[str, ...]:
    return tuple(name.strip() for name in _cells(text, _delimiter(text)))


def _cells(text: str, delimiter: str) -> list[str]:
    """Return the fields of one line. A quote that is not closed ends with the line: it cannot swallow the file."""
    text = text.rstrip("\r\n")
    if '"' not in text:
        return text.split(delimiter)
    try:
        return next(csv.reader([text], delimiter=delimiter, skipinitialspace=True), [])
    except csv.Error:
        return text.split(delimiter)


def _number(cell: str, delimiter: str) -> float | None:
    """Return a finite number, or None."""
    if "_" in cell:                                     # Python reads 1_000 as a number; nobody else does
        return None
    if delimiter != "," and cell.count(",") == 1 and "." not in cell:
        cell = cell.replace(",", ".")
    try:
        value = float(cell)
    except ValueError:
        return None
    return value if math.isfinite(value) else None

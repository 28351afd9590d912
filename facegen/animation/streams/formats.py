"""The formats of recordings that are read and written: who knows a file by its content, who reads, who writes.

A format is one entry of `FORMATS`; `register` adds another. The door to them is `facegen.animation.streams.files`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from facegen.animation.performance import Performance
from facegen.errors import FileError, InputError, nearest
from facegen.fileio.table import are_numbers, fold, header_of, shown


@dataclass(frozen=True)
class Wish:
    """What a reader is asked for.

    fps: frames a second of a file that has no times of its own; it also goes before the file's times. person: which
    face, if the file has several. presence: the weight of a unit that the file only calls present.
    """

    fps: float | None = None
    person: str | None = None
    presence: float | None = None


@dataclass(frozen=True)
class Sample:
    """A file by its name and its first bytes, to be known by."""

    path: Path
    head: bytes

    @cached_property
    def names(self) -> tuple[str, ...]:
        """The names in the first line; none if this is no table."""
        return header_of(self.head)

    @cached_property
    def columns(self) -> frozenset[str]:
        """The same without capitals and spaces."""
        return frozenset(map(fold, self.names))

    @cached_property
    def is_json(self) -> bool:
        """Whether the first character is one that JSON begins with."""
        return self.head.removeprefix(b"\xef\xbb\xbf").lstrip()[:1] in (b"{", b"[")


@dataclass(frozen=True)
class Format:
    """One format. ``about``: a line for people. ``suffixes``: what its files end in, the first being usual.

    knows: whether a sample is of this format; they are asked in order. read, write: None where it cannot be.
    vocabulary: what it holds, to which other performances are converted before they are written; None: any. sides: it
    tells left from right. parts: what it holds of head, place and gaze.
    """

    name: str
    about: str
    suffixes: tuple[str, ...]
    knows: Callable[[Sample], bool]
    read: Callable[[Path, Wish], Performance] | None = None
    write: Callable[[Performance, Path], None] | None = None
    vocabulary: str | None = None
    sides: bool = True
    parts: tuple[str, ...] = ("head", "place", "gaze")


FORMATS: dict[str, Format] = {}
"""name -> format, in the order in which they are asked whether they know a file."""


def register(one: Format) -> None:
    """Add a format. InputError if its name is taken."""
    if one.name in FORMATS:
        raise InputError(f"format: there is one called '{one.name}' already")
    FORMATS[one.name] = one


def format_of(name: str, what: str = "format") -> Format:
    """Return a format by its name; InputError, with the nearest."""
    if name not in FORMATS:
        raise InputError(f"{what}: expected {', '.join(FORMATS)}, got {name!r}{nearest(str(name), FORMATS)}")
    return FORMATS[name]


def detect(sample: Sample) -> Format:
    """Return the format that knows a file; FileError if none does."""
    for one in FORMATS.values():
        if one.read is not None and one.knows(sample):
            return one
    names = sample.names
    if are_numbers(names):
        raise FileError(f"{sample.path}: line 1: expected the names of the columns, got numbers "
                        f"({', '.join(names[:4])} ...): put the header back on top")
    seen = ", ".join(map(shown, names[:6]))
    raise FileError(f"{sample.path}: is none of the recordings that are known by their content "
                    f"({', '.join(FORMATS)})" + (f"; its columns begin with {seen}" if seen else "")
                    + "; if it is one of them nevertheless, say which format")


def for_output(path: Path, name: str | None, before: str | None = None) -> Format:
    """Return the format that a file is to be written in: the named one, or by its suffix and what was read before.

    InputError or FileError if there is none, or it cannot be written.
    """
    suffix = path.suffix.lower()
    if name is not None:
        one = format_of(name)
        if one.write is None:
            raise InputError(f"format: {name} can be read, but not written; expected {_written(FORMATS.values())}")
        if suffix not in one.suffixes:
            raise FileError(f"{path}: expected a name that ends in {' or '.join(one.suffixes)} for {name}, "
                            f"got {suffix or 'no suffix'}")
        return one
    fits = [one for one in FORMATS.values() if one.write is not None and suffix in one.suffixes]
    if not fits:
        ends = dict.fromkeys(end for one in FORMATS.values() if one.write is not None for end in one.suffixes)
        raise FileError(f"{path}: expected a name that ends in {', '.join(ends)}, got {suffix or 'no suffix'}"
                        f"{nearest(suffix, ends) if suffix else ''}")
    if len(fits) > 1:
        fits = [one for one in fits if one.name == before] or fits
    if len(fits) > 1:
        raise InputError(f"{path}: say which format it is to be: {_written(fits)}")
    return fits[0]


def _written(several: Sequence[Format]) -> str:
    return ", ".join(one.name for one in several if one.write is not None)

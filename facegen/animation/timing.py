"""How long movements take: ``tables/timing.yaml``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from facegen.animation.easing import DEFAULT_EASE, EASES
from facegen.data import tables_dir
from facegen.errors import FacegenError
from facegen.facs.expressions import resolve
from facegen.facs.validate import Entry
from facegen.facs.yamlfile import read_data

LONGEST = 60.0  # seconds of one part of an event in the table; scripts may ask for more
_PARTS = ("onset", "apex", "offset")


@dataclass(frozen=True)
class Kind:
    """Defaults of one kind of event; times in seconds. ``suits``: expressions that take it by themselves."""

    name: str
    onset: float
    apex: float
    offset: float
    about: str
    source: str
    pose: str | None = None
    onset_ease: str = DEFAULT_EASE
    offset_ease: str = DEFAULT_EASE
    suits: tuple[str, ...] = ()


@dataclass(frozen=True)
class Timing:
    """The whole table: kinds by name, and the numbers of the idle layer."""

    kinds: Mapping[str, Kind]
    blink: Mapping[str, float | tuple[float, float]]
    gaze: Mapping[str, float | tuple[float, float]]
    head: Mapping[str, float | tuple[float, float]]

    def kind_of(self, expression: str | None) -> Kind:
        """Return the kind that an expression takes by itself."""
        found = next((kind for kind in self.kinds.values() if expression in kind.suits), None)
        return found or self.kinds["expression"]


@cache
def load_timing() -> Timing:
    """Return the shipped table, read once."""
    return read_timing(tables_dir() / "timing.yaml")


def read_timing(path: Path) -> Timing:
    """Return the table of a file; TableError names what is wrong in it."""
    fields = Entry(read_data(path), str(path)).fields(required=("sources", "kinds", "idle"))
    sources = {key: entry.text() for key, entry in fields["sources"].items()}
    kinds = {name: _kind(name, entry, sources) for name, entry in fields["kinds"].items()}
    if "expression" not in kinds:
        raise fields["kinds"].fail("the kind 'expression' is missing: it stands for all others")
    idle = fields["idle"].fields(required=("blink", "gaze", "head"))
    return Timing(
        kinds,
        _numbers(idle["blink"], ("mean", "deviation", "double", "complete"), ("double_gap", "partial"), sources),
        _numbers(idle["gaze"], ("delay", "per_degree", "near"), ("hold", "look", "away", "glance"), sources),
        _numbers(idle["head"], ("sway", "breath", "breaths"), (), sources))


def _kind(name: str, entry: Entry, sources: Mapping[str, str]) -> Kind:
    fields = entry.fields(required=(*_PARTS, "about", "source"), optional=("pose", "onset_ease", "offset_ease", "for"))
    times = {part: fields[part].number(0.0, LONGEST) for part in _PARTS}
    if not any(times.values()):
        raise entry.fail("expected an event that takes time, got onset, apex and offset 0")
    eases = {key: fields[key].choice(EASES, "ease") for key in ("onset_ease", "offset_ease") if key in fields}
    suits = fields["for"].texts() if "for" in fields else ()
    pose = fields["pose"].text() if "pose" in fields else None
    for key, text in (("pose", pose), *(("for", word) for word in suits)):
        if text is not None:
            try:
                resolve(text)
            except FacegenError as error:
                raise fields[key].fail(str(error)) from error
    return Kind(name, **times, about=fields["about"].text(), pose=pose, suits=suits, **eases,
                source=sources[fields["source"].choice(sources, "source")])


def _numbers(entry: Entry, single: tuple[str, ...], ranges: tuple[str, ...],
             sources: Mapping[str, str]) -> dict[str, float | tuple[float, float]]:
    """Return checked numbers, none negative, and ranges [low, high]."""
    fields = entry.fields(required=(*single, *ranges, "source"))
    fields["source"].choice(sources, "source")
    result: dict[str, float | tuple[float, float]] = {key: fields[key].number(0.0, LONGEST) for key in single}
    for key in ranges:
        pair = [one.number(0.0, LONGEST) for one in fields[key].each()]
        if len(pair) != 2 or pair[0] > pair[1]:
            raise fields[key].wrong("a range [low, high]")
        result[key] = (pair[0], pair[1])
    return result

"""The catalogue of action units: numbers, names, muscles and sides (Ekman, Friesen, Hager: FACS, 2002
numbering).

A *code* names a unit as a user does: ``12`` (both sides), ``L12``, ``T23``, ``30`` never without a side. An
*atom* is the smallest thing scored: ``L12`` and ``R12``, ``T23`` and ``B23``, ``17``. Weights 0..1
everywhere.
"""

from __future__ import annotations

import bisect
import numbers
import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path

from facegen.data import tables_dir
from facegen.errors import InputError
from facegen.facs.validate import Entry
from facegen.facs.yamlfile import read_data

SIDES = ("none", "both", "direction", "asymmetric")
REGIONS = ("brows", "eyes", "nose", "cheeks", "mouth", "jaw", "tongue", "neck", "head", "gaze")
LETTERS = "ABCDE"
DEFAULT_LETTER = "D"  # of a unit typed without intensity: plain to see, short of the extreme

_CODE = re.compile(r"([LRTB]?)(0|[1-9][0-9]?)", re.ASCII)


@dataclass(frozen=True)
class Unit:
    """One action unit. ``sides``: none; both (scored left and right); direction (a side must be said, like
    L30); asymmetric (one-sided by nature, like a turn of the head). ``variants``: ("T", "B") where lips are
    scored apart. ``plain``: what is seen, for people who do not know the name. ``region``: where, of `REGIONS`."""

    number: str
    name: str
    plain: str
    effect: str
    muscles: tuple[str, ...]
    region: str
    source: str
    sides: str = "none"
    variants: tuple[str, ...] = ()
    parts_lips: bool = False

    @property
    def marks(self) -> tuple[str, ...]:
        """The prefixes of this unit's atoms; one empty prefix where it has no sides."""
        return self.variants or (("L", "R") if self.sides in ("both", "direction") else ("",))

    @property
    def atoms(self) -> tuple[str, ...]:
        """The codes of this unit's atoms."""
        return tuple(mark + self.number for mark in self.marks)

    @property
    def codes(self) -> tuple[str, ...]:
        """Every code a user may write for this unit."""
        if self.marks == ("",):
            return (self.number,)
        return self.atoms if self.sides == "direction" else (self.number, *self.atoms)


@dataclass(frozen=True)
class Catalogue:
    """The units by number, in FACS order; ``letters`` A-E -> weight; what cannot be shown -> why."""

    units: Mapping[str, Unit]
    letters: Mapping[str, float]
    not_shown: Mapping[str, str]
    movements: Mapping[str, str]
    source: str

    @cached_property
    def codes(self) -> tuple[str, ...]:
        """Every valid code."""
        return tuple(code for unit in self.units.values() for code in unit.codes)

    @cached_property
    def atoms(self) -> tuple[str, ...]:
        """Every atom."""
        return tuple(atom for unit in self.units.values() for atom in unit.atoms)

    @property
    def default_weight(self) -> float:
        """The weight of a unit without intensity."""
        return self.letters[DEFAULT_LETTER]

    def unit(self, code: str) -> Unit:
        """Return the unit of a code such as "12" or "L12"; raise InputError, with the reason, if none."""
        match = _CODE.fullmatch(code) if isinstance(code, str) else None
        if match is None:
            raise InputError(f"unit: expected a code such as 12, L12 or T23, got {code!r}")
        problem = self.problem(*match.groups())
        if problem:
            raise InputError(f"unit {code}: {problem}")
        return self.units[match[2]]

    def unit_of(self, code: str) -> Unit:
        """Return the unit of a code that is known to be valid, or of a bare number that needs a side."""
        return self.units[split_code(code)[1]]

    def problem(self, mark: str, number: str) -> str | None:
        """Return what is wrong with a side or lip prefix and a number, or None if they are a code."""
        unit = self.units.get(number)
        if unit is None:
            if number in self.not_shown:
                return self.not_shown[number]
            near = sorted(self.units, key=lambda known: (abs(int(known) - int(number[:6])), int(known)))[:4]
            return f"there is no unit {number[:6]}; near it: {', '.join(sorted(near, key=int))}"
        if mark + number in unit.codes:
            return None
        if not mark:
            return f"{number} ({unit.name.lower()}) needs a side: write L{number} or R{number}"
        if unit.marks == ("",):
            return f"{number} ({unit.name.lower()}) is not scored by side or lip; write {number}"
        return f"{number} ({unit.name.lower()}) has no '{mark}'; write {', '.join(unit.codes)}"

    def expand(self, weights: Mapping[str, float]) -> dict[str, float]:
        """Return atom -> weight for code -> weight; zeros are left out.

        Raises InputError for an unknown code, a weight outside 0..1, or two different weights for one atom.
        """
        result: dict[str, float] = {}
        for code, weight in weights.items():
            unit = self.unit(code)
            if isinstance(weight, bool) or not isinstance(weight, numbers.Real) or not 0.0 <= weight <= 1.0:
                raise InputError(f"unit {code}: expected a weight in 0..1, got {weight!r}")
            for atom in (code,) if code in unit.atoms else unit.atoms:
                if result.setdefault(atom, float(weight)) != weight:
                    raise InputError(f"unit {atom}: given twice, as {result[atom]:g} and as {weight:g}")
        return {atom: weight for atom, weight in result.items() if weight}

    def fold(self, atoms: Mapping[str, float]) -> dict[str, float]:
        """Return code -> weight in FACS order, one plain code where both sides (or lips) agree."""
        result = {}
        for number in sorted({split_code(atom)[1] for atom in atoms}, key=int):
            unit = self.units[number]
            found = {atom: atoms[atom] for atom in unit.atoms if atom in atoms}
            if len(found) == len(unit.marks) and unit.number in unit.codes and len(set(found.values())) == 1:
                found = {unit.number: next(iter(found.values()))}
            result |= found
        return result

    def from_openface(self, value: float) -> float:
        """Return the weight of an OpenFace intensity 0..5: 1..5 are A..E, decimals lie between."""
        if not 0.0 <= value <= 5.0:
            raise InputError(f"an OpenFace intensity lies in 0..5, got {value:g}")
        knots = [0.0, *(self.letters[letter] for letter in LETTERS)]
        low = min(bisect.bisect_right(range(6), value) - 1, 4)
        return knots[low] + (value - low) * (knots[low + 1] - knots[low]) if value < 5 else knots[5]


def split_code(code: str) -> tuple[str, str]:
    """Return the prefix ("", "L", "R", "T", "B") and the number of a valid code."""
    return (code[0], code[1:]) if code[0] in "LRTB" else ("", code)


def load_catalogue(path: str | Path | None = None) -> Catalogue:
    """Return the catalogue of ``action_units.yaml`` (the shipped one by default, read once)."""
    return _shipped() if path is None else read_catalogue(Path(path))[0]


@cache
def _shipped() -> Catalogue:
    return read_catalogue(tables_dir() / "action_units.yaml")[0]


def read_catalogue(path: Path) -> tuple[Catalogue, dict[str, Entry]]:
    """Return the catalogue of a file and the entries of its other keys: combinations, limits, antagonists."""
    root = Entry(read_data(path), str(path))
    others = ("combinations", "limits", "antagonists")
    fields = root.fields(required=("sources", "intensity", "units"),
                         optional=(*others, "not_shown", "movements"))
    sources = {key: entry.text() for key, entry in fields["sources"].items()}
    scale = fields["intensity"].fields(required=LETTERS)
    letters = {letter: scale[letter].number(0.0, 1.0) for letter in LETTERS}
    ordered = list(letters.values())
    if any(low >= high for low, high in zip([0.0, *ordered], ordered, strict=False)):
        raise fields["intensity"].fail("expected weights above 0 that rise from A to E")
    units = {number: _unit(number, entry, sources) for number, entry in fields["units"].items()}
    units = {number: units[number] for number in sorted(units, key=int)}

    def numbered(key: str) -> dict[str, str]:
        return {number: entry.text() for number, entry in fields[key].items()} if key in fields else {}

    catalogue = Catalogue(units, letters, numbered("not_shown"), numbered("movements"),
                          source="; ".join(sources.values()))
    return catalogue, {key: fields[key] for key in others if key in fields}


def _unit(number: str, entry: Entry, sources: Mapping[str, str]) -> Unit:
    """Return one checked unit."""
    if not _CODE.fullmatch(number) or number == "0" or not number.isdigit():
        raise entry.fail(f"a unit's key is its number, 1 to 99, got '{number}'")
    fields = entry.fields(required=("name", "effect", "muscles", "region", "source"),
                          optional=("plain", "sides", "variants", "parts_lips"))
    sides = "none"
    if "sides" in fields:
        value = fields["sides"].value
        sides = {True: "both", False: "none"}[value] if isinstance(value, bool) else \
            fields["sides"].choice(SIDES, "kind of sides")
    variants = fields["variants"].texts() if "variants" in fields else ()
    if variants and (variants != ("T", "B") or sides != "none"):
        raise fields["variants"].fail("expected [T, B] on a unit without sides")
    name = fields["name"].text()
    return Unit(number, name, fields["plain"].text() if "plain" in fields else name, fields["effect"].text(),
                fields["muscles"].texts(),
                region=fields["region"].choice(REGIONS, "region"),
                source=sources[fields["source"].choice(sources, "source")], sides=sides, variants=variants,
                parts_lips=fields["parts_lips"].flag() if "parts_lips" in fields else False)

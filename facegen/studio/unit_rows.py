"""Which sliders there are for action units, and what moving one does to the units. Nothing here knows the browser."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Self

from facegen.facs.units import REGIONS, Unit, load_catalogue, split_code

_TITLES = {"neck": "Neck", "head": "Head", "gaze": "Gaze", "eyes": "Eyelids", "brows": "Brows", "nose": "Nose",
           "cheeks": "Cheeks", "mouth": "Mouth and chin", "jaw": "Jaw", "tongue": "Tongue"}
_SIDES = {"L": "left", "R": "right", "T": "upper lip", "B": "lower lip"}


@dataclass(frozen=True)
class Row:
    """A slider. ``code`` it sets; ``whole``: whether it stands for both sides or lips of a unit that has two."""

    code: str
    label: str
    hint: str
    whole: bool
    part: bool

    @property
    def number(self) -> str:
        """The unit's number."""
        return split_code(self.code)[1]

    @cached_property
    def atoms(self) -> tuple[str, ...]:
        """What it moves."""
        return tuple(load_catalogue().expand({self.code: 1.0}))


def groups() -> Iterator[tuple[str, tuple[Row, ...]]]:
    """Yield the title of each region and its sliders, brows first."""
    units = load_catalogue().units.values()
    for region in REGIONS:
        rows = tuple(row for unit in units if unit.region == region for row in _rows(unit))
        if rows:
            yield _TITLES[region], rows


def _rows(unit: Unit) -> Iterator[Row]:
    hint = f"{unit.effect[:1].upper()}{unit.effect[1:]}. FACS {unit.number}, {unit.name.lower()}"
    hint += f" ({', '.join(unit.muscles)})." if unit.muscles else "."
    two = len(unit.marks) > 1
    if unit.sides != "direction":
        yield Row(unit.number, f"{unit.plain} ({unit.number})", hint, whole=two, part=False)
    for code in unit.atoms if two else ():
        yield Row(code, f"{unit.plain}, {_SIDES[split_code(code)[0]]} ({code})", hint, whole=False,
                  part=unit.sides != "direction")


@dataclass(frozen=True)
class Stand:
    """How the sliders stand: ``weights`` by atom; numbers of units whose sides or lips are ``uneven``; ``apart``."""

    weights: Mapping[str, float]
    uneven: frozenset[str]
    apart: bool

    @classmethod
    def of(cls, units: Mapping[str, float], *, apart: bool) -> Self:
        """Return it for unit code -> weight."""
        catalogue = load_catalogue()
        atoms = catalogue.expand(units)
        several = (catalogue.unit_of(code) for code in atoms)
        uneven = (unit.number for unit in several if len({atoms.get(atom, 0.0) for atom in unit.atoms}) > 1)
        return cls(atoms, frozenset(uneven), apart)

    def shows(self, row: Row) -> bool:
        """Return whether a slider stands there: one for a pair, or two where it is apart or its sides differ."""
        if not (row.whole or row.part):
            return True
        return row.part if self.apart or row.number in self.uneven else row.whole

    def weight(self, row: Row) -> float:
        """Return where a slider stands: of a pair that differs, at the stronger."""
        return max(self.weights.get(atom, 0.0) for atom in row.atoms)


def moved(row: Row, units: Mapping[str, float], value: float) -> dict[str, float]:
    """Return the units with a slider at another weight."""
    catalogue = load_catalogue()
    atoms = catalogue.expand(units) | dict.fromkeys(row.atoms, float(value))
    return catalogue.fold({atom: weight for atom, weight in atoms.items() if weight > 0.0})

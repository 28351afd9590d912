"""Which sliders there are for action units, and what moving one does to the units. Nothing here knows the browser."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

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


def uneven(units: Mapping[str, float]) -> frozenset[str]:
    """Return the numbers of the units whose sides, or lips, differ."""
    atoms, found = load_catalogue().expand(units), set()
    for code in atoms:
        unit = load_catalogue().unit(code)
        if len({atoms.get(atom, 0.0) for atom in unit.atoms}) > 1:
            found.add(unit.number)
    return frozenset(found)


def shown(row: Row, units: Mapping[str, float], *, apart: bool) -> bool:
    """Return whether a slider stands there: one for a pair, or two where it is apart or its sides differ."""
    if not (row.whole or row.part):
        return True
    split = apart or split_code(row.code)[1] in uneven(units)
    return row.part if split else row.whole


def weight(row: Row, units: Mapping[str, float]) -> float:
    """Return where a slider stands: of a pair that differs, the stronger."""
    atoms = load_catalogue().expand(units)
    return max(atoms.get(atom, 0.0) for atom in load_catalogue().expand({row.code: 1.0}))


def moved(row: Row, units: Mapping[str, float], value: float) -> dict[str, float]:
    """Return the units with a slider at another weight."""
    catalogue = load_catalogue()
    atoms = catalogue.expand(units) | dict.fromkeys(catalogue.expand({row.code: 1.0}), float(value))
    return catalogue.fold({atom: weight for atom, weight in atoms.items() if weight > 0.0})

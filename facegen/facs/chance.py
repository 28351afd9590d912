"""An expression by chance that a face could make."""

from __future__ import annotations

import random
from collections.abc import Mapping

from facegen.errors import InputError
from facegen.facs.expression_table import load_expressions
from facegen.facs.tables import UnitTable, load_units
from facegen.facs.units import split_code

# What moves together: each group takes the units that one named expression has there. Because the upper and the lower
# face are moved by different nerves' branches and go their own ways, while within one the table's recipes tell what
# people do at once.
_GROUPS = (("brows", "eyes"), ("nose", "cheeks", "mouth", "jaw", "tongue", "neck"), ("head", "gaze"))
_MOVES = (0.9, 0.95, 0.35)      # how often a group takes part: a head is mostly still
_STRENGTH = (0.35, 1.0)         # of a group, beside the recipe's
_UNLIKE = 0.2                   # most that a unit differs from its recipe
_ONE_SIDED = 0.25               # how often a unit is stronger on one side, and
_LEAST_SIDE = 0.6               # the weaker side's least share
_FAINT = 0.05                   # less is not seen
_LONGEST = 2**64


def random_expression(seed: int | None = None) -> dict[str, float]:
    """Return unit code -> weight of an expression by chance that looks like one.

    Brows and eyes, nose to chin, head and gaze each take the units of a named expression, not always the same one's;
    strengths vary, sides too, and of two units that work against each other the weaker is left out. Never neutral.
    seed: the same gives the same, of one version of facegen; None is another each time. Raises InputError.
    """
    if seed is not None and (isinstance(seed, bool) or not isinstance(seed, int) or not 0 <= seed < _LONGEST):
        raise InputError(f"seed: expected a whole number from 0 on, got {seed!r}")
    chance, table = random.Random(seed), load_units()
    while True:
        atoms = _compatible(table, _drawn(chance, table))
        if atoms:
            return table.catalogue.fold(atoms)


def _drawn(chance: random.Random, table: UnitTable) -> dict[str, float]:
    """Return atom -> weight, each group from an expression of its own."""
    recipes = [one.units for one in load_expressions().expressions.values() if one.units]
    atoms: dict[str, float] = {}
    for regions, often in zip(_GROUPS, _MOVES, strict=True):
        strength = chance.uniform(*_STRENGTH)
        donors = [found for found in (_within(table, units, regions) for units in recipes) if found]
        chosen = chance.choice(donors)
        if chance.random() > often:
            continue
        for code, weight in chosen.items():
            weight *= strength * chance.uniform(1.0 - _UNLIKE, 1.0 + _UNLIKE)
            sides = dict.fromkeys(table.catalogue.expand({code: 1.0}), 1.0)
            if len(sides) == 2 and set(map(_side, sides)) == {"L", "R"} and chance.random() < _ONE_SIDED:
                sides[chance.choice(sorted(sides))] = chance.uniform(_LEAST_SIDE, 1.0)
            atoms |= {atom: round(min(weight * share, 1.0), 2) for atom, share in sides.items()}
    return {atom: weight for atom, weight in atoms.items() if weight >= _FAINT}


def _side(atom: str) -> str:
    return split_code(atom)[0]


def _within(table: UnitTable, units: Mapping[str, float], regions: tuple[str, ...]) -> dict[str, float]:
    return {code: weight for code, weight in units.items() if table.catalogue.unit(code).region in regions}


def _compatible(table: UnitTable, atoms: dict[str, float]) -> dict[str, float]:
    """Return the atoms without the weaker ones of those that work against each other."""
    left: dict[str, float] = {}
    for atom, weight in sorted(atoms.items(), key=lambda item: (-item[1], item[0])):
        if not table.warnings({**left, atom: weight}):
            left[atom] = weight
    return left

"""The rules of combination (`facegen.facs.rules`) for many frames at once.

The same sums as `facegen.facs.rules.coefficients` makes for one pose, with an array of n frames in place of each
number: a recording of minutes takes what a few poses take.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from facegen.facs.tables import UnitTable
from facegen.facs.units import Catalogue

Array = NDArray[np.float64]


def coefficients_of_many(table: UnitTable, atoms: Mapping[str, Array]) -> dict[str, Array]:
    """Return member of the basis -> coefficients (n,) of atom -> weights (n,); what is 0 throughout is left out."""
    catalogue = table.catalogue
    atoms = {atom: weights for atom, weights in atoms.items() if weights.any()}
    if not atoms:
        return {}
    factors = {atom: np.ones_like(weights) for atom, weights in atoms.items()}
    extra: dict[str, Array] = {}
    active = {atom.lstrip("LRTB") for atom in atoms}

    def weight(number: str, place: str) -> Array:
        return _weight(catalogue, atoms, number, place)

    def apply(number: str, by_place: Mapping[str, Array]) -> None:
        mean = sum(by_place.values()) / len(by_place)
        for mark in catalogue.units[number].marks:
            if mark + number in factors:
                factors[mark + number] *= by_place.get(mark, mean)

    for rule in table.rules:
        if not active.issuperset(rule.when):
            continue
        strength = {}
        for place in rule.places:
            strength[place] = np.min([weight(number, place) for number in rule.when], axis=0)
            for number in rule.without:
                strength[place] = strength[place] * (1.0 - weight(number, place))
        for number, scale in rule.scale.items():
            apply(number, {place: 1.0 - one * (1.0 - scale) for place, one in strength.items()})
        for number, other in rule.yields.items():
            left = {}
            for place in rule.places:
                own = weight(number, place)
                there = own > 0.0
                left[place] = np.where(there, np.maximum(0.0, 1.0 - weight(other, place) / np.where(there, own, 1.0)),
                                       1.0)
            apply(number, left)
        for name in rule.correctives:
            extra[name] = strength.get(name.rpartition(":")[2], sum(strength.values()) / len(strength))
    for limit in table.limits:
        if len(active.intersection(limit.units)) < 2:
            continue
        share = {}
        for place in limit.places:
            total = np.sum([weight(number, place) for number in limit.units], axis=0)
            share[place] = np.minimum(1.0, limit.most / np.maximum(total, 1e-300))
        for number in active.intersection(limit.units):
            apply(number, share)
    result = {atom: weights * factors[atom] for atom, weights in atoms.items()} | extra
    return {name: values for name, values in result.items() if values.any()}


def _weight(catalogue: Catalogue, atoms: Mapping[str, Array], number: str, place: str) -> Array:
    """Return the weights (n,) of a unit at one side or lip."""
    nothing = np.zeros_like(next(iter(atoms.values())))
    marks = catalogue.units[number].marks
    if place in marks:
        return atoms.get(place + number, nothing)
    return np.max([atoms.get(mark + number, nothing) for mark in marks], axis=0)

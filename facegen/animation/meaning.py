"""What the shapes of a recording are made of, so that any rig can be driven by them.

A frame of weights becomes coefficients of *parts*: members of the unit table, and movements that are no units, such as
half a glance. Units combine by the unit table's rules, as in a pose; shapes of every other set add, as their owners
mean them, but for a corrective, which counts only as far as what it corrects is there.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from facegen.animation.performance import VOCABULARIES
from facegen.blendshapes.names import match
from facegen.blendshapes.recipes import half, is_head, shape_set
from facegen.errors import InputError, NotationError, nearest
from facegen.facs.deformation import Deformation
from facegen.facs.notation import parse_weights
from facegen.facs.tables import load_units

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Part:
    """Something that a rig can make: ``members`` of the unit table, or else ``raw`` movement without that of
    ``minus``."""

    members: Mapping[str, float]
    raw: tuple[Deformation, ...] = ()
    minus: tuple[Deformation, ...] = ()

    @property
    def deformations(self) -> tuple[Deformation, ...]:
        """What moves."""
        basis = load_units().basis
        return self.raw or tuple(basis[member] for member in self.members)

    @property
    def looks(self) -> bool:
        """Whether it turns the eyes."""
        return any(one.eyes for one in self.deformations)

    @property
    def turns(self) -> bool:
        """Whether it turns the head."""
        return any(map(is_head, self.members))

    @property
    def corrects(self) -> bool:
        """Whether it corrects a combination of units."""
        return any(member not in load_units().catalogue.atoms for member in self.members)


class Meaning:
    """The shapes of one recording, in their order, as parts.

    vocabulary: one of `VOCABULARIES`. names: the shapes; another spelling is understood. ``shapes``: name -> the shape
    or unit code that it means; ``parts``: name -> part; ``made_of``: name of a shape -> its parts; ``unknown``: names
    that mean nothing. Raises InputError for an unknown vocabulary and for a unit that two names give.
    """

    def __init__(self, vocabulary: str, names: Sequence[str]) -> None:
        if vocabulary not in VOCABULARIES:
            raise InputError(f"vocabulary: expected {', '.join(VOCABULARIES)}, got {vocabulary!r}"
                             f"{nearest(str(vocabulary), VOCABULARIES)}")
        self.vocabulary = vocabulary
        self.names = tuple(names)
        self.shapes: dict[str, str] = {}
        self.parts: dict[str, Part] = {}
        self.made_of: dict[str, dict[str, float]] = {name: {} for name in self.names}
        self._minus: list[tuple[int, int]] = []
        if vocabulary == "units":
            self._read_units()
        else:
            self._read_shapes()
        self.unknown = tuple(name for name in self.names if name not in self.shapes)

    def coefficients(self, weights: Array, without: NDArray[np.bool_] | None = None) -> Array:
        """Return the coefficients (p,) of the parts for weights (k,) in 0..1; those of ``without`` (k,) count as 0."""
        weights = weights.copy()
        for column, corrected in self._minus:
            weights[column] = min(weights[column], weights[corrected]) if corrected >= 0 else 0.0
        if without is not None:
            weights[without] = 0.0
        found = weights @ self._linear
        if self.vocabulary != "units":
            return found
        atoms = {atom: min(value, 1.0) for atom, value in zip(self.parts, found.tolist(), strict=True) if value}
        combined = load_units().coefficients(atoms)
        return np.array([combined.get(member, 0.0) for member in self.parts])

    def columns(self, which: str) -> NDArray[np.bool_]:
        """Return which shapes (k,) have a part that "looks" or "turns"."""
        return np.array([any(getattr(self.parts[part], which) for part in self.made_of[name]) for name in self.names],
                        bool)

    @cached_property
    def _linear(self) -> Array:
        """How much (k, p) of each part a shape is."""
        place = {part: column for column, part in enumerate(self.parts)}
        linear = np.zeros((len(self.names), len(place)))
        for row, name in enumerate(self.names):
            for part, value in self.made_of[name].items():
                linear[row, place[part]] = value
        return linear

    def _read_units(self) -> None:
        table, owner = load_units(), {}
        for name in self.names:
            try:
                codes = parse_weights({name: 1.0})
            except NotationError:
                continue
            self.shapes[name] = "+".join(codes)
            # A performance's weights are 0..1 whatever the name: AU12_r stands for the unit, not for 0..5.
            self.made_of[name] = dict.fromkeys(table.catalogue.expand(codes), 1.0)
            for atom in self.made_of[name]:
                if owner.setdefault(atom, name) != name:
                    raise InputError(f"names: unit {atom} is given twice, by {owner[atom]} and by {name}")
        if owner:
            self.parts = {member: Part({member: 1.0}) for member in table.basis
                          if member in owner or member not in table.catalogue.atoms}

    def _read_shapes(self) -> None:
        recipes = shape_set("all" if self.vocabulary == "shapes" else self.vocabulary)
        self.shapes = match(self.names, {shape: one.also for shape, one in recipes.items()})
        column_of = {shape: self.names.index(name) for name, shape in self.shapes.items()}
        for name, shape in self.shapes.items():
            recipe = recipes[shape]
            self.made_of[name] = dict(recipe.members)
            self.parts.update((member, Part({member: 1.0})) for member in recipe.members)
            if not recipe.members and any(recipe.deformation):
                minus = () if recipe.minus is None else recipes[recipe.minus].deformation
                self.parts[shape] = Part({}, recipe.deformation, minus)
                self.made_of[name] = {shape: 1.0}
            if recipe.minus is not None:
                self._minus.append((self.names.index(name), column_of.get(recipe.minus, -1)))


def pairs(parts: Mapping[str, Part]) -> tuple[tuple[str, str, Part], ...]:
    """Return which two parts are the halves of something, and that: both sides of a unit, a glance of both eyes.

    What a rig can only show together, it can show as far as both are there.
    """
    table, found = load_units(), []
    for unit in table.catalogue.units.values():
        if len(unit.atoms) == 2 and all(atom in parts for atom in unit.atoms):
            found.append((*unit.atoms, Part(dict.fromkeys(unit.atoms, 1.0))))
        elif unit.number in table.basis and table.basis[unit.number].eyes:
            sought = [(half(table.basis[unit.number], side),) for side in "LR"]
            halves = [name for raw in sought for name, part in parts.items() if part.raw == raw]
            if len(halves) == 2:
                found.append((*halves, Part({unit.number: 1.0})))
    return tuple(found)

"""Weights of one vocabulary as weights of another: units, expressions, ARKit, visemes, VRM.

Where a shape of the target is a unit or several (``mouthSmileLeft`` is L12), its weight is read off. What remains is
fitted on the base face: the vertices that the source's shapes move, made as well as can be of the target's
(`facegen.blendshapes.fit`). So every conversion is possible, and says what share of the movement it loses.
"""

from __future__ import annotations

import math
import numbers
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, cached_property, lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from facegen.blendshapes.fit import Fit
from facegen.blendshapes.names import match
from facegen.blendshapes.recipes import SETS, Recipe, is_head, shape_set
from facegen.errors import InputError, nearest
from facegen.face.face import Face, load_face
from facegen.face.motion import posed, shape_motion
from facegen.facs.deformation import Deformation
from facegen.facs.expression_table import Person
from facegen.facs.notation import parse_weights
from facegen.facs.tables import load_units

# How much a vertex of a part counts beside one of the skin's cage, whose vertices are dense where faces are looked at:
# an eyeball's 266 vertices together as much as the lids round it. Teeth and hair say nothing that the skin does not.
_COUNTS = {"skin": 1.0, "eye_L": 0.1, "eye_R": 0.1, "tongue": 0.1}
# Rounds in which weights are found whose coefficients, after the rules of combination, are the ones asked for.
_ROUNDS = 60
# Members whose coefficient is less than this are spent.
_SPENT = 1e-12
# A movement shorter than this, in millimetres, is rounding.
_STILL = 1e-6

Members = Mapping[str, float]


@dataclass(frozen=True)
class Conversion:
    """``weights``: shape (or unit code) -> weight 0..1. ``residual``: share of the movement that is lost, 0..1.

    ``left_out``: units of the head, which no set of shapes has.
    """

    weights: Mapping[str, float]
    residual: float
    left_out: tuple[str, ...] = ()


def convert(weights: Mapping[str, float], source: str, target: str, *, person: str | Path | Person | None = None
            ) -> Conversion:
    """Return weights of one set of shapes as weights of another.

    weights: name -> 0..1 in the set ``source``; other spellings are understood (`eyeBlink_L`). source, target:
        "units", "expressions", "arkit", "visemes" or "vrm". person: whose habits change expressions.

    mouthClose counts only as far as jawOpen is there, and is never given without. Units come back as codes ("12" or
    "L12"), combined as a pose of them would be. Deterministic. Raises InputError for an unknown set or name (with the
    nearest) or a weight outside 0..1. ::

        convert({"12": 0.8}, "units", "arkit").weights      # {"mouthSmileLeft": 0.8, "mouthSmileRight": 0.8}
    """
    for argument, name in (("source", source), ("target", target)):
        if name not in SETS:
            raise InputError(f"{argument}: expected {', '.join(SETS)}, got {name!r}{nearest(str(name), SETS)}")
    head: tuple[str, ...] = ()
    if source == "units":
        found = load_units().coefficients(parse_weights(weights))
        head = tuple(member for member in found if is_head(member))
        members = {member: value for member, value in found.items() if member not in head}
        raw = np.zeros(movement_space().size)
    else:
        shapes = of_set(source) if person is None else Shapes(shape_set(source, person))
        members, raw = shapes.split(checked(weights, shapes.recipes, source))
    if target == "units":
        made, residual = _as_units(members, raw)
        return Conversion(made | ({code: weights_of(found[code]) for code in head} if head else {}), residual)
    shapes = of_set(target) if person is None else Shapes(shape_set(target, person))
    return Conversion(*shapes.fitted(members, raw), head)


def weights_of(value: float) -> float:
    """Return a coefficient as a weight, 0..1."""
    return min(max(float(value), 0.0), 1.0)


def checked(weights: Mapping[str, float], recipes: Mapping[str, Recipe], kind: str) -> dict[str, float]:
    """Return shape -> weight with the shapes' own names, without zeros; InputError."""
    if not isinstance(weights, Mapping):
        raise InputError(f"weights: expected a mapping of shapes to weights, got {type(weights).__name__}")
    names = match(map(str, weights), {shape: recipe.also for shape, recipe in recipes.items()})
    result = {}
    for name, weight in weights.items():
        if str(name) not in names:
            raise InputError(f"weights: '{name}' is no shape of {kind}{nearest(str(name), recipes)}")
        if isinstance(weight, bool) or not isinstance(weight, numbers.Real) or not 0.0 <= weight <= 1.0:
            raise InputError(f"weights: {name}: expected a number in 0..1, got {weight!r}")
        if weight:
            result[names[str(name)]] = float(weight)
    return result


class Shapes:
    """A set of shapes, by recipe, as what movements can be made of."""

    def __init__(self, recipes: Mapping[str, Recipe]) -> None:
        self.recipes = recipes
        # Shapes that are units at full weight, those of more units first: blink before blinkLeft.
        self.direct = sorted((name for name, one in recipes.items()
                               if one.members and all(value == 1.0 for value in one.members.values())),
                              key=lambda name: -len(recipes[name].members))

    def split(self, weights: Mapping[str, float]) -> tuple[dict[str, float], NDArray[np.float64]]:
        """Return what a sum of these shapes is: members of the unit table, and the rest as movement (d,)."""
        members: dict[str, list[float]] = {}
        raw = np.zeros(movement_space().size)
        for name, weight in weights.items():
            one = self.recipes[name]
            if one.minus is not None:
                weight = min(weight, weights.get(one.minus, 0.0))
            for member, value in one.members.items():
                members.setdefault(member, []).append(weight * value)
            if not one.members and weight:
                raw += weight * self.vectors[self.rows[name]]
        return {member: math.fsum(several) for member, several in members.items()}, raw

    def read_off(self, members: Members) -> tuple[dict[str, float], dict[str, float]]:
        """Return the weights of shapes that are units themselves, and the members that are left."""
        left, weights = dict(members), {}
        for name in self.direct:
            needs = self.recipes[name].members
            weight = min(1.0, *(left.get(member, 0.0) for member in needs))
            if weight > 0.0:
                weights[name] = weight
                for member in needs:
                    left[member] -= weight
        return weights, {member: value for member, value in left.items() if abs(value) > _SPENT}

    def fitted(self, members: Members, raw: NDArray[np.float64] | None = None) -> tuple[dict[str, float], float]:
        """Return the weights that come nearest to members of the unit table and a further movement (d,), and the
        share of the movement that they lose."""
        moves = raw is not None and raw.any()
        weights, left = self.read_off(members)
        if not left and not moves:
            return self._ordered(weights), 0.0
        total = movement_space().of(members) + (raw if moves else 0.0)
        if np.linalg.norm(total) < _STILL:
            return self._ordered(weights), 0.0
        single = self._fit.weights(total, np.ones(len(self.recipes)))
        if np.count_nonzero(single) == 1:
            weights = self._named(single)
        else:
            rest = movement_space().of(left) + (raw if moves else 0.0)
            free = np.array([1.0 - weights.get(name, 0.0) for name in self.recipes])
            for name, weight in self._named(self._fit.weights(rest, free)).items():
                weights[name] = min(1.0, weights.get(name, 0.0) + weight)
        return self._ordered(weights), self._lost(total, weights)

    def _lost(self, total: NDArray, weights: Mapping[str, float]) -> float:
        made = sum((weight * self.vectors[self.rows[name]] for name, weight in weights.items()), np.zeros(len(total)))
        return min(1.0, float(np.linalg.norm(total - made) / np.linalg.norm(total)))

    def _named(self, weights: NDArray[np.float64]) -> dict[str, float]:
        """Return shape -> weight; a corrective comes with what it corrects, as `_columns` has it."""
        found: dict[str, float] = {}
        for name, weight in zip(self.recipes, weights.tolist(), strict=True):
            for one in (name, self.recipes[name].minus):
                if weight and one is not None:
                    found[one] = min(1.0, found.get(one, 0.0) + weight)
        return found

    def _ordered(self, weights: Mapping[str, float]) -> dict[str, float]:
        return {name: weights[name] for name in self.recipes if weights.get(name)}

    @cached_property
    def rows(self) -> dict[str, int]:
        """The place of each shape in the set."""
        return {name: row for row, name in enumerate(self.recipes)}

    @cached_property
    def vectors(self) -> NDArray[np.float64]:
        """The movement (k, d) of each shape."""
        space = movement_space()
        vectors = space.vectors(self.recipes)
        for name, one in self.recipes.items():
            if one.members:             # summed as its units are, so that they find their expression exactly
                vectors[self.rows[name]] = space.of(one.members)
        return vectors

    @cached_property
    def _fit(self) -> Fit:
        columns = self.vectors.copy()
        for name, one in self.recipes.items():
            if one.minus is not None:           # the corrective and what it corrects, always together
                columns[self.rows[name]] += self.vectors[self.rows[one.minus]]
        return Fit(columns)


class _Space:
    """Where movements are compared: vertices (d / 3) of the base face's coarsest level, by what they count."""

    def __init__(self, face: Face) -> None:
        self.face = face
        mesh = face.mesh(0)
        counts = np.zeros(len(mesh.vertices))
        for part, count in _COUNTS.items():
            counts[mesh.part_vertices(part)] = count
        self._rows = np.flatnonzero(counts)
        self._scale = np.sqrt(counts[self._rows])[:, None]
        self.size = 3 * len(self._rows)

    def vectors(self, recipes: Mapping[str, Recipe]) -> NDArray[np.float64]:
        """Return the movement (k, d) of shapes."""
        return self._flat(shape_motion(self.face, recipes, detail=0))

    def of(self, members: Members) -> NDArray[np.float64]:
        """Return the movement (d,) of members of the unit table, summed as a rig sums them."""
        names, basis = self.basis
        return np.array([members.get(name, 0.0) for name in names]) @ basis

    def of_raw(self, several: tuple[Deformation, ...]) -> NDArray[np.float64]:
        """Return the movement (d,) of raw data."""
        return self._flat(posed(self.face, [several], detail=0) - self.face.mesh(0).vertices)[0]

    def _flat(self, motion: NDArray[np.float64]) -> NDArray[np.float64]:
        return (motion[:, self._rows] * self._scale).reshape(len(motion), -1)

    @cached_property
    def basis(self) -> tuple[tuple[str, ...], NDArray[np.float64]]:
        """The members of the unit table's basis and their movement (m, d)."""
        recipes = shape_set("units")
        return tuple(next(iter(one.members)) for one in recipes.values()), self.vectors(recipes)


@cache
def movement_space() -> _Space:
    """Return where movements are compared."""
    return _Space(load_face())


def raw_movement(several: tuple[Deformation, ...]) -> NDArray[np.float64]:
    """Return raw data as a movement (d,) that `Shapes.fitted` takes."""
    return movement_space().of_raw(several)


@cache
def of_set(name: str) -> Shapes:
    """Return a set of shapes by its name."""
    return Shapes(shape_set(name))


def as_common(members: Members, own: Mapping[str, Deformation]) -> tuple[dict[str, float], list[Deformation]]:
    """Return members of the common unit table, and further movements, that are members of a person's.

    own: member -> what it does on that person. So much of it as is the common movement stays the common member: shapes
    for that are there, and a weaker one is less of them, which no movement on top could make.
    """
    result, rest = dict(members), []
    for name in own.keys() & members.keys():
        common = load_units().basis[name]
        share = _share(own[name], common)
        result[name] = share * members[name]
        rest.append((own[name] - common * share) * members[name])
    return {name: value for name, value in result.items() if value}, [one for one in rest if one]


@lru_cache(maxsize=512)
def _share(own: Deformation, common: Deformation) -> float:
    """Return how much of a movement another holds, 0 or more: the foot of the one on the other."""
    a, b = raw_movement((own,)), raw_movement((common,))
    size = float(b @ b)
    if size < _STILL ** 2:
        return 0.0
    foot = max(0.0, float(a @ b) / size)
    # A plain multiple is found to the last bit, so that nothing is left over.
    near = round(foot, 3)
    return near if own == common * near else foot


def _as_units(members: Members, raw: NDArray[np.float64]) -> tuple[dict[str, float], float]:
    """Return code -> weight whose combination is members of the unit table and a further movement, and the loss."""
    table, atoms = load_units(), set(load_units().catalogue.atoms)
    wanted = {member: weights_of(value) for member, value in members.items() if member in atoms}
    total = movement_space().of(members) + raw
    rest = total - movement_space().of(wanted)
    if np.linalg.norm(rest) > 1e-9 * max(1.0, float(np.linalg.norm(total))):
        shapes = of_set("units")
        names = [next(iter(one.members)) for one in shapes.recipes.values()]
        free = np.array([1.0 - wanted.get(name, 0.0) if name in atoms else 0.0 for name in names])
        for name, weight in zip(names, shapes._fit.weights(rest, free).tolist(), strict=True):
            if weight:
                wanted[name] = min(1.0, wanted.get(name, 0.0) + weight)
    weights = {name: value for name, value in wanted.items() if value > 0.0}
    for _ in range(_ROUNDS):                    # the rules weaken partners; weights that make up for it
        now = table.coefficients(weights)
        better = {name: min(1.0, weights[name] * wanted[name] / now[name]) if now.get(name) else weights[name]
                  for name in weights}
        if all(abs(better[name] - weights[name]) < 1e-15 for name in weights):
            break
        weights = better
    made = movement_space().of({k: v for k, v in table.coefficients(weights).items() if not is_head(k)})
    size = float(np.linalg.norm(total))
    lost = min(1.0, float(np.linalg.norm(total - made)) / size) if size > _STILL else 0.0
    return table.catalogue.fold({name: round(value, 12) for name, value in weights.items()}), lost

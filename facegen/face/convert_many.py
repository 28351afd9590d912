"""`facegen.face.convert` for recordings: many frames at once, and without jumps from one to the next.

What is read off is read off as there. What remains is fitted by

    minimise |t - sum_i w_i s_i|^2 + (m sum_i w_i |s_i|)^2,   0 <= w_i <= u_i

twice: with m = 0.2 over all frames, which says which few shapes the recording needs, then with a small m by these
only. A single pose is pruned shape by shape (`facegen.blendshapes.fit`); from frame to frame that would flicker, while
the minimum of a convex sum moves as smoothly as its target.

All is done in as many coordinates as there are shapes (the QR decomposition of their movements), not in vertices.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from facegen.blendshapes.recipes import is_head, shape_set
from facegen.face.convert import movement_space, of_set
from facegen.facs.many import coefficients_of_many
from facegen.facs.tables import load_units

Array = NDArray[np.float64]

# m of the choice, as for single poses; and of the fit, where it only keeps shapes from pulling against each other.
_CHOICE, _FIT = 0.2, 0.03
# A shape that makes less than this share of what the recording leaves to be fitted is left out.
_SHARE = 0.01
# A movement shorter than this, in millimetres, is rounding.
_STILL = 1e-6
# Rounds in which weights are found whose coefficients, after the rules, are the ones asked for; and when they are.
_ROUNDS, _CLOSE = 60, 1e-12


@dataclass(frozen=True)
class Conversions:
    """``weights`` (n, k) of ``names``. ``residual`` (n,): the share of each frame's movement that is lost.

    lost: the same of the whole recording, by the root of the squares. left_out: units of the head.
    """

    names: tuple[str, ...]
    weights: Array
    residual: Array
    lost: float
    left_out: tuple[str, ...] = ()


def convert_many(names: Sequence[str], weights: Array, source: str, target: str) -> Conversions:
    """Return weights (n, k) in 0..1 of one vocabulary as weights of another. Names are taken to be valid.

    source, target: as for `facegen.face.convert.convert`; units are codes. ::

        convert_many(["12"], np.array([[0.2], [0.4]]), "units", "arkit").names  # ('mouthSmileLeft', 'mouthSmileRight')
    """
    table, left_out = load_units(), ()
    raw: dict[str, Array] = {}
    if source == "units":
        members = coefficients_of_many(table, _atoms(names, weights))
        left_out = tuple(name for name in members if is_head(name))
        members = {name: values for name, values in members.items() if name not in left_out}
    else:
        members, raw = _split(names, weights, source)
    work = _Work(members, raw, source, target, len(weights))
    if target == "units":
        return Conversions(*work.as_units(), left_out)
    return Conversions(*work.as_shapes(), left_out)


def _atoms(names: Sequence[str], weights: Array) -> dict[str, Array]:
    """Return atom -> weights (n,) of codes; what is given twice counts as its larger."""
    catalogue, atoms = load_units().catalogue, {}
    for name, column in zip(names, weights.T, strict=True):
        for atom in (name,) if name in catalogue.atoms else catalogue.unit(name).atoms:
            atoms[atom] = np.maximum(atoms[atom], column) if atom in atoms else column
    return atoms


def _split(names: Sequence[str], weights: Array, source: str) -> tuple[dict[str, Array], dict[str, Array]]:
    """Return what sums of shapes are: members of the unit table, and shapes that are none."""
    recipes, by_name = shape_set(source), dict(zip(names, weights.T, strict=True))
    members: dict[str, Array] = {}
    raw: dict[str, Array] = {}
    for name, column in by_name.items():
        one = recipes[name]
        if one.minus is not None:
            column = np.minimum(column, by_name.get(one.minus, np.zeros_like(column)))
        for member, value in one.members.items():
            members[member] = members.get(member, 0.0) + column * value
        if not one.members and column.any():
            raw[name] = column
    return members, raw


class _Work:
    """One conversion, in the coordinates of all the shapes that take part."""

    def __init__(self, members: Mapping[str, Array], raw: Mapping[str, Array], source: str, target: str, count: int
                 ) -> None:
        self.members, self.count = dict(members), count
        basis_names, basis = movement_space().basis
        self.basis_rows = {name: row for row, name in enumerate(basis_names)}
        self.target = of_set(target)
        vectors = [basis, *([] if target == "units" else [self.target.vectors])]
        if raw:
            sources = of_set(source)
            vectors.append(sources.vectors[[sources.rows[name] for name in raw]])
        coordinates = np.linalg.qr(np.vstack(vectors).T, mode="r").T        # (shapes, dimensions)
        self.basis = coordinates[:len(basis)]
        self.shapes = self.basis if target == "units" else coordinates[len(basis):len(basis) + len(self.target.vectors)]
        self.raw = np.zeros((count, coordinates.shape[1]))
        if raw:
            self.raw = np.column_stack(list(raw.values())) @ coordinates[-len(raw):]
        self.total = self._of(self.members) + self.raw

    def as_shapes(self) -> tuple[tuple[str, ...], Array, Array, float]:
        """Return the target's shapes that are used, their weights, and the losses."""
        left = dict(self.members)
        recipes, rows = self.target.recipes, self.target.rows
        weights = np.zeros((self.count, len(recipes)))
        nothing = np.zeros(self.count)
        for name in self.target.direct:
            needs = recipes[name].members
            one = np.minimum(1.0, np.min([left.get(member, nothing) for member in needs], axis=0))
            one = np.maximum(one, 0.0)
            weights[:, rows[name]] = one
            for member in needs:
                left[member] = left.get(member, nothing) - one
        columns = self.shapes.copy()
        pairs = [(rows[name], rows[one.minus]) for name, one in recipes.items() if one.minus is not None]
        for row, base in pairs:                         # the corrective and what it corrects, always together
            columns[row] += self.shapes[base]
        fitted = _fitted(columns, self._of(left) + self.raw, 1.0 - weights)
        for row, base in pairs:
            fitted[:, base] += fitted[:, row]
        weights = np.minimum(1.0, weights + fitted)
        used = [rows[name] for name in recipes if weights[:, rows[name]].any()]
        names = tuple(recipes)
        return tuple(names[row] for row in used), weights[:, used], *self._lost(weights @ self.shapes)

    def as_units(self) -> tuple[tuple[str, ...], Array, Array, float]:
        """Return codes of units, both sides together where they never differ, their weights, and the losses."""
        table = load_units()
        atoms = [name for name in self.basis_rows if name in set(table.catalogue.atoms)]
        wanted = np.column_stack([np.clip(self.members.get(atom, np.zeros(self.count)), 0.0, 1.0) for atom in atoms])
        columns = self.basis[[self.basis_rows[atom] for atom in atoms]]
        wanted = np.minimum(1.0, wanted + _fitted(columns, self.total - wanted @ columns, 1.0 - wanted))
        weights = wanted.copy()
        for _ in range(_ROUNDS):        # the rules weaken partners; weights that make up for it
            now = coefficients_of_many(table, dict(zip(atoms, weights.T, strict=True)))
            found = np.column_stack([now.get(atom, np.zeros(self.count)) for atom in atoms])
            there = found > 0.0
            better = np.where(there, np.minimum(1.0, weights * wanted / np.where(there, found, 1.0)), weights)
            done = np.abs(better - weights).max(initial=0.0) < _CLOSE
            weights = better
            if done:
                break
        made = coefficients_of_many(table, dict(zip(atoms, weights.T, strict=True)))
        folded = _folded(dict(zip(atoms, np.round(weights, 12).T, strict=True)))
        matrix = np.column_stack(list(folded.values())) if folded else np.empty((self.count, 0))
        return tuple(folded), matrix, *self._lost(self._of(made))

    def _of(self, members: Mapping[str, Array]) -> Array:
        rows = [self.basis_rows[name] for name in members]
        return np.column_stack(list(members.values())) @ self.basis[rows] if rows else np.zeros(
            (self.count, self.basis.shape[1]))

    def _lost(self, made: Array) -> tuple[Array, float]:
        sizes, gone = np.linalg.norm(self.total, axis=1), np.linalg.norm(self.total - made, axis=1)
        there = sizes > _STILL
        residual = np.where(there, np.minimum(1.0, gone / np.where(there, sizes, 1.0)), 0.0)
        whole = float(np.linalg.norm(sizes))
        return residual, min(1.0, float(np.linalg.norm(gone)) / whole) if whole > _STILL else 0.0


def _folded(atoms: Mapping[str, Array]) -> dict[str, Array]:
    """Return code -> weights in FACS order, one plain code where sides or lips never differ; without what rests."""
    result: dict[str, Array] = {}
    for unit in load_units().catalogue.units.values():
        found = {atom: atoms[atom] for atom in unit.atoms if atom in atoms and atoms[atom].any()}
        first = next(iter(found.values()), None)
        if len(found) == len(unit.marks) and unit.number in unit.codes and all(
                np.array_equal(first, one) for one in found.values()):
            found = {unit.number: first}
        result |= found
    return result


def _fitted(shapes: Array, target: Array, upper: Array) -> Array:
    """Return weights (n, k) in 0..upper (n, k) of shapes (k, d) for movements (n, d)."""
    result = np.zeros_like(upper)
    moving = np.flatnonzero(np.linalg.norm(target, axis=1) > _STILL)
    if not len(moving):
        return result
    sizes = np.linalg.norm(shapes, axis=1)
    some = np.flatnonzero(sizes > _STILL)
    chosen = _bounded(shapes[some], target[moving], upper[np.ix_(moving, some)], _CHOICE)
    effort = chosen.sum(axis=0) * sizes[some]
    some = some[effort > _SHARE * effort.sum()]
    if len(some):
        result[np.ix_(moving, some)] = _bounded(shapes[some], target[moving], upper[np.ix_(moving, some)], _FIT)
    return result


def _bounded(shapes: Array, target: Array, upper: Array, tax: float) -> Array:
    """Return the weights (n, k) of the energy above; a weight beyond its bound is cut there."""
    directions, parts = np.linalg.qr(shapes.T)
    system = np.vstack([parts, tax * np.linalg.norm(shapes, axis=1)])
    goals = np.hstack([target @ directions, np.zeros((len(target), 1))])
    return np.minimum(np.array([nnls(system, goal)[0] for goal in goals]), upper)

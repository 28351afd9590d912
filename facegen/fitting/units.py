"""Places on a rig as a function of action units: on an avatar with a shape for each, and on the parametric face.

Units combine by the table's rules before they become movements, so nothing here is linear: slopes are differences, and
the parametric face keeps them as long as the pose stays near (its jaw turns and its lids roll slowly).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from facegen.animation.angles import reach
from facegen.blendshapes.names import member_of
from facegen.blendshapes.recipes import is_head
from facegen.face.avatar import held
from facegen.face.face import Controls, Face
from facegen.facs.tables import load_units

Array = NDArray[np.float64]

ALIKE = {"26": "27", "41": "43", "42": "43", "44": "43", "45": "43", "46": "43", "33": "34", "32": "28"}
"""Units that look like another one, by degree or by time, and are left out unless they are asked for."""

RARE = ("11", "13", "19", "21", "32", "33", "35", "38", "39")
"""Units that people seldom make, or that move most where no landmark lies (tongue, neck, nostrils): by few points they
would only be taken for others, so they are left out unless a whole mesh is there or they are asked for."""

GAZE = ("yaw", "pitch", "vergence")
"""Angles of both eyes, degrees: to the subject's left, up, and how far each turns outward."""

# Parts of a weight by which slopes are measured. Because lids meet and folds end: a small one sees where it is.
_STEP = 1e-3
# Because within a third of a weight the movement turns by little, and slopes cost some fifty poses.
_KEPT_WITHIN = 0.3
_WIDEST = 40.0          # degrees of an eye; people reach 35
_CROSSED = 15.0


def unit_atoms(wanted: Sequence[str] | None = None, *, dense: bool = True) -> tuple[str, ...]:
    """Return the atoms that a fit looks for, by the table's order; wanted: codes such as "12", "L12" or "AU12_L", else
    all that make sense; dense: whether whole meshes are measured."""
    catalogue = load_units().catalogue
    if wanted is None:
        out = (*ALIKE, *(() if dense else RARE))
        return tuple(atom for atom in catalogue.atoms if not is_head(atom)
                     and catalogue.unit_of(atom).region != "gaze" and catalogue.unit_of(atom).number not in out)
    found = {atom for code in wanted for atom in catalogue.expand({member_of(code) or code.removeprefix("AU"): 1.0})}
    return tuple(atom for atom in catalogue.atoms if atom in found)


class UnitMix:
    """Weights of units to coefficients of an avatar's shapes. columns: member of the unit table -> row of the basis;
    halves: row -> row that corrects it half way."""

    linear = False

    def __init__(self, atoms: Sequence[str], columns: Mapping[str, int], halves: Mapping[int, int], size: int) -> None:
        self.atoms, self.columns, self.halves, self.size = tuple(atoms), columns, halves, size

    def weights(self, x: Array) -> Array:
        """Return the units' weights (k,)."""
        return np.array(x)

    def coefficients(self, x: Array) -> Array:
        """Return the coefficients (b,) that a pose of these units has."""
        found = np.zeros(self.size)
        members = load_units().coefficients({atom: min(max(w, 0.0), 1.0) for atom, w in
                                             zip(self.atoms, x.tolist(), strict=True) if w > 0.0})
        for member, value in held(members).items():
            if member in self.columns:
                found[self.columns[member]] = value
        for row, half in self.halves.items():
            inside = min(max(found[row], 0.0), 1.0)
            found[half] = 4.0 * inside * (1.0 - inside)
        return found

    def slope(self, x: Array) -> Array:
        """Return how they change, (b, k)."""
        return _differences(self.coefficients, x, np.full(len(x), _STEP), np.ones(len(x)))


class FacePoints:
    """Places on the parametric face under units and a gaze; ``weights`` (p, n) place them on ``mesh(detail)``."""

    def __init__(self, face: Face, place: sparse.csr_array, atoms: Sequence[str], *, detail: int = 2,
                 gaze: bool = True, offset: Array | None = None) -> None:
        self.face, self.atoms, self.detail = face, tuple(atoms), detail
        self.names = tuple(atoms)
        count = len(GAZE) if gaze else 0
        self.low = np.concatenate([np.zeros(len(atoms)), [-_WIDEST, -_WIDEST, -_CROSSED][:count]])
        self.high = np.concatenate([np.ones(len(atoms)), [_WIDEST, _WIDEST, _CROSSED][:count]])
        self._place, self._offset = place, 0.0 if offset is None else offset
        used = np.unique(place.indices)
        self._near, self._posed = place[:, used], face.some_posed(used, detail=detail)
        self._basis = _basis(face)
        self._kept: tuple[Array, Array, Array] | None = None

    @property
    def rest(self) -> Array:
        """The places (p, 3) of the neutral."""
        return self._place @ self.face.mesh(self.detail).vertices + self._offset

    def moved(self, offset: Array) -> FacePoints:
        """Return the same with places that rest elsewhere by ``offset`` (p, 3): another person's."""
        return FacePoints(self.face, self._place, self.atoms, detail=self.detail, gaze=len(self.low) > len(self.names),
                          offset=self._offset + offset)

    def places(self, x: Array) -> Array:
        """Return the places (p, 3), mm."""
        return self._several(x[None])[0]

    def slopes(self, x: Array) -> Array:
        """Return (3 p, k), as they are at x or near."""
        return self._slopes(x)[0]

    def gram(self, x: Array) -> Array:
        """Return (k, k)."""
        return self._slopes(x)[1]

    def weights(self, x: Array) -> Array:
        """Return the units' weights, without the gaze."""
        return np.array(x[:len(self.names)])

    def gaze(self, x: Array) -> Array | None:
        """Return yaw_L, pitch_L, yaw_R, pitch_R (4,), degrees, or None if none was fitted."""
        return _eyes(x[len(self.names):]) if len(x) > len(self.names) else None

    def _several(self, xs: Array) -> Array:
        """Return the places (m, p, 3) under m sets of parameters."""
        controls = self._basis.controls(self.atoms, xs)
        posed = self._posed(controls)                                               # (m, n, 3)
        flat = np.moveaxis(posed, 0, 1).reshape(posed.shape[1], -1)
        return np.moveaxis((self._near @ flat).reshape(-1, len(xs), 3), 0, 1) + self._offset

    def _slopes(self, x: Array) -> tuple[Array, Array]:
        size = np.where(np.isin(np.arange(len(x)), np.arange(len(self.names))), 1.0, _WIDEST)
        if self._kept is None or (np.abs(x - self._kept[2]) / size).max() > _KEPT_WITHIN:
            slopes = _differences(lambda xs: self._several(xs).reshape(len(xs), -1), x, _STEP * size, self.high,
                                  together=True)
            self._kept = slopes, slopes.T @ slopes, x.copy()
        return self._kept[:2]


@lru_cache(maxsize=8)
def _basis(face: Face) -> _Basis:
    return _Basis(face)


class _Basis:
    """What the members of the unit table give the deformer, as arrays: `Face.controls` without a dictionary a frame."""

    def __init__(self, face: Face) -> None:
        self.face = face
        basis, points = load_units().basis, list(face.feature_points)
        self.rows = {member: row for row, member in enumerate(basis)}
        found = [face.linear_controls(one, strict=False) for one in basis.values()]
        self.moves = {part.name: np.array([getattr(one, part.name) for one in found]) for part in fields(Controls)}
        self.with_jaw = np.array([[name in one.with_jaw for name in points] for one in basis.values()], float)

    def controls(self, atoms: Sequence[str], xs: Array) -> Controls:
        """Return the deformer's input for m sets of weights of the atoms, and of the gaze, (m, k)."""
        table, many = load_units(), np.zeros((len(xs), len(self.rows)))
        for row, x in zip(many, xs, strict=True):
            units = {atom: min(max(w, 0.0), 1.0) for atom, w in zip(atoms, x[:len(atoms)].tolist(), strict=True)
                     if w > 0.0}
            for axis, angle in zip(GAZE, x[len(atoms):].tolist(), strict=False):
                plus, minus = ("65", "66") if axis == "vergence" else _TURNS[axis]
                # Beyond its unit an eye goes on turning, and what goes along with it.
                row[self.rows[plus if angle >= 0.0 else minus]] = abs(angle) / _degrees(axis, angle)
            for member, value in table.coefficients(units).items():
                row[self.rows[member]] = value
        linear = Controls(**{name: np.tensordot(many, moves, 1) for name, moves in self.moves.items()})
        return self.face.finished_controls(linear, (many != 0.0) @ self.with_jaw > 0.0)


_TURNS = {"yaw": ("61", "62"), "pitch": ("63", "64")}


def _degrees(axis: str, angle: float) -> float:
    """Return how far the eyes' unit of that direction turns the left eye."""
    if axis == "vergence":
        eyes = load_units().basis["65" if angle >= 0.0 else "66"].eyes
        return abs(eyes["yaw_L"])
    return reach("eyes", axis)[int(angle < 0.0)]


def _eyes(gaze: Array) -> Array:
    yaw, pitch, apart = gaze
    return np.array([yaw + apart, pitch, yaw - apart, pitch])


def _differences(function, x: Array, step: Array, high: Array, *, together: bool = False) -> Array:
    """Return how a function's values (d,) change with x (k,), (d, k); forward, or backward at the upper end."""
    step = np.where(x + step > high, -step, step)
    moved = x + np.diag(step)
    if together:
        values = function(np.vstack([x, moved]))
        return ((values[1:] - values[0]) / step[:, None]).T
    here = function(x)
    return np.stack([(function(one) - here) / width for one, width in zip(moved, step, strict=True)], axis=1)

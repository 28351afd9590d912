"""The similarity that puts an avatar's landmarks onto the template's.

Based on: S. Umeyama, "Least-squares estimation of transformation parameters between two point patterns" (1991), and
B. Horn, "Closed-form solution of absolute orientation using unit quaternions" (1987), section 2.C, for the scale.

Plain least squares are fooled by an animal's long muzzle, which tips the whole head. So, in three steps:

1. The lateral axis is the direction of all pairs of landmarks, from right to left: it stays exactly lateral.
2. In the plane between left and right one angle is left. It is fitted to the landmarks' places and, because a muzzle
   points where a person's chin does not, also to three directions: the way up across the lids, across the lips and
   from the eyes to the brows. On a person all agree; on a horse they meet half way, as a horse carries its head.
3. Eyes, brows, mouth corners and chin count most, and what fits badly counts less (Cauchy weights).

The scale is Horn's, which is the same both ways: sqrt(spread of the target / spread of the source). Umeyama's shrinks
with the misfit, so that an animal's head would come out small.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from facegen.errors import InputError
from facegen.face.landmarks import REQUIRED

Array = NDArray[np.float64]

# How much a landmark counts. What every head has in much the same place counts most; what a muzzle carries counts less.
_WEIGHT = {"nose_tip": 0.3, "nose_bridge": 0.7, "nose_wing": 0.3, "mouth_corner": 1.5, "mouth_top": 0.5,
           "mouth_inner_top": 0.5, "mouth_inner_bottom": 0.5, "mouth_bottom": 0.5, "chin": 1.0,
           "brow_inner": 0.7, "brow_mid": 0.7, "brow_outer": 0.7}
# Ways up: from the mean of the first to the mean of the second.
_UPWARD = ((("eye_lower_L", "eye_lower_R"), ("eye_upper_L", "eye_upper_R")),
           (("mouth_bottom",), ("mouth_top",)),
           (("eye_upper_L", "eye_upper_R"), ("brow_mid_L", "brow_mid_R")))
# What the three directions together count beside the places. Because a person's lids and lips may lean ten degrees,
# they get half as much: the head then leans a few degrees at most.
_DIRECTIONS = 0.5
# Because after so many rounds the weights no longer change by what matters.
_ROUNDS = 20
# Because places closer together than this share of their farthest distance say nothing about a direction.
_FLAT = 1e-6


@dataclass(frozen=True, eq=False)
class Similarity:
    """y = scale * rotation @ x + offset; ``rotation`` (3, 3) proper, ``offset`` (3,)."""

    scale: float
    rotation: Array
    offset: Array

    def apply(self, points: ArrayLike) -> Array:
        """Return places (..., 3) after the transformation."""
        return self.apply_vectors(points) + self.offset

    def apply_vectors(self, vectors: ArrayLike) -> Array:
        """Return displacements (..., 3) after the transformation: they have no offset."""
        return self.scale * (np.asarray(vectors, float) @ self.rotation.T)

    def inverse(self) -> Similarity:
        """Return the transformation back."""
        back = self.rotation.T
        return Similarity(1.0 / self.scale, back, -(back @ self.offset) / self.scale)


def align(source: Mapping[str, ArrayLike], target: Mapping[str, ArrayLike]) -> Similarity:
    """Return the similarity that takes the source's landmarks to the target's as well as it can.

    source, target: name -> place (3,), in any units and axes. Names that only one of them has do not count, nor do
    optional landmarks beside the required ones. A turned, scaled and moved source gives the same places after it.
    Raises InputError where the landmarks fix no similarity: fewer than three, all on a line, not finite.
    """
    common = [name for name in source if name in target]
    names = [name for name in common if name in REQUIRED] or common
    p, q = _places(source, names, "source"), _places(target, names, "target")
    base = weights = np.array([_WEIGHT.get(name.removesuffix("_L").removesuffix("_R"), 1.0) for name in names])
    frames = _lateral_axis(p, names), _lateral_axis(q, names)
    sided = frames[0] is not None and frames[1] is not None
    ups = _upward(source, target, set(names)) if sided else []
    for _ in range(_ROUNDS):
        found = _fit(p, q, weights, frames if sided else None, ups)
        misfit = np.linalg.norm(found.apply(p) - q, axis=1)
        usual = 2.0 * np.median(misfit)
        if usual <= _FLAT * np.ptp(q, axis=0).max():            # nothing to weigh: they fit
            break
        weights = base / (1.0 + (misfit / usual) ** 2)
    return found


def _places(points: Mapping[str, ArrayLike], names: list[str], which: str) -> Array:
    """Return the places (k, 3) of the names, checked."""
    if len(names) < 3:
        raise InputError(f"{which}: expected at least three landmarks that both faces have, got {len(names)}")
    try:
        places = np.array([np.asarray(points[name], float) for name in names])
    except (TypeError, ValueError):
        places = np.empty(0)
    if places.shape != (len(names), 3) or not np.isfinite(places).all():
        raise InputError(f"{which}: expected three finite numbers for every landmark")
    spread = np.linalg.svd(places - places.mean(axis=0), compute_uv=False)
    if spread[1] <= _FLAT * spread[0] or not spread[0] > 0:
        raise InputError(f"{which}: the landmarks lie on one line or one place, so no direction can be read off them")
    return places


def _lateral_axis(places: Array, names: list[str]) -> Array | None:
    """Return the direction (3,) from right to left that fits all pairs best, or None without two pairs."""
    rows = {name: i for i, name in enumerate(names)}
    pairs = [places[i] - places[rows[f"{name[:-2]}_R"]] for name, i in rows.items()
             if name.endswith("_L") and f"{name[:-2]}_R" in rows]
    if len(pairs) < 2:
        return None
    across = np.array(pairs)
    axis = np.linalg.svd(across, full_matrices=False)[2][0]         # largest sum of squares along it
    return axis if (across @ axis).sum() >= 0 else -axis


def _basis(axis: Array) -> Array:
    """Return a right-handed orthonormal basis (3, 3) in columns, whose first column is the axis."""
    other = np.cross(axis, np.eye(3)[np.abs(axis).argmin()])
    other /= np.linalg.norm(other)
    return np.stack([axis, other, np.cross(axis, other)], axis=1)


def _upward(source: Mapping, target: Mapping, names: set[str]) -> list[tuple[Array, Array]]:
    """Return the ways up of both faces, as pairs of vectors."""
    def way(points: Mapping, low: tuple[str, ...], high: tuple[str, ...]) -> Array:
        return (np.mean([np.asarray(points[name], float) for name in high], axis=0)
                - np.mean([np.asarray(points[name], float) for name in low], axis=0))

    return [(way(source, low, high), way(target, low, high)) for low, high in _UPWARD if names.issuperset(low + high)]


def _fit(p: Array, q: Array, weights: Array, axes: tuple[Array, Array] | None,
         ups: list[tuple[Array, Array]]) -> Similarity:
    """Return the similarity for given weights; with ``axes`` the first is taken to the second exactly."""
    w = weights / weights.sum()
    mean_p, mean_q = w @ p, w @ q
    x, y = p - mean_p, q - mean_q
    spread_p, spread_q = (np.sqrt((w * (z**2).sum(axis=1)).sum()) for z in (x, y))
    rotation = _rotation(x, y, w) if axes is None else \
        _rotation_about(x / spread_p, y / spread_q, w, _basis(axes[0]), _basis(axes[1]), ups)
    scale = float(spread_q / spread_p)
    return Similarity(scale, rotation, mean_q - scale * (rotation @ mean_p))


def _rotation(x: Array, y: Array, w: Array) -> Array:
    """Return the proper rotation with the least squares (Umeyama 1991, eq. 40-43)."""
    u, _, vt = np.linalg.svd((y * w[:, None]).T @ x)
    sign = np.array([1.0, 1.0, np.sign(np.linalg.det(u) * np.linalg.det(vt))])
    return (u * sign) @ vt


def _rotation_about(x: Array, y: Array, w: Array, from_basis: Array, to_basis: Array,
                    ups: list[tuple[Array, Array]]) -> Array:
    """Return the rotation that takes the first column of one basis to the other's and fits best about it.

    In the plane of the other two columns places are complex numbers: the best turn is the argument of the sum of
    conj(from) * to.
    """
    def flat(vectors: Array, basis: Array) -> NDArray[np.complex128]:
        return vectors @ basis[:, 1] + 1j * (vectors @ basis[:, 2])

    a, b = flat(x, from_basis), flat(y, to_basis)
    total = (w * a.conj() * b).sum()
    ways = [(flat(s, from_basis), flat(t, to_basis)) for s, t in ups]
    ways = [(s / abs(s), t / abs(t)) for s, t in ways if abs(s) > 0 and abs(t) > 0]
    if ways:
        evidence = np.sqrt((w * abs(a) ** 2).sum() * (w * abs(b) ** 2).sum())
        total = total + _DIRECTIONS * evidence * np.mean([s.conj() * t for s, t in ways])
    turn = total / abs(total) if abs(total) > 0 else 1.0
    plane = np.array([[1.0, 0.0, 0.0], [0.0, turn.real, -turn.imag], [0.0, turn.imag, turn.real]])
    return to_basis @ plane @ from_basis.T

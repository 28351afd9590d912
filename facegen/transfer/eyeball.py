"""How an eye turns: about the centre of its ball, within an egg's own shape, or sliding as a painted disc.

Sphere: linear least squares |x|^2 = 2 c.x + d, on what is left after the cornea's bulge is cut away. Ellipsoid: the
quadric x.Q x + 2 q.x = 1 by linear least squares; it turns as A R A^-1, A the ellipsoid's axes: a cartoon's egg of an
eye keeps its outline and never leaves its lids.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

Array = NDArray[np.float64]

# A cornea is about a fifth of a ball: this share of the surface decides the sphere.
_KEPT = 0.7
_FEWEST = 8         # vertices that say something about a sphere
_ROUNDS = 12
# Misfit of a sphere, as a share of its radius, above which an ellipsoid is tried; and how much better that must be.
_EGG, _BETTER = 0.03, 0.4
_LONGEST_EGG = 3.0
# A disc: its thickness against its width, or a sphere so large, in eye widths, that it is none.
_FLAT, _LARGEST = 0.06, 2.5
# A disc turns about a point this many eye widths behind it: a person's ball has 0.57.
_BEHIND = 0.57
# Eyes that look aside by less than this, degrees, turn about the head's axes, as a person's do; an animal's, about
# their own.
_ASIDE = 30.0
# What stands out of an eye, a cornea or a glint, counts so many radii around: lids of few vertices span it.
_AROUND = 0.1
_TINY = 1e-300


@dataclass(frozen=True, eq=False)
class Eyeball:
    """``centre`` (3,), mm. ``shape`` (3, 3), symmetric: takes the unit ball to the eye. ``azimuth``: radians by which
    its pitch axis is turned. ``slide``: for a flat disc, the farthest way (mm) it may slide in its plane with the
    normal ``normal``; None for a ball."""

    centre: Array
    shape: Array
    azimuth: float = 0.0
    slide: float | None = None
    normal: Array | None = None

    @property
    def radius(self) -> float:
        """The mean half axis, mm."""
        return float(np.cbrt(np.linalg.det(self.shape)))

    @cached_property
    def inverse(self) -> Array:
        """(3, 3): takes the eye to the unit ball."""
        return np.linalg.inv(self.shape)

    def in_radii(self, at: Array) -> Array:
        """Return places (n, 3) as seen from the centre, where the eye is the unit ball."""
        return (at - self.centre) @ self.inverse

    def turned(self, yaw: Array, pitch: Array, at: Array) -> Array:
        """Return displacements (k, n, 3) of places (n, 3) for angles (k,) in degrees: to the subject's left, and up."""
        turn = gaze_rotation(yaw, pitch, self.azimuth)
        if self.slide is not None:
            way = self.radius * (turn @ self.normal - self.normal)
            way = way - (way @ self.normal)[:, None] * self.normal
            length = np.linalg.norm(way, axis=1, keepdims=True)
            way = way * (np.minimum(length, self.slide) / np.maximum(length, 1e-300))
            return np.repeat(way[:, None, :], len(at), axis=1)
        moves = self.shape @ (turn - np.eye(3)) @ self.inverse
        return (at - self.centre) @ np.swapaxes(moves, 1, 2)


class EyeFront:
    """How far an eye reaches from its centre, cornea, glint and all, in radii of its ``ball``."""

    def __init__(self, ball: Eyeball, vertices: Array) -> None:
        """vertices (e, 3): the eye's, mm."""
        self.ball = ball
        away = ball.in_radii(vertices)
        radius = np.linalg.norm(away, axis=1)
        self._tree = cKDTree(away / np.maximum(radius, _TINY)[:, None])
        around = self._tree.query_ball_point(self._tree.data, _AROUND)
        self._radius = np.array([radius[some].max() for some in around])

    def __call__(self, unit: Array) -> Array:
        """Return the radius (n,) in the directions (n, 3), unit vectors of `Eyeball.in_radii`."""
        return self._radius[self._tree.query(unit)[1]]


def gaze_rotation(yaw: Array, pitch: Array, azimuth: float = 0.0) -> Array:
    """Return rotations (k, 3, 3): pitch (up) first, about an axis ``azimuth`` from x, then yaw (to the left) about y.

    Angles (k,) in degrees, azimuth in radians. As the base face turns its eyes.
    """
    def about_y(angle: Array) -> Array:
        c, s, o, i = np.cos(angle), np.sin(angle), np.zeros_like(angle), np.ones_like(angle)
        return np.stack([c, o, s, o, i, o, -s, o, c], axis=-1).reshape(-1, 3, 3)

    pitch = np.radians(np.asarray(pitch, float))
    c, s, o, i = np.cos(pitch), np.sin(pitch), np.zeros_like(pitch), np.ones_like(pitch)
    up = np.stack([i, o, o, o, c, s, o, -s, c], axis=-1).reshape(-1, 3, 3)
    if azimuth:
        side = about_y(np.array([azimuth]))
        up = side @ up @ np.swapaxes(side, 1, 2)
    return about_y(np.radians(np.asarray(yaw, float))) @ up


def fit_eye(components: Sequence[tuple[Array, Array]], *, outward: Array, width: float, opening: Array,
            pupil: Array | None = None) -> Eyeball:
    """Return how an eye turns.

    components: (vertices (p, 3), their areas (p,)) of ball, cornea, iris and whatever it has, mm. outward (3,): where
    the lids' opening looks; width (mm): from corner to corner; opening (3,): its middle. pupil: the landmark
    eye_center, if given: it tells where the eye looks.
    """
    at, area = max(components, key=lambda one: float(np.ptp(one[0], axis=0).max()))
    area = np.maximum(area, 1e-12 * max(area.max(), 1e-300))
    enough = len(at) >= _FEWEST
    _, spread, axes = np.linalg.svd(at - at.mean(axis=0) if enough else np.zeros((3, 3)), full_matrices=False)
    centre, radius, misfit = _sphere(at, area) if enough else (outward, np.inf, np.inf)
    if spread[2] <= _FLAT * spread[0] or not radius < _LARGEST * width:
        normal = axes[2] * np.sign(axes[2] @ outward or 1.0) if spread[1] > 0 else outward
        middle = pupil if pupil is not None else np.average(at, axis=0, weights=area)
        ball = _BEHIND * width
        # A disc as wide as the opening is sclera and all: it would leave a gap where it slid away from.
        room = max(0.0, 0.5 * (width - float(np.ptp(at @ _across(normal)))))
        return Eyeball(middle - ball * normal, ball * np.eye(3), 0.0, room, normal)
    shape = radius * np.eye(3)
    if misfit > _EGG * radius:
        egg = _ellipsoid(at, area)
        if egg is not None and egg[2] < _BETTER * misfit:
            centre, shape = egg[:2]
    look = (pupil if pupil is not None else opening) - centre
    azimuth = float(np.arctan2(look[0], look[2]))
    aside = abs(np.degrees(azimuth)) > _ASIDE and np.hypot(look[0], look[2]) > 0.2 * radius
    return Eyeball(centre, shape, azimuth if aside else 0.0)


def _across(normal: Array) -> Array:
    """Return the horizontal direction (3,) in a disc's plane."""
    across = np.cross([0.0, 1.0, 0.0], normal)
    return across / max(np.linalg.norm(across), 1e-300)


def _sphere(at: Array, area: Array) -> tuple[Array, float, float]:
    """Return centre, radius and root mean square misfit of the sphere that most of the surface lies on."""
    weight, middle = area.copy(), at.mean(axis=0)
    x = at - middle
    centre, radius, off = np.zeros(3), np.inf, np.zeros(len(at))
    for _ in range(_ROUNDS):
        root = np.sqrt(weight)[:, None]
        left = np.column_stack([2 * x, np.ones(len(x))])
        found = np.linalg.lstsq(left * root, (x**2).sum(axis=1) * root[:, 0], rcond=None)[0]
        square = found[3] + found[:3] @ found[:3]
        if square <= 0:
            return middle, np.inf, np.inf
        centre, radius = found[:3], float(np.sqrt(square))
        off = np.abs(np.linalg.norm(x - centre, axis=1) - radius)
        order = np.argsort(off, kind="stable")
        share = np.cumsum(area[order]) / area.sum()
        weight = np.where(off <= off[order[min(np.searchsorted(share, _KEPT), len(at) - 1)]], area, 0.0)
        if (weight > 0).sum() < _FEWEST:
            break
    return centre + middle, radius, float(np.sqrt(np.average(off**2, weights=area)))


def _ellipsoid(at: Array, area: Array) -> tuple[Array, Array, float] | None:
    """Return centre, shape (3, 3) and misfit (mm) of the ellipsoid, or None where the quadric is none."""
    middle, size = at.mean(axis=0), float(np.ptp(at, axis=0).max())
    x, y, z = ((at - middle) / size).T
    left = np.column_stack([x * x, y * y, z * z, 2 * x * y, 2 * x * z, 2 * y * z, 2 * x, 2 * y, 2 * z])
    root = np.sqrt(area)
    a, b, c, d, e, f, *g = np.linalg.lstsq(left * root[:, None], root, rcond=None)[0]
    quadric = np.array([[a, d, e], [d, b, f], [e, f, c]])
    values, axes = np.linalg.eigh(quadric)
    if values[0] <= 0 or values[2] > _LONGEST_EGG**2 * values[0]:
        return None
    centre = -np.linalg.solve(quadric, g)
    values = values / (1.0 + centre @ quadric @ centre)
    shape = (axes / np.sqrt(values)) @ axes.T * size
    away = at - middle - centre * size
    unit = np.linalg.norm(away @ np.linalg.inv(shape), axis=1)
    off = (unit - 1.0) * np.linalg.norm(away, axis=1) / np.maximum(unit, 1e-300)
    return middle + centre * size, shape, float(np.sqrt(np.average(off**2, weights=area)))

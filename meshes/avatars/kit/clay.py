"""Smooth shapes to model with: balls and strokes that melt into one another, as a field that is negative inside.

Blending: the quadratic smooth minimum (I. Quilez, "smooth minimum", 2013). Distances are near-exact close to the
surface, which is all that `Clay.onto` (Newton's method along the gradient) needs.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

# Central differences: far below any detail (models are about ten units high), far above rounding.
_STEP = 1e-4
_NEWTON_STEPS = 12
# Newton's step is bounded, because far from the surface an ellipsoid's distance is only a guess.
_LONGEST_STEP = 0.4
_RAY_SAMPLES = 160

Field = Callable[[NDArray], NDArray]


def ball(at: ArrayLike, radii: ArrayLike, turn: ArrayLike | None = None) -> Field:
    """Return an ellipsoid's field. turn: (3, 3) rows are its axes."""
    at, radii = np.asarray(at, float), np.broadcast_to(np.asarray(radii, float), 3)
    axes = np.eye(3) if turn is None else np.asarray(turn, float)

    def field(p: NDArray) -> NDArray:
        q = (p - at) @ axes.T
        k0, k1 = _length(q / radii), _length(q / radii**2)
        return np.where(k1 > 0, k0 * (k0 - 1) / np.maximum(k1, 1e-12), -radii.min())

    return field


def stroke(points: ArrayLike, radii: ArrayLike, squash: ArrayLike = (1.0, 1.0, 1.0)) -> Field:
    """Return the field of a brush stroke: round cones along points (k, 3). squash: its thickness in x, y and z."""
    points, radii = np.asarray(points, float), np.broadcast_to(np.asarray(radii, float), len(points))
    squash = np.asarray(squash, float)

    def field(p: NDArray) -> NDArray:
        best = np.full(p.shape[:-1], np.inf)
        for a, b, r, s in zip(points[:-1], points[1:], radii[:-1], radii[1:], strict=True):
            along = (b - a) / squash
            t = np.clip(((p - a) / squash) @ along / (along @ along), 0.0, 1.0)
            off = (p - a - t[..., None] * (b - a)) / squash
            best = np.minimum(best, _length(off) - (r + t * (s - r)))
        return best * squash.min()

    return field


def _length(vectors: NDArray) -> NDArray:
    return np.sqrt(np.einsum("...i,...i->...", vectors, vectors))


def mirrored(points: ArrayLike) -> NDArray:
    """Return points (..., 3) on the other side of the plane x = 0."""
    return np.asarray(points, float) * (-1.0, 1.0, 1.0)


def rotation(axis: ArrayLike, degrees: float) -> NDArray:
    """Return the rotation matrix (3, 3) about an axis (Rodrigues)."""
    x, y, z = np.asarray(axis, float) / np.linalg.norm(axis)
    angle = np.radians(degrees)
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k


class Clay:
    """A heap of shapes, in the order they were put on or carved out.

    ``melt`` is how far a shape melts into what is there: the width of the fillet. Those of ``pair`` come twice, on
    both sides of x = 0.
    """

    def __init__(self) -> None:
        self._shapes: list[tuple[Field, float, bool]] = []

    def add(self, field: Field, melt: float = 0.5, *, pair: bool = False) -> None:
        """Put a shape on."""
        self._put(field, melt, pair, True)

    def carve(self, field: Field, melt: float = 0.3, *, pair: bool = False) -> None:
        """Take a shape out."""
        self._put(field, melt, pair, False)

    def _put(self, field: Field, melt: float, pair: bool, more: bool) -> None:
        self._shapes.append((field, melt, more))
        if pair:
            self._shapes.append((lambda p: field(mirrored(p)), melt, more))

    def __call__(self, points: ArrayLike) -> NDArray:
        """Return the field at points (..., 3): about the distance to the surface, negative inside."""
        p = np.asarray(points, float)
        total = np.full(p.shape[:-1], 1e3)
        for field, melt, more in self._shapes:
            d = field(p)
            total = _smooth_min(total, d, melt) if more else -_smooth_min(-total, d, melt)
        return total

    def gradient(self, points: ArrayLike) -> NDArray:
        """Return the field's gradient (..., 3)."""
        p = np.asarray(points, float)
        steps = _STEP * np.eye(3)
        return np.stack([(self(p + s) - self(p - s)) / (2 * _STEP) for s in steps], axis=-1)

    def normals(self, points: ArrayLike) -> NDArray:
        """Return unit normals (..., 3)."""
        g = self.gradient(points)
        return g / np.maximum(np.linalg.norm(g, axis=-1, keepdims=True), 1e-9)

    def onto(self, points: ArrayLike, level: ArrayLike = 0.0, steps: int = _NEWTON_STEPS) -> NDArray:
        """Return points (..., 3) moved onto the surface, or to a distance ``level`` (one, or (...)) outside
        it."""
        p = np.array(points, float)
        for _ in range(steps):
            g = self.gradient(p)
            step = ((self(p) - level) / np.maximum((g**2).sum(-1), 1e-6))[..., None] * g
            p -= step * np.minimum(1.0, _LONGEST_STEP / np.maximum(np.linalg.norm(step, axis=-1, keepdims=True), 1e-12))
        return p

    def shoot(self, start: ArrayLike, directions: ArrayLike, reach: float) -> NDArray:
        """Return where rays (n, 3) from a start inside leave the surface for the last time within ``reach``."""
        start, d = np.asarray(start, float), np.asarray(directions, float)
        d = d / np.linalg.norm(d, axis=-1, keepdims=True)
        t = np.linspace(0.0, reach, _RAY_SAMPLES)
        inside = np.stack([self(start + s * d) < 0 for s in t], axis=-1)
        last = _RAY_SAMPLES - 1 - np.argmax(inside[..., ::-1], axis=-1)
        low, high = t[last], t[np.minimum(last + 1, _RAY_SAMPLES - 1)]
        for _ in range(40):
            middle = (low + high) / 2
            within = self(start + middle[..., None] * d) < 0
            low, high = np.where(within, middle, low), np.where(within, high, middle)
        return start + low[..., None] * d


def _smooth_min(a: NDArray, b: NDArray, melt: float) -> NDArray:
    h = np.maximum(melt - np.abs(a - b), 0.0) / melt
    return np.minimum(a, b) - h * h * melt / 4


def curve(points: Sequence[ArrayLike], count: int, power: float = 1.0) -> NDArray:
    """Return ``count`` points (count, 3), evenly spaced, on a Catmull-Rom spline through points.

    power: above 1 crowds them towards the end.
    """
    p = np.asarray(points, float)
    p = np.concatenate([[2 * p[0] - p[1]], p, [2 * p[-1] - p[-2]]])
    t = np.linspace(0, 1, 24, endpoint=False)[:, None]
    pieces = [
        0.5 * (2 * b + (c - a) * t + (2 * a - 5 * b + 4 * c - d) * t**2 + (3 * b - a - 3 * c + d) * t**3)
        for a, b, c, d in zip(p[:-3], p[1:-2], p[2:-1], p[3:], strict=True)
    ]
    fine = np.concatenate([*pieces, p[-2:-1]])
    return on_path(fine, 1 - (1 - np.linspace(0, 1, count)) ** power)


def on_path(points: NDArray, shares: NDArray) -> NDArray:
    """Return places (count, d) on a path (k, d) at shares (count,) of its length, 0 to 1."""
    length = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    where = shares * length[-1]
    return np.stack([np.interp(where, length, axis) for axis in points.T], axis=1)

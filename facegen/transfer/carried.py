"""What the skin carries: brows, lashes, a moustache. Each vertex takes the rigid motion of the skin under it.

The skin under a vertex is its nearest triangle; its motion is the foot's displacement and the rotation of the
triangle: normal onto normal, and in the plane the rotation nearest to the deformation (polar decomposition of a 2 x 2
matrix, in closed form). Skin that moves rigidly carries what lies on it exactly rigidly.

Thin pieces: the rigid motions T_i are spread over the piece by the screened Laplace equation

    (L + A / s^2) T = A / s^2 T_foot,        A = diag(trust_i area_i)

whose rows sum to one, so that a lash's tip follows its root and a moustache does not tear. Bulky pieces move as a
whole: the rigid motion with the least squares to what their vertices would do.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from facegen.geometry.closest import ClosestPoints
from facegen.geometry.factor import Factor
from facegen.geometry.operators import Surface

Array = NDArray[np.float64]

# Motion is smooth over this share of the face's height: three millimetres on a person.
_SMOOTH = 0.03
# Trust falls off beyond the nearest vertices over this share of the height, or of the piece's own thickness.
_NEAR, _NEAR_THICK = 0.008, 0.25
# Because every vertex needs something to hold on to, however far it is and however small its triangles are.
_LEAST_TRUST, _LEAST_AREA = 1e-6, 1e-3
# Nine tenths of a piece within this share of the height of the skin make it thin.
BULKY = 0.09
_TINY = 1e-300


class SkinFrames:
    """Feet of places on the skin, and the skin's rigid motion at them."""

    def __init__(self, skin: Surface, places: Array) -> None:
        """skin: vertices of the whole avatar and the skin's triangles, mm. places (p, 3): what it carries."""
        low, high = (places.min(axis=0), places.max(axis=0)) if len(places) else (np.zeros(3), np.zeros(3))
        margin = 0.5 * float(np.max(high - low, initial=0.0))
        corners = skin.vertices[skin.faces]
        near = np.flatnonzero(((corners.max(axis=1) >= low - margin) & (corners.min(axis=1) <= high + margin)).all(1))
        near = near if len(near) else np.arange(len(skin.faces))
        feet = ClosestPoints(Surface(skin.vertices, skin.faces[near]))(places)
        self.distances = feet.distances
        self.corners = skin.faces[near[feet.faces]]                     # (p, 3)
        self.weights = feet.weights
        self._points = feet.points
        self._triangles, self._of_place = np.unique(near[feet.faces], return_inverse=True)
        self._rest = skin.vertices[skin.faces[self._triangles]]         # (t, 3, 3)
        self._faces = skin.faces[self._triangles]
        self._basis, self._inverse = _plane_frames(self._rest)

    def moves(self, motion: Array) -> NDArray[np.bool_]:
        """Return in which shapes (k,) of a skin motion (k, n, 3) anything under the places moves."""
        return np.any(motion[:, self._faces] != 0.0, axis=(1, 2, 3))

    def rigid(self, motion: Array) -> tuple[Array, Array]:
        """Return (D, s) for a skin motion (k, n, 3): the skin under place i takes x to x + D_i x + s_i.

        D (k, p, 3, 3) is the rotation less the identity, s (k, p, 3).
        """
        moved = motion[:, self._faces]                                  # (k, t, 3, 3)
        turn = _turns(self._basis, self._inverse, self._rest + moved) - np.eye(3)
        still = ~np.any(moved != 0.0, axis=(2, 3))
        turn[still] = 0.0
        turn = turn[:, self._of_place.reshape(-1)]
        foot = np.einsum("pc,kpci->kpi", self.weights, motion[:, self.corners])
        return turn, foot - np.einsum("kpij,pj->kpi", turn, self._points)


def _plane_frames(corners: Array) -> tuple[Array, Array]:
    """Return orthonormal frames (t, 3, 3) in columns (two in the plane, the normal) and the inverses (t, 2, 2) of the
    sides in them."""
    frames = _frames(corners)
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    sides = np.einsum("tji,tjk->tik", frames[:, :, :2], np.stack([a, b], axis=2))
    det = sides[:, 0, 0] * sides[:, 1, 1] - sides[:, 0, 1] * sides[:, 1, 0]
    adjoint = np.stack([sides[:, 1, 1], -sides[:, 0, 1], -sides[:, 1, 0], sides[:, 0, 0]], axis=1).reshape(-1, 2, 2)
    return frames, adjoint / np.where(np.abs(det) > _TINY, det, np.inf)[:, None, None]


def _frames(corners: Array) -> Array:
    a, b = corners[..., 1, :] - corners[..., 0, :], corners[..., 2, :] - corners[..., 0, :]
    normal = np.cross(a, b)
    normal = normal / np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), _TINY)
    first = a / np.maximum(np.linalg.norm(a, axis=-1, keepdims=True), _TINY)
    return np.stack([first, np.cross(normal, first), normal], axis=-1)


def _turns(basis: Array, inverse: Array, corners: Array) -> Array:
    """Return the rotations (k, t, 3, 3) of triangles (k, t, 3, 3) from rest; the identity where one has collapsed."""
    frames = _frames(corners)
    a, b = corners[..., 1, :] - corners[..., 0, :], corners[..., 2, :] - corners[..., 0, :]
    sides = np.einsum("...ji,...jk->...ik", frames[..., :2], np.stack([a, b], axis=-1))
    f = sides @ inverse
    cos, sin = f[..., 0, 0] + f[..., 1, 1], f[..., 1, 0] - f[..., 0, 1]
    size = np.hypot(cos, sin)
    flat = (size <= _TINY) | (np.linalg.norm(frames[..., 2], axis=-1) < 0.5) | (np.abs(inverse).sum((1, 2)) <= 0)
    cos, sin = (np.where(flat, one, two / np.maximum(size, _TINY)) for one, two in ((1.0, cos), (0.0, sin)))
    zero, one = np.zeros_like(cos), np.ones_like(cos)
    plane = np.stack([cos, -sin, zero, sin, cos, zero, zero, zero, one], axis=-1).reshape(*cos.shape, 3, 3)
    turns = frames @ plane @ np.swapaxes(basis, -1, -2)
    turns[flat] = np.eye(3)
    return turns


class Carried:
    """All carried pieces of an avatar, prepared once."""

    def __init__(self, skin: Surface, pieces: list[tuple[NDArray, NDArray]], height: float) -> None:
        """skin: vertices of the whole avatar and the skin's triangles, mm. pieces: (vertices (p,), triangles (q, 3)).
        height of the face, mm."""
        self.rows = np.concatenate([rows for rows, _ in pieces])
        self._at = skin.vertices[self.rows]
        self._frames = SkinFrames(skin, self._at)
        lengths = [len(rows) for rows, _ in pieces]
        starts = np.concatenate([[0], np.cumsum(lengths)])
        local = np.full(len(skin.vertices), -1)
        local[self.rows] = np.arange(len(self.rows))
        faces = local[np.concatenate([triangles for _, triangles in pieces])]
        area = Surface(self._at, faces).vertex_areas
        area = np.maximum(area, _LEAST_AREA * max(float(area.mean()), _TINY))
        trust = np.empty(len(self.rows))
        self._bulky = []
        for start, end in pairwise(starts):
            far = self._frames.distances[start:end]
            low, high = np.quantile(far, [0.1, 0.9])
            width = max(_NEAR * height, _NEAR_THICK * (high - low))
            trust[start:end] = np.exp(-0.5 * (np.maximum(far - low, 0.0) / width) ** 2) + _LEAST_TRUST
            if high > BULKY * height:
                self._bulky.append((start, end))
        self._trust = trust * area
        links = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
        edges = np.unique(np.sort(links, axis=1), axis=0)
        n = len(self.rows)
        join = sparse.coo_array((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), shape=(n, n))
        join = join + join.T
        laplace = sparse.diags_array(np.asarray(join.sum(axis=1)).reshape(-1)) - join
        self._hold = self._trust / (_SMOOTH * height) ** 2
        self._factor = Factor(sparse.csc_array(laplace + sparse.diags_array(self._hold)), what="the carried pieces")

    def move(self, motion: Array) -> Array:
        """Return the displacements (k, p, 3) of ``rows`` for a skin motion (k, n, 3)."""
        result = np.zeros((len(motion), len(self.rows), 3))
        active = np.flatnonzero(self._frames.moves(motion))
        if not len(active):
            return result
        turn, shift = self._frames.rigid(motion[active])
        moved = np.empty((len(active), len(self.rows), 3))
        # Both about a place amid the pieces, so that nothing cancels when the head is far from the origin.
        centre = self._at.mean(axis=0)
        shift = shift + np.einsum("kpij,j->kpi", turn, centre)
        both = np.concatenate([turn.reshape(*turn.shape[:2], 9), shift], axis=2)
        right = (np.moveaxis(both, 0, 1) * self._hold[:, None, None]).reshape(len(self.rows), -1)
        spread = np.moveaxis(self._factor.solve(right).reshape(len(self.rows), len(active), 12), 1, 0)
        moved[:] = np.einsum("kpij,pj->kpi", spread[..., :9].reshape(*turn.shape), self._at - centre) + spread[..., 9:]
        for start, end in self._bulky:
            own = slice(start, end)
            each = np.einsum("kpij,pj->kpi", turn[:, own], self._at[own] - centre) + shift[:, own]
            moved[:, own] = _rigid_fit(self._at[own], each, self._trust[own])
        result[active] = moved
        return result


def _rigid_fit(at: Array, moved: Array, weights: Array) -> Array:
    """Return the displacements (k, p, 3) of the rigid motions nearest to ``moved`` (k, p, 3) (Umeyama 1991)."""
    w = weights / weights.sum()
    centre = w @ at
    shift = np.einsum("p,kpi->ki", w, moved)
    x = at - centre
    y = x + moved - shift[:, None]
    u, _, vt = np.linalg.svd(np.einsum("p,kpi,pj->kij", w, y, x))
    sign = np.ones((len(moved), 3))
    sign[:, 2] = np.linalg.det(u) * np.linalg.det(vt)
    turn = (u * sign[:, None, :]) @ vt
    return x @ np.swapaxes(turn - np.eye(3), 1, 2) + shift[:, None]

"""Teeth and tongue do not come through lips, nor a mouth's lining: how far something lies behind the outermost skin,
along the way out of the mouth."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from facegen.geometry.ahead import ahead
from facegen.geometry.normals import vertex_normals
from facegen.geometry.operators import Surface
from facegen.transfer.piece_motion import PieceMotion
from facegen.transfer.pushing import DONE, ROUNDS, Contact, Spread, moving

Array = NDArray[np.float64]

# Because facets of teeth and of lips cross by as much, this share of the face's height is no fault.
_ALLOWED = 0.002
# A row of teeth gives way by this share of the face's height: two millimetres on a person.
_GIVE = 0.02
# Teeth farther than this share of the height before any skin have not come through it; they hang free.
_THROUGH = 0.12
# Teeth farther than this share behind the lips never reach them.
_NEAR_LIPS = 0.15
# Lips come from no farther than this share of the height to lie before them.
_LIP_TRAVEL = 0.15
# Lips: skin within this share of the height from the lip line that looks forward and was to be seen at rest.
_LIP_REACH, _FORWARD = 0.6, 0.1
_SEEN = 0.03
# Skin of which the half, or this share of the height, is left before a lining is thick enough.
_LEFT = 0.01


class Front:
    """The skin before the teeth, as seen from the front at rest."""

    def __init__(self, pieces: PieceMotion, inner: NDArray[np.int64] | None = None) -> None:
        """inner: vertices of the skin that are behind the lips, where that is known."""
        face = pieces.face
        self.rest, self.height, self.axes = pieces.vertices, face.height, face.mouth_axes
        corners = pieces.skin.corners @ self.axes.T
        middles = corners.mean(axis=1)
        near = np.linalg.norm(middles - self.axes @ face.lips, axis=1) < _LIP_REACH * face.height
        self.near = np.unique(pieces.skin.faces[near])
        forward = pieces.skin.normals @ self.axes[2]
        near &= forward * (np.sign(forward[near].sum()) or 1.0) > _FORWARD      # triangles may be wound inward
        if inner is not None:
            near &= ~np.isin(pieces.skin.faces, inner).any(axis=1)
        rows = np.flatnonzero(near)
        # What was hidden at rest, such as the back of the mouth, is no barrier.
        seen = ahead(middles[rows], corners[rows])[0] < _SEEN * face.height
        self.faces = pieces.skin.faces[rows[seen]]
        self.corners = self.rest[self.faces] @ self.axes.T
        self.facing = vertex_normals(pieces.vertices, pieces.faces) @ self.axes[2] > 0

    def ahead_of(self, rows: NDArray) -> Array:
        """Return how far (p,) the skin is before some vertices (p,) at rest, mm; infinite where there is none."""
        return ahead(self.rest[rows] @ self.axes.T, self.corners)[0]


class _Barrier:
    """Some of the front's skin, and how far behind it some vertices are to stay."""

    def __init__(self, front: Front, faces: NDArray, own: NDArray, least: Array) -> None:
        """faces (t, 3); own (p,); least (p,), mm."""
        self._front, self.faces, self._own, self._least = front, faces, own, least
        self._skin, local = np.unique(faces, return_inverse=True)
        self._local = local.reshape(-1, 3)

    def touched(self, motion: Array) -> NDArray[np.int64]:
        """Return the shapes in which anything moves."""
        return np.flatnonzero(moving(motion, np.concatenate([self._skin, self._own]), self._front.height))

    def missing(self, moved: Array, allowed: float = 0.0) -> tuple[Array, NDArray[np.int64]]:
        """Return how much farther behind the skin the vertices (p,) would have to lie, mm, in a shape (n, 3), and which
        of its triangles lies over each (p,)."""
        front = self._front
        places = (front.rest[self._own] + moved[self._own]) @ front.axes.T
        now, which = ahead(places, ((front.rest[self._skin] + moved[self._skin]) @ front.axes.T)[self._local])
        through = (which >= 0) & (now > -_THROUGH * front.height)
        return np.where(through, np.maximum(self._least - allowed - now, 0.0), 0.0), which


class Behind:
    """A row of teeth, or the tongue: behind the lips."""

    def __init__(self, front: Front, pieces: PieceMotion, kind: str) -> None:
        self._front, self._rows = front, pieces.rows(kind)
        self._barrier = None
        gap = front.ahead_of(self._rows)
        near = (gap < _NEAR_LIPS * front.height) & (gap > -_THROUGH * front.height) & front.facing[self._rows]
        if near.any():
            own, gap, corners = self._rows[near], gap[near], front.corners
            at = front.rest[own] @ front.axes.T
            margin = _LIP_TRAVEL * front.height
            close = (corners.max(axis=1) > at.min(axis=0) - margin) & (corners.min(axis=1) < at.max(axis=0) + margin)
            self._barrier = _Barrier(front, front.faces[close[:, :2].all(axis=1)], own,
                                     np.minimum(gap, 0.0) - _ALLOWED * front.height)

    def part(self, motion: Array, allowed: Array, spread: Spread) -> Contact:
        """Bring the teeth behind the lips in all shapes, in place: they give way by a little, the skin by the rest."""
        before, after = np.zeros(len(motion)), np.zeros(len(motion))
        barrier, front = self._barrier, self._front
        for k in () if barrier is None else barrier.touched(motion):
            given = 0.0
            for step in range(ROUNDS + 1):
                missing, which = barrier.missing(motion[k], allowed[k])
                after[k] = missing.max()
                before[k] = after[k] if step == 0 else before[k]
                if after[k] <= DONE * front.height or step == ROUNDS:
                    break
                back = min(float(after[k]), _GIVE * front.height - given)
                given += back
                motion[k, self._rows] -= back * front.axes[2]
                push = np.zeros(len(front.rest))
                hit = missing > back
                np.maximum.at(push, barrier.faces[which[hit]].ravel(), np.repeat(missing[hit] - back, 3))
                motion[k] += spread(push)[:, None] * front.axes[2]
        return Contact(before, after)


class Lining:
    """What lay behind the lips at rest, thin and close behind them: it gives way by itself."""

    def __init__(self, front: Front, pieces: PieceMotion, *, lined: bool = False) -> None:
        """lined: whether all that the skin has there is behind the lips without this."""
        self._front, self._barrier = front, None
        rows = pieces.rows("mouth")
        own = np.setdiff1d(rows if lined else np.concatenate([front.near, rows]), front.faces)
        gap = front.ahead_of(own)
        behind = (gap > _ALLOWED * front.height) & (gap < _NEAR_LIPS * front.height)
        if behind.any():
            self._own = own[behind]
            self._barrier = _Barrier(front, front.faces, self._own, np.minimum(gap[behind] / 2, _LEFT * front.height))
            inner = [pieces.faces[piece.faces] for piece in pieces.pieces if piece.kind in ("skin", "mouth")]
            self._spread = Spread(Surface(front.rest, np.concatenate(inner)))

    def part(self, motion: Array) -> Contact:
        """Bring the lining behind the lips in all shapes, in place."""
        before, after = np.zeros(len(motion)), np.zeros(len(motion))
        barrier, front = self._barrier, self._front
        for k in () if barrier is None else barrier.touched(motion):
            for step in range(ROUNDS + 1):
                missing, _ = barrier.missing(motion[k])
                after[k] = missing.max()
                before[k] = after[k] if step == 0 else before[k]
                if after[k] <= DONE * front.height or step == ROUNDS:
                    break
                push = np.zeros(len(front.rest))
                push[self._own] = missing
                motion[k, self._own] -= self._spread(push)[self._own, None] * front.axes[2]
        return Contact(before, after)

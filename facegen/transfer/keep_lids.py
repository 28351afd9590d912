"""Eyes do not come through lids: how far a place of the skin lies outside the eye, along the ray from its centre."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from facegen.transfer.eyeball import Eyeball, gaze_rotation
from facegen.transfer.piece_motion import PieceMotion
from facegen.transfer.pushing import DONE, ROUNDS, Contact, Spread, moving

Array = NDArray[np.float64]

# Because facets of a ball and of lids that lie on it cross by as much, this share of the eye's radius is no fault; and
# skin that is clear of the eye at rest has to stay as clear, lest it show between samples.
_FACETS = 0.01
# Lids lie within so many radii of the eye's centre, and before the plane that is this far behind it.
_LID_REACH, _LID_BACK = 1.7, -0.2
# So much of its distance from the centre, in radii, a triangle of a lid's front faces outward.
_FRONT = 0.3
# So many triangles of the eye with the nearest middles are tried for one in a direction: a cornea lies over an iris.
_AROUND = 10
# A direction this little beside a triangle meets it: rounding must leave no seam.
_SEAM = 1e-9
# Because a triangle seen from the centre at no more than this solid angle has no inside.
_SLIVER = 1e-9
_TINY = 1e-300


class Lids:
    """The skin round one eye, sampled at vertices, middles of sides and of triangles: lids of few vertices cut
    corners."""

    def __init__(self, pieces: PieceMotion, s: str, ball: Eyeball) -> None:
        self._ball, self._rest = ball, pieces.vertices
        faces = np.concatenate([pieces.faces[piece.faces] for piece in pieces.pieces if piece.kind == f"eye_{s}"])
        away = ball.in_radii(pieces.vertices)
        corners = away[faces]
        self._farthest = np.linalg.norm(corners, axis=2).max()
        # A direction d meets the triangle a, b, c where d = l1 a + l2 b + l3 c with no l below zero, at 1 / sum l.
        solid = np.abs(np.linalg.det(corners)) > _SLIVER * np.linalg.norm(corners, axis=2).prod(axis=1)
        self._meets = np.linalg.inv(np.swapaxes(corners[solid], 1, 2))
        middles = corners[solid].mean(axis=1)
        self._middles = cKDTree(middles / np.maximum(np.linalg.norm(middles, axis=1), _TINY)[:, None])
        look = ball.in_radii(pieces.face.eye(s))
        look = look / max(np.linalg.norm(look), _TINY)
        near = (np.linalg.norm(away, axis=1) < _LID_REACH) & (away @ look > _LID_BACK)
        # A lid's back may lie in the eye, where nobody sees it: its front may not.
        outside = np.einsum("ti,ti->t", pieces.skin.normals, pieces.skin.corners.mean(axis=1) - ball.centre)
        near_faces = near[pieces.skin.faces].all(axis=1)
        outside = outside * (np.sign(outside[near_faces].sum()) or 1.0)         # triangles may be wound inward
        faces = pieces.skin.faces[near_faces & (outside > _FRONT * ball.radius)]
        sides = np.unique(np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1), axis=0)
        corners = np.unique(faces)
        # Every sample as three corners: a vertex thrice, a side's ends with one twice and half the weight each.
        self._corners = np.concatenate([np.repeat(corners[:, None], 3, 1), sides[:, [0, 1, 1]], faces])
        self._weights = np.concatenate([np.tile([1.0, 0.0, 0.0], (len(corners), 1)),
                                        np.tile([0.5, 0.25, 0.25], (len(sides), 1)),
                                        np.full((len(faces), 3), 1 / 3)])
        self._samples = np.einsum("sc,sci->si", self._weights, self._rest[self._corners])
        rest = self._clearance(self._samples, np.eye(3))
        facets = _FACETS * ball.radius
        self._least = np.minimum(rest, 0.0) + np.clip(rest - 2.0 * facets, -facets, facets)
        self._spare = np.where(np.isfinite(rest), rest, 0.0) - self._least

    def _clearance(self, places: Array, turn: Array) -> Array:
        """Return how far outside the eye places (s, 3) lie, mm; infinite where that is beyond doubt."""
        away = self._ball.in_radii(places)
        length = np.linalg.norm(away, axis=1)
        result = np.full(len(away), np.inf)
        near = np.flatnonzero((length < self._farthest) & (length > 0))
        if len(near) and self._middles.n:
            back = (away[near] / length[near, None]) @ turn                             # the eye is at rest again
            k = min(_AROUND, self._middles.n)
            _, which = self._middles.query(back, k=k)
            shares = np.einsum("skij,sj->ski", self._meets[which.reshape(len(near), k)], back)
            hit = shares.min(axis=2) >= -_SEAM
            radius = np.where(hit, 1.0 / np.maximum(shares.sum(axis=2), _TINY), 0.0).max(axis=1)
            result[near] = np.where(radius > 0, (length[near] - radius) * self._ball.radius, np.inf)
        return result

    def part(self, motion: Array, gaze: Array, allowed: Array, spread: Spread) -> Contact:
        """Push the skin out of the eye, which looks along gaze (k, 2), in all shapes, in place."""
        turn = gaze_rotation(gaze[:, 0], gaze[:, 1], self._ball.azimuth)
        before, after = np.zeros(len(motion)), np.zeros(len(motion))
        if not len(self._corners):
            return Contact(before, after)
        turns = np.any(turn != np.eye(3), axis=(1, 2))
        moves = moving(motion, np.unique(self._corners), self._ball.radius)
        for k in np.flatnonzero(moves | turns):
            for step in range(ROUNDS + 1):
                missing = self._missing(motion[k], turn[k] if turns[k] else None, allowed[k])
                after[k] = missing.max()
                before[k] = after[k] if step == 0 else before[k]
                if after[k] <= DONE * self._ball.radius or step == ROUNDS:
                    break
                self._push(motion[k], missing, spread)
        return Contact(before, after)

    def _missing(self, moved: Array, turn: Array | None, allowed: float) -> Array:
        """Return how much farther out the samples (s,) would have to lie, mm."""
        moved = np.einsum("sc,sci->si", self._weights, moved[self._corners])
        missing = np.zeros(len(moved))
        # Where the eye is still, skin that moves by less than it has to spare is safe.
        some = np.arange(len(moved)) if turn is not None else \
            np.flatnonzero((moved**2).sum(axis=1) > np.maximum(self._spare, 0.0) ** 2)
        clear = self._clearance(self._samples[some] + moved[some], np.eye(3) if turn is None else turn)
        missing[some] = np.maximum(self._least[some] - allowed - clear, 0.0)
        return missing

    def _push(self, moved: Array, missing: Array, spread: Spread) -> None:
        """Push the skin out along the rays from the eye's centre, in place."""
        push = np.zeros(len(self._rest))
        np.maximum.at(push, self._corners.ravel(), np.repeat(missing, 3))
        push = spread(push)
        pushed = np.flatnonzero(push > 0)
        away = (self._rest + moved)[pushed] - self._ball.centre
        moved[pushed] += (push[pushed] / np.maximum(np.linalg.norm(away, axis=1), _TINY))[:, None] * away

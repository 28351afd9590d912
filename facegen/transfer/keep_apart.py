"""The last guard: eyes do not come through lids, nor teeth through lips, where they did not at rest.

Measured, then pushed apart as far as needed and no farther. Lids: how far a place of the skin lies outside the eye,
along the ray from the eye's centre; the skin is pushed out. Lips: how far a tooth lies behind the outermost skin, along
the way out of the mouth; the row of teeth gives way by a little, the skin by the rest. What stood out at rest, as buck
teeth do, may stand out as far. A mouth's lining is thin and lies close behind the skin: it gives way by itself. A push
spreads over the neighbours, so that it leaves no dent.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import sparse
from scipy.spatial import cKDTree

from facegen.errors import InputError
from facegen.geometry.ahead import ahead
from facegen.geometry.normals import vertex_normals
from facegen.geometry.operators import Surface
from facegen.progress import Progress, counted, silent
from facegen.transfer.eyeball import Eyeball, gaze_rotation
from facegen.transfer.piece_motion import PieceMotion

Array = NDArray[np.float64]

# Because facets of a ball and of lids that lie on it cross by as much, this share of the eye's radius or of the
# face's height is no fault.
_FACETS, _ALLOWED = 0.01, 0.002
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
# So many rings of neighbours share a push, and so many rounds make sure of it.
_RINGS, _ROUNDS = 3, 4
# Because a hundred-thousandth of an eye or a face is nothing.
_DONE = 1e-5
_TINY = 1e-300


@dataclass(frozen=True, eq=False)
class Contact:
    """How deep something is through the skin at most, in each shape (k,), mm, beyond what is allowed and what it is at
    rest."""

    before: Array
    after: Array


def keep_apart(pieces: PieceMotion, motion: ArrayLike,
               gaze: ArrayLike | None = None, *,
               allowed: Mapping[str, ArrayLike] | None = None, progress: Progress = silent
               ) -> tuple[Array, dict[str, Contact]]:
    """Return displacements (k, n, 3) in which nothing pokes through, and what was measured: "eye_L", "teeth_upper"...

    motion (k, n, 3): of all vertices, as `PieceMotion.move` gives, mm. gaze (k, 4): as given there.
    allowed: name -> mm (k,): how deep something may be through the skin, such as the template's own ``before``.
    """
    motion = np.array(motion, float)
    if motion.ndim != 3 or motion.shape[1:] != pieces.vertices.shape:
        raise InputError(f"motion: expected shape (k, {len(pieces.vertices)}, 3), got {motion.shape}")
    angles = np.zeros((len(motion), 4)) if gaze is None else np.asarray(gaze, float)
    if angles.shape != (len(motion), 4):
        raise InputError(f"gaze: expected shape ({len(motion)}, 4), got {angles.shape}")
    spread = _Spread(pieces.skin)
    deep = {name: np.broadcast_to(np.asarray(mm, float), len(motion)) for name, mm in (allowed or {}).items()}
    none = np.zeros(len(motion))
    found, lips = {}, _Lips(pieces)
    balls = {f"eye_{s}": (s, ball) for s, ball in pieces.eyes.items() if ball.slide is None}  # a disc has no inside
    behind = [kind for kind in ("teeth_upper", "teeth_lower", "tongue") if len(pieces.rows(kind))]
    for name in counted(progress, "keeping eyes and teeth behind the skin", [*balls, *behind, "mouth"]):
        if name in balls:
            s, ball = balls[name]
            own = angles[:, :2] if s == "L" else angles[:, 2:]
            turn = gaze_rotation(own[:, 0], own[:, 1], ball.azimuth)
            found[name] = _Lids(pieces, s, ball).part(motion, turn, deep.get(name, none), spread)
        elif name in behind:
            found[name] = lips.part(motion, pieces.rows(name), deep.get(name, none), spread)
        else:
            found[name] = lips.lining(motion, pieces)
    return motion, found


def _move(motion: Array, rows: NDArray, size: float) -> NDArray[np.bool_]:
    """Return in which shapes (k,) any of the vertices moves by more than nothing of something of a size, mm."""
    return np.abs(motion[:, rows]).max(axis=(1, 2), initial=0.0) > _DONE * size


class _Spread:
    """Spreads pushes over the skin: at least the push itself, and less and less of it round it."""

    def __init__(self, skin: Surface) -> None:
        edges, _ = skin.edges
        n = len(skin.vertices)
        join = sparse.coo_array((np.ones(2 * len(edges)), (edges.T.ravel(), edges[:, ::-1].T.ravel())), shape=(n, n))
        join = sparse.csr_array(join)
        degree = np.maximum(np.asarray(join.sum(axis=1)).reshape(-1), 1.0)
        self._mean = sparse.csr_array(join / degree[:, None])

    def __call__(self, push: Array) -> Array:
        """Return pushes (n,) that are as large or larger, and smoother."""
        for _ in range(_RINGS):
            push = np.maximum(push, self._mean @ push)
        return push


# -- lids ----------------------------------------------------------------------------------------------------------
class _Lids:
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
        self._least = np.minimum(rest, 0.0) - _FACETS * ball.radius
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

    def part(self, motion: Array, turn: Array, allowed: Array, spread: _Spread) -> Contact:
        """Push the skin out of the eye in all shapes, in place."""
        before, after = np.zeros(len(motion)), np.zeros(len(motion))
        if not len(self._corners):
            return Contact(before, after)
        turns = np.any(turn != np.eye(3), axis=(1, 2))
        moves = _move(motion, np.unique(self._corners), self._ball.radius)
        for k in np.flatnonzero(moves | turns):
            for step in range(_ROUNDS + 1):
                missing = self._missing(motion[k], turn[k] if turns[k] else None, allowed[k])
                after[k] = missing.max()
                before[k] = after[k] if step == 0 else before[k]
                if after[k] <= _DONE * self._ball.radius or step == _ROUNDS:
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

    def _push(self, moved: Array, missing: Array, spread: _Spread) -> None:
        """Push the skin out along the rays from the eye's centre, in place."""
        push = np.zeros(len(self._rest))
        np.maximum.at(push, self._corners.ravel(), np.repeat(missing, 3))
        push = spread(push)
        pushed = np.flatnonzero(push > 0)
        away = (self._rest + moved)[pushed] - self._ball.centre
        moved[pushed] += (push[pushed] / np.maximum(np.linalg.norm(away, axis=1), _TINY))[:, None] * away


# -- lips ----------------------------------------------------------------------------------------------------------
class _Lips:
    """The skin before the teeth, as seen from the front at rest."""

    def __init__(self, pieces: PieceMotion) -> None:
        face = pieces.face
        self._rest, self._height = pieces.vertices, face.height
        self._axes = face.mouth_axes
        corners = pieces.skin.corners @ self._axes.T
        middles = corners.mean(axis=1)
        near = np.linalg.norm(middles - self._axes @ face.lips, axis=1) < _LIP_REACH * face.height
        self._near = np.unique(pieces.skin.faces[near])
        forward = pieces.skin.normals @ self._axes[2]
        near &= forward * (np.sign(forward[near].sum()) or 1.0) > _FORWARD      # triangles may be wound inward
        rows = np.flatnonzero(near)
        # What was hidden at rest, such as the back of the mouth, is no barrier.
        seen = ahead(middles[rows], corners[rows])[0] < _SEEN * face.height
        self._faces = pieces.skin.faces[rows[seen]]
        self._facing = vertex_normals(pieces.vertices, pieces.faces) @ self._axes[2] > 0

    def part(self, motion: Array, rows: NDArray, allowed: Array, spread: _Spread) -> Contact:
        """Bring a row of teeth behind the lips in all shapes, in place."""
        before, after = np.zeros(len(motion)), np.zeros(len(motion))
        corners = self._rest[self._faces] @ self._axes.T
        gap, _ = ahead(self._rest[rows] @ self._axes.T, corners)
        near = (gap < _NEAR_LIPS * self._height) & (gap > -_THROUGH * self._height) & self._facing[rows]
        if not near.any():
            return Contact(before, after)
        own, gap = rows[near], gap[near]
        least = np.minimum(gap, 0.0) - _ALLOWED * self._height
        at = self._rest[own] @ self._axes.T
        margin = _LIP_TRAVEL * self._height
        close = ((corners.max(axis=1) > at.min(axis=0) - margin) & (corners.min(axis=1) < at.max(axis=0) + margin))
        faces = self._faces[close[:, :2].all(axis=1)]
        skin, local = np.unique(faces, return_inverse=True)
        local = local.reshape(-1, 3)
        for k in np.flatnonzero(_move(motion, np.concatenate([skin, own]), self._height)):
            given = 0.0
            for step in range(_ROUNDS + 1):
                missing, which = self._missing(motion[k], own, least - allowed[k], skin, local)
                after[k] = missing.max()
                before[k] = after[k] if step == 0 else before[k]
                if after[k] <= _DONE * self._height or step == _ROUNDS:
                    break
                back = min(float(after[k]), _GIVE * self._height - given)
                given += back
                motion[k, rows] -= back * self._axes[2]
                push = np.zeros(len(self._rest))
                hit = missing > back
                np.maximum.at(push, faces[which[hit]].ravel(), np.repeat(missing[hit] - back, 3))
                motion[k] += spread(push)[:, None] * self._axes[2]
        return Contact(before, after)

    def _missing(self, moved: Array, own: NDArray, least: Array, skin: NDArray, local: NDArray
                 ) -> tuple[Array, NDArray[np.int64]]:
        """Return how much farther behind the skin the vertices own (p,) would have to lie (p,), mm, and which of its
        triangles lies over each (p,). moved (n, 3); least (p,), mm; skin (s,): its vertices, local (t, 3) over them."""
        places = (self._rest[own] + moved[own]) @ self._axes.T
        now, which = ahead(places, ((self._rest[skin] + moved[skin]) @ self._axes.T)[local])
        through = (which >= 0) & (now > -_THROUGH * self._height)
        return np.where(through, np.maximum(least - now, 0.0), 0.0), which

    def lining(self, motion: Array, pieces: PieceMotion) -> Contact:
        """Bring the lining that lay behind the lips at rest behind them in all shapes, in place."""
        before, after = np.zeros(len(motion)), np.zeros(len(motion))
        corners = self._rest[self._faces] @ self._axes.T
        own = np.setdiff1d(np.unique(np.concatenate([self._near, pieces.rows("mouth")])), self._faces)
        gap, _ = ahead(self._rest[own] @ self._axes.T, corners)
        behind = (gap > _ALLOWED * self._height) & (gap < _NEAR_LIPS * self._height)
        own, least = own[behind], np.minimum(gap[behind] / 2, _LEFT * self._height)
        if not len(own):
            return Contact(before, after)
        inner = [pieces.faces[piece.faces] for piece in pieces.pieces if piece.kind in ("skin", "mouth")]
        spread = _Spread(Surface(self._rest, np.concatenate(inner)))
        front, local = np.unique(self._faces, return_inverse=True)
        local = local.reshape(-1, 3)
        for k in np.flatnonzero(_move(motion, np.concatenate([front, own]), self._height)):
            for step in range(_ROUNDS + 1):
                missing, _ = self._missing(motion[k], own, least, front, local)
                after[k] = missing.max()
                before[k] = after[k] if step == 0 else before[k]
                if after[k] <= _DONE * self._height or step == _ROUNDS:
                    break
                push = np.zeros(len(self._rest))
                push[own] = missing
                motion[k, own] -= spread(push)[own, None] * self._axes[2]
        return Contact(before, after)

"""How every piece of an avatar moves when its skin does: for all shapes at once, prepared once.

Skull and body keep still, as do the upper teeth; lower teeth and tongue turn with the jaw; a mouth's lining blends
from one to the other; eyes turn; what lies on the skin is carried by it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from facegen.errors import InputError
from facegen.geometry.fade import smooth_step
from facegen.geometry.operators import Surface
from facegen.transfer.carried import Carried, SkinFrames
from facegen.transfer.eyeball import Eyeball, fit_eye
from facegen.transfer.face_measures import FaceMeasures
from facegen.transfer.piece_names import kind_of_name
from facegen.transfer.pieces import Piece
from facegen.transfer.tongue import Tongue

Array = NDArray[np.float64]

# A lining's jaw share goes from none to all over this share of its height, from the lip line both ways.
_BLEND = 0.35
# It follows the skin over it, so that cheeks and lips that draw in do not bare it: wholly up to the first of these
# shares of the face's height, four millimetres on a person, and not at all from the second on.
_FOLLOWS, _LEFT = 0.04, 0.12


@dataclass(frozen=True, eq=False)
class RigidMotions:
    """k rigid motions x -> rotation @ x + translation: ``rotations`` (k, 3, 3), ``translations`` (k, 3), mm."""

    rotations: Array
    translations: Array

    @classmethod
    def of(cls, movement: Callable[[Array], Array]) -> RigidMotions:
        """Return the motions whose displacements of places (n, 3) are ``movement(places)`` (k, n, 3), such as
        ``lambda at: jaw.movement(at, angles)``."""
        moved = movement(np.concatenate([np.zeros((1, 3)), np.eye(3)]))
        shift = moved[:, 0]
        return cls(np.swapaxes(moved[:, 1:] - shift[:, None], 1, 2) + np.eye(3), shift)

    def displacements(self, at: Array) -> Array:
        """Return how places (n, 3) move (k, n, 3); exactly zero for the identity."""
        return at @ np.swapaxes(self.rotations - np.eye(3), 1, 2) + self.translations[:, None, :]


class PieceMotion:
    """Moves the pieces of one avatar; everything that no shape changes is computed once."""

    def __init__(self, pieces: Sequence[Piece], vertices: ArrayLike, faces: ArrayLike,
                 points: Mapping[str, ArrayLike]) -> None:
        """pieces: what `find_pieces` gave for vertices (n, 3), mm, in the template's frame, faces (m, 3) and points."""
        self.pieces = tuple(pieces)
        self.vertices, self.faces = np.asarray(vertices, float), np.asarray(faces, np.int64)
        faces = self.faces
        self.face = face = FaceMeasures({name: np.asarray(place, float) for name, place in points.items()})
        self.skin = skin = Surface(self.vertices, np.concatenate(
            [faces[piece.faces] for piece in pieces if piece.kind == "skin"] or [np.empty((0, 3), np.int64)]))
        if not len(skin.faces):
            raise InputError("pieces: expected a piece of the kind 'skin'")
        self._with_jaw = self.rows("teeth_lower", "tongue")
        self._tongue = self.rows("tongue")
        self.eyes = {s: self._eye(s, faces, face) for s in "LR" if len(self.rows(f"eye_{s}"))}
        thin = [(piece.vertices, faces[piece.faces]) for piece in pieces if piece.kind == "carried"]
        self._carried = Carried(skin, thin, face.height) if thin else None
        self._linings = [_Lining(piece, self.vertices, skin, face) for piece in pieces if piece.kind == "mouth"]

    def move(self, skin_motion: ArrayLike, jaw: RigidMotions | None = None, gaze: ArrayLike | None = None, *,
             tongue: Tongue | None = None) -> NDArray[np.float64]:
        """Return the displacements (k, n, 3) of all vertices, mm.

        skin_motion (k, n, 3): the skin's; rows of other pieces are not read. jaw: k motions, none without. gaze
        (k, 4): degrees, yaw of the left eye (to the subject's left), its pitch (up), and the right eye's. tongue: what
        a template's does in the k shapes beside going with the jaw.
        """
        motion = np.array(skin_motion, float)
        k, n = motion.shape[0] if motion.ndim == 3 else 0, len(self.vertices)
        if motion.shape != (k, n, 3):
            raise InputError(f"skin_motion: expected shape (k, {n}, 3), got {motion.shape}")
        for piece in self.pieces:
            if piece.kind != "skin":
                motion[:, piece.vertices] = 0.0
        if jaw is not None:
            if jaw.rotations.shape != (k, 3, 3) or jaw.translations.shape != (k, 3):
                raise InputError(f"jaw: expected {k} motions, got rotations of shape {jaw.rotations.shape}")
            motion[:, self._with_jaw] = jaw.displacements(self.vertices[self._with_jaw])
        if gaze is not None:
            angles = np.asarray(gaze, float)
            if angles.shape != (k, 4):
                raise InputError(f"gaze: expected shape ({k}, 4), got {angles.shape}")
            for s, ball in self.eyes.items():
                yaw, pitch = angles[:, :2].T if s == "L" else angles[:, 2:].T
                rows, turning = self.rows(f"eye_{s}"), (yaw != 0) | (pitch != 0)
                motion[np.ix_(turning, rows)] = ball.turned(yaw[turning], pitch[turning], self.vertices[rows])
        if tongue is not None:
            if len(tongue.motion) != k:
                raise InputError(f"tongue: expected {k} motions, got {len(tongue.motion)}")
            motion[:, self._tongue] += tongue.moves(self.vertices[self._tongue], self.face)
        for lining in self._linings:
            motion[:, lining.rows] = lining.move(motion, jaw)
        if self._carried is not None:
            motion[:, self._carried.rows] = self._carried.move(motion)
        return motion

    def rows(self, *kinds: str) -> NDArray[np.int64]:
        """Return the vertices of all pieces of some kinds."""
        return np.concatenate([p.vertices for p in self.pieces if p.kind in kinds] or [np.empty(0, np.int64)])

    def surface(self, kind: str) -> Surface:
        """Return all pieces of a kind as one surface of the vertices in `rows`."""
        rows = self.rows(kind)
        local = np.full(len(self.vertices), -1)
        local[rows] = np.arange(len(rows))
        faces = [self.faces[piece.faces] for piece in self.pieces if piece.kind == kind]
        return Surface(self.vertices[rows], local[np.concatenate(faces)].astype(np.int32))

    def _eye(self, s: str, faces: NDArray, face: FaceMeasures) -> Eyeball:
        parts = []
        for piece in self.pieces:
            if piece.kind == f"eye_{s}":
                own = Surface(self.vertices[piece.vertices], np.searchsorted(piece.vertices, faces[piece.faces]))
                parts.append((own.vertices, own.vertex_areas))
        return fit_eye(parts, outward=face.eye_outward(s), width=face.eye_width(s), opening=face.eye(s),
                       pupil=face.points.get(f"eye_center_{s}"))


class _Lining:
    """A mouth's lining, or both rows of teeth in one piece: below the lip line with the jaw, above it still."""

    def __init__(self, piece: Piece, vertices: Array, skin: Surface, face: FaceMeasures) -> None:
        self.rows = piece.vertices
        self._at = vertices[self.rows]
        height = (self._at - face.lips) @ face.lip_normal
        reach = _BLEND * max(float(np.abs(height).max()), 1e-300)
        self._jaw = smooth_step(0.5 - 0.5 * height / reach)
        self._over = []
        if kind_of_name(piece.name) != "teeth":         # teeth do not bend with the lips
            above = (skin.corners.mean(axis=1) - face.lips) @ face.lip_normal > 0
            for half, faces in ((height > 0, skin.faces[above]), (height <= 0, skin.faces[~above])):
                if half.any() and len(faces):           # closed lips touch: a lining's nearest lip may be the other one
                    frames = SkinFrames(Surface(skin.vertices, faces), self._at[half])
                    share = smooth_step((_LEFT - frames.distances / face.height) / (_LEFT - _FOLLOWS))
                    self._over.append((half, frames, share[:, None]))

    def move(self, motion: Array, jaw: RigidMotions | None) -> Array:
        """Return the displacements (k, p, 3)."""
        moved = np.zeros((len(motion), *self._at.shape)) if jaw is None else \
            self._jaw[:, None] * jaw.displacements(self._at)
        for half, frames, share in self._over:
            skin = np.einsum("pc,kpci->kpi", frames.weights, motion[:, frames.corners])
            moved[:, half] += share * (skin - moved[:, half])
        return moved

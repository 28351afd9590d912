"""What a template from a file does not say: how its jaw and its eyes turn, read off the shapes themselves.

The jaw: the rigid motion of the lower teeth, or of the skin on the chin where there are none, is split into a turn
about one lateral axis, a slide to the side and one forward. The eyes: the rigid motion of each ball.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from facegen.face.deformer import Jaw
from facegen.transfer.eyeball import Eyeball
from facegen.transfer.piece_motion import PieceMotion

Array = NDArray[np.float64]

# Degrees: a template whose jaw turns less in every shape shows no jaw; the axis of a smaller turn would be noise.
_LEAST_OPENING = 4.0
# Millimetres in the working frame: how far from the teeth the joint of a jaw may lie.
_HINGE_NEAR, _HINGE_FAR = 20.0, 250.0
# Turn and slides must account for this share of a motion's size: a chin that is drawn up is no jaw that moves.
_EXPLAINED = 0.85
# Millimetres round the landmark: the chin.
_CHIN = 22.0
# Motion below this, mm, is rounding; an eye's turn below this, degrees, too.
_STILL_MM, _STILL_DEGREES = 1e-3, 0.05


def measured_jaw(pieces: PieceMotion, motion: Array) -> tuple[Jaw | None, Array, Array]:
    """Return the hinge, the jaw's movements (k, 3) as in `Template.jaw`, and its share (n,) of each vertex' motion.

    motion (k, n, 3): of all vertices, mm. None, and zeros, where no shape opens the jaw.
    """
    k, n = motion.shape[:2]
    none = None, np.zeros((k, 3)), np.zeros(n)
    rows = pieces.rows("teeth_lower")
    if len(rows) < 3:
        chin = pieces.face.points["chin"]
        skin = np.unique(pieces.skin.faces)
        rows = skin[np.linalg.norm(pieces.vertices[skin] - chin, axis=1) < _CHIN]
        if len(rows) < 3:
            return none
    at, moved = pieces.vertices[rows], motion[:, rows]
    turns = rigid_turns(at, moved)
    angles = np.arctan2(turns[:, 2, 1] - turns[:, 1, 2], turns[:, 1, 1] + turns[:, 2, 2])
    angles[np.abs(moved).max(axis=(1, 2)) < _STILL_MM] = 0.0
    widest = int(angles.argmax())
    if np.degrees(angles[widest]) < _LEAST_OPENING:
        return none
    hinge = _fixed_place(at.mean(axis=0), moved[widest].mean(axis=0), angles[widest])
    sides = [pieces.face.points.get(f"jaw_{s}", pieces.face.points[f"mouth_corner_{s}"]) for s in "LR"]
    hinge[0] = (sides[0][0] + sides[1][0]) / 2
    if not _HINGE_NEAR < np.linalg.norm((hinge - at.mean(axis=0))[1:]) < _HINGE_FAR:
        return none
    jaw = Jaw(hinge, np.zeros(3))
    found = np.zeros((k, 3))
    found[:, 0] = np.degrees(np.maximum(angles, 0.0))
    left = (moved - jaw.movement(at, found)).mean(axis=1)
    found[:, 1:] = left[:, [0, 2]]
    size = np.sqrt((moved**2).sum(axis=(1, 2)))
    missed = np.sqrt(((moved - jaw.movement(at, found)) ** 2).sum(axis=(1, 2)))
    found[(missed > np.sqrt(1 - _EXPLAINED**2) * size) | (size < _STILL_MM * np.sqrt(len(rows)))] = 0.0
    if not found[widest].any():
        return none
    turned = jaw.movement(pieces.vertices, found[widest:widest + 1])[0]
    share = (motion[widest] * turned).sum(axis=1) / np.maximum((turned**2).sum(axis=1), 1e-12)
    return jaw, found, np.clip(share, 0.0, 1.0)


def measured_gaze(pieces: PieceMotion, motion: Array) -> Array:
    """Return where the eyes look in each shape, (k, 4) degrees as in `Template.gaze`. motion (k, n, 3): as above."""
    found = np.zeros((len(motion), 4))
    for column, (s, eye) in enumerate(_both(pieces.eyes)):
        if eye is None:
            continue
        rows = pieces.rows(f"eye_{s}")
        moved = motion[:, rows]
        ahead = _slid(eye, moved) if eye.slide is not None else _turned(eye, pieces.vertices[rows], moved)
        yaw, pitch = np.arctan2(ahead[:, 0], ahead[:, 2]), np.arcsin(np.clip(ahead[:, 1], -1, 1))
        both = np.degrees(np.stack([yaw, pitch], axis=1))
        both[(np.abs(both) < _STILL_DEGREES).all(axis=1) | (np.abs(moved).max(axis=(1, 2)) < _STILL_MM)] = 0.0
        found[:, 2 * column:2 * column + 2] = both
    return found


def _both(eyes: Mapping[str, Eyeball]) -> tuple[tuple[str, Eyeball | None], ...]:
    return tuple((s, eyes.get(s)) for s in "LR")


def _turned(eye: Eyeball, at: Array, moved: Array) -> Array:
    """Return where (k, 3) the rotations of an eye take the way ahead, for its vertices (e, 3) and their motion."""
    turns = rigid_turns(eye.in_radii(at), moved @ eye.inverse)
    c, s = np.cos(eye.azimuth), np.sin(eye.azimuth)
    side = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])       # pitch is about an axis turned by the azimuth
    return turns @ side @ np.array([0.0, 0.0, 1.0]) @ side


def _slid(eye: Eyeball, moved: Array) -> Array:
    """Return the direction (k, 3) in which a flat disc looks after it slid, as seen from one that looks ahead."""
    way = moved.mean(axis=1) / eye.radius
    way -= (way @ eye.normal)[:, None] * eye.normal
    way *= np.minimum(1.0, 0.95 / np.maximum(np.linalg.norm(way, axis=1), 1e-12))[:, None]
    ahead = np.sqrt(1 - (way**2).sum(axis=1))[:, None] * eye.normal + way
    yaw = np.arctan2(ahead[:, 0], ahead[:, 2]) - np.arctan2(eye.normal[0], eye.normal[2])
    pitch = np.arcsin(np.clip(ahead[:, 1], -1, 1)) - np.arcsin(eye.normal[1])
    return np.stack([np.sin(yaw) * np.cos(pitch), np.sin(pitch), np.cos(yaw) * np.cos(pitch)], axis=1)


def rigid_turns(at: Array, moved: Array) -> Array:
    """Return the rotations (k, 3, 3) of the rigid motions nearest to the motion (k, p, 3) of places (p, 3)
    (Umeyama 1991)."""
    x = at - at.mean(axis=0)
    y = x + moved - moved.mean(axis=1, keepdims=True)
    u, _, vt = np.linalg.svd(np.einsum("kpi,pj->kij", y, x))
    sign = np.ones((len(moved), 3))
    sign[:, 2] = np.linalg.det(u) * np.linalg.det(vt)
    return (u * sign[:, None, :]) @ vt


def _fixed_place(at: Array, moved: Array, angle: float) -> Array:
    """Return the place (3,) that a turn by ``angle`` (radians, opening) about a lateral axis leaves where it is, if
    the place ``at`` (3,) moves by ``moved`` (3,): (I - R) h = at + moved - R at in the plane of the turn."""
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, -s], [s, c]])
    hinge = at.copy()
    hinge[1:] = np.linalg.solve(np.eye(2) - turn, at[1:] + moved[1:] - turn @ at[1:])
    return hinge

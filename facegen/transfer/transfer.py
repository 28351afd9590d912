"""The one door of the transfer: an avatar's mesh and landmarks in, its shapes out.

Based on: Onizuka et al. (2018), section 4, on avatars of several pieces. The steps: into the template's frame (eq. 9,
by landmarks instead of boxes, so that hair or a body does not count), apart into pieces, the skin by `skin`, the other
pieces as what they are, and back.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from facegen.errors import InputError, nearest
from facegen.fileio.kept import Kept
from facegen.geometry.mesh import Mesh
from facegen.progress import Progress, silent, within
from facegen.transfer.alignment import Similarity, align
from facegen.transfer.apart import take_apart
from facegen.transfer.closing import closing
from facegen.transfer.eyeball import EyeFront
from facegen.transfer.halfway import halfway
from facegen.transfer.keep_apart import Contact, keep_apart
from facegen.transfer.landmarks import Landmarks
from facegen.transfer.margins import LIDS, LIPS, Slit
from facegen.transfer.piece_motion import PieceMotion, RigidMotions
from facegen.transfer.pieces import Piece
from facegen.transfer.sides import painted
from facegen.transfer.skin import METHODS, Skin, lay_skin
from facegen.transfer.template import Template
from facegen.transfer.weights import AnyWeights

# The jaw of an avatar opens between these shares of what is estimated; more is a mistake.
_LEAST_OPENING, _MOST_OPENING = 0.1, 3.0
# Because squares of larger numbers, and float32 in files, run over.
_FARTHEST = 1e30


@dataclass(frozen=True, eq=False)
class Transferred:
    """``shapes``: name -> displacement (n, 3) of the avatar's own vertices, in its own axes and units. ``frame``: from
    there to the template's. ``skin``, ``pieces``: what the avatar was taken for; ``contacts``: how far eyes and teeth
    went through the skin before and after they were kept apart, mm. ``halves``: shape -> its corrective half way, see
    `halfway`. ``warnings``: what was odd about the mesh."""

    shapes: Mapping[str, NDArray]
    frame: Similarity
    skin: Skin
    pieces: tuple[Piece, ...]
    contacts: Mapping[str, Contact]
    halves: Mapping[str, NDArray]
    warnings: tuple[str, ...] = ()


def transfer(mesh: Mesh, landmarks: Landmarks, template: Template, *, method: str = "landmarks",
             weights: AnyWeights | None = None, opening: float = 1.0,
             pieces: Mapping[str, str] | None = None, kept: Kept | None = None, progress: Progress = silent
             ) -> Transferred:
    """Return the template's shapes on an avatar.

    mesh: the avatar, in any axes and units. landmarks: on it. method: "landmarks" (ours), or a published one to compare
    with: "sumner", "cloning". weights: of the energies, see `read_weights`; ours without. opening: a factor on how
    far the jaw opens. pieces: part, material or number of a component -> kind. kept: where registrations are kept
    and found again. progress: called as `Progress` says. Raises InputError for what cannot be used: unknown names, a
    mesh that cannot be solved.
    """
    if method not in METHODS:
        raise InputError(f"method: expected {', '.join(METHODS)}, got {method!r}{nearest(str(method), METHODS)}")
    if weights is not None and method != "landmarks":
        raise InputError(f"weights: the method '{method}' has none to choose; leave them out, or the method")
    if not _LEAST_OPENING <= opening <= _MOST_OPENING:
        raise InputError(f"opening: expected a factor of {_LEAST_OPENING} to {_MOST_OPENING}, got {opening!r}")
    far = np.flatnonzero((np.abs(mesh.vertices) > _FARTHEST).any(axis=1))
    if len(far):
        raise InputError(f"mesh: {len(far)} of {len(mesh.vertices)} vertices lie beyond {_FARTHEST:g} (first: "
                         f"{', '.join(map(str, far[:5]))}); remove them or write the mesh in larger units")
    frame = align(landmarks.points(mesh.vertices), template.landmarks)
    progress("telling the pieces apart", 0.0)
    parts = take_apart(mesh, landmarks, frame, explicit=pieces)
    vertices, found, rows = parts.vertices, parts.pieces, parts.rows
    skin = lay_skin(template, parts.surface, parts.places(template.places), opening=opening, kept=kept,
                    progress=within(progress, 0.05, 0.3))
    on_skin = skin.motion(method, weights, progress=within(progress, 0.3, 0.6))
    contacts: Mapping[str, Contact] = {}
    notes = parts.skin.notes
    halves: Mapping[int, NDArray] = {}
    if method != "landmarks":
        motion = _among_all(on_skin, rows, len(vertices))
    else:
        progress("closing lids and lips", 0.6)
        moved = PieceMotion(parts.solid, vertices, parts.skin.wound(parts.faces), parts.points)
        fronts = {f"eye_{s}": EyeFront(ball, vertices[moved.rows(f"eye_{s}")]) for s, ball in moved.eyes.items()}
        found_slits = {slit: closing(skin, slit, fronts.get(slit.name)) for slit in (*LIDS, LIPS)}
        notes += tuple(_no_opening(slit) for slit, one in found_slits.items() if not one and _expected(slit, skin))
        # A copy closes as the template does: there is nothing to mend.
        slits = [] if skin.copied else [one for one in found_slits.values() if one]
        for slit in slits:
            slit.close(on_skin)
        jaw = None if skin.jaw is None else RigidMotions.of(lambda at: skin.jaw.movement(at, template.jaw))
        motion = moved.move(_among_all(on_skin, rows, len(vertices)), jaw, template.gaze, tongue=template.tongue)
        # A tongue that comes out is before the lips, and is meant to be.
        out = {} if template.tongue is None else {"tongue": np.where(template.tongue.comes_out() > 0, np.inf, 0.0)}
        motion, contacts = keep_apart(moved, motion, template.gaze, allowed=out,
                                      progress=within(progress, 0.7, 0.95))
        if skin.copied:             # whatever pokes through it there
            motion[:, rows] = on_skin
        for slit in slits:
            slit.seal(motion, rows)
        progress("bending lids round the eyes", 0.95)
        lids = [slit for slit in slits if slit.eye is not None]
        still = ~(template.jaw.any(axis=1) | template.gaze.any(axis=1))
        halves = halfway(moved, lids, rows, motion, still)
    parts.skin.carry(motion)
    parts.skin.carry(halves.values())
    back, shapes = frame.inverse(), {}
    for name, shape, other in zip(template.names, motion, template.minus, strict=True):
        shapes[name] = back.apply_vectors(shape if other < 0 else shape - motion[other])[parts.own]
    bent = {template.names[k]: back.apply_vectors(one)[parts.own] for k, one in halves.items()}
    return Transferred(shapes, frame, skin, found, contacts, bent, notes)


def _expected(slit: Slit, skin: Skin) -> bool:
    """Return whether landmarks say that there is a slit: of both faces, and not both edges on one place."""
    names = {*slit.corners, slit.upper[len(slit.upper) // 2], slit.lower[len(slit.lower) // 2]}
    return (names <= skin.places.keys() and names <= skin.template.places.keys()
            and slit.side not in painted(skin.surface, skin.places, skin.sides))


def _no_opening(slit: Slit) -> str:
    what = "the lips" if slit is LIPS else f"the {'left' if slit.name.endswith('L') else 'right'} eye's lids"
    return (f"no opening was found between {what} where the landmarks are: they close or part no more than the skin "
            "round them moves")


def _among_all(on_skin: NDArray, rows: NDArray, n: int) -> NDArray[np.float64]:
    """Return the displacements (k, n, 3) of all vertices, where those in ``rows`` are the skin's."""
    motion = np.zeros((len(on_skin), n, 3))
    motion[:, rows] = on_skin
    return motion

"""From the motion of an avatar's skin to that of all of it: lids, lips, jaw, pieces, and nothing pokes through."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from facegen.transfer.apart import Apart
from facegen.transfer.closing import closing
from facegen.transfer.eyeball import EyeFront
from facegen.transfer.halfway import halfway
from facegen.transfer.keep_apart import Guard
from facegen.transfer.lining import inner_side
from facegen.transfer.margins import LIDS, LIPS, Slit
from facegen.transfer.piece_motion import PieceMotion, RigidMotions
from facegen.transfer.pushing import Contact
from facegen.transfer.same_pieces import SamePieces
from facegen.transfer.sides import painted
from facegen.transfer.skin import Skin

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Beside:
    """What is known of shapes beside their motion. ``contacts``: see `Guard`. ``halves``: shape -> corrective (n, 3),
    see `halfway`."""

    contacts: Mapping[str, Contact]
    halves: Mapping[int, Array]


class WholeMotion:
    """Moves one avatar; what no shape changes is computed once. ``notes``: what was odd about its slits."""

    def __init__(self, skin: Skin, parts: Apart) -> None:
        self._skin, self._rows, self._n = skin, parts.rows, len(parts.vertices)
        self._hanging = parts.skin
        self._pieces = pieces = PieceMotion(parts.solid, parts.vertices, parts.skin.wound(parts.faces), parts.points)
        self._same = SamePieces(skin.template.shapes.pieces, pieces.pieces, parts.vertices)
        self._inner = None if skin.copied else inner_side(skin)
        self._guard = Guard(pieces, None if self._inner is None else self._rows[skin.depth > 0])
        fronts = {f"eye_{s}": EyeFront(ball, parts.vertices[pieces.rows(f"eye_{s}")])
                  for s, ball in pieces.eyes.items()}
        found = {slit: closing(skin, slit, fronts.get(slit.name)) for slit in (*LIDS, LIPS)}
        self.notes = tuple(_no_opening(slit) for slit, one in found.items() if not one and _expected(slit, skin))
        self._slits = [one for one in found.values() if one]
        self._lids = [found[slit] for slit in LIDS if found[slit]]
        template, none = skin.template, np.zeros(len(skin.template.names), bool)
        still = ~(template.shapes.jaw.any(axis=1) | template.shapes.gaze.any(axis=1))
        self._closing = still & np.any([lid.closes() for lid in self._lids if lid.eye is not None] or [none], axis=0)
        self.jaw_moves = template.shapes.jaw.any(axis=1) if template.hinge is not None else none
        """Which shapes (k,) depend on how far the jaw opens."""
        self.lids_close = np.any([lid.narrows() for lid in self._lids] or [none], axis=0)
        """Which shapes (k,) depend on how far lids close."""

    def __call__(self, shapes: NDArray[np.int64], on_skin: Array, *, opening: float = 1.0,
                 lid_closure: float = 1.0) -> tuple[Array, Beside]:
        """Return the displacements (s, n, 3) of all vertices in some shapes (s,) of the template, mm, and what is known
        beside them. on_skin (s, n, 3): the skin's; overwritten."""
        skin, template, pieces = self._skin, self._skin.template, self._pieces
        jaw, gaze = template.shapes.jaw[shapes], template.shapes.gaze[shapes]
        # A copy closes as the template does: there is nothing to mend.
        mended = [] if skin.copied and lid_closure == 1.0 else self._lids if skin.copied else self._slits
        slits = [slit.of(shapes, lid_closure) for slit in mended]
        for slit in slits:
            slit.close(on_skin)
        if self._inner is not None:
            self._inner.carry(on_skin)
        own = skin.jaw(opening)
        turns = None if own is None else RigidMotions.of(lambda at: own.movement(at, jaw))
        tongue = template.shapes.tongue
        tongue = None if tongue is None else replace(tongue, motion=tongue.motion[shapes])
        motion = pieces.move(among_all(on_skin, self._rows, self._n), turns, gaze, tongue=tongue)
        with_jaw = None if own is None else own.movement(pieces.vertices[self._same.rows], jaw)
        self._same.lead(motion, shapes, with_jaw)
        # A tongue that comes out is before the lips, and is meant to be.
        out = {} if tongue is None else {"tongue": np.where(tongue.comes_out() > 0, np.inf, 0.0)}
        contacts = self._guard(motion, gaze, allowed=out)
        if skin.copied:             # whatever pokes through it there
            motion[:, self._rows] = on_skin
            self._same.lead(motion, shapes, with_jaw)
        for slit in slits:
            slit.seal(motion, self._rows)
        lids = [slit for slit in slits if slit.eye is not None]
        halves = {} if skin.copied or not lids else halfway(pieces, self._guard, lids, self._rows, motion,
                                                                  self._closing[shapes])
        for half in halves.values():
            half[self._same.rows] *= 1.0 - self._same.trust[:, None]
        self._hanging.carry(motion)
        self._hanging.carry(halves.values())
        return motion, Beside(contacts, {int(shapes[k]): one for k, one in halves.items()})


def among_all(on_skin: Array, rows: NDArray, n: int) -> Array:
    """Return the displacements (k, n, 3) of all vertices, where those in ``rows`` are the skin's."""
    motion = np.zeros((len(on_skin), n, 3))
    motion[:, rows] = on_skin
    return motion


def _expected(slit: Slit, skin: Skin) -> bool:
    """Return whether landmarks say that there is a slit: of both faces, and not both edges on one place."""
    names = {*slit.corners, slit.upper[len(slit.upper) // 2], slit.lower[len(slit.lower) // 2]}
    return (names <= skin.places.keys() and names <= skin.template.places.keys()
            and slit.side not in painted(skin.surface, skin.places, skin.sides))


def _no_opening(slit: Slit) -> str:
    what = "the lips" if slit is LIPS else f"the {'left' if slit.name.endswith('L') else 'right'} eye's lids"
    return (f"no opening was found between {what} where the landmarks are: they close or part no more than the skin "
            "round them moves")

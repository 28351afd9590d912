"""The last guard: eyes do not come through lids, nor teeth through lips, where they did not at rest.

Measured, then pushed apart as far as needed and no farther. Lids: the skin is pushed out of the eye (`keep_lids`).
Lips: the row of teeth gives way by a little, the skin by the rest, and a lining by itself (`keep_lips`). What stood out
at rest, as buck teeth do, may stand out as far. A push spreads over the neighbours, so that it leaves no dent.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from facegen.errors import InputError
from facegen.transfer.keep_lids import Lids
from facegen.transfer.keep_lips import Behind, Front, Lining
from facegen.transfer.piece_motion import PieceMotion
from facegen.transfer.pushing import Contact, Spread

Array = NDArray[np.float64]


def keep_apart(pieces: PieceMotion, motion: ArrayLike,
               gaze: ArrayLike | None = None, *,
               allowed: Mapping[str, ArrayLike] | None = None) -> tuple[Array, dict[str, Contact]]:
    """Return displacements (k, n, 3) in which nothing pokes through, and what was measured: see `Guard`."""
    motion = np.array(motion, float)
    return motion, Guard(pieces)(motion, gaze, allowed=allowed)


class Guard:
    """Keeps the pieces of one avatar apart; what no shape changes is computed once."""

    def __init__(self, pieces: PieceMotion, inner: NDArray[np.int64] | None = None) -> None:
        """inner: vertices of the skin behind the lips' edges that go with the outer side, see `InnerSide`: they need no
        guard, and are none. Without, what hides what tells both sides apart."""
        self._vertices, self._spread = pieces.vertices, Spread(pieces.skin)
        self._lids = {s: Lids(pieces, s, ball) for s, ball in pieces.eyes.items()
                      if ball.slide is None}                                    # a disc has no inside
        front = Front(pieces, inner)
        self._behind = {kind: Behind(front, pieces, kind) for kind in ("teeth_upper", "teeth_lower", "tongue")
                        if len(pieces.rows(kind))}
        self._lining = Lining(front, pieces, lined=inner is not None)

    def __call__(self, motion: Array, gaze: ArrayLike | None = None, *,
                 allowed: Mapping[str, ArrayLike] | None = None) -> dict[str, Contact]:
        """Push apart what pokes through, in place; return what was measured: "eye_L", "teeth_upper"...

        motion (k, n, 3): of all vertices, as `PieceMotion.move` gives, mm. gaze (k, 4): as given there.
        allowed: name -> mm (k,): how deep something may be through the skin, such as the template's own ``before``.
        """
        if motion.ndim != 3 or motion.shape[1:] != self._vertices.shape:
            raise InputError(f"motion: expected shape (k, {len(self._vertices)}, 3), got {motion.shape}")
        angles = np.zeros((len(motion), 4)) if gaze is None else np.asarray(gaze, float)
        if angles.shape != (len(motion), 4):
            raise InputError(f"gaze: expected shape ({len(motion)}, 4), got {angles.shape}")
        deep = {name: np.broadcast_to(np.asarray(mm, float), len(motion)) for name, mm in (allowed or {}).items()}
        none, found = np.zeros(len(motion)), {}
        for s, lids in self._lids.items():
            name, own = f"eye_{s}", angles[:, :2] if s == "L" else angles[:, 2:]
            found[name] = lids.part(motion, own, deep.get(name, none), self._spread)
        for kind, row in self._behind.items():
            found[kind] = row.part(motion, deep.get(kind, none), self._spread)
        found["mouth"] = self._lining.part(motion)
        return found

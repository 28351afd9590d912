"""Pieces that are the template's own: what lies where the template's piece of its kind lies moves as that does.

Other pieces move by rules (`piece_motion`), which on a copy of the template would be another motion than its own: a
lining follows the lips, brows ride on the skin. What the jaw does is carried over as the avatar's own jaw has it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from facegen.geometry.closest import ClosestPoints
from facegen.geometry.fade import smooth_step
from facegen.geometry.operators import Surface
from facegen.transfer.pieces import Piece

Array = NDArray[np.float64]

# Millimetres: a piece none of whose vertices is farther from the template's than the first of these is the same piece,
# remeshed; from the second on it is another one. Between, it goes some of the way as a whole, so that it never tears.
_SAME, _OTHER = 0.5, 2.0


@dataclass(frozen=True, eq=False)
class TemplatePiece:
    """All of a template that is of one kind: ``surface`` of p vertices (mm), ``motion`` (k, p, 3) without what the jaw
    alone does, and ``jaw_share`` (p,) of that."""

    surface: Surface
    motion: Array
    jaw_share: Array


class SamePieces:
    """The pieces of an avatar that are its template's. ``rows`` (r,): their vertices; ``trust`` (r,): how much they
    move as the template's do."""

    def __init__(self, template: Mapping[str, TemplatePiece], pieces: Sequence[Piece], vertices: Array) -> None:
        """template: kind -> what is of that kind. pieces: the avatar's, whose vertices (n, 3) are in the template's
        frame, mm."""
        self._parts = []
        for kind, source in template.items():
            low, high = source.surface.vertices.min(axis=0) - _OTHER, source.surface.vertices.max(axis=0) + _OTHER
            near = [piece.vertices for piece in pieces if piece.kind == kind
                    and ((vertices[piece.vertices] > low) & (vertices[piece.vertices] < high)).all()]
            closest = ClosestPoints(source.surface) if near else None
            for rows in near:
                feet = closest(vertices[rows])
                trust = float(smooth_step((_OTHER - feet.distances.max()) / (_OTHER - _SAME)))
                if trust > 0:
                    self._parts.append((rows, trust, source, source.surface.faces[feet.faces], feet.weights))
        self.rows = np.concatenate([rows for rows, *_ in self._parts] or [np.empty(0, np.int64)])
        self.trust = np.concatenate([np.full(len(rows), trust) for rows, trust, *_ in self._parts] or [np.empty(0)])

    def lead(self, motion: Array, shapes: NDArray[np.int64], with_jaw: Array | None) -> None:
        """Move the pieces in displacements (s, n, 3) of some shapes (s,), in place. with_jaw (s, r, 3): how ``rows``
        would move if they were all jaw; None without a jaw."""
        start = 0
        for rows, trust, source, corners, weights in self._parts:
            told = np.einsum("pc,kpci->kpi", weights, source.motion[shapes][:, corners])
            if with_jaw is not None:
                share = (weights * source.jaw_share[corners]).sum(axis=1)
                told += share[:, None] * with_jaw[:, start:start + len(rows)]
            motion[:, rows] += trust * (told - motion[:, rows])
            start += len(rows)

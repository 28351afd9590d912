"""Corrective shapes for lids half way: a blendshape goes straight, a lid goes round the eye.

At weight w a shape s with the corrective c is drawn as w s + 4 w (1 - w) c: nothing at rest and at full weight, all of
c half way, where the straight way cuts deepest into the ball. Small or flat eyes need none.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from facegen.geometry.fade import smooth_step
from facegen.transfer.closing import Closing
from facegen.transfer.keep_apart import Guard
from facegen.transfer.piece_motion import PieceMotion

Array = NDArray[np.float64]

# Lids that miss being as clear of the eye half way as `keep_lids` asks, which is up to 0.02 more than not to be cut by
# it, by more than this share of its radius are seen to.
_SEEN = 0.05
# Skin this many radii from the eye's centre still goes all of the way round it; from the second on it goes straight.
_NEAR, _FAR = 1.35, 1.8


def half_name(shape: str) -> str:
    """Return what the corrective of a shape half way is called in a file."""
    return f"{shape}_half"


def halfway(pieces: PieceMotion, guard: Guard, lids: Sequence[Closing], rows: NDArray, motion: Array,
            closing: NDArray[np.bool_]) -> dict[int, Array]:
    """Return shape -> corrective (n, 3), mm, for the shapes that need one.

    lids: of the skin, whose vertices are ``rows`` of all, each before an eye. motion (k, n, 3): final displacements.
    closing (k,): shapes that shut lids and move neither jaw nor eyes; others, expressions for example, are given none.
    """
    some = np.flatnonzero(closing)
    if not len(some):
        return {}
    straight = motion[some] / 2
    found = guard(straight.copy())
    deep = np.max([found[f"eye_{s}"].before / ball.radius for s, ball in pieces.eyes.items() if f"eye_{s}" in found]
                  or [np.zeros(len(some))], axis=0)
    some, straight = some[deep > _SEEN], straight[deep > _SEEN]
    if not len(some):
        return {}
    skin = straight[:, rows]
    for one in lids:
        _round_the_eye(one, skin, motion[some][:, rows])
    bent = straight.copy()
    bent[:, rows] = skin
    bent = pieces.move(bent)
    guard(bent)
    # Only what the skin's lids and what they carry do: jaw and eyes keep still in these shapes.
    return {int(k): there - here for k, there, here in zip(some, bent, straight, strict=True)}


def _round_the_eye(lid: Closing, half: Array, whole: Array) -> None:
    """Put the lid's skin half way (k, n, 3) onto the arc to where it goes (k, n, 3), in place."""
    ball, at = lid.eye.ball, lid.field.rows
    rest = ball.in_radii(lid.rest[at])
    there = ball.in_radii(lid.rest[at] + whole[:, at])
    low, high = np.linalg.norm(rest, axis=-1), np.linalg.norm(there, axis=-1)
    middle = rest + there
    way = middle / np.maximum(np.linalg.norm(middle, axis=-1, keepdims=True), 1e-300)
    chord = np.linalg.norm(middle, axis=-1) / 2
    near = smooth_step((_FAR - low) / (_FAR - _NEAR))
    radius = chord + near * np.maximum((low + high) / 2 - chord, 0.0)
    placed = (radius[..., None] * way) @ ball.shape + ball.centre - lid.rest[at]
    half[:, at] = np.where((whole[:, at] != 0).any(axis=-1, keepdims=True), placed, half[:, at])

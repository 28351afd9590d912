"""Landmarks of the skull, which no front of a face tells: its top and its back, in the plane between left and right."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from facegen.landmarking.profile import cut
from facegen.landmarking.skin import Head
from facegen.landmarking.symmetry import Plane
from facegen.transfer.alignment import Similarity

Array = NDArray[np.float64]

# How far a place behind the face may be from where it is said to be, mm of the base face, each way, on the mean of
# the shipped heads: of the skull's top and back; of a joint of the jaw, which skin covers, and the others.
SKULL, OTHERS = 6.0, 12.0
# The skull reaches this far up, down and back from between the eyes, mm of the base face: beyond are hats and bodies.
_UP, _DOWN, _BACK = 150.0, 45.0, 240.0
# Its top lies behind the eyes by at least this, mm.
_BEHIND = 20.0


def skull_ends(head: Head, plane: Plane, frame: Similarity, eyes: Array) -> Mapping[str, Array]:
    """Return "head_top" and "head_back" -> place (3,) in the base face's frame, mm, as far as the mesh has a skull.

    eyes: the middle between the eyes (3,) in that frame. frame: from it to the mesh's.
    """
    middle = eyes - np.array([0.0, 0.0, _BACK / 2])
    places, _, _ = cut(head.shown_welded, plane, frame.apply(middle), frame.scale * _BACK)
    if not len(places):
        return {}
    off = frame.inverse().apply(places) - eyes
    found = {}
    over = (off[:, 1] > 0) & (off[:, 1] < _UP) & (off[:, 2] < -_BEHIND) & (off[:, 2] > -_BACK / 2)
    if over.any():
        found["head_top"] = off[over][off[over, 1].argmax()] + eyes
    behind = (off[:, 1] > -_DOWN) & (off[:, 1] < _UP / 2) & (off[:, 2] > -_BACK) & (off[:, 2] < -_BACK / 4)
    if behind.any():
        found["head_back"] = off[behind][off[behind, 2].argmin()] + eyes
    return found

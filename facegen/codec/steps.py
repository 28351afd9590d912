"""How fine a parameter is sent: by how far it moves the face.

A step of any shape moves the face by about as many millimetres where the shape acts, so that bits go where they are
seen. The measure of a shape is the mean length of its movement, weighted by that length: over the vertices that it
moves, however few they are (lids), and little influenced by a long fading edge.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from facegen.blendshapes.recipes import shape_set
from facegen.errors import InputError
from facegen.face.face import Face, load_face
from facegen.face.motion import posed, shape_motion
from facegen.facs.deformation import Deformation
from facegen.facs.tables import load_units

QUALITY = 0.8
"""Millimetres of a step, by default: keeps a lively face's mean error under half a millimetre."""

COARSEST = 0.5
"""The largest step of a weight: half of it must not be lost, however little of the face it moves."""

HEAD_SHARE = 0.5
"""A step of the head, of a step of the face: it moves everything at once, so its errors add to all others."""

GAZE_DEGREES = 2.0
"""A step of the gaze at a quality of one millimetre. Seen by where it looks, not by how far it moves: people notice
about a degree."""

PLACE_SHARE = 2.0
"""A step of the head's place in the room, of a step of the face: nothing is seen against it."""

UNKNOWN = 6.0
"""Millimetres that a shape moves that is not facegen's own: what shapes of the sets move, in the middle."""

_DETAIL = 1                 # finer levels of the same surface change the means by less than a percent
_TURN = 5.0                 # degrees by which the head's movement is measured


def movement(vocabulary: str, names: tuple[str, ...]) -> NDArray[np.float64]:
    """Return how far each shape moves the base face at weight one (k,), mm; `UNKNOWN` for what is not known.

    Shapes that turn the eyes count by `GAZE_DEGREES`.
    """
    if vocabulary == "shapes":
        return np.full(len(names), UNKNOWN)
    known = _known(vocabulary)
    return np.array([known.get(name) or _unit(name, vocabulary) or UNKNOWN for name in names])


@lru_cache(maxsize=8)
def _known(vocabulary: str) -> dict[str, float]:
    face, recipes = load_face(), shape_set(vocabulary)
    turn = [max(map(abs, [0.0, *(v for one in recipe.deformation for v in one.eyes.values())]))
            for recipe in recipes.values()]
    moved = _measured(face, shape_motion(face, recipes, detail=_DETAIL))
    return dict(zip(recipes, np.maximum(moved, np.array(turn) / GAZE_DEGREES).tolist(), strict=True))


@lru_cache(maxsize=256)
def _unit(code: str, vocabulary: str) -> float | None:
    """Return how far a unit by its code ("12", "L12") moves the face, or None if there is none."""
    if vocabulary != "units":
        return None
    try:
        load_units().catalogue.unit(code)
    except InputError:
        return None
    face = load_face()
    meaning = face.resolve({code: 1.0})
    moved = face.pose(meaning, detail=_DETAIL) - face.mesh(_DETAIL).vertices
    turn = max(map(abs, [0.0, *meaning.deformation.eyes.values()]))
    return max(float(_measured(face, moved[None])[0]), turn / GAZE_DEGREES)


@lru_cache(maxsize=1)
def head_movement() -> NDArray[np.float64]:
    """Return how far a degree of yaw, pitch and roll moves the base face (3,), mm."""
    face = load_face()
    turned = posed(face, [[Deformation(head={axis: _TURN})] for axis in ("yaw", "pitch", "roll")], detail=_DETAIL)
    return _measured(face, turned - face.mesh(_DETAIL).vertices) / _TURN


def _measured(face: Face, motion: NDArray[np.float64]) -> NDArray[np.float64]:
    length = np.linalg.norm(motion[:, face.mesh(_DETAIL).part_vertices("skin")], axis=2)
    return (length**2).sum(axis=1) / np.maximum(length.sum(axis=1), 1e-9)


def extra_steps(parts: tuple[str, ...], quality: float) -> list[float]:
    """Return the steps of what is sent beside weights: degrees, millimetres, degrees."""
    turn = GAZE_DEGREES * quality
    steps = {"head": (HEAD_SHARE * quality / head_movement()).tolist() if "head" in parts else [],
             "place": [PLACE_SHARE * quality] * 3, "gaze": [turn, turn, 2 * turn, 2 * turn]}
    return [step for part in parts for step in steps[part]]

"""Eyes that look at a point."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from facegen.errors import InputError
from facegen.face.head import rotation

SIDEWAYS, UP, DOWN = 40.0, 30.0, 38.0
"""Degrees that an eye turns at most: people reach a little farther, and turn the head before."""


def look_at(rig: Any, target: ArrayLike, *, head: ArrayLike = (0.0, 0.0, 0.0, 0.0)) -> dict[str, float]:
    """Return the eyes of a deformation, degrees, that look at a point: ``Deformation(eyes=look_at(face, target))``.

    rig: a face or avatar that knows where its eyes are. target (3,): millimetres in the frame of the neutral face; eyes
    converge on what is near. head (4,): how the head is turned meanwhile: yaw, pitch, roll in degrees and forward in
    mm. An eye goes no farther than `SIDEWAYS`, `UP` and `DOWN`; what lies behind is looked at as far as that goes.
    Raises InputError for a target that is not a point, and for a rig without eyes.
    """
    target = np.asarray(target, np.float64)
    if target.shape != (3,) or not np.isfinite(target).all():
        raise InputError("target: expected three finite numbers x, y, z in millimetres")
    centres = rig.eye_centres
    if centres is None:
        raise InputError(f"face: where the eyes of {rig.name} are is not known; facegen rig notes it")
    way = _unturned(target, np.asarray(head, np.float64), np.asarray(rig.neck, np.float64)) - centres
    yaw = np.degrees(np.arctan2(way[:, 0], way[:, 2]))
    pitch = np.degrees(np.arctan2(way[:, 1], np.hypot(way[:, 0], way[:, 2])))
    yaw, pitch = np.clip(yaw, -SIDEWAYS, SIDEWAYS), np.clip(pitch, -DOWN, UP)
    return {"yaw_L": float(yaw[0]), "pitch_L": float(pitch[0]), "yaw_R": float(yaw[1]), "pitch_R": float(pitch[1])}


def _unturned(point: NDArray[np.float64], head: NDArray[np.float64], neck: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return where a point lies for a head that does not turn: the inverse of `turn_head` at weight 1."""
    away = point - neck
    away[2] -= head[3]
    return rotation(head).T @ away + neck

"""Turns of head and eyes between the recorders' conventions and ours.

Ours: the head turns by R = Ry(yaw) Rx(-pitch) Rz(-roll), degrees, in axes +x to the subject's left, +y up, +z forward
(`facegen.face.head`). An eye looks along (sin yaw cos pitch, sin pitch, cos yaw cos pitch) in the head.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]

_SIGNS = np.array([1.0, -1.0, -1.0])        # of yaw, pitch and roll about +y, +x and +z
# Camera axes (x to the right of the picture, y down, z away from the camera) as ours.
_CAMERA = np.array([1.0, -1.0, -1.0])


def head_of_camera(turns: Array) -> Array:
    """Return yaw, pitch, roll (n, 3) degrees of turns (n, 3) radians about a camera's x, y, z: R = Rx Ry Rz."""
    return _kept(turns, lambda some: head_of(Rotation.from_euler("XYZ", some * _CAMERA)))


def head_of(turns: Rotation) -> Array:
    """Return yaw, pitch, roll (n, 3) in degrees of turns in our axes."""
    return turns.as_euler("YXZ", degrees=True) * _SIGNS + 0.0        # + 0.0: no minus zero


def camera_of_head(head: Array) -> Array:
    """Return the turns (n, 3) in radians about a camera's axes that `head_of_camera` makes head of."""
    def back(some: Array) -> Array:
        return rotation(some).as_euler("XYZ") * _CAMERA

    return _kept(head, back)


def rotation(head: Array) -> Rotation:
    """Return yaw, pitch, roll (n, 3) in degrees as turns."""
    return Rotation.from_euler("YXZ", np.asarray(head, float) * _SIGNS, degrees=True)


def gaze_of_camera(right: Array, left: Array, head: Array) -> Array:
    """Return gaze (n, 4) in the head of the eyes' directions (n, 3) in a camera's axes; a head (n, 3) of NaN: NaN."""
    return np.column_stack([_looks(one, head) for one in (left, right)])


def camera_of_gaze(gaze: Array, head: Array) -> tuple[Array, Array]:
    """Return the directions (n, 3) of the right and the left eye in a camera's axes."""
    eyes = []
    for yaw, pitch in ((gaze[:, 2], gaze[:, 3]), (gaze[:, 0], gaze[:, 1])):
        a, b = np.radians(yaw), np.radians(pitch)
        way = np.column_stack([np.sin(a) * np.cos(b), np.sin(b), np.cos(a) * np.cos(b)])
        both = np.hstack([way, head])
        eyes.append(_kept(both, lambda some: rotation(some[:, 3:]).apply(some[:, :3]) * _CAMERA))
    return eyes[0], eyes[1]


def _looks(way: Array, head: Array) -> Array:
    def angles(some: Array) -> Array:
        x, y, z = (rotation(some[:, 3:]).inv().apply(some[:, :3] * _CAMERA)).T
        pitch = np.arctan2(y, np.hypot(x, z))
        return np.degrees(np.column_stack([np.arctan2(x, z), pitch]))

    return _kept(np.hstack([way, head]), angles, 2)


def _kept(values: Array, make: Callable[[Array], Array], width: int = 3) -> Array:
    """Return what a function makes of the rows (n, k) without NaN, NaN (n, width) elsewhere."""
    there = np.isfinite(values).all(axis=1)
    result = np.full((len(values), width), np.nan)
    if there.any():
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)    # at 90 degrees of pitch yaw and roll are one
            result[there] = make(values[there])
    return result

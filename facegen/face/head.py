"""The head turns on its neck: all above turns as one, the neck follows less and less downward."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from facegen.geometry.fade import smooth_step

Array = NDArray[np.float64]


def neck_weight(vertices: Array, moves_above: Array, rests_below: Array) -> Array:
    """Return how much of the head's turn each vertex makes, (n, 1): 1 above the one place, 0 below the other."""
    way = moves_above - rests_below
    return smooth_step((vertices - rests_below) @ way / (way @ way))[:, None]


def turn_head(vertices: Array, head: Array, pivot: Array, weight: Array) -> Array:
    """Return vertices (..., n, 3) after a turn about the pivot: yaw about y, then pitch about x, then roll about z.

    head (..., 4): yaw, pitch and roll in degrees, and forward in the vertices' unit. weight (n, 1).
    """
    if not np.any(head):
        return vertices
    turn = rotation(head)
    at = vertices - pivot
    turned = at @ np.swapaxes(turn, -1, -2)
    turned[..., 2] += head[..., 3, None]
    return vertices + weight * (turned - at)


def rotation(head: Array) -> Array:
    """Return the rotation (..., 3, 3) by yaw, pitch and roll (..., 3 or more), degrees: v -> rotation @ v."""
    yaw, pitch, roll = (np.radians(head[..., i]) for i in range(3))
    zero, one = np.zeros_like(yaw), np.ones_like(yaw)

    def rows(*nine):
        return np.stack(nine, axis=-1).reshape(*yaw.shape, 3, 3)

    cy, sy, cp, sp, cr, sr = np.cos(yaw), np.sin(yaw), np.cos(pitch), np.sin(pitch), np.cos(roll), np.sin(roll)
    return (rows(cy, zero, sy, zero, one, zero, -sy, zero, cy)
            @ rows(one, zero, zero, zero, cp, sp, zero, -sp, cp)
            @ rows(cr, sr, zero, -sr, cr, zero, zero, zero, one))


def angles(turn: Array) -> Array:
    """Return yaw, pitch and roll (..., 3), degrees, of rotations (..., 3, 3), pitch within -90..90."""
    yaw, roll = np.arctan2(turn[..., 0, 2], turn[..., 2, 2]), np.arctan2(-turn[..., 1, 0], turn[..., 1, 1])
    pitch = np.arcsin(np.clip(turn[..., 1, 2], -1.0, 1.0))
    return np.degrees(np.stack([yaw, pitch, roll], axis=-1))

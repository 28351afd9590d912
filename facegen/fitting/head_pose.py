"""Where a head is and how it is turned: rotations, their angles, and a first guess from points."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from facegen.fitting.views import Pinhole, Space, View

Array = NDArray[np.float64]

# Because a face's points need not lie in a plane or on a line for a pose, but close to it everything is noise.
_FLAT = 1e-3
# Rounds in which the guess for a perspective camera corrects the nearer points' size.
_ROUNDS = 8


@dataclass(frozen=True, eq=False)
class HeadPose:
    """places -> ``turn`` (3, 3) @ places + ``place`` (3,), mm, in the recorder's frame; ``zoom``: of the view."""

    turn: Array
    place: Array
    zoom: float = 1.0

    def apply(self, points: Array) -> Array:
        """Return points (..., 3) in the recorder's frame."""
        return points @ self.turn.T + self.place


def angles(turn: Array) -> Array:
    """Return yaw, pitch and roll (..., 3), degrees, of rotations (..., 3, 3): as `facegen.face.head` turns heads."""
    pitch = np.arcsin(np.clip(turn[..., 1, 2], -1.0, 1.0))
    yaw = np.arctan2(turn[..., 0, 2], turn[..., 2, 2])
    roll = np.arctan2(-turn[..., 1, 0], turn[..., 1, 1])
    return np.degrees(np.stack([yaw, pitch, roll], axis=-1))


def rotation(yaw: float, pitch: float, roll: float) -> Array:
    """Return the rotation (3, 3) of angles in degrees."""
    (cy, cp, cr), (sy, sp, sr) = np.cos(np.radians([yaw, pitch, roll])), np.sin(np.radians([yaw, pitch, roll]))
    return np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]]) @ np.array([[1, 0, 0], [0, cp, sp], [0, -sp, cp]]) \
        @ np.array([[cr, sr, 0], [-sr, cr, 0], [0, 0, 1]])


def small_turn(vector: Array) -> Array:
    """Return the rotation (3, 3) about a vector (3,) by its length in radians (Rodrigues)."""
    x, y, z = vector.tolist()
    angle = math.sqrt(x * x + y * y + z * z)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    if angle < 1e-8:
        return np.eye(3) + cross
    return np.eye(3) + math.sin(angle) / angle * cross + (1.0 - math.cos(angle)) / angle**2 * (cross @ cross)


def spread(points: Array) -> int:
    """Return in how many directions (0 to 3) points (p, 3) or (p, 2) reach."""
    if len(points) < 2:
        return 0
    sizes = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return int((sizes > _FLAT * max(sizes[0], 1e-300)).sum())


def first_pose(view: View, points: Array, goal: Array, weight: Array) -> HeadPose:
    """Return a pose that brings points (p, 3) near their measurements (p, 2 or 3), weighed by (p,)."""
    rows = np.flatnonzero(weight > 0.0)
    points, goal, share = points[rows], goal[rows], weight[rows] / weight[rows].sum()
    if isinstance(view, Space):
        return _similar(points, goal, share, view.zooms)
    return _perspective(view, points, goal, share) if isinstance(view, Pinhole) else _flat(view, points, goal, share)


def _similar(points: Array, goal: Array, share: Array, zooms: bool) -> HeadPose:
    """S. Umeyama, "Least-squares estimation of transformation parameters between two point patterns", 1991."""
    middle, there = share @ points, share @ goal
    at, to = points - middle, goal - there
    left, sizes, right = np.linalg.svd((to * share[:, None]).T @ at)
    sign = np.array([1.0, 1.0, np.sign(np.linalg.det(left @ right)) or 1.0])
    turn = (left * sign) @ right
    zoom = float((sizes * sign).sum() / max(share @ (at**2).sum(axis=1), 1e-300)) if zooms else 1.0
    zoom = max(zoom, 1e-12)
    return HeadPose(turn, there / zoom - turn @ middle, zoom)


def _flat(view: View, points: Array, goal: Array, share: Array) -> HeadPose:
    """The nearest weak perspective to the best affine picture."""
    middle, there = share @ points, share @ goal
    at, to = points - middle, (goal - there) * (1.0, -1.0)
    root = np.sqrt(share)[:, None]
    affine = np.linalg.lstsq(root * at, root * to, rcond=1e-6)[0].T              # (2, 3)
    if np.linalg.matrix_rank(affine, tol=1e-12) < 2:
        affine = np.eye(2, 3) * float(np.sqrt(share @ (to**2).sum(axis=1) / max(share @ (at**2).sum(axis=1), 1e-300)))
    left, sizes, right = np.linalg.svd(affine, full_matrices=False)
    zoom = max(float(sizes.mean()), 1e-12)
    rows = left @ right
    turn = np.vstack([rows, np.cross(*rows)])
    place = np.append((there - view.centre) * (1.0, -1.0) / zoom, 0.0) - turn @ middle
    return HeadPose(turn, np.append(place[:2], 0.0), zoom)


def _perspective(view: Pinhole, points: Array, goal: Array, share: Array) -> HeadPose:
    """D. DeMenthon, L. Davis, "Model-based object pose in 25 lines of code", 1995: weak perspective, with the points
    that turn out nearer made smaller, again and again."""
    rays = (goal - view.centre) / view.focal                                   # pictures at a focal length of one
    depth = np.ones(len(points))
    for _ in range(_ROUNDS):
        pose = _flat(_CENTRED, points, rays * depth[:, None], share)
        middle = 1.0 / pose.zoom                                               # distance of the rig's origin
        depth = np.maximum(1.0 - points @ pose.turn[2] / middle, 0.1)
    return HeadPose(pose.turn, np.array([*pose.place[:2], -middle]), 1.0)


class _Centred:
    centre = (0.0, 0.0)


_CENTRED = _Centred()

"""What measurements say of each weight, and what they cannot: units that no marker sees.

At the neutral, with all points ever seen: the covariance of the weights that the noise leaves, the pose unknown too
and a weight before any measurement anywhere in 0..1.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from facegen.fitting.head_pose import HeadPose
from facegen.fitting.points import Points
from facegen.fitting.views import View

Array = NDArray[np.float64]

# A shape that moves no point by more than the noise is not seen.
_SEEN = 1.0
# Deviation of a weight that may be anything from 0 to 1.
_ANY = 1.0 / np.sqrt(12.0)
# Of an angle before it is measured, degrees; and next to nothing, for a pose.
_ANGLE, _NONE = 20.0, 1e-9
# A weight of which the points leave more than this share of that deviation is not determined by a frame.
_UNSURE = 0.6


@dataclass(frozen=True)
class Observed:
    """``unseen``: weights that no point tells anything of. ``unsure``: weight -> the one it is mistaken for, where one
    frame says little; what one frame leaves open is set by sparsity and by the frames before. ``deviations``:
    weight -> what the noise makes of it."""

    unseen: tuple[str, ...]
    unsure: Mapping[str, str]
    deviations: Mapping[str, float]


def observed(points: Points, view: View, pose: HeadPose, share: Array, noise: float) -> Observed:
    """Return what points of which each counts ``share`` (p,), 0 if it was never seen, tell of the weights."""
    x = np.clip(np.zeros(len(points.low)), points.low, points.high)
    count, p = len(points.names), len(share)
    rest = points.places(x) @ pose.turn.T
    by_place, by_zoom = view.slopes(rest + pose.place, pose.zoom)
    moved = (by_place @ pose.turn) @ points.slopes(x).reshape(p, 3, -1)         # (p, size, k)
    unit = noise * (pose.zoom if view.size == 3 else 1.0)
    used = share > 0.0
    far = np.sqrt((moved[used, :, :count] ** 2).sum(axis=1)).max(axis=0, initial=0.0)
    blind = (far < _SEEN * unit) | (points.high[:count] <= points.low[:count])
    spin = np.cross(np.eye(3)[None], rest[:, None]).swapaxes(1, 2)              # axis x rest, columns by axis
    posed = np.concatenate([by_place @ spin, by_place, by_zoom[:, :, None] * view.zooms], axis=2)
    both = np.concatenate([posed, moved], axis=2) * np.sqrt(share)[:, None, None]
    flat = both.reshape(-1, both.shape[2]) / unit
    prior = np.full(both.shape[2], 1.0 / _ANGLE**2)
    prior[:7], prior[7:7 + count] = _NONE, 1.0 / _ANY**2
    spread = np.linalg.inv(flat.T @ flat + np.diag(prior))[7:7 + count, 7:7 + count]
    deviation = np.sqrt(np.diagonal(spread))
    alike = np.abs(spread) / np.outer(deviation, deviation)
    np.fill_diagonal(alike, 0.0)
    alike[:, blind] = 0.0
    names = points.names
    return Observed(tuple(name for name, hidden in zip(names, blind, strict=True) if hidden),
                    {names[k]: names[int(alike[k].argmax())] for k in range(count)
                     if not blind[k] and deviation[k] > _UNSURE * _ANY},
                    {name: float(value) for name, value in zip(names, deviation, strict=True)})

"""Weights and pose of one frame, by Gauss-Newton in a box.

    E = 1/2 sum_j u_j |y_j(x, pose) - g_j|^2 / s^2  +  m sum_i x_i  +  1/2 sum_i (x_i - x'_i)^2 / c^2  +  angles
    0 <= x_i <= 1

y_j: where place j is seen, g_j: where it was measured, s: the noise of a measurement. The second term is the
logarithm of an exponential prior: weights are 0 unless something speaks for them, so few are used. The third keeps to
the frame before. u_j: how much the measurement counts; against outliers 1 / (1 + r^2 / (k s)^2)^2 of its distance
(S. Geman, D. McClure, "Statistical methods for tomographic image reconstruction", 1987), with s large at first.
Blendshapes are linear in x and few rounds do; what is not (a camera, a jaw that turns) is made linear again in each.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from facegen.fitting.box import bowl_minimum
from facegen.fitting.head_pose import HeadPose, small_turn
from facegen.fitting.points import Points
from facegen.fitting.views import Space, View

Array = NDArray[np.float64]

# Because measurements farther than three times the noise are hardly ever noise.
_OUTLIER = 3.0
# The middle of a normal distribution's absolute values in two or three dimensions, over its deviation.
_MEDIAN = {2: 1.1774, 3: 1.5382}
# Because steps shrink fast, the one after a step of so many weights, radians or tenths of a metre is not seen, nor
# is a change of E by less than this share.
_SHORT, _STILL = 3e-3, 1e-6
_HALVINGS = 8
# What counts in a step as much as a whole weight: a radian, a tenth of a metre, the zoom's logarithm.
_LENGTHS = np.array([1.0, 1.0, 1.0, 100.0, 100.0, 100.0, 1.0, 1.0])
# Keeps directions that nothing determines (the depth of a weak perspective) where they are; in 1 / mm^2 and 1 / rad^2.
_RIDGE = 1e-9
_FREE = np.full(7, -np.inf)         # a pose has no bounds


@dataclass(frozen=True)
class Rules:
    """What a fit believes. noise: deviation of a measurement in each direction, its unit; sparsity: m, one over the
    mean of a weight; change: c of a second, how far a weight wanders; turn: deviation of gaze angles, degrees;
    robust: whether outliers count less; rounds: at most."""

    noise: float
    sparsity: float = 8.0
    change: float = 3.0
    turn: float = 20.0
    robust: bool = False
    rounds: int = 12


@dataclass(frozen=True, eq=False)
class State:
    """Parameters ``x`` (k,) and a pose. After a fit ``counted`` (p,): how much each point counted, 0..1; ``cost``."""

    x: Array
    pose: HeadPose
    counted: Array
    cost: float = np.inf


def solve(points: Points, view: View, goal: Array, share: Array, start: State, rules: Rules, *,
          before: Array | None = None, seconds: float = 0.0) -> State:
    """Return the state that fits measurements goal (p, 2 or 3); share (p,): how much each counts, 0 for a missing one.

    before: parameters of the frame ``seconds`` ago, if they are to be kept to.
    """
    k, weights = len(points.low), len(points.names)
    goal = np.where(share[:, None] > 0.0, goal, 0.0)
    pull, middle = np.zeros(k), np.zeros(k)
    pull[weights:] = 1.0 / rules.turn**2
    if before is not None and seconds > 0.0:
        keep = np.full(k, 1.0 / (rules.change**2 * seconds))
        keep[weights:] /= 90.0**2                       # an angle of a full turn of the eye for a whole weight
        middle = keep * before / (pull + keep)
        pull = pull + keep
    tax = np.zeros(k)
    tax[:weights] = rules.sparsity

    def away(x: Array, pose: HeadPose) -> tuple[Array, Array, Array]:
        rest = points.places(x) @ pose.turn.T
        seen = rest + pose.place
        return rest, seen, view.project(seen, pose.zoom) - goal

    def cost(x: Array, off: Array, counts: Array, scale: float) -> float:
        return 0.5 * float(counts @ (off**2).sum(axis=1)) / scale**2 + float(tax @ x) \
            + 0.5 * float(pull @ (x - middle)**2)

    x, pose = np.clip(start.x, points.low, points.high), start.pose
    rest, seen, off = away(x, pose)
    for _ in range(rules.rounds):
        unit = rules.noise * (pose.zoom if isinstance(view, Space) else 1.0)
        counts, scale = _counts(off, share, unit, rules.robust)
        now = cost(x, off, counts, scale)
        step = _step(points, view, x, pose, rest, seen, off, counts / scale**2, tax, pull, middle)
        length = 1.0
        for _ in range(_HALVINGS):
            near = np.clip(x + length * step[7:], points.low, points.high)
            there = HeadPose(small_turn(length * step[:3]) @ pose.turn, pose.place + length * step[3:6],
                             pose.zoom * float(np.exp(length * step[6])))
            rest, seen, off = away(near, there)
            value = cost(near, off, counts, scale)
            if value <= now:
                break
            length *= 0.5
        else:
            rest, seen, off = away(x, pose)
            break
        x, pose = near, there
        short = length * (np.abs(step) / _LENGTHS[np.minimum(np.arange(len(step)), 7)]).max() <= _SHORT
        if (short or now - value <= _STILL * (1.0 + abs(now))) and scale <= unit * (1.0 + 1e-9):
            break
    counts, scale = _counts(off, share, unit, rules.robust)
    return State(x, pose, counts / np.maximum(share, 1e-300) * (share > 0.0), cost(x, off, counts, scale))


def _counts(off: Array, share: Array, noise: float, robust: bool) -> tuple[Array, float]:
    """Return how much each point counts, and the noise to take: larger as long as most points are far off."""
    if not robust:
        return share, noise
    far = np.sqrt((off**2).sum(axis=1))
    seen = far[share > 0.0]
    scale = max(noise, float(np.median(seen)) / _MEDIAN[off.shape[1]]) if len(seen) else noise
    return share / (1.0 + (far / (_OUTLIER * scale)) ** 2) ** 2, scale


def _step(points: Points, view: View, x: Array, pose: HeadPose, rest: Array, seen: Array, off: Array, counts: Array,
          tax: Array, pull: Array, middle: Array) -> Array:
    """Return the step (7 + k,) to the least of what is linear here: turn, place, zoom's logarithm, parameters."""
    k, p = len(x), len(rest)
    slopes = points.slopes(x)
    by_place, by_zoom = view.slopes(seen, pose.zoom)
    size, root = by_zoom.shape[1], np.sqrt(counts)
    even = size == 3 and bool((counts == counts[0]).all())
    moved = np.empty((p, size, 7 if even else 7 + k))
    way = by_place * root[:, None, None]                            # (p, size, 3)
    u, v, w = (way[:, :, i] for i in range(3))
    a, b, c = (rest[:, i, None] for i in range(3))
    moved[:, :, 0], moved[:, :, 1], moved[:, :, 2] = b * w - c * v, c * u - a * w, a * v - b * u    # rest x way
    moved[:, :, 3:6] = way
    moved[:, :, 6] = by_zoom * root[:, None] if view.zooms else 0.0
    turned = (way.reshape(-1, 3) @ pose.turn).reshape(p, size, 3)
    gap = (off * root[:, None]).ravel()
    if even:            # in space a turn changes no product of slopes: they were made once
        hessian, flat, back = np.empty((7 + k, 7 + k)), moved.reshape(-1, 7), np.swapaxes(turned, 1, 2)
        hessian[:7, :7] = flat.T @ flat
        hessian[:7, 7:] = (back @ moved).reshape(-1, 7).T @ slopes
        hessian[7:, :7] = hessian[:7, 7:].T
        hessian[7:, 7:] = points.gram(x) * float(counts[0] * pose.zoom**2)
        slope = np.concatenate([gap @ flat, (back @ gap.reshape(p, size, 1)).ravel() @ slopes])
    else:
        np.matmul(turned, slopes.reshape(p, 3, k), out=moved[:, :, 7:])
        flat = moved.reshape(-1, 7 + k)
        hessian, slope = flat.T @ flat, gap @ flat
    slope[7:] += tax + pull * (x - middle)
    diagonal = hessian.diagonal().copy()
    diagonal[:7] *= 1.0 + _RIDGE
    diagonal[:7] += _RIDGE
    diagonal[7:] += pull + _RIDGE
    np.fill_diagonal(hessian, diagonal)
    low = np.concatenate([_FREE, points.low - x])
    return bowl_minimum(hessian, -slope, low, np.concatenate([-_FREE, points.high - x]), 7)

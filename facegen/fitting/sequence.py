"""Frame after frame: every fit begins where the last one ended, and what was lost is found again."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from facegen.errors import InputError
from facegen.fitting.head_pose import HeadPose, first_pose, spread
from facegen.fitting.points import Points
from facegen.fitting.solve import Rules, State, solve
from facegen.fitting.views import Pinhole, Space, View, fixed

Array = NDArray[np.float64]

# A pose has six unknowns (seven with a scale), and three points give nine numbers, or four in a picture eight.
_LEAST = {2: 4, 3: 3}
# Frames that say how large the head is.
_SIZED_BY = 9
# A frame whose residual is this much larger than usual is fitted from the beginning as well.
_LOST = 3.0
# Outliers are farther than three times the noise: of their weight a quarter is left.
COUNTED = 0.25


class Tracker:
    """Fits frames as they come; the last one is where the next begins."""

    def __init__(self, points: Points, view: View, share: Array, rules: Rules, zoom: float | None = None) -> None:
        self.points, self.view, self.share, self.rules, self.zoom = points, view, share, rules, zoom
        self._last: State | None = None
        self._usual: float | None = None

    def step(self, goal: Array, seconds: float = 0.04) -> State | None:
        """Return the fit of measurements (p, 2 or 3), NaN where missing, ``seconds`` after the last; None if there are
        too few points."""
        share = np.where(np.isfinite(goal).all(axis=1), self.share, 0.0)
        if not enough(goal, share):
            return None
        goal = np.where(share[:, None] > 0.0, goal, 0.0)
        before = None if self._last is None else self._last.x
        found = None
        if self._last is not None:
            found = solve(self.points, self.view, goal, share, self._last, self.rules, before=before, seconds=seconds)
        if found is None or residual(self.points, self.view, goal, found, share) > _LOST * self._typical():
            again = solve(self.points, self.view, goal, share, self._fresh(goal, share), self.rules, before=before,
                          seconds=seconds)
            found = again if found is None or again.cost < found.cost else found
        off = residual(self.points, self.view, goal, found, share)
        self._usual = off if self._usual is None else 0.9 * self._usual + 0.1 * off
        self._last = found
        return found

    def _typical(self) -> float:
        return max(self._usual or 0.0, self.rules.noise)

    def _fresh(self, goal: Array, share: Array) -> State:
        x = np.clip(np.zeros(len(self.points.low)), self.points.low, self.points.high)
        pose = first_pose(self.view, self.points.places(x), goal, share)
        return State(x, pose if self.zoom is None else _of_size(pose, self.zoom), share)


def _of_size(pose: HeadPose, zoom: float) -> HeadPose:
    """Return a pose in space with another scale that keeps the head where it is measured."""
    return HeadPose(pose.turn, pose.place * (pose.zoom / zoom), zoom)


def enough(goal: Array, share: Array) -> bool:
    """Return whether there are points enough for a pose, and not all on a line."""
    seen = goal[share > 0.0]
    return len(seen) >= _LEAST[goal.shape[1]] and spread(seen) >= 2


def residual(points: Points, view: View, goal: Array, state: State, share: Array) -> float:
    """Return the root of the mean square distance of the points that count: millimetres of the rig's, or pixels."""
    off = view.project(state.pose.apply(points.places(state.x)), state.pose.zoom) - goal
    counts = (share > 0.0) & (state.counted >= COUNTED)
    if not counts.any():
        return float("nan")
    return float(np.sqrt((off[counts] ** 2).sum(axis=1).mean())) / (state.pose.zoom if isinstance(view, Space) else 1.0)


def head_scale(points: Points, goals: Array, share: Array, rules: Rules) -> float:
    """Return the measurements' unit in millimetres of the rig's, by some frames: a head does not grow."""
    view, found = Space(True), []
    usable = [k for k, goal in enumerate(goals)
              if enough(np.nan_to_num(goal), np.where(np.isfinite(goal).all(axis=1), share, 0.0))]
    for k in np.unique(np.linspace(0, len(usable) - 1, _SIZED_BY).round().astype(int)) if usable else ():
        state = Tracker(points, view, share, rules).step(goals[usable[k]])
        if state is not None:
            found.append(state.pose.zoom)
    if not found:
        raise InputError(f"points: expected a frame with {_LEAST[3]} points or more that are not on a line, got none")
    return float(np.median(found))


def own_shape(points: Points, view: View, goals: Array, share: Array, rules: Rules, frames: Sequence[int],
              zoom: float | None) -> tuple[Points, NDArray[np.bool_]]:
    """Return the points as they rest on the person that was recorded, by frames in which the face is neutral, and which
    (p,) were seen there.

    What a picture does not show, how far forward a point lies, is the rig's.
    """
    still = points.moved(np.zeros((goals.shape[1], 3)))
    still.low = still.high = np.zeros(len(points.low))
    moves, seen = np.zeros((goals.shape[1], 3)), np.zeros(goals.shape[1])
    for k in frames:
        # The person is not the rig: that is no noise, and most of it is the same for all points.
        state = Tracker(still, view, share, replace(rules, robust=False), zoom).step(goals[k])
        if state is None:
            raise InputError(f"neutral: frame {k} has too few points, or all on a line")
        valid = np.isfinite(goals[k]).all(axis=1)
        at = state.pose.apply(still.places(state.x))
        off = np.where(valid[:, None], goals[k] - view.project(at, state.pose.zoom), 0.0)
        if isinstance(view, Space):
            way = off / state.pose.zoom
        else:
            depth = -at[:, 2] if isinstance(view, Pinhole) else np.ones(len(at))
            focal = view.focal if isinstance(view, Pinhole) else (state.pose.zoom, state.pose.zoom)
            way = np.column_stack([off[:, 0] / focal[0] * depth, -off[:, 1] / focal[1] * depth, np.zeros(len(at))])
        moves += way @ state.pose.turn
        seen += valid
    return points.moved(moves / np.maximum(seen, 1.0)[:, None]), seen > 0


@dataclass(frozen=True, eq=False)
class Track:
    """``states``: of each frame, or None; ``points``, ``view``: what they are states of; ``unsettled``: how many points
    no neutral frame shows, so that they rest where the rig's do."""

    states: tuple[State | None, ...]
    points: Points
    view: View
    unsettled: int = 0


def track(points: Points, view: View, goals: Array, share: Array, times: Array, rules: Rules, *,
          scale: float | None = None, neutral: Sequence[int] = ()) -> Track:
    """Return the fits of frames of measurements (n, p, 2 or 3).

    scale: measured units in a millimetre of the rig's, if it is known; only in space.
    """
    zoom = None
    if isinstance(view, Space):
        zoom = head_scale(points, goals, share, rules) if scale is None else scale
        view = fixed(view, False)
    unsettled = 0
    if len(neutral):
        points, settled = own_shape(points, view, goals, share, rules, neutral, zoom)
        unsettled = int((~settled & np.isfinite(goals).all(axis=2).any(axis=0)).sum())
    tracker = Tracker(points, view, share, rules, zoom)
    steps = np.diff(times, prepend=times[0])
    states = tuple(tracker.step(goal, float(step)) for goal, step in zip(goals, steps, strict=True))
    return Track(states, points, view, unsettled)

"""What a fit hands back: a performance, how well it fits, and what the measurements do not tell."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from facegen.animation.performance import Performance
from facegen.fitting.head_pose import angles
from facegen.fitting.observed import Observed
from facegen.fitting.rigs import Rig, Wanted
from facegen.fitting.sequence import COUNTED, Track, residual
from facegen.fitting.solve import Rules
from facegen.fitting.units import FacePoints
from facegen.fitting.views import Pinhole, View, WeakCamera

Array = NDArray[np.float64]

# A mean residual of more than this many times the noise is worth a word.
_POOR = 4.0


@dataclass(frozen=True, eq=False)
class Fitted:
    """What a fit found, of n frames and p points.

    performance: weights, NaN in frames without a fit, without those that no point sees; head, place, gaze; the residual
    as a further column. residuals (n,): root of the mean square distance in ``unit``, "mm" of the rig's or "px",
    outliers left out; NaN where there is no fit. points: (n, p, 2 or 3), where the fit sees the points, in the
    measurement's own units; ``outliers`` (n, p). scale (n,): measured units (or pixels) in a millimetre of the rig's;
    NaN for a camera with perspective. seen: what the points tell of the weights, and what not.
    """

    performance: Performance
    residuals: Array
    unit: str
    points: Array
    outliers: NDArray[np.bool_]
    scale: Array
    seen: Observed

    @property
    def fitted(self) -> int:
        """How many frames have a fit."""
        return int(np.isfinite(self.residuals).sum())

    @property
    def residual(self) -> float:
        """The root of the mean square of all residuals."""
        return float(np.sqrt(np.nanmean(self.residuals**2)))

    @property
    def worst(self) -> float:
        """The largest residual of a frame."""
        return float(np.nanmax(self.residuals))


def told(face: Rig, found: Track, goals: Array, share: Array, want: Wanted, seen: Observed, times: Array, rules: Rules,
          source: str) -> Fitted:
    """Return frames' states as a performance."""
    n, p, points, view = len(goals), goals.shape[1], found.points, found.view
    shown = np.flatnonzero(~np.isin(want.names, seen.unseen))
    weights, head, place = np.full((n, len(shown)), np.nan), np.full((n, 3), np.nan), np.full((n, 3), np.nan)
    gaze = np.full((n, 4), np.nan) if isinstance(points, FacePoints) and points.gaze(points.low) is not None else None
    off, scale, made = np.full(n, np.nan), np.full(n, np.nan), np.full(goals.shape, np.nan)
    outliers, count = np.zeros((n, p), bool), np.zeros(n)
    flat = isinstance(view, WeakCamera)
    for k, state in enumerate(found.states):
        if state is None:
            continue
        weights[k] = points.weights(state.x)[shown]
        head[k], place[k] = angles(state.pose.turn), state.pose.place
        if gaze is not None:
            gaze[k] = points.gaze(state.x)
        valid = np.where(np.isfinite(goals[k]).all(axis=1), share, 0.0)
        off[k] = residual(points, view, np.nan_to_num(goals[k]), state, valid)
        made[k] = view.project(state.pose.apply(points.places(state.x)), state.pose.zoom)
        outliers[k], count[k] = (valid > 0.0) & (state.counted < COUNTED), (valid > 0.0).sum()
        scale[k] = np.nan if isinstance(view, Pinhole) else state.pose.zoom
    if flat:
        place[:, 2] = np.nan
    if gaze is not None and not _sees_eyes(points, goals):
        gaze = None
    extra = {f"residual_{view.unit}": off, "points": count}
    if rules.robust:
        extra["outliers"] = outliers.sum(axis=1).astype(float)
    # The format says that the columns beside the shapes are ours to be written.
    about = {"format": "csv", "rig": face.name, "fitted": source, "view": type(view).__name__}
    performance = Performance(times, tuple(want.names[k] for k in shown), weights, want.vocabulary, head, place, gaze,
                              extra, about, _warnings(found, seen, off, view, rules, flat))
    return Fitted(performance, off, view.unit, made, outliers, scale, seen)


def _sees_eyes(points: FacePoints, goals: Array) -> bool:
    """Return whether a point was seen that a turn of the eyes moves by a millimetre or more."""
    x = np.clip(np.zeros(len(points.low)), points.low, points.high)
    turned = x.copy()
    turned[len(points.names)] = 10.0
    moved = np.linalg.norm(points.places(turned) - points.places(x), axis=1) > 1.0
    return bool(np.isfinite(goals).all(axis=2).any(axis=0)[moved].any())


def _warnings(found: Track, seen: Observed, off: Array, view: View, rules: Rules, flat: bool) -> tuple[str, ...]:
    said = []
    lost = [k for k, state in enumerate(found.states) if state is None]
    if lost:
        said.append(f"{len(lost)} of {len(off)} frames have too few points and stay empty, the first is {lost[0]}")
    if found.unsettled:
        said.append(f"{found.unsettled} points are missing in the neutral frames and rest where the rig's do")
    if seen.unseen:
        said.append(f"no point sees {', '.join(seen.unseen)}: not fitted")
    if seen.unsure:
        said.append("one frame says little of " + _listed([f"{name} (for {other})" for name, other in
                                                           seen.unsure.items()]))
    if flat:
        said.append("weak perspective does not tell how far away the head is: z of its place is empty")
    typical = float(np.nanmedian(off))
    if typical > _POOR * rules.noise:
        said.append(f"the points stay {typical:.3g} {view.unit} from the rig's: another person's face or other places; "
                    "name frames in which they rest (neutral), or a larger noise")
    return tuple(said)


def _listed(names: Sequence[str], most: int = 8) -> str:
    return ", ".join(names[:most]) + (f" and {len(names) - most} more" if len(names) > most else "")

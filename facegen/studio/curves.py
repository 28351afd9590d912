"""What a motion's weights do over time: the few that move most, for a picture."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from facegen.animation.clip import Clip
from facegen.animation.playback import Playback
from facegen.facs.tables import load_units
from facegen.facs.units import split_code

MOST = 6
"""Curves in one picture: more cannot be told apart."""

POINTS = 160
"""Points of a curve: as many as the panel is wide in steps that an eye sees."""

_LEAST = 0.02           # of a weight: less is no movement one sees


@dataclass(frozen=True, eq=False)
class Curves:
    """``times`` (p,), seconds; ``labels`` of k curves; ``values`` (p, k), 0..1; ``others``: how many more move."""

    times: NDArray[np.float64]
    labels: tuple[str, ...]
    values: NDArray[np.float64]
    others: int = 0


def curves(motion: Clip | Playback) -> Curves:
    """Return the curves that move most."""
    times = np.linspace(0.0, motion.duration, POINTS)
    if isinstance(motion, Playback):
        names, vocabulary = motion.performance.names, motion.performance.vocabulary
        values = np.array([motion.cue(float(t)).weights for t in times]).reshape(len(times), len(names))
    else:
        found = [_by_unit(motion.units_at(float(t))) for t in times]
        names = tuple(dict.fromkeys(code for one in found for code in one))
        values = np.array([[one.get(code, 0.0) for code in names] for one in found]).reshape(len(times), len(names))
        vocabulary = "units"
    spread = np.ptp(values, axis=0) if len(names) else np.zeros(0)
    order = [int(k) for k in np.argsort(-spread, kind="stable") if spread[k] > _LEAST]
    labels = tuple(unit_label(names[k]) if vocabulary == "units" else names[k] for k in order[:MOST])
    return Curves(times, labels, np.clip(values[:, order[:MOST]], 0.0, 1.0), max(len(order) - MOST, 0))


def _by_unit(weights: Mapping[str, float]) -> dict[str, float]:
    """Return unit -> weight, of sides that differ the stronger one: a curve each would jump where they become one."""
    found: dict[str, float] = {}
    for code, weight in weights.items():
        number = split_code(code)[1]
        found[number] = max(found.get(number, 0.0), weight)
    return found


def unit_label(code: str) -> str:
    """Return a unit as a person reads it: "Lip corners up (12), left"."""
    mark, number = split_code(code)
    side = {"L": ", left", "R": ", right", "T": ", upper lip", "B": ", lower lip"}.get(mark, "")
    return f"{load_units().catalogue.unit_of(code).plain} ({number}){side}"

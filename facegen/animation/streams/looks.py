"""Where the eyes look: as angles, as ARKit's eyeLook shapes, as units 61 to 66.

A shape or a unit at weight 1 turns as far as the table of movements says; the lids that follow are the shapes' own.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from facegen.animation.angles import reach
from facegen.animation.performance import Performance
from facegen.facs.tables import load_units

Array = NDArray[np.float64]

# shape -> which column of the gaze (yaw_L, pitch_L, yaw_R, pitch_R) it turns, which way, and which reach that is.
_SHAPES = {
    "eyeLookOutLeft": (0, 1.0), "eyeLookInLeft": (0, -1.0), "eyeLookUpLeft": (1, 1.0), "eyeLookDownLeft": (1, -1.0),
    "eyeLookInRight": (2, 1.0), "eyeLookOutRight": (2, -1.0), "eyeLookUpRight": (3, 1.0), "eyeLookDownRight": (3, -1.0)}
SHAPES = tuple(_SHAPES)
"""ARKit's shapes of the eyes' turns."""

UNITS = ("61", "62", "63", "64", "65", "66")
"""The units of the eyes' turns: left, right, up, down, apart, together."""


def gaze_of(one: Performance) -> Array | None:
    """Return where the eyes look (n, 4), as the recording says or as its shapes or units do; None if nothing does."""
    return one.gaze if one.gaze is not None else turned_by(one)


def turned_by(one: Performance) -> Array | None:
    """Return where the shapes or units of a performance turn the eyes (n, 4); None if it has none that do."""
    turns = _turns(one)
    if turns is None:
        return None
    names, matrix = turns
    return one.weights[:, [one.names.index(name) for name in names]] @ matrix


def shapes_of(gaze: Array) -> dict[str, Array]:
    """Return the weights of ARKit's shapes that look along a gaze (n, 4); beyond what they reach they are 1."""
    result = {}
    for name, (column, way) in _SHAPES.items():
        result[name] = np.clip(way * gaze[:, column] / _far(column, way), 0.0, 1.0)
    return result


def units_of(gaze: Array) -> dict[str, Array]:
    """Return the weights of units 61 to 66 that look along a gaze (n, 4).

    The eyes' mean turns them together, half of what their yaw differs in turns them apart; pitch has no difference.
    """
    yaw, pitch = (gaze[:, 0] + gaze[:, 2]) / 2, (gaze[:, 1] + gaze[:, 3]) / 2
    apart = (gaze[:, 0] - gaze[:, 2]) / 2
    basis = load_units().basis
    far = {"65": basis["65"].eyes["yaw_L"], "66": -basis["66"].eyes["yaw_L"]}
    pairs = (("61", yaw, reach("eyes", "yaw")[0]), ("62", -yaw, reach("eyes", "yaw")[1]),
             ("63", pitch, reach("eyes", "pitch")[0]), ("64", -pitch, reach("eyes", "pitch")[1]),
             ("65", apart, far["65"]), ("66", -apart, far["66"]))
    return {unit: np.clip(turn / most, 0.0, 1.0) for unit, turn, most in pairs}


def _far(column: int, way: float) -> float:
    return reach("eyes", "pitch" if column % 2 else "yaw")[int(way < 0)]


def _turns(one: Performance) -> tuple[list[str], Array] | None:
    """Return which names turn the eyes, and the degrees (k, 4) each turns at weight 1."""
    if one.vocabulary == "arkit":
        names = [name for name in one.names if name in _SHAPES]
        matrix = np.zeros((len(names), 4))
        for row, name in enumerate(names):
            column, way = _SHAPES[name]
            matrix[row, column] = way * _far(column, way)
    elif one.vocabulary == "units":
        names = [name for name in one.names if name in UNITS]
        matrix = np.array([_unit_turns()[name] for name in names]).reshape(len(names), 4)
    else:
        return None
    return (names, matrix) if names else None


@cache
def _unit_turns() -> dict[str, tuple[float, ...]]:
    basis = load_units().basis
    return {unit: tuple(basis[unit].eyes.get(key, 0.0) for key in ("yaw_L", "pitch_L", "yaw_R", "pitch_R"))
            for unit in UNITS}

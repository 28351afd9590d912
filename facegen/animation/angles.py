"""Head and eye angles as action units, so that every rig takes them.

The table of movements says how far a unit turns at weight 1; an angle becomes the weight that turns as far.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

from facegen.errors import InputError
from facegen.facs.tables import load_units

# part -> axis -> the units that turn towards + and towards -, and where their movement is written.
_UNITS = {"head": {"yaw": ("51", "52"), "pitch": ("53", "54"), "roll": ("55", "56")},
          "eyes": {"yaw": ("61", "62"), "pitch": ("63", "64")}}
AXES = {part: tuple(axes) for part, axes in _UNITS.items()}


@cache
def reach(part: str, axis: str) -> tuple[float, float]:
    """Return how many degrees a part turns at weight 1, towards + and towards -; both positive."""
    basis = load_units().basis
    plus, minus = (getattr(basis[unit], part) for unit in _UNITS[part][axis])
    key = axis if part == "head" else f"{axis}_L"
    return plus[key], -minus[key]


def turned(part: str, angles: Mapping[str, float]) -> dict[str, float]:
    """Return unit -> weight for angles in degrees: + yaw to the subject's left, + pitch up, + roll to the left.

    part: "head" (yaw, pitch, roll) or "eyes" (yaw, pitch). Raises InputError beyond what the units reach.
    """
    result = {}
    for axis, angle in angles.items():
        side = int(angle < 0)
        most = reach(part, axis)[side]
        if not abs(angle) <= most:
            low, high = -reach(part, axis)[1], reach(part, axis)[0]
            raise InputError(f"{axis}: expected degrees within {low:g}..{high:g}, got {angle:g}")
        if angle:
            result[_UNITS[part][axis][side]] = abs(angle) / most
    return result

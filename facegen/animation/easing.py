"""How a movement gets from 0 to 1.

``min_jerk``: Flash and Hogan 1985, equation for point-to-point movement, x(s) = 10 s^3 - 15 s^4 + 6 s^5: the smoothest
way between two rests; its speed is the bell that faces show.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType


def min_jerk(s: float) -> float:
    """Start and stop at rest, as smoothly as can be."""
    return s * s * s * (10.0 + s * (6.0 * s - 15.0))


def linear(s: float) -> float:
    """Move at one speed."""
    return s


def ease_in(s: float) -> float:
    """Start at rest, arrive at speed."""
    return s * s


def ease_out(s: float) -> float:
    """Start at speed, come to rest."""
    return s * (2.0 - s)


def step(s: float) -> float:
    """Stay, and jump at the end."""
    return 1.0 if s >= 1.0 else 0.0


EASES: Mapping[str, Callable[[float], float]] = MappingProxyType(
    {one.__name__: one for one in (min_jerk, linear, ease_in, ease_out, step)} | {"hold": step})
DEFAULT_EASE = "min_jerk"


def eased(name: str, s: float) -> float:
    """Return the share 0..1 of a movement done after the share ``s`` of its time; exactly 0 and 1 at its ends."""
    if s <= 0.0:
        return 0.0
    return 1.0 if s >= 1.0 else min(1.0, max(0.0, EASES[name](s)))

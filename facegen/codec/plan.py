"""Which knots to send: those whose bits are worth the error that they take away.

Minimises, over the knots of one parameter in one packet, ``D + trade * R``: D, the sum over the frames of the squared
distance from the recording in steps; R, the bits that the knots will take, estimated. No frame may be farther from
the recording than ``reach`` steps if any knots can help it. (Rate-distortion optimisation of a tree, bottom up, after
Chou, Lookabaugh, Gray 1989; the candidates at each knot are the nearest step, the one on the line, and the next one
towards zero.)
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from facegen.codec.rangecoder import ONE, Model
from facegen.codec.syntax import Curve, Models, between, code_number, knot_context, order

TRADE = 0.35
"""Squared steps that a bit must save: at high rates a bit saves 0.12, where most is still it must save more."""

REACH = 1.5
"""Steps that a frame may be off: a blink of one frame is not traded away."""

_AT_SIGHT = 2.0             # bits: no movement costs less
_Planned = dict[tuple[int, int, int, int], tuple[float, Curve]]

_KEPT = 1 << 15             # prices that are remembered


class _Ruler:
    """A coder that writes nothing and counts bits."""

    reads = False

    def __init__(self) -> None:
        self.bits = 0.0

    def bit(self, model: Model, bit: int) -> int:
        """Count an answer."""
        self.bits -= math.log2((ONE - model.no if bit else model.no) / ONE)
        return bit

    def even(self, bit: int) -> int:
        """Count a bit."""
        self.bits += 1.0
        return bit


@lru_cache(maxsize=_KEPT)
def _price(question: str, kind: int, rises: int, value: int) -> float:
    """Return the bits of a number, by models that have learned nothing yet."""
    ruler = _Ruler()
    code_number(ruler, Models(), question, kind, rises, value)
    return ruler.bits


@lru_cache(maxsize=_KEPT)
def _answer(question: str, kind: int, context: int, bit: int) -> float:
    """Return the bits of an answer, likewise."""
    ruler = _Ruler()
    ruler.bit(Models()(question, kind, context), bit)
    return ruler.bits


def plan_curve(course: NDArray[np.float64], before: int | None, kind: int = 0, *, trade: float = TRADE,
               reach: float = REACH) -> Curve:
    """Return the knots of a parameter's course (n,) in steps; ``before``: where it stood in the frame before.

    Knot -1 is that, if given. ::

        plan_curve(np.array([0.0, 0.1, 2.2, 4.1]), None)        # {0: 0, 3: 4}
    """
    first = 0 if before is None else -1
    last = len(course) - 1
    values = [float(value) for value in course]
    best: tuple[float, Curve] | None = None
    planned: _Planned = {}
    for start in (_near(values[0], 0, reach) if before is None else [before]):
        cost = 0.0
        if before is None:
            cost = (start - values[0]) ** 2 + trade * _price("start", kind, 0, start)
        for end in (_near(values[last], start, reach) if last > first else [start]):
            curve = {first: start, last: end}
            total = cost
            if last > first:
                total += (end - values[last]) ** 2 + _plan(values, first, last, curve, kind, trade, reach, planned)
                moves = int(end != start or len(curve) > 2)
                total += trade * _answer("moves", kind, int(start != 0), moves)
                total += trade * _price("end", kind, order(start), end - start) if moves else 0.0
            if best is None or total < best[0]:
                best = total, curve
    return best[1]


def _plan(values: list[float], a: int, b: int, curve: Curve, kind: int, trade: float, reach: float,
          planned: _Planned) -> float:
    """Put the best knots between the frames a and b into ``curve``; return their cost."""
    if b - a < 2:
        return 0.0
    start, end = curve[a], curve[b]
    key = a, b, start, end
    if key not in planned:              # few values are tried at each frame, in many combinations
        planned[key] = _planned(values, a, b, start, end, kind, trade, reach, planned)
    cost, knots = planned[key]
    curve.update(knots)
    return cost


def _planned(values: list[float], a: int, b: int, start: int, end: int, kind: int, trade: float, reach: float,
             planned: _Planned) -> tuple[float, Curve]:
    rise = (end - start) / (b - a)
    off = [start + rise * (t - a) - values[t] for t in range(a + 1, b)]
    context, direction = knot_context(a, b, end - start), order(end - start)
    none, some = (trade * _answer("knot", kind, context, bit) for bit in (0, 1))
    error = math.fsum(one * one for one in off)
    best: tuple[float, Curve] = (error + none if max(map(abs, off)) <= reach else math.inf), {}
    if best[0] < some:
        return best
    middle = (a + b) // 2
    line = between({a: start, b: end}, a, b, middle)
    for value in _near(values[middle], line, reach):
        knots = {a: start, middle: value, b: end}
        cost = (value - values[middle]) ** 2 + some + trade * _price("off", kind, direction, value - line)
        cost += _plan(values, a, middle, knots, kind, trade, reach, planned)
        cost += _plan(values, middle, b, knots, kind, trade, reach, planned)
        if cost < best[0]:
            best = cost, knots
    return best


def _near(value: float, expected: int, reach: float) -> list[int]:
    """Return the whole steps worth trying for a value: the nearest, the expected and the one towards zero."""
    nearest = round(value)
    return [nearest, *(one for one in dict.fromkeys((expected, math.trunc(value)))
                       if one != nearest and abs(one - value) <= reach)]


def still(courses: NDArray[np.float64], before: NDArray[np.int64] | None, *, trade: float = TRADE
          ) -> tuple[NDArray[np.bool_], NDArray[np.int64]]:
    """Return which of the courses (n, k) are best left standing, at sight, and at which step each (k,).

    Spares `plan_curve` where nothing moves, which is most of most faces.
    """
    at = np.rint(courses.mean(axis=0)).astype(np.int64) if before is None else before
    return ((courses - at) ** 2).sum(axis=0) <= _AT_SIGHT * trade, at

"""What a motion packet says, question by question: one function writes it and reads it.

A parameter's course over a packet is a polygon through knots at whole steps. The ends are told first; then each
interval is asked whether it has a knot in its middle, and its two halves likewise. So the rate in time follows the
movement: a still parameter costs a fraction of a bit, a blink gets every frame.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from facegen.codec.rangecoder import Model, RangeDecoder, RangeEncoder
from facegen.errors import InputError

WEIGHT, SIDE, HEAD, EYE = range(4)
"""Kinds of parameters, each with models of its own. SIDE: how two sides differ."""

FARTHEST = 1 << 15
"""Largest number of steps of a knot from zero; more is a damaged packet."""

_UNARY = 3                  # magnitudes told by yes or no; the rest is told by how many bits it has, and those
_LONGEST = 17               # bits of the rest

# Probability of "no" to begin with, by kind and then by context, counted on real and synthetic performances
# (benchmarks/codec_rates.py --count) and rounded; and how many answers that is worth.
_WORTH = 8
_PRIORS: dict[str, tuple[tuple[float, ...], ...]] = {
    "short": ((0.95,),),
    "gaps": ((0.9,),),
    "found": ((0.85, 0.2),),
    "start": ((0.7, 0.4), (0.99, 0.93), (0.4, 0.15), (0.85, 0.6)),
    "start more": ((0.5, 0.4), (0.65, 0.6), (0.3, 0.1), (0.4, 0.35)),
    "start bits": ((0.5, 0.5, 0.5, 0.7), (0.5, 0.5, 0.5, 0.7), (0.2, 0.2, 0.3, 0.5), (0.4, 0.4, 0.5, 0.6)),
    "start sign": ((0.99,), (0.5,), (0.5,), (0.5,)),
    "moves": ((0.85, 0.55, 0.65, 0.4), (0.99, 0.5, 0.97, 0.4), (0.65, 0.45, 0.5, 0.2), (0.9, 0.55, 0.75, 0.35)),
    "end": ((0.2,), (0.2,), (0.1,), (0.1,)),
    "end more": ((0.6, 0.45), (0.65, 0.5), (0.4, 0.25), (0.6, 0.55)),
    "end sign": ((0.99, 0.4, 0.5), (0.5, 0.2, 0.8), (0.5, 0.4, 0.6), (0.5, 0.2, 0.8)),
    "end bits": ((0.5, 0.6, 0.6, 0.7), (0.5, 0.6, 0.6, 0.7), (0.3, 0.4, 0.5, 0.6), (0.5, 0.6, 0.6, 0.7)),
    "knot": ((0.8, 0.75, 0.55, 0.75, 0.7, 0.5, 0.75, 0.75, 0.2, 0.7, 0.7, 0.15),) * 2
            + ((0.8, 0.75, 0.5, 0.65, 0.55, 0.2, 0.7, 0.7, 0.1, 0.6, 0.6, 0.1),)
            + ((0.9, 0.75, 0.4, 0.85, 0.7, 0.35, 0.7, 0.65, 0.2, 0.6, 0.6, 0.2),),
    "off": ((0.3,), (0.2,), (0.2,), (0.3,)),
    "off more": ((0.6, 0.6), (0.7, 0.6), (0.35, 0.45), (0.7, 0.7)),
    "off sign": ((0.7, 0.5, 0.5), (0.5, 0.5, 0.5), (0.5, 0.5, 0.5), (0.5, 0.5, 0.5)),
    "off bits": ((0.5, 0.6, 0.6, 0.7), (0.5, 0.6, 0.6, 0.7), (0.3, 0.4, 0.5, 0.6), (0.5, 0.6, 0.6, 0.7)),
}

Coder = RangeEncoder | RangeDecoder
Curve = dict[int, int]
"""Knots: frame in the packet -> steps. Frame -1 is the last of the packet before."""

Neighbour = tuple[int, int]


class PacketError(InputError):
    """A packet that says what no encoder writes."""


class Models:
    """The models of all questions, by name; made when first asked."""

    def __init__(self) -> None:
        self._of: dict[tuple, Model] = {}

    def copy(self) -> Models:
        """Return models that know the same and learn by themselves."""
        other = Models()
        other._of = {key: model.copy() for key, model in self._of.items()}
        return other

    def __call__(self, question: str, kind: int = 0, context: int = 0) -> Model:
        """Return the model of a question about a kind of parameter, in a context."""
        key = (question, kind, context)
        if key not in self._of:
            self._of[key] = Model(_PRIORS[question][kind][context], _WORTH)
        return self._of[key]


@dataclass
class Motion:
    """What a motion packet holds: ``found``: of each frame, whether a face was seen; ``curves``: of each parameter.

    Without any face there are no curves.
    """

    found: Sequence[bool]
    curves: list[Curve] = field(default_factory=list)


def code_motion(coder: Coder, models: Models, kinds: Sequence[int], most: int, before: Sequence[int] | None,
                motion: Motion | None = None) -> Motion:
    """Write a packet's motion, or read it if the coder is a decoder; return it.

    kinds: of each parameter. most: frames of a whole packet. before: where each parameter stood in the frame before
    (steps), or None in a key packet, which needs none. Raises PacketError for what no encoder writes.
    """
    count = len(motion.found) if motion else most
    if coder.bit(models("short"), int(count < most)):
        count = 1 + _bits(coder, count - 1, 6)
        if count >= most:
            raise PacketError(f"packet: expected fewer than {most} frames, got {count}")
    found = list(motion.found) if motion else [True] * count
    if coder.bit(models("gaps"), int(not all(found))):
        last = 1
        for k, seen in enumerate(found):
            last = coder.bit(models("found", 0, last), int(seen))
            found[k] = bool(last)
    if not any(found):
        return Motion(found)
    curves = motion.curves if motion else [{} for _ in kinds]
    near: Neighbour = (0, 0)
    for k, (kind, curve) in enumerate(zip(kinds, curves, strict=True)):
        near = code_curve(coder, models, kind, count, None if before is None else before[k], curve, near)
    return Motion(found, curves)


def code_curve(coder: Coder, models: Models, kind: int, count: int, before: int | None, curve: Curve,
               near: Neighbour = (0, 0)) -> Neighbour:
    """Write the knots of one parameter over ``count`` frames, or read them into ``curve``.

    near: whether the parameter before it was away from zero, and whether it moved: neighbours often go together.
    Returns the same of this one.
    """
    first, last = -1 if before is not None else 0, count - 1
    start = before
    if start is None:
        start = curve[0] = _near(code_number(coder, models, "start", kind, 0, curve.get(0, 0), near[0]))
    else:
        curve[-1] = start
    away = int(start != 0)
    if last == first:
        return away, near[1]
    moves = coder.bit(models("moves", kind, away + 2 * near[1]),
                      int(len(curve) > 2 or curve.get(last, start) != start))
    if not moves:
        curve[last] = start
        return away, 0
    curve[last] = _near(start + code_number(coder, models, "end", kind, order(start), curve.get(last, start) - start))
    # What moves, and ends where it began, must have a knot: that is not asked.
    _between(coder, models, kind, first, last, curve, must=curve[last] == start)
    return away, 1


def _between(coder: Coder, models: Models, kind: int, a: int, b: int, curve: Curve, *, must: bool = False) -> None:
    """Write or read the knots between the frames a and b, which have theirs."""
    if b - a < 2:
        return
    middle = (a + b) // 2
    rise = curve[b] - curve[a]
    if not must and not coder.bit(models("knot", kind, knot_context(a, b, rise)), int(middle in curve)):
        return
    expected = between(curve, a, b, middle)
    curve[middle] = _near(expected + code_number(coder, models, "off", kind, order(rise),
                                                 curve.get(middle, expected) - expected))
    _between(coder, models, kind, a, middle, curve)
    _between(coder, models, kind, middle, b, curve)


def knot_context(a: int, b: int, rise: int) -> int:
    """Return the context of the question whether there is a knot between the frames a and b."""
    return 3 * (min((b - a).bit_length(), 5) - 2) + min(abs(rise), 2)


def order(value: int) -> int:
    """Return 0, 1, 2 for a number that is zero, above, below."""
    return 0 if value == 0 else 1 if value > 0 else 2


def between(curve: Curve, a: int, b: int, t: int) -> int:
    """Return the whole number of steps nearest to the line from knot a to knot b at frame t; halves go up."""
    return curve[a] + (2 * (curve[b] - curve[a]) * (t - a) + (b - a)) // (2 * (b - a))


def code_number(coder: Coder, models: Models, question: str, kind: int, rises: int, value: int, near: int = 0) -> int:
    """Write or read a whole number: whether it is zero, its sign, whether it is 1, 2 or more, and how much more.

    rises, near: what its sign, and whether it is zero, may depend on.
    """
    size = abs(value)
    if not coder.bit(models(question, kind, near), int(size > 0)):
        return 0
    negative = coder.bit(models(f"{question} sign", kind, rises), int(value < 0))
    found = 1
    while found < _UNARY and coder.bit(models(f"{question} more", kind, found - 1), int(size > found)):
        found += 1
    if found == _UNARY:
        found += _rest(coder, models, f"{question} bits", kind, size - _UNARY)
    return -found if negative else found


def _rest(coder: Coder, models: Models, question: str, kind: int, value: int) -> int:
    """Write or read a number from 0 on: how many bits value + 1 has after its first, then those."""
    length, wanted = 0, (value + 1).bit_length() - 1 if not coder.reads else 0
    while coder.bit(models(question, kind, min(length, 3)), int(length < wanted)):
        length += 1
        if length > _LONGEST:
            raise PacketError("packet: a number is longer than any encoder writes")
    return (1 << length | _bits(coder, value + 1, length)) - 1


def _bits(coder: Coder, value: int, length: int) -> int:
    """Write or read the lowest bits of a number, highest first."""
    found = 0
    for k in reversed(range(length)):
        found = found << 1 | coder.even(value >> k & 1)
    return found


def _near(value: int) -> int:
    if abs(value) > FARTHEST:
        raise PacketError(f"packet: expected knots within {FARTHEST} steps of zero, got {value}")
    return value

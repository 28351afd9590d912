"""A person's own neutral and range: recorders are off by what a face looks like at rest.

    w' = gain (w - offset) / (1 - offset),   not below 0

so that a face at rest is 0 and a full movement stays 1. The offset of each shape is its middle weight in seconds of
rest, or a low percentile of all of the recording.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from facegen.animation.performance import Performance
from facegen.errors import InputError, nearest

Array = NDArray[np.float64]

LARGEST_OFFSET = 0.8
"""A face whose rest is above this is not at rest: more is not taken off, because what is left would be noise."""

# Head and eyes rest where they mostly are.
_MIDDLE = ("head", "gaze")


@dataclass(frozen=True)
class Calibration:
    """Where the neutral is. Give one: ``seconds`` (from, to) of rest, a ``percentile`` 0..100, or ``offsets`` by shape.

    gain: a number, or shape -> number, by which all is multiplied. head: whether head and gaze are set to 0 as well
    (by their middle in the same seconds; with a percentile, in all of the recording).
    """

    seconds: tuple[float, float] | None = None
    percentile: float | None = None
    offsets: Mapping[str, float] | None = None
    gain: float | Mapping[str, float] = field(default=1.0)
    head: bool = False

    def __post_init__(self) -> None:
        given = [name for name in ("seconds", "percentile", "offsets") if getattr(self, name) is not None]
        if len(given) > 1:
            raise InputError(f"calibrate: expected one of seconds, percentile and offsets, got {' and '.join(given)}")
        if self.seconds is not None:
            start, end = (_number("seconds", value, 0.0, 1e6) for value in self.seconds)
            if not start < end:
                raise InputError(f"calibrate: expected seconds from a time to a later one, got {start:g}-{end:g}")
        if self.percentile is not None:
            _number("percentile", self.percentile, 0.0, 100.0)
        for name, value in (self.offsets or {}).items():
            _number(f"offsets: {name}", value, 0.0, LARGEST_OFFSET)
        for name, value in self.gain.items() if isinstance(self.gain, Mapping) else (("all", self.gain),):
            _number(f"gain: {name}", value, 0.0, 100.0)

    @classmethod
    def of(cls, value: Calibration | str | None) -> Calibration | None:
        """Return a calibration as an option says it: nothing, a text, or a calibration."""
        if value is None or isinstance(value, cls):
            return value
        if isinstance(value, str):
            return parse_calibration(value)
        raise InputError(f"calibrate: expected FROM-TO in seconds or a percentile such as 5%, "
                         f"got {type(value).__name__}")


def parse_calibration(text: str, *, gain: float | Mapping[str, float] = 1.0, head: bool = False) -> Calibration:
    """Return the calibration of a text: "FROM-TO" seconds of rest, or "5%". InputError."""
    number = r"\s*([0-9]*\.?[0-9]+)\s*"
    if found := re.fullmatch(f"{number}-{number}", text, re.ASCII):
        return Calibration(seconds=(float(found[1]), float(found[2])), gain=gain, head=head)
    if found := re.fullmatch(f"{number}%\\s*", text, re.ASCII):
        return Calibration(percentile=float(found[1]), gain=gain, head=head)
    raise InputError(f"calibrate: expected FROM-TO in seconds such as 0-2, or a percentile such as 5%, got {text!r}")


def calibrated(one: Performance, calibration: Calibration) -> Performance:
    """Return a performance with its neutral taken off. InputError for seconds without a frame, or unknown shapes."""
    chosen = np.ones(len(one), bool)
    if calibration.seconds is not None:
        start, end = calibration.seconds
        since = one.times - one.times[0]
        chosen = (since >= start) & (since <= end)
        if not (chosen & one.found).any():
            raise InputError(f"calibrate: no frame with a face in {start:g}-{end:g} s; "
                             f"the recording is {one.duration:.3f} s long")
    offset = _offsets(one, calibration, chosen)
    far = [name for name, value in zip(one.names, offset, strict=True) if value > LARGEST_OFFSET]
    said = [f"calibrate: at rest {', '.join(far[:5])}{' ...' if len(far) > 5 else ''} are above {LARGEST_OFFSET:g}; "
            f"no more than that is taken off"] if far else []
    offset = np.minimum(offset, LARGEST_OFFSET)
    weights = np.maximum((one.weights - offset) / (1.0 - offset) * _gains(one, calibration), 0.0)
    parts = {}
    for name in _MIDDLE if calibration.head else ():
        values = getattr(one, name)
        if values is not None and np.isfinite(values[chosen]).any():
            there = values[chosen][np.isfinite(values[chosen]).all(axis=1)]
            parts[name] = values - np.median(there, axis=0) if len(there) else values
    return replace(one, weights=weights, **parts, warnings=(*one.warnings, *said))


def _offsets(one: Performance, calibration: Calibration, chosen: NDArray[np.bool_]) -> Array:
    if calibration.offsets is not None:
        return _by_name(one, calibration.offsets, "offsets", 0.0)
    if calibration.seconds is None and calibration.percentile is None:
        return np.zeros(len(one.names))
    some = one.weights[chosen]
    result = np.zeros(len(one.names))
    there = np.isfinite(some).any(axis=0)
    if there.any():
        result[there] = np.nanmedian(some[:, there], axis=0) if calibration.percentile is None \
            else np.nanpercentile(some[:, there], calibration.percentile, axis=0)
    return np.maximum(result, 0.0)


def _gains(one: Performance, calibration: Calibration) -> Array:
    if isinstance(calibration.gain, Mapping):
        return _by_name(one, calibration.gain, "gain", 1.0)
    return np.full(len(one.names), float(calibration.gain))


def _by_name(one: Performance, values: Mapping[str, float], what: str, rest: float) -> Array:
    for name in values:
        if name not in one.names:
            raise InputError(f"calibrate: {what}: the performance has no '{name}'{nearest(str(name), one.names)}")
    return np.array([float(values.get(name, rest)) for name in one.names])


def _number(name: str, value: object, low: float, high: float) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not low <= value <= high:
        raise InputError(f"calibrate: {name}: expected a number in {low:g}..{high:g}, got {value!r}")
    return float(value)

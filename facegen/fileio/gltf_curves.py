"""Curves of glTF animations as straight pieces: what every interpolation says, at as many times as it takes.

Khronos, "glTF 2.0 Specification", section 3.11 (animations) and appendix C (interpolation).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from facegen.fileio.gltf_accessors import Accessors
from facegen.fileio.jsontree import Tree

INTERPOLATIONS = ("LINEAR", "STEP", "CUBICSPLINE")

CLOSE = 1e-4
"""How far a straight piece may lie from a cubic one: a ten-thousandth of a weight is not seen."""

# Because a key costs the file a few bytes and a cubic may need many pieces: no recording has a tenth of these.
_MOST_KEYS, _MOST_NUMBERS, _MOST_PIECES = 1_000_000, 30_000_000, 10_000


@dataclass(frozen=True, eq=False)
class Curve:
    """Values (n, k) at ascending times (n,), seconds; straight between them, held before and after."""

    times: NDArray[np.float64]
    values: NDArray[np.float64]

    def at(self, times: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the values (m, k) at other times."""
        if len(self.times) == 1:
            return np.repeat(self.values, len(times), axis=0)
        after = np.clip(np.searchsorted(self.times, times, side="right"), 1, len(self.times) - 1)
        start, end = self.times[after - 1], self.times[after]
        share = np.clip((times - start) / (end - start), 0.0, 1.0)[:, None]
        return (1.0 - share) * self.values[after - 1] + share * self.values[after]


def read_curve(sampler: Tree, width: int, kind: str, accessors: Accessors) -> Curve:
    """Return the curve of a sampler whose output has ``width`` numbers a key, in elements of a kind ("SCALAR", ...).

    Raises FileError, which names the place.
    """
    keys = accessors.count(sampler["input"])
    if keys > _MOST_KEYS:
        raise sampler["input"].error(f"{keys:,} keys; facegen reads {_MOST_KEYS:,} at most")
    times = accessors.floats(sampler["input"], "SCALAR")[:, 0].astype(np.float64)
    back = np.flatnonzero(np.diff(times) <= 0.0)
    if len(back) or times[0] < 0.0:
        at = int(back[0]) + 1 if len(back) else 0
        raise sampler["input"].error(f"expected ascending seconds, 0 or more, but key {at} is at {times[at]:g}")
    name = sampler["interpolation"].text() if sampler.get("interpolation") else "LINEAR"
    if name not in INTERPOLATIONS:
        raise sampler["interpolation"].error(f"expected {', '.join(INTERPOLATIONS)}, got {name[:30]!r}")
    each = 3 if name == "CUBICSPLINE" else 1
    expected = keys * each * (width if kind == "SCALAR" else 1)
    found = accessors.count(sampler["output"])
    if found != expected:
        shown = f"{keys} keys of {width} numbers" + (", each with two tangents" if each == 3 else "")
        raise sampler["output"].error(f"expected {expected:,} elements for {shown}, but its accessor has {found:,}")
    values = accessors.floats(sampler["output"], kind).astype(np.float64).reshape(keys, each, width)
    curve = _steps(times, values[:, 0]) if name == "STEP" else _pieces(times, values, sampler) if each == 3 else \
        Curve(times, values[:, 0])
    if curve.values.size > _MOST_NUMBERS:
        raise sampler.error(f"{curve.values.size:,} numbers; facegen reads {_MOST_NUMBERS:,} at most")
    return curve


def _steps(times: NDArray, values: NDArray) -> Curve:
    """Return a curve that jumps: it stands until just before a key, by what float32 times can tell."""
    before = np.nextafter(times.astype(np.float32), np.float32(-1.0)).astype(np.float64)[1:]
    apart = before > times[:-1]
    rows = np.sort(np.concatenate([2 * np.arange(len(times)), 2 * np.flatnonzero(apart) + 1]))
    both = np.repeat(values, 2, axis=0)[rows]           # row 2 k is key k, row 2 k + 1 stands just before the next
    when = np.empty(2 * len(times))
    when[::2], when[1:-1:2], when[-1] = times, before, np.nan
    return Curve(when[rows], both)


def _pieces(times: NDArray, values: NDArray, sampler: Tree) -> Curve:
    """Return a cubic spline cut into straight pieces that stay within `CLOSE`. values: (n, 3, k), the middle one the
    value, the others the tangents that come in and go out."""
    when, found, total = [times[:1]], [values[:1, 1]], 1
    for k, (start, end) in enumerate(pairwise(times)):
        length = end - start
        v0, out, into, v1 = values[k, 1], length * values[k, 2], length * values[k + 1, 0], values[k + 1, 1]
        with np.errstate(over="ignore"):
            bend = np.abs([6 * (v1 - v0) - 4 * out - 2 * into, 6 * (v0 - v1) + 2 * out + 4 * into]).max(initial=0.0)
        count = int(min(_MOST_PIECES, max(1.0, np.ceil(np.sqrt(bend / 8.0 / CLOSE)))))
        s = np.arange(1, count + 1)[:, None] / count
        square, cube = s**2, s**3
        part = (2 * cube - 3 * square + 1) * v0 + (cube - 2 * square + s) * out + (3 * square - 2 * cube) * v1 \
            + (cube - square) * into
        part[-1] = v1
        total += count
        if total * values.shape[2] > _MOST_NUMBERS:
            raise sampler.error(f"a spline that takes more than {_MOST_NUMBERS:,} numbers, which facegen does not read")
        when.append(start + length * s[:, 0])
        when[-1][-1] = end
        found.append(part)
    return Curve(np.concatenate(when), np.concatenate(found))

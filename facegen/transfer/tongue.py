"""The tongue's own motion, on an avatar's tongue of any make: it goes with the jaw, and beside that it comes out.

Both tongues are seen along their mouth's axes and filled into one box, so that a tip answers a tip. How far a tongue
comes out counts from the lips: one that lies farther behind them goes farther.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from facegen.geometry.closest import ClosestPoints
from facegen.geometry.operators import Surface
from facegen.transfer.face_measures import FaceMeasures

Array = NDArray[np.float64]

# Because a tongue of no thickness has no inside to compare.
_TINY = 1e-9
# A tongue that lies at the lips, or far behind them, goes by no less and no more than so many times its size says.
_LEAST, _MOST = 0.5, 3.0


@dataclass(frozen=True, eq=False)
class Tongue:
    """A template's: ``surface`` of p vertices (mm), ``motion`` (k, p, 3) beside the jaw's, and its ``face``."""

    surface: Surface
    motion: Array
    face: FaceMeasures

    def moves(self, at: Array, face: FaceMeasures) -> Array:
        """Return the displacements (k, q, 3), mm, of the vertices (q, 3) of another face's tongue."""
        result = np.zeros((len(self.motion), len(at), 3))
        active = np.flatnonzero(np.abs(self.motion).max(axis=(1, 2), initial=0.0) > _TINY)
        if not len(active) or not len(at):
            return result
        own, axes = self.face.mouth_axes, face.mouth_axes
        here, there = self.surface.vertices @ own.T, np.asarray(at, float) @ axes.T
        size, other = (np.maximum(np.ptp(one, axis=0), _TINY) for one in (here, there))
        box = Surface((here - here.min(axis=0)) / size, self.surface.faces)
        feet = ClosestPoints(box)((there - there.min(axis=0)) / other)
        corners = (self.motion[active] @ own.T)[:, self.surface.faces[feet.faces]]
        moved = np.einsum("qc,kqci->kqi", feet.weights, corners)
        gap, own_gap = (float(one.lips @ way[2] - place[:, 2].max()) for one, way, place in (
            (face, axes, there), (self.face, own, here)))
        scale = other / size
        moved *= scale
        moved[:, :, 2] *= _farther(moved[:, :, 2].max(axis=1), scale[2] * own_gap, gap)[:, None]
        result[active] = moved @ axes
        return result

    def comes_out(self) -> Array:
        """Return how far before the lips the tongue comes in each shape (k,), mm; 0 where it stays behind them."""
        out = self.face.mouth_axes[2]
        tip = (self.surface.vertices + self.motion) @ out
        return np.maximum(tip.max(axis=1) - self.face.lips @ out, 0.0)


def _farther(way: Array, behind: float, gap: float) -> Array:
    """Return the factors (k,) on ways out (k,), mm, so that what reached the lips from ``behind`` reaches them over the
    gap, and goes as far beyond them."""
    if behind <= _TINY:
        return np.ones(len(way))
    within = np.clip(gap / behind, _LEAST, _MOST)
    beyond = np.maximum(way - behind, 0.0)
    return np.where(way > _TINY, (within * np.minimum(way, behind) + beyond) / np.maximum(way, _TINY), 1.0)

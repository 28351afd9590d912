"""An ear: a crescent that is hollow towards the front and narrows to its tip, on a ring of the head's skin."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from clay import Clay
from numpy.typing import ArrayLike, NDArray
from sheet import Sheet

# The foot's ring lies between the head's surface and the crescent.
_FOOT = 0.55
# Seen along the ear, the hollow ends this near to its edges, as a cosine.
_EDGE = 0.93


@dataclass(frozen=True, eq=False)
class Ear:
    """The left ear. axes (3, 3): rows along it, across it to its outer edge, and out of its hollow. width: half of it;
    profile, lean: of the height 0..1, the share of the width and how far it leans outwards. foot: half widths of its
    ring on the head, across, to the front and to the back."""

    base: NDArray
    axes: NDArray
    height: float
    width: float
    hollow: float
    thickness: float
    profile: Callable[[float], float]
    lean: Callable[[float], float]
    foot: tuple[float, float, float]
    count: int = 20

    def ring(self, height: float) -> NDArray:
        """Return the ring (count, 3) at a height from 0 to 1: outer edge, front, inner edge, back."""
        t = 2 * np.pi * np.arange(self.count) / self.count
        axis, wide, front = self.axes
        narrow = 1 - height
        hollow, thick = self.hollow * narrow**0.6, self.thickness * narrow**0.5
        s = np.sin(t)
        depth = -hollow * np.abs(s) ** 0.8 - np.where(s > 0, 0.0, thick * (0.6 + 0.4 * np.abs(s)))
        depth[np.abs(s) < 1e-9] = -0.3 * thick
        return (
            self.base
            + height * self.height * axis
            + self.lean(height) * wide
            + self.width * self.profile(height) * np.cos(t)[:, None] * wide
            + depth[:, None] * front
        )

    def loop(self, clay: Clay) -> NDArray:
        """Return the ring where the ear meets the head."""
        t = 2 * np.pi * np.arange(self.count) / self.count
        _, wide, front = self.axes
        across, ahead, behind = self.foot
        return clay.onto(
            self.base
            + across * np.cos(t)[:, None] * wide
            + np.where(np.sin(t) > 0, ahead, behind)[:, None] * np.sin(t)[:, None] * front
        )

    def add(self, sheet: Sheet, loop: NDArray, heights: Sequence[float], outside: str, inside: str) -> None:
        """Add the ear on a loop of the sheet's vertices: rings at heights, materials of its back and its hollow."""
        rings = [self.ring(h) for h in heights]
        rings[0] = _FOOT * rings[0] + (1 - _FOOT) * (sheet.at(loop) + heights[0] * self.height * self.axes[0])
        t = 2 * np.pi * (np.arange(self.count) + 0.5) / self.count
        last = loop
        for number, ring in enumerate(rings):
            ring = sheet.row(ring)
            hollow = (np.sin(t) > 0) & (np.abs(np.cos(t)) < _EDGE) & (number > 0)
            sheet.band(last, ring, [inside if x else outside for x in hollow])
            last = ring
        sheet.cap(last, outside, self.ring(0.99).mean(axis=0))


def ear_axes(along: ArrayLike, across: ArrayLike) -> NDArray:
    """Return an ear's axes (3, 3) from the way along it and about the way to its outer edge."""
    along, across = np.asarray(along, float), np.asarray(across, float)
    along = along / np.linalg.norm(along)
    across = across - (across @ along) * along
    across = across / np.linalg.norm(across)
    return np.stack([along, across, np.cross(across, along)])

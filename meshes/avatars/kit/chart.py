"""Where places on a head lie on a sphere of directions, and back: seen from one place inside, or from a line.

Every place must be seen from inside. From one place a long head is not: a muzzle hides what lies behind its lips. From
a line inside it, square to which every cross-section is seen, it is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from clay import Clay
from numpy.typing import ArrayLike, NDArray


@dataclass(frozen=True, eq=False)
class Round:
    """Seen from ``centre`` (3,)."""

    centre: NDArray

    def directions(self, points: ArrayLike) -> NDArray:
        """Return unit vectors (n, 3)."""
        return _unit(np.asarray(points, float) - self.centre)

    def shoot(self, clay: Clay, directions: NDArray, reach: float) -> NDArray:
        """Return the places (n, 3) on the clay that lie in these directions (n, 3)."""
        return clay.shoot(self.centre, directions, reach)


@dataclass(frozen=True, eq=False)
class Long:
    """Seen from the line from ``back`` to ``front`` (3,): beside it squarely, beyond its ends from them.

    The sphere is the capsule round the line, pressed together: cylinder and caps, whose middles lie ``stretch`` radii
    from the sphere's, are seen from the sphere's middle.
    """

    back: NDArray
    front: NDArray
    stretch: float

    def directions(self, points: ArrayLike) -> NDArray:
        """Return unit vectors (n, 3)."""
        away = np.asarray(points, float) - self.back
        line = self.front - self.back
        share = np.clip(away @ line / (line @ line), 0.0, 1.0)[:, None]
        return _unit(_unit(away - share * line) + self.stretch * (2 * share - 1) * _unit(line))

    def shoot(self, clay: Clay, directions: NDArray, reach: float) -> NDArray:
        """Return the places (n, 3) on the clay that lie in these directions (n, 3)."""
        line = self.front - self.back
        axis = _unit(line)
        along = (directions @ axis)[:, None]
        across = directions - along * axis
        high = np.clip(along / np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-12),
                       -self.stretch, self.stretch)
        # On a cap: where the ray from the sphere's middle meets the unit sphere about the cap's.
        k = self.stretch
        far = k * np.abs(along) + np.sqrt(np.maximum(1 - k * k * (1 - along**2), 0.0))
        beyond = np.abs(high) >= k
        ways = np.where(beyond, far * directions - np.sign(along) * k * axis, across)
        return clay.shoot(self.back + (high / k + 1) / 2 * line, ways, reach)


Chart = Round | Long


def _unit(vectors: NDArray) -> NDArray:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12)

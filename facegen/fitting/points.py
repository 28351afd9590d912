"""Places on a rig's surface as a function of its weights: what a fit compares with what was measured.

    q(x) = q0 + sum_b c_b(x) B_b                                        Onizuka 2018, eq. 1, at p places

For plain blendshapes c is x. Shapes that the file corrects half way have a further 4 x (1 - x); a corrective such as
mouthClose is fitted together with what it corrects, so that it never stands alone; units go through the table's rules
of combination.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Points(Protocol):
    """p places and their k parameters, each within ``low``..``high`` (k,).

    ``names``: of the first parameters, which are weights; any further ones are angles in degrees (`gaze`).
    """

    names: tuple[str, ...]
    low: Array
    high: Array

    def places(self, x: Array) -> Array:
        """Return the places (p, 3), mm, for parameters (k,)."""

    def slopes(self, x: Array) -> Array:
        """Return how the places change with the parameters, (3 p, k)."""

    def gram(self, x: Array) -> Array:
        """Return slopes' @ slopes, (k, k)."""

    def weights(self, x: Array) -> Array:
        """Return the weights (len(names),) that parameters mean."""


class Mix(Protocol):
    """c(x): parameters to coefficients of a basis. ``linear``: whether slopes are the same for all x."""

    linear: bool

    def coefficients(self, x: Array) -> Array:
        """Return the coefficients (b,)."""

    def slope(self, x: Array) -> Array:
        """Return how they change, (b, k)."""

    def weights(self, x: Array) -> Array:
        """Return the shapes' weights (k,)."""


@dataclass(frozen=True, eq=False)
class Shapes:
    """Blendshapes. ``halves``: column -> row of the basis that corrects it half way; ``pairs``: column of a corrective
    -> column of what it corrects."""

    count: int
    halves: Mapping[int, int]
    pairs: Mapping[int, int]

    @property
    def linear(self) -> bool:
        """Whether slopes are the same for all weights."""
        return not self.halves

    def weights(self, x: Array) -> Array:
        """Return the shapes' weights (k,): what a corrective corrects comes with it."""
        weights = np.array(x, float)
        for column, base in self.pairs.items():
            weights[base] += x[column]
        return np.minimum(weights, 1.0)

    def coefficients(self, x: Array) -> Array:
        """Return the coefficients (b,)."""
        weights = self.weights(x)
        if not self.halves:
            return weights
        columns = list(self.halves)
        inside = np.clip(weights[columns], 0.0, 1.0)
        return np.concatenate([weights, 4.0 * inside * (1.0 - inside)])

    def slope(self, x: Array) -> Array:
        """Return how the coefficients change, (b, k)."""
        slope = np.vstack([np.eye(self.count), np.zeros((len(self.halves), self.count))])
        weights = self.weights(x)
        for row, column in enumerate(self.halves):
            slope[self.count + row, column] = 4.0 * (1.0 - 2.0 * weights[column])
        for column, base in self.pairs.items():
            slope[:, column] += slope[:, base]
        return slope


class BlendPoints:
    """Places on a blendshape rig: ``rest`` (p, 3), ``basis`` (b, p, 3) in mm, and how weights mix it."""

    def __init__(self, names: tuple[str, ...], rest: Array, basis: Array, mix: Mix) -> None:
        self.names, self.rest, self.mix = names, rest, mix
        self.low, self.high = np.zeros(len(names)), np.ones(len(names))
        self._basis = np.ascontiguousarray(basis.reshape(len(basis), -1).T)       # (3 p, b)

    def places(self, x: Array) -> Array:
        """Return the places (p, 3), mm."""
        return self.rest + (self._basis @ self.mix.coefficients(x)).reshape(-1, 3)

    def slopes(self, x: Array) -> Array:
        """Return (3 p, k)."""
        if self.mix.linear:
            return self._constant[0]
        return self._basis @ self.mix.slope(x)

    def gram(self, x: Array) -> Array:
        """Return (k, k), from products that were made once."""
        if self.mix.linear:
            return self._constant[1]
        slope = self.mix.slope(x)
        return slope.T @ self._products @ slope

    def weights(self, x: Array) -> Array:
        """Return the weights (k,)."""
        return self.mix.weights(x)

    def moved(self, offset: Array) -> BlendPoints:
        """Return the same with places that rest elsewhere by ``offset`` (p, 3): another person's."""
        other = object.__new__(BlendPoints)
        other.__dict__.update(self.__dict__, rest=self.rest + offset)
        return other

    @cached_property
    def _constant(self) -> tuple[Array, Array]:
        slope = self.mix.slope(self.low)
        slopes = np.ascontiguousarray(self._basis @ slope)
        return slopes, slopes.T @ slopes

    @cached_property
    def _products(self) -> Array:
        return self._basis.T @ self._basis

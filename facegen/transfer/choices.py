"""What a user may choose about a transfer, beside what goes from where to where."""

from __future__ import annotations

import math
from dataclasses import dataclass

from facegen.errors import InputError, nearest
from facegen.transfer.baselines import PaperWeights
from facegen.transfer.skin import METHODS
from facegen.transfer.weights import AnyWeights

# The jaw of an avatar opens between these shares of what is estimated; more is a mistake.
_LEAST_OPENING, _MOST_OPENING = 0.1, 3.0
# Lids close between not at all and twice as far as the template's; they never go past each other.
_LEAST_CLOSURE, _MOST_CLOSURE = 0.0, 2.0


@dataclass(frozen=True)
class Choices:
    """``method``: "landmarks" (ours), or a published one to compare with: "sumner", "cloning". ``weights``: of the
    energies, see `read_weights`; ours without. ``opening``: a factor on how far the jaw opens. ``lid_closure``: a
    factor on how far lids close; at 1 they meet where the template's do. Raises InputError for what cannot be."""

    method: str = "landmarks"
    weights: AnyWeights | None = None
    opening: float = 1.0
    lid_closure: float = 1.0

    def __post_init__(self) -> None:
        if self.method not in METHODS:
            raise InputError(f"method: expected {', '.join(METHODS)}, got {self.method!r}"
                             f"{nearest(str(self.method), METHODS)}")
        for name, none in (("weights", None), ("opening", 1.0), ("lid_closure", 1.0)):
            if self.method != "landmarks" and getattr(self, name) != none:
                raise InputError(f"{name}: the method '{self.method}' has none to choose; leave it out, or the method")
        _check_factor("opening", self.opening, _LEAST_OPENING, _MOST_OPENING)
        _check_factor("lid_closure", self.lid_closure, _LEAST_CLOSURE, _MOST_CLOSURE)

    @property
    def ours(self) -> bool:
        """Whether the energy that is minimised is ours."""
        return self.method == "landmarks" and not isinstance(self.weights, PaperWeights)


def _check_factor(name: str, value: float, least: float, most: float) -> None:
    if not isinstance(value, (int, float)) or not math.isfinite(value) or not least <= value <= most:
        raise InputError(f"{name}: expected a factor of {least} to {most}, got {value!r}")


OURS_CHOICES = Choices()
"""What measures best."""

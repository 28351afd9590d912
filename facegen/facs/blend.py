"""Several expressions at once, each with its share."""

from __future__ import annotations

import math
import numbers
from collections.abc import Mapping
from pathlib import Path

from facegen.errors import InputError
from facegen.facs.expression_table import Person
from facegen.facs.expressions import resolve
from facegen.facs.units import load_catalogue

MOST = 100
"""Expressions of one blend."""


def blend(shares: Mapping[str, float], *, person: str | Path | Person | None = None) -> dict[str, float]:
    """Return unit code -> weight of expressions mixed: each unit is the sum of its weights by share, at most 1.

    shares: name of an expression, or a FACS script, -> 0..1. They need not sum to 1: halves of a smile and of raised
    brows make a weak mixture, both whole show both. A blend is made of units, not of pictures: what two expressions
    share adds, and the rules of combination hold afterwards. person: as in :func:`resolve`. Raises InputError. ::

        facegen.render(face, facegen.blend({"happiness": 0.6, "surprise": 0.4}))
    """
    if len(shares) > MOST:
        raise InputError(f"shares: expected at most {MOST} expressions, got {len(shares)}")
    catalogue, terms = load_catalogue(), {}
    for name, share in shares.items():
        if isinstance(share, bool) or not isinstance(share, numbers.Real) or not 0.0 <= share <= 1.0:
            raise InputError(f"shares: {name}: expected a number in 0..1, got {share!r}")
        found = resolve(name, person=person)
        if found.kind == "deformation":
            raise InputError(f"shares: {name}: is raw data, which has no units; add deformations instead")
        for atom, weight in catalogue.expand(found.units).items():
            terms.setdefault(atom, []).append(share * weight)
    sums = {atom: min(math.fsum(several), 1.0) for atom, several in terms.items()}
    return catalogue.fold({atom: weight for atom, weight in sums.items() if weight > 0.0})

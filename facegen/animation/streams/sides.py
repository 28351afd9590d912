"""Units of both sides as one number, for the formats that know no sides."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from facegen.animation.performance import Performance
from facegen.facs.units import load_catalogue, split_code

# Sides that differ by less than this are alike.
_ALIKE = 1e-6


def without_sides(one: Performance) -> Performance:
    """Return a performance of units without sides: each the mean of its sides, or lips. What that loses is told.

    Units that never act on two sides at once (30, 46) are left out.
    """
    if not any(split_code(name)[0] for name in one.names):
        return one
    units = load_catalogue().units
    found: dict[str, dict[str, NDArray[np.float64]]] = {}
    for name, column in zip(one.names, one.weights.T, strict=True):
        mark, number = split_code(name)
        found.setdefault(number, {})[mark] = column
    rest = np.where(one.found, 0.0, np.nan)
    whole, uneven, dropped = {}, [], []
    for number in sorted(found, key=int):
        sides = found[number]
        if units[number].sides == "direction":
            dropped += [mark + number for mark in sides]
        elif set(sides) == {""}:
            whole[number] = sides[""]
        else:
            plain = sides.get("", rest)
            parts = np.column_stack([np.fmax(plain, sides.get(mark, rest)) for mark in units[number].marks])
            whole[number] = parts.mean(axis=1)
            if np.nanmax(np.ptp(parts, axis=1), initial=0.0) > _ALIKE:
                uneven.append(number)
    said = [f"the sides of {', '.join(uneven)} are not told apart: their mean is written"] if uneven else []
    said += [f"{', '.join(dropped)}: units of one side only are left out"] if dropped else []
    weights = np.column_stack(list(whole.values())) if whole else np.empty((len(one), 0))
    return replace(one, names=tuple(whole), weights=weights, warnings=(*one.warnings, *said))

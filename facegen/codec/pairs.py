"""Left and right together: most faces move both alike, and their difference is then nothing to send."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from facegen.blendshapes.names import folded, member_of
from facegen.facs.units import split_code

_UNPAIRED = ("jaw", "mouth", "eyelookin", "eyelookout")    # jawLeft and jawRight exclude each other


def partners(names: Sequence[str], vocabulary: str) -> tuple[int, ...]:
    """Return, of each name, how many places after it the other side of the same shape is; 0 where there is none."""
    stems: dict[str, int] = {}
    found = [0] * len(names)
    for k, name in enumerate(names):
        stem, side = _split(name, vocabulary)
        if side not in ("l", "r") or stem in _UNPAIRED:
            continue
        if stem in stems and 0 < k - stems[stem] < 256:
            found[stems[stem]] = k - stems[stem]
        stems.setdefault(stem, k)
    return tuple(found)


def _split(name: str, vocabulary: str) -> tuple[str, str]:
    if vocabulary == "units":
        side, number = split_code(member_of(name) or name)
        return number, side.lower()
    stem, _, side = folded(name).rpartition(":")
    return stem, side


def to_sums(values: NDArray[np.float64], pairs: Sequence[tuple[int, int]]) -> NDArray[np.float64]:
    """Return values (..., k) with each pair's mean at its first place, and the first less the second at its second."""
    result = values.copy()
    for a, b in pairs:
        result[..., a] = (values[..., a] + values[..., b]) / 2
        result[..., b] = values[..., a] - values[..., b]
    return result


def from_sums(values: NDArray[np.float64], pairs: Sequence[tuple[int, int]]) -> NDArray[np.float64]:
    """Return what `to_sums` was given."""
    result = values.copy()
    for a, b in pairs:
        result[..., a] = values[..., a] + values[..., b] / 2
        result[..., b] = values[..., a] - values[..., b] / 2
    return result

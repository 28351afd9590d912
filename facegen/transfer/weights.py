"""The weights of the energies, as a user gives them: a preset's name, a file, or numbers by name."""

from __future__ import annotations

import math
import numbers
from collections.abc import Mapping
from dataclasses import fields, replace
from pathlib import Path
from types import MappingProxyType

from facegen.errors import InputError, nearest
from facegen.facs.validate import Entry
from facegen.facs.yamlfile import read_data
from facegen.transfer.baselines import PAPER, PaperWeights
from facegen.transfer.solve import OURS, Weights

AnyWeights = Weights | PaperWeights
WeightsLike = str | Path | Mapping[str, float] | AnyWeights
"""What `read_weights` takes."""

PRESETS: Mapping[str, AnyWeights] = MappingProxyType({"ours": OURS, "paper": PAPER})
"""Preset -> weights: ours, of the energy in `facegen.transfer.solve`; the paper's, of eq. 19."""

_LARGEST = 1e9      # beside a weight of one, more makes the system singular
_EXAMPLE = "for example gradients=1,landmarks=20"


def read_weights(what: WeightsLike | None) -> AnyWeights | None:
    """Return weights: a preset's name, "gradients=1,landmarks=20", the path of a YAML file, or a mapping.

    Numbers by name change those of a preset: ours, or the one that ``preset`` names. Each is finite and 0 or more, and
    one at least of those that say how shapes go over (gradients, landmarks, anchor) is above. Raises InputError;
    FileError or TableError for a file. ::

        read_weights("paper")
        read_weights({"preset": "paper", "smooth": 0})
    """
    if what is None:
        return None
    if isinstance(what, (Weights, PaperWeights)):
        return _checked({}, what, "weights")
    if isinstance(what, Mapping):
        return _named(what, "weights")
    text = str(what).strip()
    if text in PRESETS:
        return PRESETS[text]
    if Path(text).suffix.lower() in (".yaml", ".yml"):
        return _named({key: entry.value for key, entry in Entry(read_data(Path(text)), text).items()}, text)
    if "=" not in text:
        raise InputError(f"weights: expected {', '.join(PRESETS)}, the path of a .yaml file, or weights by name "
                         f"({_EXAMPLE}), got {text!r}{nearest(text, PRESETS)}")
    given: dict[str, object] = {}
    for word in text.split(","):
        name, equals, value = (part.strip() for part in word.partition("="))
        if not (name and equals and value):
            raise InputError(f"weights: expected NAME=NUMBER by commas, {_EXAMPLE}, got {word.strip()!r}")
        if name in given:
            raise InputError(f"weights: {name} is given twice")
        given[name] = value if name == "preset" else _number(name, value)
    return _named(given, "weights")


def _number(name: str, text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise InputError(f"weights: {name}: expected a number, got {text!r}") from None


def _named(given: Mapping[str, object], source: str) -> AnyWeights:
    """Return a preset with other numbers."""
    numbers_given = dict(given)
    preset = numbers_given.pop("preset", "ours")
    if preset not in PRESETS:
        raise InputError(f"{source}: preset: expected {', '.join(PRESETS)}, got {preset!r}"
                         f"{nearest(str(preset), PRESETS)}")
    return _checked(numbers_given, PRESETS[preset], source)


def _checked(given: Mapping[str, object], base: AnyWeights, source: str) -> AnyWeights:
    """Return ``base`` with some numbers changed, checked."""
    known = [one.name for one in fields(base)]
    for name in given:
        if name not in known:
            raise InputError(f"{source}: unknown weight {str(name)!r}{nearest(str(name), known)} "
                             f"(known: {', '.join(known)})")
    values = {name: given.get(name, getattr(base, name)) for name in known}
    for name, value in values.items():
        if isinstance(value, bool) or not isinstance(value, numbers.Real) or not math.isfinite(value) \
                or not 0 <= value <= _LARGEST:
            raise InputError(f"{source}: {name}: expected a number from 0 to {_LARGEST:g}, got {value!r}")
    telling = [name for name in ("gradients", "landmarks", "anchor") if name in known]
    if not any(values[name] for name in telling):
        raise InputError(f"{source}: expected at least one of {', '.join(telling)} above 0: they say how shapes go "
                         "over, without them nothing moves")
    return replace(base, **{name: float(value) for name, value in values.items()})

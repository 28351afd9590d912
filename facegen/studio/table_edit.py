"""A person's table as plain data, edited: what the workshop does, without its page."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

from facegen.blendshapes.recipes import half
from facegen.errors import InputError
from facegen.facs.deformation import Deformation, weighted_sum
from facegen.facs.expression_table import fold_name, load_expressions, person_from_data
from facegen.facs.notation import canonical
from facegen.facs.tables import load_units
from facegen.facs.units import Unit, load_catalogue

Data = Mapping[str, Any]

SOURCE = "made in the studio of facegen"

# Decimals of fractions of the face: hundredths of a millimetre, as the common table has them, and one more.
_DECIMALS = 5
_LEFT, _RIGHT = "L", "R"


@dataclass(frozen=True)
class Recipe:
    """An expression in a table: ``units`` a script. own: whether it is the person's."""

    name: str
    units: str
    about: str
    own: bool


def new_table(name: str) -> dict[str, Any]:
    """Return a table of a new person, without habits yet."""
    if not name.strip():
        raise InputError("name: expected the person's name, such as Ada")
    return {"name": name.strip(), "about": f"{name.strip()}'s habits.", "source": SOURCE}


def file_name(name: str) -> str:
    """Return the file's name of a person's.

    >>> file_name("Ada Lovelace")
    'ada_lovelace.yaml'
    """
    stem = re.sub(r"[^\w-]+", "", fold_name(name))
    if not stem:
        raise InputError(f"name: expected letters or digits, got {name!r}")
    return f"{stem[:60]}.yaml"


# -- expressions ------------------------------------------------------------------------------------------------------
def recipes(data: Data) -> dict[str, Recipe]:
    """Return name -> recipe of every expression, the person's in place of the common ones."""
    person = person_from_data({**new_table("x"), **data, "aliases": data.get("aliases") or {}})
    return _common() | {name: Recipe(name, canonical(one.units), one.about, True)
                        for name, one in person.expressions.items()}


@cache
def _common() -> dict[str, Recipe]:
    return {name: Recipe(name, canonical(one.units), one.about, False)
            for name, one in load_expressions().expressions.items()}


def with_recipe(data: Data, name: str, units: str, about: str) -> dict[str, Any]:
    """Return data in which an expression is done this person's way: a script of units, and what one sees.

    A name that the common table has is overridden, another added. What else is wrong is for the table's reader to say.
    """
    name = fold_name(name)
    key = "overrides" if name in load_expressions().expressions else "adds"
    before = dict((data.get(key) or {}).get(name) or {})
    return _with(data, key, name, {**before, "units": units.strip(), "about": about.strip()})


def without_recipe(data: Data, name: str) -> dict[str, Any]:
    """Return data in which an expression is done as everybody does it, or is none."""
    return _with(_with(data, "overrides", name, None), "adds", name, None)


# -- units ------------------------------------------------------------------------------------------------------------
def unit_choices() -> dict[str, str]:
    """Return what can be changed of units, as a reader is told it -> the key in a person's table."""
    found = {}
    for unit in load_catalogue().units.values():
        for code in unit.codes:
            mark = code.removesuffix(unit.number)
            side = {"": "", "L": ", left", "R": ", right", "T": ", upper lip", "B": ", lower lip"}[mark]
            if not (unit.variants and not mark):
                found[f"{unit.name}{side} ({code})"] = code
    return found


def unit_says(data: Data, code: str) -> str:
    """Return where a unit's movement comes from, in words."""
    own = data.get("units") or {}
    unit = load_catalogue().unit_of(code)
    keys = [key for key in dict.fromkeys((code, *_atoms(unit, code), unit.number)) if key in own]
    if not keys:
        return f"{code}: everybody's movement"
    scales = {key: own[key].get("scale") for key in keys}
    return "; ".join(f"{key}: {scale:g} times the common movement" if scale is not None else
                     f"{key}: a movement of this person's own" for key, scale in scales.items())


def scale_of(data: Data, code: str) -> float:
    """Return how much of the common movement a unit makes; 1 where it has a movement of its own."""
    own = data.get("units") or {}
    unit = load_catalogue().unit_of(code)
    entry = own.get(code) or own.get(unit.number) or {}
    return float(entry.get("scale", 1.0))


def with_scale(data: Data, code: str, scale: float) -> dict[str, Any]:
    """Return data in which a unit makes so much of the common movement."""
    common = scale == 1.0 and not _sided(data, code)
    return _set(data, code, {} if common else {code: {"scale": round(scale, 3)}})


def without_unit(data: Data, code: str) -> dict[str, Any]:
    """Return data in which a unit moves as everybody's."""
    return _set(data, code, {})


def movement_of(data: Data, code: str) -> Deformation:
    """Return what a unit moves at full weight on this person, in fractions of the face."""
    table = load_units()
    own = table.own_basis(person_from_data({**new_table("x"), **data, "aliases": data.get("aliases") or {}}))
    basis = {**table.basis, **own}
    return weighted_sum([(1.0, basis[atom]) for atom in table.catalogue.expand({code: 1.0})])


def with_movement(data: Data, code: str, movement: Deformation) -> dict[str, Any]:
    """Return data in which a unit moves so at full weight: a deformation in fractions of the face.

    A unit with sides is kept as its left half where both sides mirror each other, and else side by side.
    """
    if movement.units != "face" and movement.has_lengths:
        raise InputError(f"movement: expected fractions of the face, got {movement.units}")
    if not movement:
        raise InputError("movement: nothing moves; drag a point or a slider on the tab Points first")
    unit = load_catalogue().unit_of(code)
    mirror = movement == movement.mirrored()
    if unit.marks == (_LEFT, _RIGHT) and code == unit.number:
        if mirror:
            return _set(data, code, {code: _entry(half(movement, _LEFT))})
        return _set(data, code, {side + code: _entry(half(movement, side)) for side in (_LEFT, _RIGHT)})
    if unit.sides == "none":
        return _set(data, code, {code: _entry(_left(movement)) if mirror else {"sides": "asymmetric",
                                                                               **_entry(movement)}})
    return _set(data, code, {code: _entry(movement)})


def _atoms(unit: Unit, code: str) -> tuple[str, ...]:
    return unit.atoms if code == unit.number else (code,)


def _sided(data: Data, code: str) -> bool:
    """Return whether an entry of both sides would hold for a side whose own is taken out."""
    number = load_catalogue().unit_of(code).number
    return code != number and number in (data.get("units") or {})


def _set(data: Data, code: str, entries: Mapping[str, Any]) -> dict[str, Any]:
    """Return data with entries for a unit or one of its sides; an entry of both takes those of the sides with it."""
    unit = load_catalogue().unit_of(code)
    gone = {code, *(unit.atoms if code == unit.number else ())}
    units = {key: one for key, one in (data.get("units") or {}).items() if key not in gone} | dict(entries)
    return _whole(data, "units", units)


def _entry(movement: Deformation) -> dict[str, Any]:
    """Return a unit's entry: the keys of a deformation, rounded, without its unit of length."""
    data = movement.as_dict()
    del data["units"]
    return {key: _rounded(value) for key, value in data.items()}


def _rounded(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _rounded(one) for key, one in value.items()}
    if isinstance(value, list):
        return [_rounded(one) for one in value]
    return round(value, _DECIMALS) + 0.0 if isinstance(value, float) else value


def _left(movement: Deformation) -> Deformation:
    """Return the left half and the midline, from which the rest is completed."""
    kept = {kind: {name: one for name, one in getattr(movement, kind).items() if not name.endswith("_R")}
            for kind in ("points", "jaw", "lids", "eyes", "head", "folds")}
    return replace(movement, **kept, with_jaw=tuple(one for one in movement.with_jaw if not one.endswith("_R")))


def _with(data: Data, key: str, name: str, entry: Any) -> dict[str, Any]:
    """Return data with another entry under a key, or without one."""
    inner = {other: one for other, one in (data.get(key) or {}).items() if other != name or entry is not None}
    if entry is not None:
        inner[name] = entry
    return _whole(data, key, inner)


def _whole(data: Data, key: str, inner: Mapping[str, Any]) -> dict[str, Any]:
    result = {other: one for other, one in data.items() if other != key or inner}
    if inner:
        result[key] = dict(inner)
    return result

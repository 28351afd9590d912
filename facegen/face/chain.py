"""The chain of Akimoto 1986, figure 10, with its numbers: name -> action units -> combination -> deformation data."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from facegen.facs.deformation import Deformation, weighted_sum
from facegen.facs.expressions import Resolution
from facegen.facs.rules import coefficients
from facegen.facs.tables import UnitTable, load_units
from facegen.fileio.columns import columns

SHOWN = 12
"""Feature points listed unless all are asked for."""

# Key of a deformation -> (words for a positive number, words for a negative one, unit).
_WORDS = {
    "jaw.open": ("opens by", "closes by", "degrees"),
    "jaw.side": ("goes to the subject's left by", "goes to the subject's right by", "units"),
    "jaw.forward": ("comes forward by", "goes back by", "units"),
    "head.yaw": ("turns to the subject's left by", "turns to the subject's right by", "degrees"),
    "head.pitch": ("chin lifts by", "chin sinks by", "degrees"),
    "head.roll": ("tilts to the subject's left by", "tilts to the subject's right by", "degrees"),
    "head.forward": ("comes forward by", "draws back by", "units"),
    "eyes.yaw": ("turns to the subject's left by", "turns to the subject's right by", "degrees"),
    "eyes.pitch": ("looks up by", "looks down by", "degrees"),
    "lids.upper": ("lowers by", "rises by", "of the open eye"),
    "lids.lower": ("rises by", "sinks by", "of the open eye"),
}


def chain(meaning: Resolution, rig: Any, person: str | None = None) -> dict[str, Any]:
    """Return all steps that lead from what was resolved to the movements of a face, as plain data.

    rig: a face or an avatar. person: whose habits are in it, for the words. What a name, a script and raw data mean
    stands under ``name``, ``units`` (with FACS letters), ``combinations`` (what does not simply add), ``coefficients``,
    ``deformation``, and ``millimetres`` of the feature points or ``shapes`` of the avatar.
    """
    table, one = load_units(), meaning.expression
    moved: dict[str, Any] = {"millimetres": {}}
    if hasattr(rig, "shape_weights"):       # an avatar is moved by its blendshapes, not by feature points
        moved["shapes"] = {name: round(weight, 6) for name, weight in rig.shape_weights(meaning).items()}
    else:
        controls = rig.controls(meaning.deformation, *meaning.more, strict=not meaning.units)
        moved["millimetres"] = {name: [round(float(c), 3) + 0.0 for c in vector] for name, vector
                                in zip(rig.feature_points, controls.vectors, strict=True) if vector.any()}
    letters = {weight: letter for letter, weight in table.catalogue.letters.items()}
    units = [{"code": code, "name": unit.name, "weight": weight, "letter": letters.get(weight),
              "effect": unit.effect, "muscles": list(unit.muscles)}
             for code, weight in meaning.units.items() for unit in [table.catalogue.unit_of(code)]]
    own = [name for name in table.coefficients(meaning.units) if name in meaning.own]
    return {
        "what": str(meaning.what), "kind": meaning.kind, "name": meaning.name,
        "about": one.about if one else None, "source": meaning.source, "units": units,
        "combinations": list(combinations(table, meaning.units)),
        "coefficients": {name: round(value, 6) for name, value in table.coefficients(meaning.units).items()},
        "own": own, "person": person, "deformation": _whole(meaning).as_dict(), "face": rig.name, **moved,
        "warnings": list(meaning.warnings),
    }


def _whole(meaning: Resolution) -> Deformation:
    """Return all movements in one where their units of length agree, else those of the units and angles alone."""
    every = [one for one in (meaning.deformation, *meaning.more) if one]
    if len({one.units for one in every if one.has_lengths}) > 1:
        return meaning.deformation
    return weighted_sum([(1.0, one) for one in every]) if every else meaning.deformation


def combinations(table: UnitTable, units: Mapping[str, float]) -> Iterator[dict[str, Any]]:
    """Yield the declared combinations, and the limits, that change something here."""
    atoms = table.catalogue.expand(units)
    for rule in table.rules:
        if coefficients(table.catalogue, (rule,), (), atoms) != atoms:
            yield {"units": list(rule.when), "why": rule.why}
    for limit in table.limits:
        if coefficients(table.catalogue, (), (limit,), atoms) != atoms:
            active = {atom.lstrip("LRTB") for atom in atoms}
            yield {"units": [number for number in limit.units if number in active], "why": limit.why}


def chain_lines(data: Mapping[str, Any], *, full: bool = False, hint: str = "") -> Iterator[str]:
    """Yield what `chain` gave as text, line by line.

    full: all feature points, not only `SHOWN`; else ``hint`` says how to see all.
    """
    about = f": {data['about']}" if data["about"] else ""
    yield f"{data['name']}{about}"
    if data["source"]:
        yield f"  {data['source']}"
    if data["kind"] != "deformation":
        yield ""
        yield "Action units (weight 0 to 1; letters A to E are the FACS intensities)"
        rows = [(f"  {u['code']}", f"{u['letter'] or ' '} {u['weight']:.3g}", u["name"], u["effect"])
                for u in data["units"]]
        yield from columns(rows) if rows else ["  none: the face at rest"]
    if data["combinations"]:
        yield ""
        yield "Combinations that do not simply add"
        for one in data["combinations"]:
            yield f"  {' with '.join(one['units'])}: {one['why']}"
        used = ", ".join(f"{name} {value:.3g}" for name, value in data["coefficients"].items())
        yield f"  weights after that: {used}"
    if data["own"]:
        yield ""
        yield f"Units that {data['person']} moves otherwise than the common table: {', '.join(data['own'])}"
    yield ""
    yield from movement_lines(data, full=full, hint=hint)


def movement_lines(data: Mapping[str, Any], *, full: bool = False, hint: str = "") -> Iterator[str]:
    """Yield the last step alone as text: the deformation data."""
    raw = data["deformation"]
    yield f"Deformation data, on the face {data['face']} (left and right are the subject's)"
    rows = []
    for kind in ("jaw", "head", "eyes", "lids"):
        for key, value in raw.get(kind, {}).items():
            stem, _, side = key.partition("_")
            more, less, unit = _WORDS[f"{kind}.{stem}"]
            who = {"eyes": "eye", "lids": f"{stem} lid"}.get(kind, kind)
            who = {"L": "left ", "R": "right ", "": ""}[side] + who
            unit = {"units": {"face": "of the face's own measure", "millimetre": "mm",
                              "paper": "half head heights"}[raw["units"]]}.get(unit, unit)
            amount = f"{abs(value) * 100:.0f} %" if kind == "lids" else f"{abs(value):.3g}"
            rows.append((f"  {who}", f"{more if value > 0 else less} {amount} {unit}"))
    if raw.get("folds"):
        rows.append(("  folds", ", ".join(f"{name} {value:.2g}" for name, value in raw["folds"].items())))
    yield from columns(rows)
    if "shapes" in data:
        yield f"  blendshapes of {data['face']}" + (":" if data["shapes"] else ": none, nothing moves")
        yield from columns([(f"    {name}", f"{weight:.3g}") for name, weight in data["shapes"].items()])
        return
    points = sorted(data["millimetres"].items(), key=lambda item: -_length(item[1]))
    if points:
        shown = points if full else points[:SHOWN]
        more = "" if len(shown) == len(points) else f"; the {SHOWN} that move most{hint}"
        yield f"  {len(points)} feature points move{more}:"
        yield from columns([(f"    {name}", f"{_length(vector):5.1f} mm", _direction(name, vector))
                            for name, vector in shown])
    elif not rows:
        yield "  nothing moves"


def _length(vector: list[float]) -> float:
    return sum(c * c for c in vector) ** 0.5


def _direction(name: str, vector: list[float]) -> str:
    """Return a movement in words, the largest part first; under a tenth of a millimetre is left out."""
    side = {"_L": ("outward", "inward"), "_R": ("inward", "outward")}.get(name[-2:], ("left", "right"))
    ways = (side, ("up", "down"), ("forward", "back"))
    words = [(abs(c), f"{abs(c):.1f} {way[0] if c > 0 else way[1]}")
             for c, way in zip(vector, ways, strict=True) if abs(c) >= 0.1]
    return ", ".join(word for _, word in sorted(words, reverse=True))

"""Combinations of units that do not add (FACS 2002, on unit combinations): weights -> coefficients.

A rule's strength is ``min(w of when) * prod(1 - w of without)``: it grows with the weakest partner and never
jumps. A rule may weaken a partner (``scale``: at full strength its weight is multiplied by the number), let
one unit yield to another (``yields``: only what exceeds the other counts), and add a corrective deformation.
A limit keeps units that share a muscle from summing beyond it. All rules read the original weights, so their
order does not matter.

Rules with a sided unit hold on each side; rules with a lip variant hold on each lip; a partner without sides
then takes the mean of both.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from facegen.facs.deformation import Deformation, deformation_from_entry
from facegen.facs.units import Catalogue
from facegen.facs.validate import Entry


@dataclass(frozen=True)
class Rule:
    """One declared combination; ``places`` are the prefixes at which it is evaluated."""

    name: str
    when: tuple[str, ...]
    without: tuple[str, ...]
    scale: Mapping[str, float]
    yields: Mapping[str, str]
    places: tuple[str, ...]
    why: str
    add: Deformation = field(default_factory=Deformation)

    @property
    def correctives(self) -> tuple[str, ...]:
        """The coefficients of what is added: one a side where sides matter, "1+4:L"."""
        if not self.add:
            return ()
        return (f"{self.name}:L", f"{self.name}:R") if self.places == ("L", "R") else (self.name,)


@dataclass(frozen=True)
class Limit:
    """Units that share a muscle: the sum of their weights stays at most ``most``."""

    units: tuple[str, ...]
    most: float
    places: tuple[str, ...]
    why: str


def _weight(catalogue: Catalogue, atoms: Mapping[str, float], number: str, place: str) -> float:
    """Return the weight of a unit at one side or lip."""
    marks = catalogue.units[number].marks
    if place in marks:
        return atoms.get(place + number, 0.0)
    return max(atoms.get(mark + number, 0.0) for mark in marks)


def coefficients(catalogue: Catalogue, rules: tuple[Rule, ...], limits: tuple[Limit, ...],
                 atoms: Mapping[str, float]) -> dict[str, float]:
    """Return the coefficient of every atom and corrective after all rules; zeros are left out."""
    factors = dict.fromkeys(atoms, 1.0)
    extra: dict[str, float] = {}
    active = {atom.lstrip("LRTB") for atom in atoms}

    def apply(number: str, by_place: Mapping[str, float]) -> None:
        mean = sum(by_place.values()) / len(by_place)
        for mark in catalogue.units[number].marks:
            if mark + number in factors:
                factors[mark + number] *= by_place.get(mark, mean)

    for rule in rules:
        if not active.issuperset(rule.when):
            continue
        strength = {}
        for place in rule.places:
            strength[place] = min(_weight(catalogue, atoms, number, place) for number in rule.when)
            for number in rule.without:
                strength[place] *= 1.0 - _weight(catalogue, atoms, number, place)
        for number, scale in rule.scale.items():
            apply(number, {place: 1.0 - s * (1.0 - scale) for place, s in strength.items()})
        for number, other in rule.yields.items():
            left = {}
            for place in rule.places:
                own = _weight(catalogue, atoms, number, place)
                left[place] = max(0.0, 1.0 - _weight(catalogue, atoms, other, place) / own) if own else 1.0
            apply(number, left)
        for name in rule.correctives:
            extra[name] = strength.get(name.rpartition(":")[2], sum(strength.values()) / len(strength))
    for limit in limits:
        if len(active.intersection(limit.units)) < 2:
            continue
        share = {}
        for place in limit.places:
            total = sum(_weight(catalogue, atoms, number, place) for number in limit.units)
            share[place] = min(1.0, limit.most / total) if total else 1.0
        for number in active.intersection(limit.units):
            apply(number, share)
    result = {atom: weight * factors[atom] for atom, weight in atoms.items()} | extra
    return {name: value for name, value in result.items() if value}


def read_rules(catalogue: Catalogue, entry: Entry | None) -> tuple[Rule, ...]:
    """Return the checked rules of a table's ``combinations``."""
    rules = tuple(_rule(catalogue, one) for one in entry.each()) if entry else ()
    names = [rule.name for rule in rules]
    for i, rule in enumerate(rules):
        if rule.name in names[:i]:
            raise entry.fail(f"the combination {rule.name} is declared twice; merge the two")
    return rules


def _numbers(catalogue: Catalogue, entry: Entry) -> tuple[str, ...]:
    return tuple(one.choice(catalogue.units, "unit") for one in entry.each())


def _places(catalogue: Catalogue, partners: tuple[str, ...]) -> tuple[str, ...]:
    marks = {mark for number in partners for mark in catalogue.units[number].marks}
    return ("L", "R") if "L" in marks else ("T", "B") if "T" in marks else ("",)


def _rule(catalogue: Catalogue, entry: Entry) -> Rule:
    fields = entry.fields(required=("when", "why"), optional=("without", "scale", "yields", "add"))
    when = _numbers(catalogue, fields["when"])
    if len(set(when)) < max(len(when), 2):
        raise fields["when"].fail("expected at least two different units")
    without = _numbers(catalogue, fields["without"]) if "without" in fields else ()
    scale = {key: one.number(0.0, 2.0) for key, one in fields["scale"].items()} if "scale" in fields else {}
    yields = dict(fields["yields"].items()) if "yields" in fields else {}
    yields = {key: one.choice(when, "partner") for key, one in yields.items()}
    for kind, keys in (("scale", scale), ("yields", yields)):
        for key in keys:
            if key not in when:
                raise fields[kind].fail(f"unit '{key}' is not one of the combination ({', '.join(when)})")
    add = Deformation()
    places = _places(catalogue, (*when, *without))
    if "add" in fields:
        add = deformation_from_entry(fields["add"])
        add = add if places == ("L", "R") else symmetric(fields["add"], add)
    if not (scale or yields or add):
        raise entry.fail("a combination needs one of: scale, yields, add")
    name = "+".join(when) + ("-" + "-".join(without) if without else "")
    return Rule(name, when, without, scale, yields, places, fields["why"].text(), add)


def read_limits(catalogue: Catalogue, entry: Entry | None) -> tuple[Limit, ...]:
    """Return the checked ``limits`` of a table."""
    result = []
    for one in entry.each() if entry else ():
        fields = one.fields(required=("units", "most", "why"))
        units = _numbers(catalogue, fields["units"])
        result.append(Limit(units, fields["most"].number(0.1, 10.0), _places(catalogue, units),
                            fields["why"].text()))
    return tuple(result)


def symmetric(entry: Entry, half: Deformation) -> Deformation:
    """Return a deformation written as its left half and midline, completed; errors name ``entry``."""
    mirror = half.mirrored()
    for kind in ("points", "lids", "eyes", "folds"):
        for name in getattr(half, kind):
            if name.endswith("_R"):
                raise entry.fail(f"{kind}.{name}: write the left (_L) only; the right is its mirror image")
    for kind in ("points", "jaw", "head"):
        for name, value in getattr(half, kind).items():
            if not name.endswith("_L") and getattr(mirror, kind).get(name) != value:
                raise entry.fail(f"{kind}.{name}: a unit without sides leaves the midline in the middle "
                                 "(x, side, yaw and roll 0); otherwise say 'sides: asymmetric'")
    return half.both_sides()

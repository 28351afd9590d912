"""The AU -> deformation table of Akimoto 1986, figure 10: ``action_units.yaml`` with ``deformations.yaml``.

``load_units().deformation({"6": 0.5, "12": 0.8})``. Weights become coefficients (rules.py, the only
non-linear step); the deformation is the linear sum of ``basis`` with them. A rig that poses many frames keeps
its own arrays of ``basis`` and asks for ``coefficients`` only.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from functools import cache, cached_property
from pathlib import Path

from facegen.data import tables_dir
from facegen.errors import InputError
from facegen.facs import rules as combining
from facegen.facs.deformation import UNITS, Deformation, deformation_from_entry, weighted_sum
from facegen.facs.expression_table import (
    Expression,
    ExpressionTable,
    Person,
    load_expressions,
    load_person,
    people,
)
from facegen.facs.own_units import UNIT_KEYS, check_own, known_points
from facegen.facs.units import Catalogue, read_catalogue, split_code
from facegen.facs.validate import Entry
from facegen.facs.yamlfile import read_data


@dataclass(frozen=True)
class UnitTable:
    """What every unit does. ``basis``: atom or corrective -> deformation at weight 1, in ``units``."""

    catalogue: Catalogue
    basis: Mapping[str, Deformation]
    rules: tuple[combining.Rule, ...]
    limits: tuple[combining.Limit, ...]
    antagonists: tuple[tuple[str, str], ...]
    units: str
    source: str
    path: str
    places: Mapping[str, tuple[str, str]]  # where each member of basis is written: file, key path

    def coefficients(self, weights: Mapping[str, float]) -> dict[str, float]:
        """Return the coefficients of ``basis`` for code -> weight (0..1), after all combinations.

        Raises InputError for an unknown code or a weight outside 0..1.
        """
        return combining.coefficients(self.catalogue, self.rules, self.limits, self.catalogue.expand(weights))

    def deformation(self, weights: Mapping[str, float]) -> tuple[Deformation, list[str]]:
        """Return the deformation of code -> weight, and the warnings.

        Lids and folds are plain sums and may pass 1: where lids meet and folds end is the face's to know.
        Raises InputError for an unknown code or a weight outside 0..1.
        """
        found = self.coefficients(weights)
        total = weighted_sum([(value, self.basis[name]) for name, value in found.items()])
        if not total.has_lengths:
            total = replace(total, units=self.units)
        return total, self.warnings(weights)

    def own_basis(self, person: Person | None) -> dict[str, Deformation]:
        """Return the members of the basis that a person moves in their own way, and how.

        Raises TableError for a feature point or fold that no face has.
        """
        if person is None or not person.units:
            return {}
        check_own(person.units, *self._names)
        if self.units != "face":
            raise InputError(f"person: data of units are fractions of the face, but this table is in {self.units}")
        return {atom: one.of(self.basis[atom]) for atom, one in person.units.items()}

    def with_basis(self, own: Mapping[str, Deformation]) -> UnitTable:
        """Return the table with some members of the basis in place of its own."""
        return replace(self, basis={**self.basis, **own}) if own else self

    @cached_property
    def _names(self) -> tuple[frozenset[str], frozenset[str]]:
        """Feature points and folds that data may name."""
        return known_points(self.basis), frozenset(name for one in self.basis.values() for name in one.folds)

    def warnings(self, weights: Mapping[str, float]) -> list[str]:
        """Return one sentence for each pair of active units that work against each other."""
        atoms = self.catalogue.expand(weights)
        result = []
        for pair in self.antagonists:
            one, other = (self._atoms(code) for code in pair)
            if any(_meet(a, b, pair) for a in one for b in other if a in atoms and b in atoms):
                first, second = (f"{code} ({self.catalogue.unit_of(code).name.lower()})" for code in pair)
                result.append(f"{first} and {second} work against each other; both are applied")
        return result

    def _atoms(self, code: str) -> tuple[str, ...]:
        unit = self.catalogue.unit_of(code)
        return (code,) if code in unit.atoms else unit.atoms

    def check_names(self, *, points: Collection[str], folds: Collection[str] | None = None) -> None:
        """Raise TableError if anything here moves a feature point, or fold, that a face does not have."""
        for name, deformation in self.basis.items():
            source, path = self.places[name]
            deformation.check_names(points=points, folds=folds, source=source, path=path)


def _meet(one: str, other: str, declared: tuple[str, str]) -> bool:
    """Return whether two atoms act at one place; a pair declared with its sides (L30, R30) always does."""
    marks = {split_code(one)[0], split_code(other)[0]}
    return (one, other) == declared or not (marks >= {"L", "R"} or marks >= {"T", "B"})


def load_units(path: str | Path | None = None) -> UnitTable:
    """Return the shipped units (read once), or those of another ``action_units.yaml``.

    The movements come from ``deformations.yaml`` in the same folder. Raises FileError or TableError.
    """
    return _shipped() if path is None else _load(Path(path))


@cache
def _shipped() -> UnitTable:
    return _load(tables_dir() / "action_units.yaml")


def _load(path: Path) -> UnitTable:
    catalogue, others = read_catalogue(path)
    rules = combining.read_rules(catalogue, others.get("combinations"))
    limits = combining.read_limits(catalogue, others.get("limits"))
    antagonists = _antagonists(catalogue, others.get("antagonists"))

    file = path.with_name("deformations.yaml")
    fields = Entry(read_data(file), str(file)).fields(required=("source", "units", "deformations"))
    units = fields["units"].choice(UNITS, "unit of length")
    basis, places = _basis(catalogue, fields["deformations"], units)
    for i, rule in enumerate(rules):
        if rule.add.has_lengths and rule.add.units != units:
            raise others["combinations"].each()[i].fail(f"add.units: expected '{units}' as in {file.name}")
        for name in rule.correctives:
            basis[name] = rule.add.mirrored() if name.endswith(":R") else rule.add
            places[name] = (str(path), f"combinations.{i}.add")
    source = fields["source"].text()
    return UnitTable(catalogue, basis, rules, limits, antagonists, units, source, str(path), places)


def _antagonists(catalogue: Catalogue, entry: Entry | None) -> tuple[tuple[str, str], ...]:
    result = []
    for one in entry.each() if entry else ():
        pair = one.each()
        if len(pair) != 2:
            raise one.wrong("two units")
        codes = (*catalogue.codes, *catalogue.units)
        result.append((pair[0].choice(codes, "unit"), pair[1].choice(codes, "unit")))
    return tuple(result)


def _basis(catalogue: Catalogue, entry: Entry,
           units: str) -> tuple[dict[str, Deformation], dict[str, tuple[str, str]]]:
    """Return atom -> deformation, and where each is written."""
    written = dict(entry.items())
    expected = [key for u in catalogue.units.values() for key in (u.atoms if u.variants else (u.number,))]
    for key, one in written.items():
        Entry(key, one.source, one.path).choice(expected, "unit")
    basis: dict[str, Deformation] = {}
    places: dict[str, tuple[str, str]] = {}

    def build(key: str, asked: tuple[str, ...] = ()) -> dict[str, Deformation]:
        """Return prefix -> deformation of one key: its own data, or those of the unit it refers to."""
        if key not in written:
            raise entry.fail(f"unit {key} is missing; write '\"{key}\": {{}}' if it moves nothing")
        one = written[key]
        if key in asked:
            raise one.fail(f"refers to itself: {' -> '.join((*asked, key))}")
        unit = catalogue.unit_of(key)
        marks = (key[0],) if unit.variants else unit.marks
        values = dict(one.items())
        if "same_as" in values or "mirror_of" in values:
            kind = "same_as" if "same_as" in values else "mirror_of"
            fields = one.fields(required=(kind,), optional=("scale",))
            scale = fields["scale"].number(0.0, 2.0) if "scale" in fields else 1.0
            target = build(fields[kind].choice(expected, "unit"), (*asked, key))
            if len(target) != len(marks):
                raise fields[kind].fail("refers to a unit with other sides")
            return {mark: (d.mirrored() if kind == "mirror_of" else d) * scale
                    for mark, d in zip(marks, target.values(), strict=True)}
        one.fields(optional=UNIT_KEYS)
        own = deformation_from_entry(Entry({**one.value, "units": units}, one.source, one.path))
        if marks == ("L", "R"):
            return {"L": own, "R": own.mirrored()}
        return {mark: own if unit.sides == "asymmetric" else combining.symmetric(one, own) for mark in marks}

    for key in expected:
        number = key.lstrip("TB")
        for mark, deformation in build(key).items():
            basis[mark + number] = deformation
            places[mark + number] = (written[key].source, written[key].path)
    return basis, places


__all__ = ["Expression", "ExpressionTable", "Person", "UnitTable", "load_expressions", "load_person",
           "load_units", "people"]

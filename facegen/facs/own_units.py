"""Action units as one person moves them: deformation data that stand for the common table's, or a share of those.

The lowest level at which a person's table may differ: their 12 is not everybody's 12, wherever a script or an
expression has it.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field

from facegen.errors import nearest
from facegen.facs.deformation import KEYS, Deformation, deformation_from_entry
from facegen.facs.rules import symmetric
from facegen.facs.units import Catalogue, Unit, split_code
from facegen.facs.validate import Entry

UNIT_KEYS = tuple(key for key in KEYS if key != "units")
"""What a unit's entry may move; lengths are in the table's own units."""

LARGEST = 5.0
"""Of ``scale``: a face that moves five times as far as everybody's is torn."""

UNMOVED = (*(f"F{k}" for k in range(1, 16)), "tongue_back", "tongue_body")
"""Feature points that faces have though no unit of the common table moves them: the paper's own names among them."""


@dataclass(frozen=True)
class OwnUnit:
    """What one atom does: ``deformation`` in fractions of the face, or ``scale`` times the common one if that is None.

    written: where, for an error.
    """

    deformation: Deformation | None
    scale: float = 1.0
    written: Entry = field(default=Entry(None, ""), compare=False, repr=False)

    def of(self, common: Deformation) -> Deformation:
        """Return the person's deformation in place of the common one."""
        return common * self.scale if self.deformation is None else self.deformation


def read_own_units(catalogue: Catalogue, entry: Entry) -> dict[str, OwnUnit]:
    """Return atom -> what the person's does, of the ``units`` of a person's table; TableError names the place.

    A key is a unit (12: its left half, the right is the mirror image; T23; 17) or one side of it (L12), which goes
    before the unit as a whole.
    """
    found: dict[str, OwnUnit] = {}
    sides: dict[str, OwnUnit] = {}
    for code, one in entry.items():
        unit, mark = _unit(catalogue, code, one)
        (sides if mark in ("L", "R") else found).update(_atoms(unit, mark, one))
    return found | sides


def known_points(basis: Mapping[str, Deformation]) -> frozenset[str]:
    """Return the feature points that a person's data may name."""
    return frozenset(name for one in basis.values() for name in one.points) | frozenset(UNMOVED)


def check_own(own: Mapping[str, OwnUnit], points: Collection[str], folds: Collection[str]) -> None:
    """Raise TableError for a feature point or fold that no face has."""
    for one in own.values():
        if one.deformation is not None:
            one.deformation.check_names(points=points, folds=folds, source=one.written.source, path=one.written.path)


def _unit(catalogue: Catalogue, code: str, entry: Entry) -> tuple[Unit, str]:
    """Return the unit of a key and the side or lip that it says, if any."""
    code = code.strip().upper().removeprefix("AU")
    mark, number = split_code(code) if code else ("", "")
    unit = catalogue.units.get(number)
    if unit is None or (mark and mark not in unit.marks):
        raise entry.fail(f"unknown unit '{code}'{nearest(code, catalogue.codes)}")
    if unit.variants and not mark:
        raise entry.fail(f"unit {number} has an upper and a lower lip: write {' and '.join(unit.atoms)}")
    return unit, mark


def _atoms(unit: Unit, mark: str, entry: Entry) -> dict[str, OwnUnit]:
    """Return what an entry says of each atom that it is about."""
    fields = entry.fields(optional=(*UNIT_KEYS, "scale", "sides", "about"))
    if "about" in fields:
        fields["about"].text()
    atoms = (mark + unit.number,) if mark else unit.atoms
    moves = [key for key in UNIT_KEYS if key in fields]
    if "scale" in fields:
        if moves or "sides" in fields:
            raise entry.fail(f"scale takes the common unit's data, so it goes without "
                             f"{moves[0] if moves else 'sides'}: give one or the other")
        scale = fields["scale"].number(0.0, LARGEST)
        return {atom: OwnUnit(None, scale, entry) for atom in atoms}
    as_written = "sides" in fields and fields["sides"].choice(("asymmetric",), "kind of sides") == "asymmetric"
    if not moves:
        raise entry.fail(f"says nothing: give scale, or what moves ({', '.join(UNIT_KEYS)}); scale: 0 moves nothing")
    own = deformation_from_entry(Entry({key: fields[key].value for key in moves}, entry.source, entry.path))
    if atoms == (f"L{unit.number}", f"R{unit.number}"):
        if as_written:
            raise entry.fail(f"sides: asymmetric is for units without sides; write {' and '.join(atoms)} instead")
        return {atoms[0]: OwnUnit(own, 1.0, entry), atoms[1]: OwnUnit(own.mirrored(), 1.0, entry)}
    if unit.sides == "none" and not as_written:
        own = symmetric(entry, own)
    return {atom: OwnUnit(own, 1.0, entry) for atom in atoms}

"""From what a user says to a deformation: the whole chain of Akimoto 1986, figure 10, entered at any level.

name -> action units -> deformation data. An intensity scales whatever comes in: unit weights before they are
combined, or raw data as they are.
"""

from __future__ import annotations

import numbers
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from facegen.data import tables_dir
from facegen.errors import FileError, InputError, nearest
from facegen.facs.deformation import KEYS, Deformation, deformation_from_dict, load_deformation_file
from facegen.facs.expression_table import (
    Expression,
    ExpressionTable,
    Person,
    fold_name,
    is_path,
    load_expressions,
    load_person,
)
from facegen.facs.notation import canonical, looks_like_units, parse, parse_weights
from facegen.facs.tables import UnitTable, load_units

What = str | Path | Mapping[str, object] | Deformation


@dataclass(frozen=True)
class Resolution:
    """What an input means. ``kind``: "expression", "units" or "deformation".

    name: for a caption - the expression's name, the canonical script, or the file's stem. expression: the
    table's entry, if a name led here. units: code -> weight, intensity applied, combinations not yet; empty
    for raw data. source: where the recipe or data come from, as far as known. more: further movements, in other units
    of length than ``deformation``, which only a face can add to it. optional: movements that a face without the points
    for them leaves out, as the tongue's in speech. own: members of the unit table's basis -> what they do, where a
    person moves them otherwise; ``deformation`` has it so.
    """

    what: object
    kind: str
    name: str
    expression: Expression | None
    units: Mapping[str, float]
    deformation: Deformation
    warnings: tuple[str, ...] = ()
    source: str | None = None
    more: tuple[Deformation, ...] = ()
    optional: tuple[Deformation, ...] = ()
    own: Mapping[str, Deformation] = field(default_factory=dict)


def presets() -> tuple[str, ...]:
    """Return the names of the shipped raw deformations."""
    return tuple(sorted(path.stem for path in (tables_dir() / "presets").glob("*.yaml")))


def full_name(what: str) -> str:
    """Return a preset's full name for its unmistakable end: figure-8 for akimoto-1986-figure-8."""
    word = "-".join(what.split()).replace("_", "-").casefold()
    found = [name for name in presets() if name.endswith(f"-{word}") and not word.isdigit()]
    return found[0] if len(found) == 1 else what


def resolve(what: What, *, person: str | Path | Person | None = None, intensity: float = 1.0,
            units: UnitTable | None = None, expressions: ExpressionTable | None = None) -> Resolution:
    """Return what ``what`` means for a face.

    what: an expression's name ("happiness"), a FACS script ("6C+12D"), a mapping of unit weights ({"AU12":
    0.8}) or of raw data ({"jaw": {"open": 10}}), a Deformation, a preset's name, or the path of a .yaml, .yml
    or .json file of raw data. A name comes before a script, and only a text with a suffix or a slash is a
    path. person: a shipped person's name or the path of a file. intensity: 0..1. units, expressions: tables
    other than the shipped ones.

    A person's own units move their way in scripts and mappings too.

    Raises InputError; its children NotationError (a script), TableError and FileError (a file) say more.
    """
    if isinstance(intensity, bool) or not isinstance(intensity, numbers.Real) or not 0.0 <= intensity <= 1.0:
        raise InputError(f"intensity: expected a number in 0..1, got {intensity!r}")
    units = units or load_units()
    someone = None if person is None else load_person(person, expressions=expressions or load_expressions())
    own = units.own_basis(someone)

    if isinstance(what, Deformation):
        return Resolution(what, "deformation", "deformation", None, {}, what * intensity)
    if isinstance(what, Mapping):
        if any(key in KEYS for key in what):
            raw = deformation_from_dict(what)
            return Resolution(what, "deformation", "deformation", None, {}, raw * intensity)
        return _units(what, parse_weights(what, catalogue=units.catalogue), intensity, units, own)
    if isinstance(what, Path):
        return _file(what, what, intensity)
    if not isinstance(what, str):
        raise InputError("what: expected an expression's name, a FACS script, a mapping, a Deformation or a "
                         f"path, got {type(what).__name__}")
    if not what.strip():
        raise InputError("what: expected an expression's name, a FACS script or a file, got an empty text")

    expressions = expressions or load_expressions()
    expression = expressions.find(what, someone)
    if expression is not None:
        return _units(what, expression.units, intensity, units, own, expression)
    if is_path(what):
        return _file(what, Path(what).expanduser(), intensity)
    if looks_like_units(what):
        return _units(what, parse(what, catalogue=units.catalogue), intensity, units, own)
    preset = {fold_name(name): name for name in presets()}.get(fold_name(what))
    if preset is not None:
        return _file(what, tables_dir() / "presets" / f"{preset}.yaml", intensity)
    raise _unknown(what, someone, expressions)


def resolve_units(weights: Mapping[str, float], own: Mapping[str, Deformation]) -> Resolution:
    """Return what unit weights mean where some members of the basis move otherwise, as `Resolution.own` has them."""
    return _units(weights, parse_weights(weights), 1.0, load_units(), own)


def _units(what: object, weights: Mapping[str, float], intensity: float, table: UnitTable,
           own: Mapping[str, Deformation], expression: Expression | None = None) -> Resolution:
    """Return the resolution of unit weights."""
    scaled = {code: weight * intensity for code, weight in weights.items() if weight * intensity > 0.0}
    deformation, warnings = table.with_basis(own).deformation(scaled)
    name = expression.name if expression else canonical(scaled, catalogue=table.catalogue)
    source = expression.source if expression else None
    return Resolution(what, "expression" if expression else "units", name, expression, scaled, deformation,
                      tuple(warnings), source, own=own)


def _file(what: object, path: Path, intensity: float) -> Resolution:
    """Return the resolution of a file of raw data."""
    try:
        deformation, source = load_deformation_file(path)
    except FileError as error:
        if path.exists() or isinstance(what, Path):
            raise
        raise FileError(f"{error} (a name or a FACS script has no slash and no suffix)") from error
    return Resolution(what, "deformation", path.stem, None, {}, deformation * intensity, (), source)


def _unknown(what: str, person: Person | None, expressions: ExpressionTable) -> InputError:
    """Return the error for a word that means nothing, with the nearest that does."""
    head = what.split("+")[0]
    if "+" in what and (found := expressions.find(head, person)):
        return InputError(f"what: '{what}': names and units do not mix; write the units of '{head.strip()}', "
                          f"which are {canonical(found.units)}")
    words = (*(person.words if person else ()), *expressions.words, *presets())
    return InputError(f"what: unknown expression '{what.strip()}'{nearest(fold_name(what), words)} "
                      f"({len(expressions.expressions)} expressions are known; a FACS script such as "
                      "6C+12D or a file of raw data also works)")

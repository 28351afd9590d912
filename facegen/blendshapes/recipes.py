"""What every named shape is made of: recipes of deformation data, from the tables.

Units and expressions come from the tables of action units and expressions; ARKit, visemes and VRM from
``tables/vocabularies.yaml``, whose entries are scripts of units, raw deformation data, or both.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from types import MappingProxyType

from facegen.blendshapes.names import shape_of
from facegen.data import tables_dir
from facegen.errors import FacegenError, InputError, TableError, nearest
from facegen.facs.deformation import Deformation, deformation_from_entry, weighted_sum
from facegen.facs.expression_table import Expression, Person, load_expressions, load_person
from facegen.facs.notation import canonical, parse
from facegen.facs.rules import symmetric
from facegen.facs.tables import load_units
from facegen.facs.validate import Entry
from facegen.facs.yamlfile import read_data

TABLE_SETS = ("arkit", "visemes", "vrm")
SETS = ("units", "expressions", *TABLE_SETS)
"""The sets of shapes there are; "all" is all of them."""

CLASH = "expression_"
"""Goes before an expression in "all" whose name is a shape of another set too."""

KEYS = ("units", "half", "jaw", "both", "add", "mirror_of", "corrects", "about", "also")
_WIDEST = "27"          # `jaw` of a viseme is a share of this unit, the mouth stretched open


@dataclass(frozen=True)
class Recipe:
    """How one shape comes about.

    deformation: movements of the base face, to be summed (more than one if their units of length differ). minus:
        the shape that this one corrects: ``shape = pose(deformation) - pose(deformation of minus)``, to be added to
        that shape at full weight.
    members: member of the unit table's basis -> coefficient, if the shape is nothing else; else empty.
    script: the recipe as the table has it, to be read. set, about, source: where it belongs, what is seen, where
        that comes from. also: what other people call it.
    weights: unit -> weight of an entry's units and jaw as written, before they are combined; no raw data.
    """

    deformation: tuple[Deformation, ...]
    minus: str | None = None
    members: Mapping[str, float] = field(default_factory=dict, hash=False)
    script: str = ""
    set: str = ""
    about: str = ""
    source: str = ""
    also: tuple[str, ...] = ()
    weights: Mapping[str, float] = field(default_factory=dict, hash=False)

    def __post_init__(self) -> None:
        for name in ("members", "weights"):
            object.__setattr__(self, name, MappingProxyType(dict(getattr(self, name))))

    def __reduce__(self) -> tuple:                  # mapping proxies cannot be pickled
        return Recipe, (self.deformation, self.minus, dict(self.members), self.script, self.set, self.about,
                        self.source, self.also, dict(self.weights))


def shape_set(name: str, person: str | Path | Person | None = None) -> dict[str, Recipe]:
    """Return shape -> recipe of a set, in its own order.

    name: "units" (each side and lip apart, and correctives: their sum with the unit table's coefficients is any
        expression), "expressions" (at full intensity), "arkit" (Apple's 52), "visemes" (15), "vrm" (the presets of VRM
        1.0) or "all". person: whose habits override expressions, as everywhere. Units stay the common ones, so that
        they mean the same on every rig; an expression with units that the person moves otherwise is no sum of them.

    The head's own movements (units 51 to 58) are no shapes: a neck turns, it does not blend. Raises InputError. ::

        shape_set("arkit")["mouthSmileLeft"].members        # {"L12": 1.0}
    """
    if name not in (*SETS, "all"):
        raise InputError(f"set: expected {', '.join(SETS)} or all, got {name!r}{nearest(str(name), (*SETS, 'all'))}")
    if name == "all":
        return shape_sets(SETS, person)
    if name == "expressions":
        return _expressions(person)
    return dict(_units() if name == "units" else _vocabularies()[name])


def is_head(member: str) -> bool:
    """Return whether a member of the unit table's basis moves the head."""
    table = load_units()
    return member in table.catalogue.atoms and table.catalogue.unit_of(member).region == "head"


def shape_sets(names: Sequence[str], person: str | Path | Person | None = None) -> dict[str, Recipe]:
    """Return the recipes of several sets together, expressions last: one whose name another shape has gets `CLASH`.

    names: as `shape_set` takes them, one or more; InputError otherwise.
    """
    if not names:
        raise InputError(f"sets: expected one or more of {', '.join(SETS)}, all, got none")
    shapes: dict[str, Recipe] = {}
    for name in sorted(dict.fromkeys(names), key=("expressions", "all").__contains__):
        if name != "expressions":
            shapes |= shape_set(name, person)
    if "expressions" in names and "all" not in names:
        for name, recipe in _expressions(person).items():
            shapes[CLASH + name if name in shapes else name] = recipe
    return shapes


@cache
def _units() -> Mapping[str, Recipe]:
    table, made = load_units(), {}
    for member, deformation in table.basis.items():
        if is_head(member):
            continue
        unit = table.catalogue.units.get(member.lstrip("LRTB"))
        about = unit.effect if unit else f"corrects {member.partition(':')[0].replace('+', ' with ')}"
        made[shape_of(member)] = Recipe((deformation,), None, {member: 1.0}, member, "units", about,
                                        unit.source if unit else table.source)
    return made


def _expressions(person: str | Path | Person | None) -> dict[str, Recipe]:
    if person is None:
        return dict(_common())
    someone = load_person(person)
    own = load_units().own_basis(someone)
    if not own:
        return {**_common(), **_made(someone.expressions)}
    return _made({**load_expressions().expressions, **someone.expressions}, own)


@cache
def _common() -> Mapping[str, Recipe]:
    return _made(load_expressions().expressions)


def _made(expressions: Mapping[str, Expression], own: Mapping[str, Deformation] = MappingProxyType({})
          ) -> dict[str, Recipe]:
    table, made = load_units(), {}
    for name, one in expressions.items():
        members = {member: value for member, value in table.coefficients(one.units).items() if not is_head(member)}
        total = _sum(members, own)
        if own.keys() & members.keys():
            members = {}
        made[name] = Recipe((total,), None, members, canonical(one.units), "expressions", one.about,
                            one.source)
    return made


def _sum(members: Mapping[str, float], own: Mapping[str, Deformation] = MappingProxyType({})) -> Deformation:
    table = load_units().with_basis(own)
    total = weighted_sum([(value, table.basis[member]) for member, value in members.items()])
    return total if total.has_lengths else replace(total, units=table.units)


@cache
def _vocabularies() -> Mapping[str, Mapping[str, Recipe]]:
    return read_vocabularies(tables_dir() / "vocabularies.yaml")


def read_vocabularies(path: Path) -> dict[str, dict[str, Recipe]]:
    """Return set -> shape -> recipe of a file like the shipped ``vocabularies.yaml``. TableError, FileError."""
    top = Entry(read_data(path), str(path)).fields(required=("sources", "sets"))
    sources = {key: entry.text() for key, entry in top["sources"].items()}
    return {name: _Set(name, entry, sources).recipes()
            for name, entry in top["sets"].fields(required=TABLE_SETS).items()}


class _Set:
    """Reads one set of a file; entries may refer to each other."""

    def __init__(self, name: str, entry: Entry, sources: Mapping[str, str]) -> None:
        fields = entry.fields(required=("about", "source", "shapes"))
        fields["about"].text()
        self.name = name
        self.source = "; ".join(sources[one.choice(sources, "source")] for one in fields["source"].each())
        self.entries = dict(fields["shapes"].items())

    def recipes(self) -> dict[str, Recipe]:
        """Return every shape."""
        return {shape: self._recipe(shape) for shape in self.entries}

    def _recipe(self, shape: str) -> Recipe:
        entry = self.entries[shape]
        fields = entry.fields(optional=KEYS)
        also = fields["also"].texts() if "also" in fields else ()
        if "mirror_of" in fields:
            other = self._other(fields["mirror_of"], shape)
            if set(fields) - {"mirror_of", "also"}:
                raise entry.fail("a mirror image has nothing of its own but other names (also)")
            one = self._recipe(other)
            image = one.deformation[0].mirrored()
            members = {_mirrored(m): value for m, value in one.members.items()}
            if not set(members) <= set(load_units().basis) or _sum(members) != image:
                members = {}                            # the mirror image of a turn to the left is another unit
            return replace(one, deformation=(image,), members=members, weights={}, about=_swapped(one.about), also=also,
                           script=f"mirror image of {other}")
        if "about" not in fields:
            raise entry.fail("the key 'about' is missing")
        weights = self._weights(fields)
        members = load_units().coefficients(weights)
        if any(map(is_head, members)):
            raise fields["units"].fail("units of the head (51 to 58) are no shapes")
        made = _sum(members)
        if "half" in fields:
            made, members = half(made, fields["half"].choice(("L", "R"), "half")), {}
        for key in ("both", "add"):
            if key in fields:
                raw = deformation_from_entry(fields[key])
                made = _added(fields[key], made, symmetric(fields[key], raw) if key == "both" else raw)
                members = {}
        minus = None
        if "corrects" in fields:
            minus = self._other(fields["corrects"], shape)
            made = _added(entry, made, *self._recipe(minus).deformation)
        return Recipe((made,), minus, members, _script(fields), self.name, fields["about"].text(), self.source, also,
                      weights)

    def _weights(self, fields: Mapping[str, Entry]) -> dict[str, float]:
        """Return the weights of an entry's units and jaw."""
        weights: dict[str, float] = {}
        if "units" in fields:
            value = fields["units"].value               # a bare 0 or 17 reads as a number
            try:
                weights = parse(str(value) if type(value) is int else fields["units"].text())
            except FacegenError as error:
                raise fields["units"].fail(str(error)) from error
        if "jaw" in fields:
            if _WIDEST in weights:
                raise fields["jaw"].fail(f"the jaw is given twice: leave out unit {_WIDEST}")
            weights[_WIDEST] = fields["jaw"].number(0.0, 1.0)
        return weights

    def _other(self, entry: Entry, shape: str) -> str:
        other = entry.choice(self.entries, "shape")
        if other == shape or {"mirror_of", "corrects"} & set(dict(self.entries[other].items())):
            raise entry.fail("expected a shape that is written out")
        return other


def _script(fields: Mapping[str, Entry]) -> str:
    """Return an entry's recipe in words."""
    said = [f"{fields[key].value}" for key in ("units",) if key in fields]
    if "half" in fields:
        said[-1:] = [f"{said[-1] if said else ''} {({'L': 'left', 'R': 'right'})[fields['half'].value]} half".strip()]
    said += [f"jaw {fields['jaw'].value:g}"] if "jaw" in fields else []
    said += ["raw data"] if {"both", "add"} & set(fields) else []
    return ", ".join(said) + (f", with {fields['corrects'].value}" if "corrects" in fields else "")


def half(deformation: Deformation, side: str) -> Deformation:
    """Return the half of a movement on one side, "L" or "R"; both halves sum to the whole.

    What has no side moves half as far.
    """
    other = {"L": "_R", "R": "_L"}[side]

    def share(name: str) -> float:
        return 0.0 if name.endswith(other) else 1.0 if name.endswith(f"_{side}") else 0.5

    scalars = {kind: {key: share(key) * value for key, value in getattr(deformation, kind).items()}
               for kind in ("jaw", "lids", "eyes", "head", "folds")}
    points = {name: tuple(share(name) * c for c in vector) for name, vector in deformation.points.items()}
    return Deformation(points=points, **scalars, units=deformation.units, with_jaw=deformation.with_jaw)


def _added(entry: Entry, *several: Deformation) -> Deformation:
    try:
        return weighted_sum([(1.0, one) for one in several])
    except TableError:
        raise
    except InputError as error:
        raise entry.fail(str(error)) from error


def _mirrored(member: str) -> str:
    name, _, place = member.partition(":")
    turn = {"L": "R", "R": "L"}
    if place:
        return f"{name}:{turn.get(place, place)}"
    return turn[name[0]] + name[1:] if name[0] in turn else name


def _swapped(text: str) -> str:
    """Return a description of the other side."""
    return re.sub(r"\b(left|right)\b", lambda found: {"left": "right", "right": "left"}[found[0]], text)

"""The Expression -> AU tables of Akimoto 1986, section 3.3 and figure 10: the common one, and one for each
person.

A person's habits override the common table: their ``happiness`` stands for everybody's, and so does every
synonym. Their action units, too, may move otherwise (`facegen.facs.own_units`).
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

from facegen.data import tables_dir
from facegen.errors import InputError, NotationError, TableError, nearest
from facegen.facs.notation import looks_like_units, parse
from facegen.facs.own_units import OwnUnit, read_own_units
from facegen.facs.units import Catalogue, load_catalogue
from facegen.facs.validate import Entry
from facegen.facs.yamlfile import SUFFIXES, line_of, read_data

HABITS = ("overrides", "adds", "aliases", "units")
"""Keys of a person's table, of which one at least is there."""


@dataclass(frozen=True)
class Expression:
    """A named set of unit weights. ``also`` lists its synonyms."""

    name: str
    units: Mapping[str, float]
    about: str
    source: str
    also: tuple[str, ...] = ()


@dataclass(frozen=True)
class ExpressionTable:
    """The common table: ``expressions`` by name, ``aliases``: synonym -> name."""

    expressions: Mapping[str, Expression]
    aliases: Mapping[str, str]
    source: str

    @property
    def words(self) -> tuple[str, ...]:
        """Every name and synonym."""
        return (*self.expressions, *self.aliases)

    def find(self, word: str, person: Person | None = None) -> Expression | None:
        """Return the expression of a name or synonym, the person's own before the common one, or None."""
        name = fold_name(word)
        own = person.expressions if person else {}
        if name not in own and person:
            name = person.aliases.get(name, name)
        if name not in own:
            name = self.aliases.get(name, name)
        return own.get(name) or self.expressions.get(name)


@dataclass(frozen=True)
class Person:
    """One person's habits: ``expressions`` that override common ones or are new, own ``aliases``.

    ``units``: atom -> how this person moves it, where not as everybody.
    """

    name: str
    about: str
    source: str
    expressions: Mapping[str, Expression]
    aliases: Mapping[str, str] = field(default_factory=dict)
    units: Mapping[str, OwnUnit] = field(default_factory=dict)

    @property
    def words(self) -> tuple[str, ...]:
        """Every name and synonym of this person's own."""
        return (*self.expressions, *self.aliases)


def fold_name(word: str) -> str:
    """Return a name as tables write it.

    >>> fold_name(" Happily Surprised ")
    'happily_surprised'
    """
    return re.sub(r"[\s_-]+", "_", word.strip().casefold())


def is_path(text: str) -> bool:
    """Return whether a text is meant as a file's path; the slash of a script such as 26/27 makes none."""
    slash = any(c in text for c in {"/", os.sep, os.altsep or "/"})
    return text.lower().endswith(SUFFIXES) or (slash and not looks_like_units(text))


def load_expressions(path: str | Path | None = None) -> ExpressionTable:
    """Return the shipped table of expressions (read once) or another of the same form."""
    return _shipped() if path is None else _read_expressions(Path(path))


@cache
def _shipped() -> ExpressionTable:
    return _read_expressions(tables_dir() / "expressions.yaml")


def people() -> tuple[str, ...]:
    """Return the names of the shipped people."""
    return tuple(sorted(path.stem for path in (tables_dir() / "people").glob("*.yaml")))


def load_person(name_or_path: str | Path | Person, *, expressions: ExpressionTable | None = None) -> Person:
    """Return a shipped person by name, or one's own by the path of a file.

    Raises InputError for an unknown name, FileError or TableError for a file.
    """
    if isinstance(name_or_path, Person):
        return name_or_path
    if not isinstance(name_or_path, (str, Path)):
        raise InputError(f"person: expected a name or a path, got {type(name_or_path).__name__}")
    expressions = expressions or load_expressions()
    if isinstance(name_or_path, Path) or is_path(name_or_path):
        return _read_person(Path(name_or_path), expressions)
    name = fold_name(name_or_path)
    if name not in people():
        raise InputError(f"person: unknown person '{name_or_path}'{nearest(name, people())} "
                         f"(shipped: {', '.join(people())}; or give the path of a .yaml file)")
    return _read_person(tables_dir() / "people" / f"{name}.yaml", expressions)


def _name(entry: Entry, name: str) -> str:
    """Return a name that is fit for a table."""
    if name != fold_name(name) or not name.isidentifier() or looks_like_units(name):
        raise entry.fail(f"'{name}' is no name for an expression: use small letters, digits and _, "
                         "beginning with a letter, and nothing that reads as an action unit")
    return name


def _expression(name: str, entry: Entry, catalogue: Catalogue, sources: Mapping[str, str] | None,
                source: str = "") -> Expression:
    """Return one checked expression; ``sources`` None: all share ``source``."""
    fields = entry.fields(required=("units", "about", *(("source",) if sources is not None else ())),
                          optional=("also",))
    _name(entry, name)
    try:
        value = fields["units"].value  # a bare 0 or 12 reads as a number
        weights = parse(str(value) if type(value) is int else fields["units"].text(), catalogue=catalogue)
    except NotationError as error:
        raise fields["units"].fail(str(error)) from error
    if sources is not None:
        source = sources[fields["source"].choice(sources, "source")]
    also = tuple(_name(one, one.text()) for one in fields["also"].each()) if "also" in fields else ()
    return Expression(name, weights, fields["about"].text(), source, also)


def _read_expressions(path: Path) -> ExpressionTable:
    fields = Entry(read_data(path), str(path)).fields(required=("sources", "expressions"))
    sources = {key: entry.text() for key, entry in fields["sources"].items()}
    catalogue = load_catalogue()
    entries = dict(fields["expressions"].items())
    table = {name: _expression(name, entry, catalogue, sources) for name, entry in entries.items()}
    if "neutral" not in table or table["neutral"].units:
        raise fields["expressions"].fail("the expression 'neutral' is missing or not 0")
    return ExpressionTable(table, _aliases(table, entries), "; ".join(sources.values()))


def _aliases(table: Mapping[str, Expression], entries: Mapping[str, Entry]) -> dict[str, str]:
    """Return synonym -> name; a synonym that means two things is an error."""
    aliases: dict[str, str] = {}
    for name, expression in table.items():
        for word in expression.also:
            other = word if word in table else aliases.get(word)
            if other:
                raise entries[name].fail(f"also: '{word}' already means the expression '{other}'")
            aliases[word] = name
    return aliases


def _read_person(path: Path, common: ExpressionTable) -> Person:
    person = person_from_data(read_data(path), str(path), name=path.stem, expressions=common)
    if person.units:
        check_movements(person, path.read_text(encoding="utf-8-sig"), str(path))
    return person


def check_movements(person: Person, text: str, source: str) -> None:
    """Raise TableError, with the line, for a feature point or fold in a person's units that no face has.

    text: of the file that they were read from; source: its name.
    """
    from facegen.facs.tables import load_units  # which reads expressions, too

    try:
        load_units().own_basis(person)
    except TableError as error:
        place, _, why = str(error).removeprefix(f"{source}: ").partition(": ")
        raise TableError(f"{source}: line {line_of(text, place.split('.'))}: {place}: {why}") from None


def person_from_data(data: object, source: str = "person", *, name: str = "person",
                     expressions: ExpressionTable | None = None) -> Person:
    """Return the person that plain data of a file's form describe (docs/tables.md).

    source: names the data in errors. name: if the data give none. Raises TableError.
    """
    common, root = expressions or load_expressions(), Entry(data, source)
    fields = root.fields(required=("about", "source"), optional=("name", *HABITS))
    said, catalogue = fields["source"].text(), load_catalogue()
    table: dict[str, Expression] = {}
    entries: dict[str, Entry] = {}
    for key in ("overrides", "adds"):
        for word, entry in fields[key].items() if key in fields else ():
            known = word in common.expressions
            if key == "overrides" and not known:
                hint = f"; '{word}' is a synonym of '{common.aliases[word]}': override that" \
                    if word in common.aliases else nearest(word, common.expressions) or ""
                raise entry.fail(f"unknown expression '{word}'{hint} (a new one belongs under 'adds')")
            if key == "adds" and known:
                raise entry.fail(f"'{word}' is an expression of the common table: put it under 'overrides'")
            table[word] = _expression(word, entry, catalogue, None, said)
            entries[word] = entry
    if not any(key in fields for key in ("aliases", "units")) and not table:
        raise root.fail(f"a person has at least one of: {', '.join(HABITS)}")
    aliases, known = _aliases(table, entries), dict.fromkeys((*table, *common.expressions))
    for word, entry in fields["aliases"].items() if "aliases" in fields else ():
        _name(entry, word)
        if word in table or word in aliases:
            raise entry.fail(f"'{word}' already means an expression of this person")
        aliases[word] = entry.choice(known, "expression")
    units = read_own_units(catalogue, fields["units"]) if "units" in fields else {}
    name = fields["name"].text() if "name" in fields else name
    return Person(name, fields["about"].text(), said, table, aliases, units)

"""The named expressions that a person can choose from, and the search in them. Nothing here knows the browser."""

from __future__ import annotations

from collections.abc import Mapping

from facegen.facs.expression_table import Expression, Person, fold_name, load_expressions


def vocabulary(person: Person | None = None) -> dict[str, Expression]:
    """Return name -> expression, the person's own habits in place of the common ones, with all synonyms."""
    table = load_expressions()
    return {**table.expressions, **(person.expressions if person else {})}


def plain(name: str) -> str:
    """Return a name as people read it.

    >>> plain("happily_surprised")
    'happily surprised'
    """
    return name.replace("_", " ")


def search(words: Mapping[str, Expression], text: str) -> tuple[str, ...]:
    """Return the names that a text finds: in names and synonyms, else in what is said of them; all for no text."""
    asked = fold_name(text)
    if not asked:
        return tuple(words)
    common = load_expressions().expressions
    said = {name: (name, *one.also, *(common[name].also if name in common else ())) for name, one in words.items()}
    found = [name for name, every in said.items() if any(asked in word for word in every)]
    begins = [name for name in found if any(word.startswith(asked) for word in said[name])]
    if found:
        return tuple(sorted(found, key=lambda name: name not in begins))
    return tuple(name for name, one in words.items() if text.strip().casefold() in one.about.casefold())

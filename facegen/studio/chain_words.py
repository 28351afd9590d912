"""The chain of figure 10 as a panel shows it: name, action units, combination, deformation data."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from facegen.face.chain import movement_lines
from facegen.facs.units import load_catalogue
from facegen.studio.vocabulary import plain


def chain_markdown(data: Mapping[str, Any], shares: Mapping[str, float]) -> str:
    """Return what `facegen.face.chain.chain` gave, after the names and shares that the units came from, as Markdown."""
    return "\n".join(_lines(data, shares))


def _lines(data: Mapping[str, Any], shares: Mapping[str, float]) -> Iterator[str]:
    person = f", as {data['person']} does it" if data["person"] else ""
    if shares:
        yield "**Name**\n"
        yield " + ".join(f"{share:.0%} {plain(name)}" for name, share in shares.items()) + person + "\n"
    yield "**Action units**\n"
    for unit in data["units"]:
        code = unit["code"]
        seen = load_catalogue().unit_of(code)
        yield f"- `{code}` {unit['weight']:.2g} {seen.plain.lower()}: {unit['effect']}"
    if not data["units"]:
        yield "- none: the face at rest"
    if data["combinations"]:
        yield "\n**Combination**: what does not simply add\n"
        for one in data["combinations"]:
            yield f"- {' with '.join(one['units'])}: {one['why']}"
        yield "- weights after that: " + ", ".join(f"`{name}` {value:.2g}"
                                                    for name, value in data["coefficients"].items())
    if data["own"]:
        yield f"\n{data['person']} moves otherwise than others: {', '.join(data['own'])}"
    title, *rest = movement_lines(data)
    yield f"\n**{title.partition(',')[0]}**{title.partition('(')[1]}{title.partition('(')[2]}\n"
    yield "```\n" + "\n".join(line.removeprefix("  ").replace("```", "") for line in rest) + "\n```"

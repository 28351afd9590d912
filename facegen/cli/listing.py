"""``facegen list``: the names that the other commands take."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Annotated, Any

import typer

from facegen.cli.options import Json, PersonName, print_json

ShapeSet = Annotated[str, typer.Option("--set", metavar="SET", help="arkit, visemes, vrm, units, expressions or all.")]

app = typer.Typer(help="Names that the other commands take.", rich_markup_mode=None, no_args_is_help=False)


def _show(rows: list[dict[str, Any]], lines: Iterable[tuple[str, ...]], json: bool) -> None:
    """Print dictionaries as JSON, or else lines as columns."""
    if json:
        print_json(rows)
        return
    from facegen.fileio.columns import columns

    for line in columns(lines):
        print(line)


@app.command()
def expressions(person: PersonName = None, json: Json = False) -> None:
    """Expressions: name, action units, what it looks like, synonyms."""
    from facegen.facs.expression_table import load_expressions, load_person
    from facegen.facs.notation import canonical

    table = load_expressions()
    own = load_person(person).expressions if person else {}
    rows, lines = [], []
    for name, one in {**table.expressions, **own}.items():
        also = one.also or (table.expressions[name].also if name in table.expressions else ())
        rows.append({"name": name, "units": canonical(one.units), "weights": dict(one.units),
                     "about": one.about, "also": list(also), "source": one.source, "own": name in own})
        words = f" ({', '.join(also)})" if also else ""
        lines.append((name, rows[-1]["units"], one.about + words))
    _show(rows, lines, json)


@app.command()
def units(json: Json = False) -> None:
    """FACS action units: code, name, what it does."""
    from facegen.facs.units import load_catalogue

    rows = [{"number": unit.number, "codes": list(unit.codes), "name": unit.name, "plain": unit.plain,
             "effect": unit.effect, "muscles": list(unit.muscles), "region": unit.region, "source": unit.source}
            for unit in load_catalogue().units.values()]
    _show(rows, [(" ".join(row["codes"]), row["name"], row["effect"]) for row in rows], json)


@app.command()
def shapes(name: ShapeSet = "arkit", person: PersonName = None, json: Json = False) -> None:
    """Blendshapes of a vocabulary: name, what it is made of, what is seen.

    arkit (Apple's 52), visemes (15), vrm (the presets of VRM 1.0), units, expressions or all.
    """
    from facegen.blendshapes.recipes import shape_set

    rows = [{"name": shape, "set": one.set, "recipe": one.script, "units": dict(one.members), "corrects": one.minus,
             "about": one.about, "also": list(one.also), "source": one.source}
            for shape, one in shape_set(name, person).items()]
    lines = [(row["name"], row["recipe"], row["about"]) for row in rows]
    _show(rows, lines, json)


@app.command()
def faces(json: Json = False) -> None:
    """Faces that can be drawn: name, number of feature points and regions; and heads that a package offers."""
    from facegen.face.face import load_face as load
    from facegen.face.named import face_names, offered_names

    rows = []
    for name in face_names():
        face = load(name)
        rows.append({"name": name, "feature_points": len(face.feature_points), "regions": len(face.regions)})
    lines = [(row["name"], f"{row['feature_points']} feature points, {row['regions']} regions") for row in rows]
    for name in offered_names():                # made when first asked for: not for a list
        package = name.partition(":")[0]
        rows.append({"name": name, "package": package})
        lines.append((name, f"a head of the package {package}"))
    _show(rows, lines, json)


@app.command()
def formats(json: Json = False) -> None:
    """Formats of recordings: name, what it is, whether it can be read and written."""
    from facegen.animation.streams import FORMATS

    rows = [{"name": one.name, "about": one.about, "suffixes": list(one.suffixes), "reads": one.read is not None,
             "writes": one.write is not None, "vocabulary": one.vocabulary} for one in FORMATS.values()]
    does = {(True, True): "reads, writes", (True, False): "reads", (False, True): "writes"}
    _show(rows, [(row["name"], does[row["reads"], row["writes"]], row["about"]) for row in rows], json)


@app.command()
def people(json: Json = False) -> None:
    """People with habits of their own: name and what they are like."""
    from facegen.facs.expression_table import load_person
    from facegen.facs.expression_table import people as names

    found = {name: load_person(name) for name in names()}
    rows = [{"name": name, "about": one.about, "expressions": list(one.expressions),
             "units": list(one.units), "source": one.source}
            for name, one in found.items()]
    _show(rows, [(row["name"], row["about"]) for row in rows], json)


@app.command()
def presets(json: Json = False) -> None:
    """Raw deformations that come with facegen: name and what happens."""
    from facegen.data import tables_dir
    from facegen.facs.expressions import presets as names
    from facegen.facs.yamlfile import read_data

    rows = []
    for name in names():
        path = tables_dir() / "presets" / f"{name}.yaml"
        data = read_data(path)
        rows.append({"name": name, "about": data.get("about", ""), "source": data.get("source"),
                     "file": str(path)})
    _show(rows, [(row["name"], row["about"]) for row in rows], json)

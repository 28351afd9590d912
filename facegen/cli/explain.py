"""``facegen explain``: the chain of Akimoto 1986, figure 10, with its numbers, in words."""

from __future__ import annotations

from typing import Annotated

import typer

from facegen.cli.options import FaceName, Intensity, Json, PersonName, Quiet, What, print_json, read_what

Full = Annotated[bool, typer.Option("--all", help="List all feature points, not only those that move most.")]


def explain(what: What, face: FaceName = "akimoto", person: PersonName = None, intensity: Intensity = 1.0,
            full: Full = False, json: Json = False, quiet: Quiet = False) -> None:
    """Say how a name becomes a movement.

    The chain is name -> action units -> deformation data, with its numbers.
    """
    meaning = read_what(what, person=person, intensity=intensity, quiet=quiet, face=face)

    from facegen.face.chain import chain, chain_lines
    from facegen.face.face import load_face

    data = chain(meaning, load_face(face), person) | {"face": face, "intensity": intensity}
    if json:
        print_json(data)
        return
    for line in chain_lines(data, full=full, hint=" (--all lists all)"):
        print(line)

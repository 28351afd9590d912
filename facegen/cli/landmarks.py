"""``facegen landmarks``: where an avatar's landmarks probably are."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from facegen.cli.options import Json, Quiet, print_json, warn
from facegen.errors import InputError

Avatar = Annotated[str, typer.Argument(
    metavar="AVATAR", help="The path of a .obj, .glb, .gltf, .vrm, .ply or .stl file, or a shipped avatar's name.")]
Out = Annotated[Path | None, typer.Option("--output", "-o", metavar="FILE", help="Where they go: .yaml. [required]")]
From = Annotated[Path | None, typer.Option(
    "--from", metavar="FILE", help="A landmark file with some of them; they are kept and help to find the others.")]
Preview = Annotated[Path | None, typer.Option(
    "--preview", metavar="PICTURE", help="Also draw a sheet that shows where they are: .png, .webp or .jpg.")]


def landmarks(avatar: Avatar, output: Out = None, known: From = None, preview: Preview = None, json: Json = False,
              quiet: Quiet = False) -> None:
    """Propose an avatar's landmarks, with how sure each is, for you to look at.

    For example: facegen landmarks avatar.obj -o avatar.yaml --preview sheet.png
    Then: facegen rig avatar.obj -l avatar.yaml -o avatar.glb
    """
    if output is None:
        raise InputError("-o: say where the landmarks go, for example -o avatar.yaml")
    from facegen.jobs.landmark_files import UNSURE, mark

    made = mark(avatar, output, known=known, preview=preview)
    if not quiet:
        warn(made.warnings)
    if json:
        print_json({"file": str(made.path), "face": round(made.found.face, 3),
                    "landmarks": {name: {"face": one.face, "barycentric": [float(w) for w in one.barycentric],
                                         "xyz": [float(x) for x in one.xyz], "confidence": round(one.confidence, 3),
                                         "why": one.why} for name, one in made.found.items()},
                    "unsure": made.found.below(UNSURE), "warnings": list(made.warnings),
                    "preview": None if preview is None else str(preview)})
    elif not quiet:
        given = sum(one.given for one in made.found.values())
        unsure = len(made.found.below(UNSURE))
        print(f"{made.path}: {len(made.found) - given} proposed, {given} given"
              + (f", {unsure} to look at" if unsure else ""))

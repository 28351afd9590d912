"""``facegen adopt``: a parametric face out of a human head."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from facegen.cli.options import Json, Quiet, print_json, read_pieces, warn
from facegen.errors import InputError

Head = Annotated[str, typer.Argument(
    metavar="HEAD", help="A human head: a .obj, .glb, .gltf, .vrm, .ply or .stl file, or a shipped avatar's name.")]
Out = Annotated[Path | None, typer.Option(
    "--output", "-o", metavar="FOLDER", help="Where the face goes: a folder, new or empty. [required]")]
Marks = Annotated[Path | None, typer.Option(
    "--landmarks", "-l", metavar="FILE", help="The head's landmarks; a shipped avatar has its own.")]
Name = Annotated[str | None, typer.Option("--name", metavar="NAME", help="The face's name. [default: the folder's]")]
Hair = Annotated[bool, typer.Option("--hair", help="Give a head without hair the base face's.")]
Pieces = Annotated[list[str] | None, typer.Option(
    "--piece", metavar="PART=KIND", help="What a part is (skin, eye_L, teeth_upper, skull, carried ...); repeatable.")]
Force = Annotated[bool, typer.Option("--force", help="Replace the face that the folder holds.")]
Preview = Annotated[Path | None, typer.Option(
    "--preview", metavar="PICTURE", help="Also draw a sheet of what the face does: .png, .webp or .jpg.")]


def adopt(head: Head, output: Out = None, landmarks: Marks = None, name: Name = None, hair: Hair = False,
          piece: Pieces = None, force: Force = False, preview: Preview = None, json: Json = False, quiet: Quiet = False
          ) -> None:
    """Make a parametric face out of a human head: it takes every expression without blendshapes.

    For example: facegen adopt me.obj --landmarks me.yaml -o me
    Then: facegen render happiness --face me -o happy.png
    """
    if output is None:
        raise InputError(f"-o: say which folder the face goes to, for example -o {Path(head).stem}")
    from facegen.jobs.adopting import adopt as make

    made = make(head, output, landmarks=landmarks, name=name, hair=hair, pieces=read_pieces(piece), force=force,
                preview=preview)
    if not quiet:
        warn(made.warnings)
    if json:
        print_json({"folder": str(made.path), "residual_mm": made.residual.as_dict(),
                    "eye_size": round(made.eye_size, 4), "millimetres_a_unit": made.frame.scale,
                    "warnings": list(made.warnings), "preview": None if preview is None else str(preview),
                    "pieces": list(made.pieces)})
    elif not quiet:
        for row in made.pieces:
            print(f"{row['name']}: {row['kind']}, {row['triangles']} triangles ({row['why']})")
        print(f"{made.path}: half of the face lies within {made.residual.median:.2f} mm of the head, 95 in 100 within "
              f"{made.residual.p95:.2f}, all within {made.residual.largest:.2f}")

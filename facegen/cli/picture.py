"""``facegen render``: one picture."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from facegen.cli.options import (
    FaceName,
    Intensity,
    Json,
    PersonName,
    Quiet,
    Size,
    View,
    What,
    print_json,
    read_background,
    read_size,
    read_view,
    read_what,
)
from facegen.errors import InputError

Out = Annotated[Path | None, typer.Option(
    "--output", "-o", metavar="OUT", help="Where the picture goes: .png, .jpg or .webp. [required]")]
Detail = Annotated[int | None, typer.Option(
    "--detail", min=0, max=3, help="How often the triangles are subdivided; by default as the size needs.")]
Flat = Annotated[bool, typer.Option("--flat", help="Show the triangles, unsmoothed.")]
Background = Annotated[str, typer.Option(
    "--background", metavar="COLOUR", help="plain, transparent, #rrggbb or r,g,b.")]


def render(what: What, output: Out = None, face: FaceName = "akimoto", person: PersonName = None,
           intensity: Intensity = 1.0, view: View = "0,0", size: Size = "512", detail: Detail = None,
           flat: Flat = False, background: Background = "plain", json: Json = False,
           quiet: Quiet = False) -> None:
    """Draw a face as a picture.

    For example: facegen render happiness -o happiness.png
    """
    if output is None:
        raise InputError("-o: say where the picture goes, for example -o picture.png")
    from facegen.fileio.images import check_image_path, save_image

    check_image_path(output)
    angles, pixels, ground = read_view(view), read_size(size), read_background(background)
    meaning = read_what(what, person=person, intensity=intensity, quiet=quiet)

    from facegen.face.face import load_face
    from facegen.render import render as draw

    picture = draw(load_face(face), meaning, size=pixels, view=angles, detail=detail,
                   background=ground, shading="flat" if flat else "smooth")
    save_image(picture, output)
    if json:
        print_json({"file": str(output), "what": what, "kind": meaning.kind, "name": meaning.name,
                    "face": face, "person": person, "intensity": intensity, "units": dict(meaning.units),
                    "view": list(angles), "size": list(pixels), "warnings": list(meaning.warnings)})

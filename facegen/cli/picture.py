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
Orthographic = Annotated[bool, typer.Option("--orthographic", help="Parallel projection instead of a lens.")]
RendererName = Annotated[str, typer.Option(
    "--renderer", metavar="NAME", help="auto, soft, fast or gl: all draw the same picture.")]
Occlusion = Annotated[str, typer.Option(
    "--occlusion", metavar="WHICH", help="Darkness of hollows: posed (right), neutral (quick) or off.")]
Shadows = Annotated[bool, typer.Option("--shadows", help="The key light casts shadows.")]
Wire = Annotated[bool, typer.Option("--wireframe", help="Draw the triangles' edges over the picture.")]
Cage = Annotated[bool, typer.Option("--cage", help="Draw the cage's edges over the smooth face.")]
Passes = Annotated[str | None, typer.Option(
    "--passes", metavar="NAMES",
    help="Also write, beside the picture: depth, normal, part, material, triangle, landmarks, feature_points.")]
Exact = Annotated[bool, typer.Option("--npz", help="With --passes: their exact numbers too, as one .npz.")]


def render(what: What, output: Out = None, face: FaceName = "akimoto", person: PersonName = None,
           intensity: Intensity = 1.0, view: View = "0,0", size: Size = "512", detail: Detail = None,
           flat: Flat = False, background: Background = "plain", orthographic: Orthographic = False,
           renderer: RendererName = "auto", occlusion: Occlusion = "posed", shadows: Shadows = False,
           wireframe: Wire = False, cage: Cage = False, passes: Passes = None, npz: Exact = False,
           json: Json = False, quiet: Quiet = False) -> None:
    """Draw a face as a picture, and what lies at each of its pixels.

    For example: facegen render happiness -o happiness.png --passes depth,part
    """
    if output is None:
        raise InputError("-o: say where the picture goes, for example -o picture.png")
    if npz and passes is None:
        raise InputError("--npz: writes the numbers of passes; name them, for example --passes depth,normal")
    from facegen.fileio.images import check_image_path, save_image

    check_image_path(output)
    wanted = read_passes(passes, output, exact=npz)
    angles, pixels, ground = read_view(view), read_size(size), read_background(background)
    meaning = read_what(what, person=person, intensity=intensity, quiet=quiet, face=face)

    from facegen.face.face import load_face
    from facegen.render import Wireframe, render_passes, save_passes
    from facegen.render import render as draw

    shape = {"size": pixels, "view": angles, "detail": detail, "orthographic": orthographic,
             "shading": "flat" if flat else "smooth"}
    found = render_passes(load_face(face), meaning, passes=wanted, **shape) if wanted else None
    picture = draw(load_face(face), meaning, **shape, background=ground, renderer=renderer, occlusion=occlusion,
                   shadows=shadows, wireframe=Wireframe(lines="cage") if cage else wireframe)
    save_image(picture, output)
    files = {} if found is None else save_passes(found, output.with_suffix(""), exact=npz)
    if json:
        print_json({"file": str(output), "what": what, "kind": meaning.kind, "name": meaning.name,
                    "face": face, "person": person, "intensity": intensity, "units": dict(meaning.units),
                    "view": list(angles), "size": list(pixels), "warnings": list(meaning.warnings),
                    "passes": {name: str(path) for name, path in files.items()}})


def read_passes(text: str | None, picture: Path, *, exact: bool) -> tuple[str, ...]:
    """Return "depth,part" as names, after a look at whether their files can be written beside the picture."""
    if text is None:
        return ()
    from facegen.render.passes import check_passes
    from facegen.render.passfiles import pass_paths

    names = check_passes([word.strip() for word in text.split(",")])
    pass_paths(names, picture.with_suffix(""), exact=exact)
    return names

"""``facegen figures``: the 1986 paper's figures 6 to 9 again, each as data, deformed mesh and image."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from facegen.cli.options import Quiet, progress
from facegen.errors import InputError

if TYPE_CHECKING:
    from facegen.face.face import Face
    from facegen.facs.expressions import Resolution

FIGURES = {"figure-6": "neutral", "figure-7": "akimoto-1986-figure-7", "figure-8": "akimoto-1986-figure-8",
           "figure-9": "akimoto-1986-figure-9"}
# Face -> subdivision level of its pictures: the paper's own shades its triangles, which are not subdivided.
FACES = {"akimoto-1986": 0, "akimoto": 2}
VIEWS = {"": (0.0, 0.0), "-side": (35.0, 0.0)}

Folder = Annotated[Path | None, typer.Option("--output", "-o", metavar="DIR",
                                             help="Folder for the figures; made if need be. [required]")]
Pixels = Annotated[int, typer.Option("--size", min=64, max=2048, help="Pixels of each picture.")]


def figures(output: Folder = None, size: Pixels = 512, quiet: Quiet = False) -> None:
    """Make figures 6 to 9 of the 1986 paper again.

    The neutral face (6) and three deformations (7 to 9), each as deformation data (.yaml), deformed
    mesh (.obj) and pictures (.png), on the paper's own 15 points and on the full face.
    """
    if output is None:
        raise InputError("-o: say which folder the figures go to, for example -o figures")
    from facegen.face.face import load_face
    from facegen.facs.expressions import resolve
    from facegen.fileio.images import contact_sheet, save_image
    from facegen.fileio.obj import format_obj
    from facegen.fileio.textfile import make_folder, save_text
    from facegen.render import render

    folder = make_folder(output)
    with progress("figures", len(FACES) * len(FIGURES), quiet=quiet) as step:
        for name, detail in FACES.items():
            face, place = load_face(name), make_folder(folder / name)
            pictures = []
            for figure, what in FIGURES.items():
                meaning = resolve(what)
                save_text(_data(face, figure, meaning), place / f"{figure}.yaml")
                comment = f"Akimoto, Mase, Suenaga 1986, {_title(figure)}, on the face {name}; millimetres"
                posed = face.mesh(detail).with_vertices(face.pose(meaning.deformation, detail=detail))
                save_text(format_obj(posed, comment=comment), place / f"{figure}.obj")
                for suffix, view in VIEWS.items():
                    pictures.append(render(face, meaning.deformation, size=size, view=view, detail=detail))
                    save_image(pictures[-1], place / f"{figure}{suffix}.png")
                step()
            labels = [_title(figure) + suffix.replace("-", ", ") for figure in FIGURES for suffix in VIEWS]
            save_image(contact_sheet(pictures, labels, 2), place / "figures.png")


def _title(figure: str) -> str:
    return figure.replace("-", " ")


def _data(face: Face, figure: str, meaning: Resolution) -> str:
    """Return a deformation file: the input as printed, and as comments what follows, in millimetres."""
    import json

    import yaml

    raw = meaning.deformation.as_dict()
    source = meaning.source if meaning.kind == "deformation" else "the face at rest"
    lines = [f"# {_title(figure).capitalize()} on the face {face.name}; `facegen render` draws this file.",
             f"source: {json.dumps(source)}", f"units: {raw.pop('units')}"]
    lines += [yaml.safe_dump({key: value}, default_flow_style=None, width=110).rstrip()
              for key, value in raw.items()]
    lines.append("# Movement of the feature points, mm; +x the subject's left, +y up, +z forward:")
    controls, deformer = face.controls(meaning.deformation), face.deformer
    turned = deformer.jaw.movement(deformer.points, controls.jaw)
    moved = controls.vectors + deformer.jaw_share[:, None] * turned
    for name, vector in zip(face.feature_points, moved, strict=True):
        if abs(vector).max() > 5e-4:
            lines.append(f"#   {name}: [{', '.join(f'{c + 0.0:.2f}' for c in vector)}]")
    return "\n".join(lines) + "\n"

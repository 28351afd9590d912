"""``facegen rig``: blendshapes for an avatar."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from facegen.cli.options import Json, PersonName, Quiet, print_json, read_pieces, warn
from facegen.errors import InputError

Avatar = Annotated[str, typer.Argument(
    metavar="AVATAR", help="The path of a .obj, .glb, .gltf, .vrm, .ply or .stl file, or a shipped avatar's name.")]
Out = Annotated[Path | None, typer.Option(
    "--output", "-o", metavar="OUT", help="Where it goes: .glb, .gltf, .vrm, .npz or an OBJ folder. [required]")]
Marks = Annotated[Path | None, typer.Option(
    "--landmarks", "-l", metavar="FILE", help="The avatar's landmarks; a shipped avatar has its own.")]
Sets = Annotated[str | None, typer.Option(
    "--set", metavar="SETS",
    help="Which shapes, by commas: units, expressions, arkit, visemes, vrm or all. [default: units,arkit,visemes]")]
Shapes = Annotated[str | None, typer.Option("--shapes", metavar="NAMES", help="Only these of them, by commas.")]
OtherTemplate = Annotated[Path | None, typer.Option(
    "--template", metavar="FACE",
    help="Another face with shapes instead of facegen's own: .glb, .gltf, .vrm or a folder with neutral.obj.")]
OtherMarks = Annotated[Path | None, typer.Option(
    "--template-landmarks", metavar="FILE", help="Its landmarks; what facegen rigged has them in the file.")]
Method = Annotated[str, typer.Option("--method", metavar="NAME", help="landmarks, or to compare: sumner, cloning.")]
EnergyWeights = Annotated[str | None, typer.Option(
    "--weights", metavar="WEIGHTS",
    help="Of the energies: ours, paper, a .yaml file, or by name, such as landmarks=20,anchor=0.03. [default: ours]")]
Opening = Annotated[float, typer.Option("--opening", metavar="FACTOR", help="How far the jaw opens, of the estimate.")]
LidClosure = Annotated[float, typer.Option(
    "--lid-closure", metavar="FACTOR", help="How far lids close; at 1 they meet where facegen's own do.")]
Pieces = Annotated[list[str] | None, typer.Option(
    "--piece", metavar="PART=KIND", help="What a part is (skin, eye_L, teeth_upper, skull, carried ...); repeatable.")]
Preview = Annotated[Path | None, typer.Option(
    "--preview", metavar="PICTURE", help="Also draw a sheet of what the shapes do: .png, .webp or .jpg.")]
NoNormals = Annotated[bool, typer.Option("--no-normals", help="Leave out how normals change: half the size.")]
Quantise = Annotated[bool, typer.Option("--quantise", help="Two bytes a number instead of four.")]
NoCache = Annotated[bool, typer.Option(
    "--no-cache", help="Lay the skin on the template anew, and do not keep that for the next time.")]


def rig(avatar: Avatar, output: Out = None, landmarks: Marks = None, sets: Sets = None, shapes: Shapes = None,
        person: PersonName = None, template: OtherTemplate = None, template_landmarks: OtherMarks = None,
        method: Method = "landmarks", weights: EnergyWeights = None, opening: Opening = 1.0,
        lid_closure: LidClosure = 1.0, piece: Pieces = None, preview: Preview = None, no_normals: NoNormals = False,
        quantise: Quantise = False, no_cache: NoCache = False, json: Json = False, quiet: Quiet = False) -> None:
    """Give an avatar the expressions as blendshapes.

    For example: facegen rig cat.obj --landmarks cat.yaml -o cat.glb
    Then: facegen render happiness --face cat.glb -o cat.png
    """
    if output is None:
        raise InputError("-o: say where the avatar goes, for example -o avatar.glb")
    from facegen.jobs.rigging import rig as make

    made = make(avatar, output, landmarks=landmarks, sets=_listed(sets), shapes=_listed(shapes), person=person,
                template=template, template_landmarks=template_landmarks, method=method, weights=weights,
                opening=opening, lid_closure=lid_closure, pieces=read_pieces(piece), preview=preview,
                normals=not no_normals, quantise=quantise, cache=not no_cache)
    if not quiet:
        warn(made.warnings)
    if json:
        print_json({"file": str(made.path), "shapes": list(made.names), "warnings": list(made.warnings),
                    "preview": None if preview is None else str(preview), "pieces": made.pieces})
    elif not quiet:
        for row in made.pieces:
            print(f"{row['name']}: {row['kind']}, {row['triangles']} triangles ({row['why']})")
        print(f"{made.path}: {len(made.names)} shapes")


def _listed(text: str | None) -> list[str] | None:
    """Return "a, b" as names."""
    return None if text is None else [name.strip() for name in text.split(",") if name.strip()]

"""``facegen fit``: weights and pose out of meshes, markers and landmarks."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from facegen.cli.options import Json, Quiet, print_json, read_size, warn
from facegen.errors import InputError

Input = Annotated[list[Path], typer.Argument(
    metavar="IN...", help="Meshes of the rig's vertices (.obj, .ply, .glb, .npz, several or a folder), or markers or "
                          "landmarks (.csv, .npz, .npy, .yaml, .json).")]
RigName = Annotated[str, typer.Option(
    "--rig", metavar="RIG", help="What is fitted: a face's name, or the path of a rigged avatar (.glb, .vrm).")]
Out = Annotated[Path | None, typer.Option(
    "--output", "-o", metavar="OUT", help="Where the weights go: a recording's file such as weights.csv. [required]")]
FormatName = Annotated[str | None, typer.Option(
    "--to", metavar="FORMAT", help="The format of OUT; by default facegen's own for .csv, else by the suffix.")]
LayoutName = Annotated[str | None, typer.Option(
    "--layout", metavar="NAME", help="What numbered landmarks are: ibug68 or mediapipe478. [default: by their number]")]
Markers = Annotated[Path | None, typer.Option(
    "--markers", metavar="FILE", help="Where named markers sit on the rig; without, they are its landmarks.")]
Lens = Annotated[str | None, typer.Option(
    "--camera", metavar="CAMERA", help="weak, fov=DEGREES, focal=PIXELS or a file of it. [default: weak]")]
Picture = Annotated[str | None, typer.Option("--picture", metavar="WxH", help="The size of the pictures, pixels.")]
Set = Annotated[str | None, typer.Option(
    "--set", metavar="SET", help="Which weights: units, arkit, visemes, vrm, expressions, shapes, or names by commas.")]
Neutral = Annotated[str | None, typer.Option(
    "--neutral", metavar="FRAMES", help="Frames in which the person's face rests, such as 0 or 0,40: what is the "
                                        "person's own is not taken for an expression.")]
Rate = Annotated[float | None, typer.Option("--fps", metavar="N", help="Frames a second; before the file's own times.")]
Person = Annotated[str | None, typer.Option("--person", metavar="ID", help="Which face of a table with several.")]
Scale = Annotated[float | None, typer.Option(
    "--scale", metavar="S", help="Measured units in a millimetre of the rig's; fitted by default.")]
Noise = Annotated[float | None, typer.Option(
    "--noise", metavar="N", help="Of a measurement: mm, or pixels. [default: 0.1 meshes, 0.5 markers, 1 pixel]")]
Sparsity = Annotated[float, typer.Option("--sparsity", metavar="M", help="How dear weights are: 0 is free.")]
Change = Annotated[float, typer.Option("--change", metavar="C", help="How far weights wander in a second; less is "
                                                                     "steadier.")]
Robust = Annotated[bool, typer.Option("--robust", help="Points that are far off count less.")]


def fit(inputs: Input, rig: RigName = "akimoto", output: Out = None, to: FormatName = None, layout: LayoutName = None,
        markers: Markers = None, camera: Lens = None, picture: Picture = None, shapes: Set = None,
        neutral: Neutral = None, fps: Rate = None, person: Person = None, scale: Scale = None, noise: Noise = None,
        sparsity: Sparsity = 8.0, change: Change = 3.0, robust: Robust = False, json: Json = False,
        quiet: Quiet = False) -> None:
    """Find the weights and the head's pose that a mesh, markers or landmarks show.

    For example: facegen fit openface.csv --rig hero.glb --camera fov=60 --picture 1280x720 -o weights.csv
    """
    if output is None:
        raise InputError("-o: say where the weights go, for example -o weights.csv")
    size = None if picture is None else read_size(picture)
    frames = _frames(neutral)
    from facegen.animation.streams.files import save_performance
    from facegen.animation.streams.formats import for_output
    from facegen.fileio.textfile import check_place
    from facegen.fitting.files import fit_files

    check_place(output, for_output(output, to, "csv").suffixes)
    wanted = [name.strip() for name in shapes.split(",")] if shapes and "," in shapes else shapes
    extra = {} if scale is None else {"scale": scale}
    found = fit_files(inputs, rig, layout=layout, markers=markers, camera=camera, picture=size, fps=fps, person=person,
                      noise=noise, shapes=wanted, neutral=frames, sparsity=sparsity, change=change, robust=robust,
                      **extra)
    written = save_performance(found.performance, output, to)
    if not quiet:
        warn(written.warnings)
    if json:
        print_json({"file": str(output), "rig": rig, "frames": len(written), "fitted": found.fitted,
                    "shapes": list(found.performance.names), "vocabulary": found.performance.vocabulary,
                    "unit": found.unit, "residual": round(found.residual, 6), "worst": round(found.worst, 6),
                    "unseen": list(found.seen.unseen), "unsure": dict(found.seen.unsure),
                    "warnings": list(written.warnings)})
    elif not quiet:
        print(f"{output}: {found.fitted} of {len(written)} frames, {len(found.performance.names)} weights, residual "
              f"{found.residual:.3g} {found.unit} (worst frame {found.worst:.3g})")


def _frames(text: str | None) -> tuple[int, ...]:
    """Return "0,40" as numbers of frames."""
    if text is None:
        return ()
    try:
        return tuple(int(part) for part in text.split(","))
    except ValueError:
        raise InputError(f"--neutral: expected numbers of frames such as 0 or 0,40, got '{text}'") from None

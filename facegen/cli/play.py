"""``facegen play``: a recorded performance on any face."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from facegen.cli.film import Out, Rate, Workers, film, target
from facegen.cli.options import Json, Quiet, Size, View
from facegen.cli.picture import Background, Detail, RendererName

if TYPE_CHECKING:
    from facegen.animation.performance import Performance

Recording = Annotated[Path, typer.Argument(metavar="FILE", help="A recording: .glb, .gltf or .vrm with an animation "
                                                                "of blendshape weights.")]
RigName = Annotated[str, typer.Option(
    "--rig", "--face", metavar="RIG", help="A face's name, the path of its face.yaml, or of a rigged avatar.")]
Animation = Annotated[str | None, typer.Option(
    "--animation", metavar="NAME", help="Which animation of a glTF file; the first with weights by default.")]
Bridge = Annotated[float | None, typer.Option(
    "--bridge", metavar="S", help="Seconds of a gap that is bridged; in a longer one the face holds. [default: 0.5]")]


def play(recording: Recording, output: Out = None, rig: RigName = "akimoto", animation: Animation = None,
         bridge: Bridge = None, fps: Rate = 25.0, size: Size = "512", view: View = "0,0",
         renderer: RendererName = "auto", background: Background = "plain", detail: Detail = None,
         workers: Workers = None, json: Json = False, quiet: Quiet = False) -> None:
    """Play a recording on a face: as a film, as pictures, or as an animation in a .glb.

    For example: facegen play take.glb --rig human.glb -o take.mp4. An animation in a .glb keeps the recording's own
    frames; --fps is for films.
    """
    out = target(output)
    from facegen.animation.playback import BRIDGE, Playback

    performance = _read(recording, animation)
    film(Playback(performance, BRIDGE if bridge is None else bridge), out, fps=fps, size=size, view=view,
         renderer=renderer, face=rig, background=background, detail=detail, workers=workers, json=json, quiet=quiet,
         about={"recording": str(recording), "vocabulary": performance.vocabulary})


def _read(recording: Path, animation: str | None) -> Performance:
    from facegen.animation.gltf_recording import SUFFIXES, read_gltf_performance
    from facegen.errors import FileError

    if recording.suffix.lower() not in SUFFIXES:
        raise FileError(f"{recording}: expected a recording, a file that ends in {', '.join(SUFFIXES)}")
    return read_gltf_performance(recording, animation)

"""``facegen play``: a recorded performance on any face."""

from __future__ import annotations

from typing import Annotated

import typer

from facegen.cli.film import Out, Rate, Workers, film, target
from facegen.cli.options import Json, Quiet, Size, View
from facegen.cli.picture import Background, Detail, RendererName
from facegen.cli.recordings import (
    Calibrate,
    CalibrateHead,
    FaceId,
    Gain,
    Presence,
    Recording,
    Smooth,
    Source,
    read_recording,
)

RigName = Annotated[str, typer.Option(
    "--rig", "--face", metavar="RIG", help="A face's name, the path of its face.yaml, or of a rigged avatar.")]
Bridge = Annotated[float | None, typer.Option(
    "--bridge", metavar="S", help="Seconds of a gap that is bridged; in a longer one the face holds. [default: 0.5]")]
RecordedRate = Annotated[float | None, typer.Option(
    "--recorded-fps", metavar="N", help="Frames a second of a recording whose file has no times, such as py-feat's.")]


def play(recording: Recording, output: Out = None, rig: RigName = "akimoto", bridge: Bridge = None, fps: Rate = 25.0,
         size: Size = "512", view: View = "0,0", renderer: RendererName = "auto", background: Background = "plain",
         detail: Detail = None, workers: Workers = None, source: Source = None, recorded_fps: RecordedRate = None,
         face_id: FaceId = None, presence: Presence = None, calibrate: Calibrate = None,
         calibrate_head: CalibrateHead = False, gain: Gain = None, smooth: Smooth = None, json: Json = False,
         quiet: Quiet = False) -> None:
    """Play a recording on a face: as a film, as pictures, or as an animation in a .glb.

    For example: facegen play openface.csv --rig human.glb -o take.mp4 --smooth on
    An animation in a .glb keeps the recording's own frames; --fps is for films.
    """
    out = target(output)
    from facegen.animation.playback import BRIDGE, Playback

    performance = read_recording(recording, source=source, fps=recorded_fps, face_id=face_id, presence=presence,
                                 calibrate=calibrate, calibrate_head=calibrate_head, gain=gain, smooth=smooth,
                                 quiet=True, rate="--recorded-fps")         # its warnings come with the film's
    film(Playback(performance, BRIDGE if bridge is None else bridge), out, fps=fps, size=size, view=view,
         renderer=renderer, face=rig, background=background, detail=detail, workers=workers, json=json, quiet=quiet,
         about={"recording": str(recording), "format": performance.about.get("format"),
                "vocabulary": performance.vocabulary})

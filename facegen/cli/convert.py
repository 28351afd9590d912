"""``facegen convert``: a recording in another format."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from facegen.cli.options import Json, Quiet, print_json, warn
from facegen.cli.recordings import (
    Calibrate,
    CalibrateHead,
    FaceId,
    Gain,
    Presence,
    RecordedRate,
    Recording,
    Smooth,
    Source,
    read_recording,
)
from facegen.errors import FileError, InputError

if TYPE_CHECKING:
    from collections.abc import Callable

    from facegen.animation.performance import Performance
    from facegen.animation.streams import Format

Out = Annotated[Path | None, typer.Option(
    "--output", "-o", metavar="OUT", help="Where it goes: .csv, .json ... [required]")]
Target = Annotated[str | None, typer.Option(
    "--to", metavar="FORMAT", help="What it becomes; by default the suffix says it, or what it was.")]
Vocabulary = Annotated[str | None, typer.Option(
    "--vocabulary", metavar="SET", help="Into these shapes, for --to csv, which takes any: units, arkit, vrm ...")]
NewRate = Annotated[float | None, typer.Option(
    "--resample", metavar="N", help="Even steps, N frames a second; by default the frames stay as recorded.")]


def convert(recording: Recording, output: Out = None, source: Source = None, target: Target = None,
            vocabulary: Vocabulary = None, fps: RecordedRate = None, resample: NewRate = None, face_id: FaceId = None,
            presence: Presence = None, calibrate: Calibrate = None, calibrate_head: CalibrateHead = False,
            gain: Gain = None, smooth: Smooth = None, json: Json = False, quiet: Quiet = False) -> None:
    """Write a recording in another format, cleaned up if you like.

    For example: facegen convert openface.csv -o take.csv --to livelink --calibrate 0-2 --smooth on
    What a conversion between vocabularies loses is said. A .glb becomes the base face with the shapes and their
    animation; facegen play takes any other face.
    """
    if output is None:
        raise InputError("-o: say where it goes, for example -o take.json")
    from facegen.animation.streams import resampled, save_performance, translated
    from facegen.fileio.avatar import ANIMATED

    animated = target is None and output.suffix.lower() in ANIMATED
    if target is not None:                              # before long work
        _format(output, target)
    read = read_recording(recording, source=source, fps=fps, face_id=face_id, presence=presence, calibrate=calibrate,
                          calibrate_head=calibrate_head, gain=gain, smooth=smooth, quiet=quiet)
    kind = "gltf" if animated else _format(output, target, read).name
    made = read
    if resample is not None:
        made = _option(resampled, made, resample)
    if vocabulary is not None:
        made = _option(translated, made, vocabulary)
    written = _animated(made, output) if animated else save_performance(made, output, kind)
    new = [warning for warning in written.warnings if warning not in read.warnings]
    if not quiet:
        warn(new)
    if json:
        print_json({"file": str(output), "format": kind, "from": read.about.get("format"),
                    "vocabulary": written.vocabulary, "frames": len(written), "found": int(written.found.sum()),
                    "duration": written.duration, "rate": written.rate, "names": list(written.names),
                    "residual": float(written.about.get("residual", 0.0)), "warnings": list(written.warnings)})


def _animated(one: Performance, output: Path) -> Performance:
    """Write a performance as an animation of the base face, and return it with what that changes."""
    from dataclasses import replace

    from facegen.animation.playback import Playback
    from facegen.jobs.animated import save_animation

    play = Playback(one)
    made = save_animation(play, output)
    return replace(one, warnings=tuple(dict.fromkeys((*play.warnings, *made.warnings))))


def _format(output: Path, target: str | None, read: Performance | None = None) -> Format:
    """Return the format to be written; an error names the option."""
    from facegen.animation.streams.formats import for_output

    try:
        return for_output(output, target, None if read is None else read.about.get("format"))
    except FileError:
        raise
    except InputError as error:
        text = str(error)
        raise InputError(f"--to{text.removeprefix('format')}" if text.startswith("format:") else f"{text} (--to)"
                         ) from error


def _option(make: Callable[..., Performance], one: Performance, value: object) -> Performance:
    """Return what a function makes; its error names an option that is called as its argument."""
    try:
        return make(one, value)
    except InputError as error:
        raise InputError(f"--{error}") from error

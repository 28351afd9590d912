"""How commands read a recording: the options, and what their texts mean."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from facegen.cli.options import warn
from facegen.errors import FileError, InputError

if TYPE_CHECKING:
    from facegen.animation.performance import Performance

Recording = Annotated[Path, typer.Argument(
    metavar="FILE", help="A recording: CSV or JSON of OpenFace, py-feat, LibreFace, Live Link Face, MediaPipe, or our "
                         "own, or a .glb with an animation. `facegen list formats` names all.")]
Source = Annotated[str | None, typer.Option(
    "--from", metavar="FORMAT", help="What the recording is; by default the content says it.")]
RecordedRate = Annotated[float | None, typer.Option(
    "--fps", metavar="N", help="Frames a second of a recording whose file has no times, such as py-feat's.")]
FaceId = Annotated[str | None, typer.Option(
    "--id", metavar="ID", help="Which face, where several were recorded; by default the one that is there longest. Of "
                               "a .glb: which animation, by name or number.")]
Presence = Annotated[float | None, typer.Option(
    "--presence", metavar="0..1", help="The weight of a unit that is only called present, such as OpenFace's AU28_c.")]
Calibrate = Annotated[str | None, typer.Option(
    "--calibrate", metavar="WHEN",
    help="Take the person's neutral off: FROM-TO, seconds in which the face rests, or a percentile such as 5%.")]
CalibrateHead = Annotated[bool, typer.Option(
    "--calibrate-head", help="Set head and gaze to 0 as well, by the middle of the same seconds.")]
Gain = Annotated[str | None, typer.Option(
    "--gain", metavar="GAIN", help="Multiply the weights: a number, or by name, such as 12=1.5,4=0.8.")]
Smooth = Annotated[str | None, typer.Option(
    "--smooth", metavar="HOW", help="Take the jitter off (One Euro filter): on, or CUTOFF or CUTOFF,BETA in Hz.")]

# What the arguments of `load_performance` are called on the command line.
_OPTIONS = {"format": "--from", "person": "--id", "presence": "--presence", "calibrate": "--calibrate",
            "gain": "--gain", "smooth": "--smooth"}


def read_recording(path: Path, *, source: str | None = None, fps: float | None = None, face_id: str | None = None,
                   presence: float | None = None, calibrate: str | None = None, calibrate_head: bool = False,
                   gain: str | None = None, smooth: str | None = None, quiet: bool = False,
                   rate: str = "--fps") -> Performance:
    """Return the performance of a recording as a command's options ask for it; warnings go to stderr.

    rate: what the command calls ``fps``, to be named in errors.
    """
    from facegen.animation.streams import load_performance
    from facegen.animation.streams.calibrate import Calibration, parse_calibration

    if calibrate_head and calibrate is None:
        raise InputError("--calibrate-head: say when head and gaze rest, for example --calibrate 0-2")
    try:
        how: Calibration | None = None
        if calibrate is not None:
            how = parse_calibration(calibrate, gain=_gain(gain), head=calibrate_head)
        elif gain is not None:
            how = Calibration(gain=_gain(gain))
        performance = load_performance(path, format=source, fps=fps, person=face_id, presence=presence, calibrate=how,
                                       smooth=smooth)
    except FileError as error:
        raise FileError(str(error).replace("(fps)", f"({rate})").replace("say which format", "say which (--from)")
                        ) from error
    except InputError as error:
        raise _named(error, rate) from error
    if not quiet:
        warn(performance.warnings)
    return performance


def _named(error: InputError, rate: str) -> InputError:
    """Return an error that names the option instead of the argument."""
    name, colon, rest = str(error).partition(":")
    inner, _, more = rest.strip().partition(":")
    if name == "calibrate" and inner == "gain":
        name, rest = inner, f" {more.strip()}"
    options = {**_OPTIONS, "fps": rate, "animation": "--id"}
    return InputError(f"{options[name]}:{rest}") if colon and name in options else error


def _gain(text: str | None) -> float | dict[str, float]:
    """Return what --gain means: a number for all, or a number by name."""
    if text is None:
        return 1.0
    try:
        if "=" not in text:
            return float(text)
        pairs = [part.partition("=") for part in text.split(",")]
        return {name.strip(): float(value) for name, _, value in pairs}
    except ValueError:
        raise InputError(f"gain: expected a number, or NAME=NUMBER by commas, got {text!r}") from None

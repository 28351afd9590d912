"""``facegen animate``, ``morph`` and ``turntable``: films, or folders of numbered pictures."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

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
    progress,
    read_background,
    read_size,
    read_view,
    read_what,
    warn,
)
from facegen.cli.picture import Background, Detail, RendererName
from facegen.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Callable

    from facegen.animation.motion import Motion
    from facegen.jobs.runner import Report

Out = Annotated[Path | None, typer.Option(
    "--output", "-o", metavar="OUT", help="Where the film goes: .mp4, .webm, .gif, .webp or .apng; a name without "
                                          "suffix is a folder of numbered pictures; .glb is an animation of "
                                          "blendshapes. [required]")]
Rate = Annotated[float, typer.Option("--fps", metavar="N", help="Frames a second.")]
Workers = Annotated[int | None, typer.Option(
    "--workers", min=1, metavar="N", help="Processes that draw; one for each core by default.")]
Seed = Annotated[int | None, typer.Option(
    "--idle", metavar="SEED", help="Blinks, small eye and head movements; a seed always gives the same.")]
Ease = Annotated[str, typer.Option("--ease", metavar="EASE", help="min_jerk, linear, ease_in, ease_out or step.")]
Seconds = Annotated[float, typer.Option("--seconds", metavar="S", help="How long it takes.")]


def animate(script: Annotated[Path, typer.Argument(metavar="SCRIPT", help="A clip as a YAML or JSON file.")],
            output: Out = None, fps: Rate = 25.0, size: Size = "512", view: View = "0,0",
            renderer: RendererName = "auto", face: FaceName = "akimoto", person: PersonName = None,
            idle: Seed = None, background: Background = "plain", detail: Detail = None, workers: Workers = None,
            json: Json = False, quiet: Quiet = False) -> None:
    """Draw a clip as a film.

    For example: facegen animate greeting.yaml -o greeting.mp4. A stopped run goes on where it was when the same
    command is given again.
    """
    out = target(output)
    from facegen.animation.script import load_clip

    clip = load_clip(script, person=person, idle=idle)
    film(clip, out, fps=fps, size=size, view=view, renderer=renderer, face=face, background=background, detail=detail,
         workers=workers, json=json, quiet=quiet, about={"script": str(script), "person": person})


def morph(poses: Annotated[list[str], typer.Argument(
        metavar="WHAT...", help="Two or more poses: expressions, FACS scripts, presets or deformation files.")],
        output: Out = None, seconds: Seconds = 1.0,
        hold: Annotated[float, typer.Option("--hold", metavar="S", help="Seconds that each pose stands.")] = 0.5,
        back: Annotated[bool, typer.Option("--back", help="Return to the first pose, to be shown round and round.")
                        ] = False,
        ease: Ease = "min_jerk", fps: Rate = 25.0, size: Size = "512", view: View = "0,0",
        renderer: RendererName = "auto", face: FaceName = "akimoto", person: PersonName = None, idle: Seed = None,
        background: Background = "plain", detail: Detail = None, workers: Workers = None, json: Json = False,
        quiet: Quiet = False) -> None:
    """Draw the change from pose to pose as a film.

    For example: facegen morph happiness anger -o morph.gif
    """
    out = target(output)
    from facegen.animation.script import morph as between

    found = [read_what(pose, person=person, intensity=1.0, quiet=True) for pose in poses]
    clip = between(*found, seconds=seconds, hold=hold, back=back, ease=ease, idle=idle)
    film(clip, out, fps=fps, size=size, view=view, renderer=renderer, face=face, background=background, detail=detail,
         workers=workers, json=json, quiet=quiet, about={"poses": poses, "person": person})


def turntable(what: What, output: Out = None, seconds: Seconds = 4.0,
              turn: Annotated[str | None, typer.Option(
                  "--range", metavar="FROM,TO", help="Swing between two yaws and back, degrees; by default once round.")
              ] = None,
              pitch: Annotated[float, typer.Option("--pitch", metavar="DEGREES", help="How high the camera stands.")
                               ] = 0.0,
              fps: Rate = 25.0, size: Size = "512", renderer: RendererName = "auto", face: FaceName = "akimoto",
              person: PersonName = None, intensity: Intensity = 1.0, background: Background = "plain",
              detail: Detail = None, workers: Workers = None, json: Json = False, quiet: Quiet = False) -> None:
    """Draw one pose with the camera going round it.

    For example: facegen turntable happiness -o turn.webp
    """
    out = target(output)
    yaws = _yaws(turn)
    pixels, ground = read_size(size), read_background(background)
    meaning = read_what(what, person=person, intensity=intensity, quiet=quiet, face=face)
    from facegen.animation.clip import Clip
    from facegen.jobs.frames import save_turn

    count = Clip((), seconds).frames(fps)
    report = _drawn(count, quiet, lambda step: save_turn(
        meaning, out, seconds=seconds, fps=fps, turn=yaws, pitch=pitch, size=pixels, face=face, detail=detail,
        background=ground, renderer=renderer, workers=_count(workers), step=step))
    if json:
        print_json({"file": str(out), "what": what, "seconds": seconds, "fps": fps, "frames": count,
                    "size": list(pixels), "face": face, "made": report.made, "kept": report.kept})


def film(clip: Motion, out: Path, *, fps: float, size: str, view: str, renderer: str, face: str, background: str,
         detail: int | None, workers: int | None, json: bool, quiet: bool, about: dict[str, Any]) -> None:
    """Draw a clip or a recording with a progress bar, or write it as an animation of blendshapes, and tell of it."""
    angles, pixels, ground = read_view(view), read_size(size), read_background(background)
    count = clip.frames(fps)
    from facegen.fileio.avatar import ANIMATED

    if out.suffix.lower() in ANIMATED:
        _animation(clip, out, fps=fps, face=face, detail=detail, json=json, quiet=quiet, about=about)
        return
    from facegen.face.face import load_face
    from facegen.jobs.frames import save_clip

    warnings = [*clip.warnings, *clip.check(load_face(face))]
    if not quiet:
        warn(warnings)
    report = _drawn(count, quiet, lambda step: save_clip(
        clip, out, fps=fps, size=pixels, view=angles, face=face, detail=detail, background=ground, renderer=renderer,
        workers=_count(workers), step=step))
    if json:
        print_json({"file": str(out), **about, "duration": clip.duration, "fps": fps, "frames": count,
                    "size": list(pixels), "view": list(angles), "face": face, "made": report.made,
                    "kept": report.kept, "warnings": warnings})


def _animation(clip: Motion, out: Path, *, fps: float, face: str, detail: int | None, json: bool, quiet: bool,
               about: dict[str, Any]) -> None:
    """Write an animation into a glTF file, and tell of it."""
    from facegen.jobs.animated import save_animation

    made = save_animation(clip, out, face=face, fps=fps, detail=detail)
    warnings = [*clip.warnings, *made.warnings]
    if not quiet:
        warn(warnings)
    if json:
        print_json({"file": str(made.path), **about, "duration": clip.duration, "face": face, "keys": made.keys,
                    "shapes": list(made.names), "warnings": warnings})


def _drawn(count: int, quiet: bool, draw: Callable[[Callable[[], None]], Report]) -> Report:
    with progress("frames", count, quiet=quiet) as step:
        return draw(step)


def target(output: Path | None) -> Path:
    """Return where a film goes; InputError without one."""
    if output is None:
        raise InputError("-o: say where the film goes, for example -o film.mp4")
    return output


def _count(workers: int | None) -> int:
    from facegen.render.request import available_cores

    return workers or available_cores()


def _yaws(text: str | None) -> tuple[float, float] | None:
    if text is None:
        return None
    try:
        first, last = (float(part) for part in text.split(","))
    except ValueError:
        raise InputError(f"--range: expected FROM,TO in degrees such as -40,40, got '{text}'") from None
    return first, last

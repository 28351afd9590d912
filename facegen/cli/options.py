"""What the commands share: options, how their texts are read, warnings, progress, JSON."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Annotated, Any

import typer

from facegen.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Callable

    from facegen.facs.expressions import Resolution

What = Annotated[str, typer.Argument(
    metavar="WHAT", help='An expression ("happiness"), a FACS script ("6C+12D"), a preset (figure-8) or the '
                         "path of a deformation file.")]
FaceName = Annotated[str, typer.Option(
    "--face", metavar="FACE",
    help="A face's name, the path of its folder or face.yaml, or of a rigged avatar (.glb, .vrm).")]
PersonName = Annotated[str | None, typer.Option(
    "--person", metavar="PERSON", help="Whose habits: a person's name, or the path of their table.")]
Intensity = Annotated[float, typer.Option("--intensity", metavar="0..1", help="Scales the whole expression.")]
View = Annotated[str, typer.Option(
    "--view", metavar="YAW,PITCH",
    help="Where the camera stands, in degrees: yaw goes to the subject's left, pitch up.")]
Size = Annotated[str, typer.Option("--size", metavar="N|WxH", help="Pixels, 32 to 4096.")]
Json = Annotated[bool, typer.Option("--json", help="Print JSON on stdout.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="No warnings and no progress bar.")]


def read_view(text: str) -> tuple[float, float]:
    """Return "30,-10" as (yaw, pitch); one number alone is the yaw."""
    from facegen.render.wishes import parse_view

    return _option(parse_view, text)


def read_size(text: str) -> tuple[int, int]:
    """Return "512" or "640x480" as (width, height)."""
    from facegen.render.wishes import parse_size

    return _option(parse_size, text)


def read_background(text: str) -> str | tuple[int, ...]:
    """Return "plain", "transparent", or "#aabbcc" and "170,187,204" as (r, g, b)."""
    from facegen.render.wishes import parse_background

    return _option(parse_background, text)


def _option(parse: Callable[[str], Any], text: str) -> Any:
    """Return what a text means; an error names the option as it is typed."""
    try:
        return parse(text)
    except InputError as error:
        raise InputError(f"--{error}") from error


def read_what(what: str, *, person: str | None, intensity: float, quiet: bool, face: str | None = None) -> Resolution:
    """Return what a command's WHAT means, with what the face, if given, has to warn of; warnings go to stderr."""
    from dataclasses import replace

    from facegen.facs.expressions import full_name, resolve

    meaning = resolve(full_name(what), person=person, intensity=intensity)
    if face is not None:
        from facegen.face.face import load_face

        meaning = replace(meaning, warnings=(*meaning.warnings, *load_face(face).check(meaning)))
    if not quiet:
        warn(meaning.warnings)
    return meaning


def read_pieces(texts: Iterable[str] | None) -> dict[str, str]:
    """Return "hat=skull" and others as part -> kind."""
    given = {}
    for entry in texts or ():
        part, equals, kind = entry.partition("=")
        if not (part and equals and kind):
            raise InputError(f"--piece: expected PART=KIND such as hat=skull, got {entry!r}")
        given[part] = kind
    return given


def warn(warnings: Iterable[str]) -> None:
    """Print warnings on stderr."""
    for warning in warnings:
        print(f"facegen: warning: {warning}", file=sys.stderr)


def print_json(data: Any) -> None:
    """Print plain data as JSON on stdout."""
    print(json.dumps(data, indent=2, ensure_ascii=False))


@contextmanager
def progress(title: str, total: int, *, quiet: bool) -> Iterator[Callable[[], None]]:
    """Show a bar with the time left on stderr, if that is a screen; call what you get once a step."""
    if quiet or not sys.stderr.isatty():
        yield lambda: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    with Progress(TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn(),
                  console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(title, total=total)
        yield lambda: bar.advance(task)

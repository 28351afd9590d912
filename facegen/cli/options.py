"""What the commands share: options, how their texts are read, warnings, progress, JSON."""

from __future__ import annotations

import json
import re
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
    "--face", metavar="FACE", help="A face's name, or the path of its face.yaml.")]
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
    parts = text.split(",")
    try:
        angles = [float(part) for part in parts]
    except ValueError:
        angles = []
    if not 1 <= len(angles) <= 2:
        raise InputError(f"--view: expected YAW,PITCH in degrees such as 30,0, got '{text}'")
    return angles[0], angles[1] if len(angles) == 2 else 0.0


def read_size(text: str) -> tuple[int, int]:
    """Return "512" or "640x480" as (width, height)."""
    found = re.fullmatch(r"([0-9]{1,6})(?:[xX×]([0-9]{1,6}))?", text.strip(), re.ASCII)
    if not found:
        raise InputError(f"--size: expected pixels such as 512 or 640x480, got '{text}'")
    return int(found[1]), int(found[2] or found[1])


def read_background(text: str) -> str | tuple[int, ...]:
    """Return "plain", "transparent", or "#aabbcc" and "170,187,204" as (r, g, b)."""
    if re.fullmatch("#[0-9a-fA-F]{6}", text):
        return tuple(bytes.fromhex(text[1:]))
    if re.fullmatch("[0-9]{1,6}(,[0-9]{1,6}){2}", text, re.ASCII):
        return tuple(int(part) for part in text.split(","))
    if text not in ("plain", "transparent"):
        raise InputError(f"--background: expected plain, transparent, #rrggbb or r,g,b, got '{text}'")
    return text


def full_name(what: str) -> str:
    """Return a preset's full name for its unmistakable end: figure-8 for akimoto-1986-figure-8."""
    from facegen.facs.expressions import presets

    word = "-".join(what.split()).replace("_", "-").casefold()
    found = [name for name in presets() if name.endswith(f"-{word}") and not word.isdigit()]
    return found[0] if len(found) == 1 else what


def read_what(what: str, *, person: str | None, intensity: float, quiet: bool) -> Resolution:
    """Return what a command's WHAT means; warnings go to stderr."""
    from facegen.facs.expressions import resolve

    resolution = resolve(full_name(what), person=person, intensity=intensity)
    if not quiet:
        warn(resolution.warnings)
    return resolution


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


def columns(rows: Iterable[tuple[str, ...]]) -> Iterator[str]:
    """Yield the rows as lines whose columns are aligned; the last one is as long as it is."""
    rows = list(rows)
    widths = [max(map(len, column)) for column in zip(*(row[:-1] for row in rows), strict=True)]
    for row in rows:
        cells = [cell.ljust(width) for cell, width in zip(row[:-1], widths, strict=True)]
        yield "  ".join([*cells, row[-1]]).rstrip()

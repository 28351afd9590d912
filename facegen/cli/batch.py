"""``facegen batch``: a labelled data set."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from facegen.cli.options import Json, Quiet, print_json, progress
from facegen.errors import InputError, JobError

Jobs = Annotated[Path | None, typer.Argument(metavar="[JOBS]", help="A jobs file, YAML or JSON; or say it by options.")]
Out = Annotated[Path | None, typer.Option("--output", "-o", metavar="DIR", help="Folder of the data set. [required]")]
Workers = Annotated[int | None, typer.Option(
    "--workers", min=1, help="How many processes; by default one for each core.")]
Scheduler = Annotated[str | None, typer.Option(
    "--scheduler", metavar="ADDRESS", help="Use the dask cluster at tcp://HOST:PORT instead.")]
Update = Annotated[bool, typer.Option(
    "--update", help="Make the folder's data set into this one: what fits stays, the rest is removed.")]


def _list(name: str, metavar: str, what: str) -> Any:
    return Annotated[str | None, typer.Option(f"--{name}", metavar=metavar, help=what)]


Poses = _list("poses", "A,B,...", "Expressions and FACS scripts, with commas between.")
Views = _list("views", "'Y,P Y,P ...'", "Views (yaw,pitch), with spaces between.")
Faces = _list("faces", "A,B,...", "Faces.")
People = _list("people", "A,B,...", "Whose habits; 'nobody' is the common tables.")
Intensities = _list("intensities", "0.5,1", "Intensities, 0 to 1.")
Lights = _list("lights", "A,B,...", "Lighting set-ups, such as portrait, left, backlit.")
Sizes = _list("sizes", "N,WxH,...", "Pixels, 32 to 4096.")
Backgrounds = _list("backgrounds", "'A B ...'", "plain, transparent, #rrggbb or r,g,b, with spaces between.")
Format = Annotated[str | None, typer.Option("--format", help="png (as by default), webp or jpg.")]
Masks = Annotated[bool, typer.Option("--masks", help="A mask of the parts beside each picture.")]
Points = Annotated[bool, typer.Option("--feature-points", help="Label the feature points too.")]


def batch(jobs: Jobs = None, output: Out = None, poses: Poses = None, views: Views = None, faces: Faces = None,
          people: People = None, intensities: Intensities = None, lights: Lights = None, sizes: Sizes = None,
          backgrounds: Backgrounds = None, format: Format = None, masks: Masks = False, feature_points: Points = False,
          workers: Workers = None, scheduler: Scheduler = None, update: Update = False, json: Json = False,
          quiet: Quiet = False) -> None:
    """Draw and label many pictures: every pose in every view, of every face and person, in every light.

    For example: facegen batch --poses "happiness,6C+12D" --views "0,0 30,0" -o set
    """
    if output is None:
        raise InputError("-o: say which folder the pictures go to, for example -o set")
    lists = {"poses": poses, "faces": faces, "people": people, "lights": lights, "sizes": sizes}
    asked: dict[str, Any] = {key: [part.strip() for part in text.split(",")] for key, text in lists.items()
                             if text is not None}
    asked |= {key: text.split() for key, text in (("views", views), ("backgrounds", backgrounds)) if text is not None}
    if intensities is not None:
        asked["intensities"] = [_number(part) for part in intensities.split(",")]
    asked |= {key: value for key, value in (("format", format), ("masks", masks), ("feature_points", feature_points))
              if value}
    if (jobs is None) == (not asked):
        raise InputError("say what to draw: either a jobs file or --poses and the other lists"
                         + (f", not both (--{next(iter(asked)).replace('_', '-')})" if asked else ""))
    from facegen.jobs.batch import run_batch
    from facegen.jobs.spec import read_batch

    work = read_batch(jobs if jobs is not None else asked)
    if not quiet:
        for warning in work.warnings:
            print(f"facegen: warning: {warning}", file=sys.stderr)
    try:
        with progress("pictures", len(work.pictures), quiet=quiet) as step:
            done = run_batch(work, output, workers=workers, scheduler=scheduler, update=update, step=step)
    except KeyboardInterrupt:
        raise JobError("stopped; the finished pictures stay: run the same again to go on") from None
    if json:
        print_json({"folder": str(output), "manifest": str(output / done.manifest.name),
                    "pictures": len(work.pictures), "made": done.made, "kept": done.kept, "removed": done.removed,
                    "lost_workers": done.lost, "warnings": list(work.warnings)})


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise InputError(f"--intensities: expected numbers in 0..1 with commas between, got '{text}'") from None

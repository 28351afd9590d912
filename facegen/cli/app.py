"""The commands together, and what happens when one fails: a line on stderr and an exit code, no traceback."""

from __future__ import annotations

import gc
import os
import signal
import sys
from collections.abc import Sequence
from typing import Annotated

import typer

from facegen import __version__
from facegen.cli import adopt as adopting
from facegen.cli import (
    batch,
    convert,
    explain,
    figures,
    film,
    gallery,
    listing,
    phoneme,
    picture,
    play,
    speak,
)
from facegen.cli import fit as fitting
from facegen.cli import landmarks as marking
from facegen.cli import rig as rigging
from facegen.cli import stream as streaming
from facegen.cli import studio as studying
from facegen.errors import FacegenError, InputError

DONE, STOPPED, WRONG = 0, 1, 2
_INTERRUPTED = 130      # what typer makes of Ctrl-C

# The errors of a command line (an unknown option, a missing argument): typer exports only their child.
_CommandLineError = typer.BadParameter.__mro__[2]

app = typer.Typer(name="facegen", add_completion=False, rich_markup_mode=None, pretty_exceptions_enable=False,
                  pretty_exceptions_show_locals=False)
app.command("render")(picture.render)
app.add_typer(listing.app, name="list")
app.command("explain")(explain.explain)
app.command("gallery")(gallery.gallery)
app.command("batch")(batch.batch)
app.command("figures")(figures.figures)
app.command("animate")(film.animate)
app.command("morph")(film.morph)
app.command("turntable")(film.turntable)
app.command("play")(play.play)
app.command("landmarks")(marking.landmarks)
app.command("rig")(rigging.rig)
app.command("fit")(fitting.fit)
app.command("speak")(speak.speak)
app.command("phoneme")(phoneme.phoneme)
app.command("convert")(convert.convert)
app.command("adopt")(adopting.adopt)
app.command("encode")(streaming.encode)
app.command("decode")(streaming.decode)
app.command("studio")(studying.studio)


def _version(asked: bool) -> None:
    if asked:
        typer.echo(f"facegen {__version__}")
        raise typer.Exit


@app.callback(invoke_without_command=True)
def facegen(context: typer.Context,
            version: Annotated[bool, typer.Option("--version", callback=_version, is_eager=True,
                                                  help="Print the version and stop.")] = False) -> None:
    """Pictures of facial expressions from a name or a FACS script.

    Left and right are always the subject's own: L12 lifts the left corner of the subject's mouth, which a
    picture from the front shows on the right.
    """
    if context.invoked_subcommand is None:
        typer.echo(context.get_help(), err=True)
        raise typer.Exit(WRONG)


def run(argv: Sequence[str] | None = None) -> int:
    """Run one command line (default: the process's own, which then ends) and return the exit code."""
    try:
        return _run(argv)
    finally:
        if argv is None:        # a Ctrl-C more would only print a traceback from the interpreter's own end
            signal.signal(signal.SIGINT, signal.SIG_IGN)
            gc.freeze()         # which need not look for cycles: a sixth of a second


def _run(argv: Sequence[str] | None) -> int:
    for stream in (sys.stdout, sys.stderr):        # a name that a narrow console cannot show is no failure
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="replace")
    try:
        code = app(args=None if argv is None else list(argv), prog_name="facegen", standalone_mode=False)
        sys.stdout.flush()
        if code == _INTERRUPTED:
            return _say("stopped", STOPPED)
        return code if isinstance(code, int) else DONE
    except FacegenError as error:
        return _say(str(error), WRONG if isinstance(error, InputError) else STOPPED)
    except _CommandLineError as error:
        context = getattr(error, "ctx", None)
        hint = f" ({context.command_path} --help explains)" if context else ""
        return _say(f"{error.format_message().rstrip('.')}{hint}", WRONG)
    except (typer.Abort, KeyboardInterrupt):
        return _say("stopped", STOPPED)
    except BrokenPipeError:                        # `facegen list units | head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return STOPPED
    except Exception as error:
        if os.environ.get("FACEGEN_DEBUG"):
            raise
        return _say(f"a fault of facegen's own, please report it: {type(error).__name__}: {error} "
                    "(FACEGEN_DEBUG=1 shows where)", STOPPED)


def _say(message: str, code: int) -> int:
    print(f"facegen: {message}", file=sys.stderr)
    return code

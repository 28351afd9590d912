"""``facegen phoneme``: how sounds are made, slowly and from inside."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from facegen.cli.film import Rate
from facegen.cli.options import FaceName, Quiet, progress, warn
from facegen.cli.speak import Alphabet, Language
from facegen.errors import InputError

Sounds = Annotated[str | None, typer.Argument(metavar="[SOUNDS]",
                                               help='Sounds in ARPAbet ("TH") or IPA ("θ", "ʃ tʃ").')]
Out = Annotated[Path | None, typer.Option("--output", "-o", metavar="FILE",
                                          help="A film, or with --still a picture. [required]")]
Word = Annotated[str | None, typer.Option("--text", metavar="TEXT", help="A word or more instead, read by espeak-ng.")]
Slow = Annotated[float, typer.Option("--slow", metavar="FACTOR", help="How many times slower than said.")]
Still = Annotated[bool, typer.Option("--still", help="A picture of every sound at its middle.")]
Pixels = Annotated[int, typer.Option("--size", min=64, max=1024, metavar="N", help="Pixels of each view.")]


def phoneme(sounds: Sounds = None, output: Out = None, text: Word = None, language: Language = "en-us",
            alphabet: Alphabet = "auto", slow: Slow = 4.0, still: Still = False, fps: Rate = 25.0,
            size: Pixels = 256, face: FaceName = "akimoto", quiet: Quiet = False) -> None:
    """Show how sounds are made: the mouth from the front, in profile and cut open, slowly.

    For example: facegen phoneme TH -o th.gif, or facegen phoneme --text three --still -o three.webp
    """
    if output is None:
        raise InputError("-o: say where it goes, for example -o th.gif, or -o th.png with --still")
    if (sounds is None) == (text is None):
        raise InputError("expected SOUNDS or --text, one of the two, such as: facegen phoneme TH -o th.gif")
    from facegen.jobs.lesson import lesson, save_lesson, save_lesson_sheet

    made = lesson(sounds, text=text, language=language, alphabet=alphabet, slow=slow)
    if not quiet:
        warn(made.warnings)
    if still:
        save_lesson_sheet(made, output, face=face, size=size)
        return
    with progress("frames", made.frames(fps), quiet=quiet) as step:
        save_lesson(made, output, face=face, size=size, fps=fps, step=step)

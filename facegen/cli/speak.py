"""``facegen speak``: a face says something, as a film."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from facegen.cli.film import Out, Rate, Seed, Workers, film, target
from facegen.cli.options import FaceName, Json, PersonName, Quiet, Size, View, print_json, read_what, warn
from facegen.cli.picture import Background, Detail, RendererName
from facegen.errors import InputError

if TYPE_CHECKING:
    from facegen.animation.speech import Speech
    from facegen.animation.speech_script import Said

Text = Annotated[str | None, typer.Argument(metavar="[TEXT]", help="What is said; espeak-ng reads it.")]
Phonemes = Annotated[str | None, typer.Option(
    "--phonemes", metavar="SOUNDS", help='The sounds instead of a text: ARPAbet ("HH AH0 L OW1") or IPA ("həˈloʊ").')]
Timing = Annotated[Path | None, typer.Option(
    "--timing", metavar="FILE", help="When what is said: a TextGrid, Rhubarb's JSON, TSV or XML, or labels.")]
Language = Annotated[str, typer.Option("--language", "-l", metavar="CODE",
                                       help="The language of the text: en-us, en-gb, de, fr, es, it, ja, ...")]
Alphabet = Annotated[str, typer.Option("--alphabet", help="auto, arpabet, ipa or xsampa.")]
TierName = Annotated[str | None, typer.Option("--tier", metavar="NAME", help="The tier of a TextGrid.")]
Speed = Annotated[float, typer.Option("--speed", metavar="FACTOR", help="How fast; 1 is calm.")]
Recording = Annotated[Path | None, typer.Option(
    "--sound", metavar="WAV", help="A recording that goes with --timing or --phonemes.")]
Meanwhile = Annotated[str | None, typer.Option(
    "--expression", "-e", metavar="WHAT", help="What the face shows meanwhile: happiness, 1C+4B, ...")]
Effort = Annotated[float, typer.Option("--effort", metavar="0..2", help="How wide the mouth opens; 1 is calm speech.")]


def speak(text: Text = None, output: Out = None, phonemes: Phonemes = None, timing: Timing = None,
          sound: Recording = None, language: Language = "en-us", speed: Speed = 1.0, alphabet: Alphabet = "auto",
          tier: TierName = None, expression: Meanwhile = None, effort: Effort = 1.0, idle: Seed = None,
          fps: Rate = 25.0, size: Size = "512", view: View = "0,0", renderer: RendererName = "auto",
          face: FaceName = "akimoto", person: PersonName = None, background: Background = "plain",
          detail: Detail = None, workers: Workers = None, json: Json = False, quiet: Quiet = False) -> None:
    """Draw a face that says something, with sound in .mp4 and .webm; .glb moves blendshapes.

    For example: facegen speak "Hello, how are you?" -o hello.mp4 --expression happiness --idle 7. With --json and
    without -o nothing is drawn: the sounds, their times and visemes are printed.
    """
    if output is None and not json:
        target(output)
    if sum(one is not None for one in (text, phonemes, timing)) != 1:
        raise InputError("expected TEXT, --phonemes or --timing, one of the three, such as: "
                         'facegen speak "Hello" -o hello.mp4')
    from facegen.animation.speech_script import say, speech_clip

    said = say(text=text, phonemes=phonemes, timing=timing, language=language, speed=speed, alphabet=alphabet,
               tier=tier, sound=sound)
    meaning = None if expression is None else read_what(expression, person=person, intensity=1.0, quiet=quiet)
    clip = speech_clip(said, effort=effort, expression=meaning, idle=idle)
    told = speech_data(said.speech) if json else {}
    if output is None:
        if not quiet:
            warn(clip.warnings)
        print_json(told)
        return
    if not quiet:
        warn(_unheard(said, output))
    film(clip, output, fps=fps, size=size, view=view, renderer=renderer, face=face, background=background,
         detail=detail, workers=workers, json=json, quiet=quiet, about=told)


def speech_data(speech: Speech) -> dict[str, Any]:
    """Return speech as plain data, which ``--timing`` reads again."""
    from facegen.animation.speech import parts_of

    made = []
    for one in speech.sounds:
        names = one.phoneme.visemes
        made.append({"start": round(one.start, 4), "end": round(one.end, 4),
                     "sound": "sil" if one.is_pause else one.phoneme.symbol, "label": one.label, "stress": one.stress,
                     "visemes": [{"start": round(start, 4), "end": round(end, 4),
                                  "viseme": names[min(k, len(names) - 1)]} for start, end, k in parts_of(one)]})
    return {"duration": round(speech.duration, 4), "about": dict(speech.about), "sounds": made,
            "warnings": list(speech.warnings)}


def _unheard(said: Said, output: Path) -> list[str]:
    """Return what to warn of where a film cannot have the sound that there is."""
    from facegen.fileio.video import FORMATS

    form = FORMATS.get(output.suffix.lower())
    silent = said.sound is not None and (form is None or not form.sound)
    return [f"{output.suffix or 'a folder of pictures'} holds no sound; .mp4 and .webm do"] if silent else []

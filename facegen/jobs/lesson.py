"""How sounds are made, for those who learn them: the mouth from the front, in profile and cut open, slowly.

The use that Akimoto, Mase and Suenaga 1986 foresee in their discussion: teaching, such as pronunciation.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from facegen.animation.clip import Clip
from facegen.animation.coarticulation import SpeechTrack
from facegen.animation.phonemes import Sound, read_sounds
from facegen.animation.speech import Speech, TimedSound, parts_of, speech_of
from facegen.animation.speech_script import LANGUAGE, say
from facegen.animation.speech_table import PAUSE, load_speech_table
from facegen.errors import InputError
from facegen.face.face import load_face
from facegen.face.rig import Rig
from facegen.fileio.images import captioned, save_image
from facegen.fileio.textfile import check_place
from facegen.fileio.video import check_film, save_video
from facegen.geometry.camera import frame
from facegen.geometry.section import half_of
from facegen.render.dress import dressed
from facegen.render.render import Renderer, render
from facegen.render.scene import Scene

STILLS = (".png", ".webp", ".jpg", ".jpeg")
MOST_STILLS = 200
"""Pictures on one sheet."""

_BETWEEN = "ə"              # what a consonant alone is said between
# The box that the views show, in mouth widths from the middle between the corners.
_SIDE, _BELOW, _ABOVE, _BEHIND, _BEFORE = 0.85, 1.05, 0.9, 1.3, 0.6
_CORNERS = ("mouth_corner_L", "mouth_corner_R")


@dataclass(frozen=True, eq=False)
class Lesson:
    """Speech slowed down. ``shown``: which of its sounds are the lesson, not what they are said between."""

    speech: Speech
    shown: tuple[int, ...]
    slow: float

    @property
    def warnings(self) -> tuple[str, ...]:
        """What was odd about the speech."""
        return self.speech.warnings

    @property
    def clip(self) -> Clip:
        """The speech as a clip of a face that does nothing else."""
        return Clip((SpeechTrack("speech", self.speech),), self.speech.duration)

    def frames(self, fps: float) -> int:
        """Return how many frames it has."""
        return self.clip.frames(fps)

    def caption(self, t: float) -> str:
        """Return what is said at a time: the sound and how it is made."""
        one = next((one for one in self.speech.sounds if one.start <= t < one.end and not one.is_pause), None)
        return "" if one is None else _caption(one)


def lesson(sounds: str | None = None, *, text: str | None = None, language: str = LANGUAGE, alphabet: str = "auto",
           slow: float = 4.0) -> Lesson:
    """Return a lesson of sounds, or of a text that espeak-ng reads, ``slow`` times slower.

    Sounds between commas are said together. One alone is shown by itself, a consonant between two short vowels; so are
    consonants without any vowel. Raises NotationError, InputError.
    """
    if (sounds is None) == (text is None):
        raise InputError("expected sounds or text, one of the two")
    if text is not None:
        speech = say(text=text, language=language).speech
        return Lesson(speech.slower(slow), _said(speech), slow)
    table = load_speech_table()
    between, pause = Sound(table.phonemes[_BETWEEN], _BETWEEN), Sound(table.pause, PAUSE)
    row: list[Sound] = []
    shown: list[int] = []
    for group in _groups(read_sounds(sounds, alphabet)):
        alone = len({one.phoneme.is_vowel for one in group}) == 1
        for together in ([one] for one in group) if alone else [group]:
            framed = alone and not group[0].phoneme.is_vowel
            row += ([pause] if row else []) + ([between] if framed else [])
            shown += range(len(row), len(row) + len(together))
            row += together + ([between] if framed else [])
    return Lesson(speech_of(row).slower(slow), tuple(shown), slow)


def save_lesson(made: Lesson, path: str | os.PathLike[str], *, face: str | os.PathLike[str] = "akimoto",
                size: int = 256, fps: float = 25.0, step: Callable[[], None] | None = None) -> Path:
    """Draw a lesson as a film: three views side by side, ``size`` pixels each, and what is said below. FileError."""
    path = Path(path)
    views = _Views(face, size)
    check_film(path, size=(3 * size, size + views.strip), fps=fps)
    clip = made.clip

    def frames() -> Iterator[NDArray[np.uint8]]:
        for t in clip.times(fps):
            yield views.draw(clip.at(t), made.caption(t))
            if step is not None:
                step()

    return save_video(frames(), path, fps=fps)


def save_lesson_sheet(made: Lesson, path: str | os.PathLike[str], *, face: str | os.PathLike[str] = "akimoto",
                      size: int = 256, columns: int = 1) -> Path:
    """Draw the sounds of a lesson as one picture, each at its middle: a row of three views for each. FileError."""
    path = check_place(path, STILLS)
    parts = [(one, (start + end) / 2) for one in (made.speech.sounds[k] for k in made.shown)
             for start, end, _ in parts_of(one)]
    if len(parts) > MOST_STILLS:
        raise InputError(f"sounds: expected {MOST_STILLS} pictures at most on one sheet, got {len(parts)}")
    views, clip = _Views(face, size), made.clip
    rows = [views.draw(clip.at(t), _caption(one)) for one, t in parts]
    rows += [np.full_like(rows[0], 255)] * (-len(rows) % columns)
    sheet = [np.concatenate(rows[k: k + columns], axis=1) for k in range(0, len(rows), columns)]
    save_image(np.concatenate(sheet), path)
    return path


class _Views:
    """Draws one face's mouth in three views."""

    def __init__(self, face: str | os.PathLike[str], size: int) -> None:
        if isinstance(size, bool) or not isinstance(size, int) or not 32 <= size <= 1024:
            raise InputError(f"size: expected whole pixels of each view, 32..1024, got {size!r}")
        self.rig: Rig = load_face(face)
        self.strip = 2 * max(8, round(size / 20))
        self.detail = 2
        mesh = self.rig.mesh(self.detail)
        around = _mouth(self.rig, mesh.vertices, self.detail)
        front, side = (frame(around, size=(size, size), view=view) for view in ((0.0, 0.0), (90.0, 0.0)))
        self.scene = dressed(Scene(), self.rig, mesh)
        self.front = Renderer(mesh, camera=front, scene=self.scene)
        self.side = Renderer(mesh, camera=side, scene=self.scene)
        self.half, self.camera = half_of(mesh), side

    def draw(self, pose: Any, caption: str) -> NDArray[np.uint8]:
        """Return the three views of a pose side by side, with a line below."""
        vertices = self.rig.pose(pose, detail=self.detail)
        views = [self.front.draw(vertices), self.side.draw(vertices),
                 render(self.half.posed(vertices), camera=self.camera, scene=self.scene)]
        return captioned(np.concatenate(views, axis=1), caption, self.strip)


def _mouth(rig: Rig, vertices: NDArray[np.float64], detail: int) -> NDArray[np.float64]:
    """Return the corners (8, 3) of a box round the mouth."""
    places = rig.landmark_points(vertices, detail=detail)
    missing = [name for name in _CORNERS if name not in places]
    if missing:
        raise InputError(f"face: {rig.name} has no landmark {' and '.join(missing)}, so its mouth cannot be found")
    left, right = (np.asarray(places[name]) for name in _CORNERS)
    middle, width = (left + right) / 2, float(np.linalg.norm(left - right))
    return np.array([middle + width * np.array([x, y, z])
                     for x in (-_SIDE, _SIDE) for y in (-_BELOW, _ABOVE) for z in (-_BEHIND, _BEFORE)])


def _groups(sounds: list[Sound]) -> list[list[Sound]]:
    """Return what stands between pauses."""
    made: list[list[Sound]] = [[]]
    for one in sounds:
        if one.label == PAUSE:
            made.append([])
        else:
            made[-1].append(one)
    return [group for group in made if group]


def _said(speech: Speech) -> tuple[int, ...]:
    return tuple(k for k, one in enumerate(speech.sounds) if not one.is_pause)


def _caption(one: TimedSound) -> str:
    codes = [code for code in one.phoneme.arpabet if code.isalpha()]
    names = dict.fromkeys([one.phoneme.symbol, *codes[:1]])
    return f"{'  '.join(names)}   {one.phoneme.about}"

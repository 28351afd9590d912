"""Frames of a stream as pictures, each as soon as it comes."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from facegen.animation.meaning import Meaning
from facegen.codec.decoder import Frame
from facegen.codec.dictionary import Dictionary
from facegen.errors import FileError
from facegen.face.face import load_face
from facegen.fileio.images import without_full_alpha, write_whole
from facegen.fileio.textfile import make_folder
from facegen.render.live import Live

_LEVEL = 1                  # of PNG compression: what is live must be quick
_MARGIN = 1.12              # of the head's extent in the picture, so that it may turn
_NO_SHAPE = ("12",)         # stays at rest, in a stream of head and gaze only


class LivePictures:
    """Draws frames into a folder, ``frame_00001.png`` and on, by the frame's number in the stream.

    A frame without a face shows the last that had one. ``warnings``: what the face cannot show, once it is known. The
    folder must hold no such pictures yet: FileError. The rest is as for `Live`. ::

        pictures = LivePictures("frames", face="cat.glb")
        for frame in decoder.push(packet):
            pictures.draw(frame, decoder.dictionary)
    """

    def __init__(self, folder: str | os.PathLike[str], *, face: str | os.PathLike[str] = "akimoto",
                 size: int | tuple[int, int] = 512, view: tuple[float, float] = (0.0, 0.0), detail: int | None = None,
                 renderer: str = "auto") -> None:
        self.folder, self.rig = Path(folder), load_face(face)
        if any(self.folder.glob("frame_*.png")):
            raise FileError(f"{self.folder}: holds frames already; choose another folder or remove them")
        neutral = self.rig.mesh(0).vertices
        middle = (neutral.min(axis=0) + neutral.max(axis=0)) / 2
        self._wishes = {"size": size, "view": view, "detail": detail, "renderer": renderer,
                        "around": middle + _MARGIN * (neutral - middle)}
        self._live = self._made("units", _NO_SHAPE)         # wrong wishes are said, and code is compiled, before
        make_folder(self.folder)
        self.warnings: tuple[str, ...] = ()
        self._of: Dictionary | None = None
        self._shapes_look = self._shapes_turn = False

    def draw(self, frame: Frame, dictionary: Dictionary) -> Path:
        """Draw a frame of a stream and return its picture's path; InputError if the face can show none of its names."""
        from PIL import Image

        if dictionary is not self._of:
            self._prepare(dictionary)
        weights = frame.weights if len(frame.weights) else np.zeros(len(_NO_SHAPE))
        pixels = self._live.draw(weights, head=None if self._shapes_turn else frame.head,
                                 gaze=None if self._shapes_look else frame.gaze)
        path = self.folder / f"frame_{frame.number + 1:05d}.png"
        write_whole(Image.fromarray(without_full_alpha(pixels)), path, "frame", compress_level=_LEVEL)
        return path

    def _prepare(self, dictionary: Dictionary) -> None:
        """Make ready for a stream's names. Shapes that turn head or eyes go before angles, as in a film of them."""
        self._of = dictionary
        if dictionary.names:
            self._live = self._made(dictionary.vocabulary, dictionary.names)
            meaning = Meaning(dictionary.vocabulary, dictionary.names)
            self._shapes_look, self._shapes_turn = (bool(meaning.columns(what).any()) for what in ("looks", "turns"))
        self.warnings = self._live.warnings

    def _made(self, vocabulary: str, names: tuple[str, ...]) -> Live:
        return Live(self.rig, vocabulary, names=names, **self._wishes)

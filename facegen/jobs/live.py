"""Frames of a stream as pictures, each as soon as it comes."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from facegen.animation.driver import Driver
from facegen.codec.decoder import Frame
from facegen.codec.dictionary import Dictionary
from facegen.errors import FileError
from facegen.face.face import load_face
from facegen.fileio.images import without_full_alpha, write_whole
from facegen.fileio.textfile import make_folder
from facegen.render.backends import warm
from facegen.render.render import Renderer

_LEVEL = 1                  # of PNG compression: what is live must be quick
_MARGIN = 1.12              # of the head's extent in the picture, so that it may turn


class LivePictures:
    """Draws frames into a folder, ``frame_00001.png`` and on, by the frame's number in the stream.

    A frame without a face shows the last that had one. ``warnings``: what the face cannot show, once it is known. The
    folder must hold no such pictures yet: FileError. The rest is as for `Renderer`. ::

        live = LivePictures("frames", face="cat.glb")
        for frame in decoder.push(packet):
            live.draw(frame, decoder.dictionary)
    """

    def __init__(self, folder: str | os.PathLike[str], *, face: str | os.PathLike[str] = "akimoto",
                 size: int | tuple[int, int] = 512, view: tuple[float, float] = (0.0, 0.0), renderer: str = "auto"
                 ) -> None:
        self.folder, self.rig = Path(folder), load_face(face)
        if any(self.folder.glob("frame_*.png")):
            raise FileError(f"{self.folder}: holds frames already; choose another folder or remove them")
        neutral = self.rig.mesh(0).vertices
        middle = (neutral.min(axis=0) + neutral.max(axis=0)) / 2
        self.renderer = Renderer(self.rig, size=size, view=view, renderer=renderer,
                                 around=middle + _MARGIN * (neutral - middle))
        warm(self.renderer.renderer, coloured=self.renderer.mesh.colours is not None)
        make_folder(self.folder)
        self.warnings: tuple[str, ...] = ()
        self._driver: Driver | None = None
        self._vertices: Any = None

    def draw(self, frame: Frame, dictionary: Dictionary) -> Path:
        """Draw a frame of a stream and return its picture's path; InputError if the face can show none of its names."""
        from PIL import Image

        if self._driver is None:
            self._driver = Driver(self.rig, dictionary.vocabulary, dictionary.names, detail=self.renderer.detail or 0)
            self.warnings = self._driver.check(head=frame.head is not None, gaze=frame.gaze is not None)
        if np.isfinite(frame.weights).all():
            self._vertices = self._driver.vertices(
                frame.weights, None if self._driver.turning.any() else _known(frame.head),
                None if self._driver.looking.any() else _known(frame.gaze))
        path = self.folder / f"frame_{frame.number + 1:05d}.png"
        pixels = without_full_alpha(self.renderer.draw(self._vertices))
        write_whole(Image.fromarray(pixels), path, "frame", compress_level=_LEVEL)
        return path


def _known(angles: NDArray[np.float64] | None) -> NDArray[np.float64] | None:
    return angles if angles is not None and np.isfinite(angles).all() else None

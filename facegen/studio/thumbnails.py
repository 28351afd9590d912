"""Small pictures of expressions on a face, drawn by our own renderer when they are asked for, and kept on disk.

A picture is known by what is in it: the face's own shape and movements, and the units. So a changed table, another
version or another person makes another, and nothing is ever stale.
"""

from __future__ import annotations

import base64
import hashlib
import io
import itertools
import os
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from facegen.errors import FacegenError
from facegen.facs.notation import canonical
from facegen.fileio.textfile import make_folder, whole_file
from facegen.geometry.camera import Camera, frame
from facegen.render.dress import portrait
from facegen.studio.latest import Latest

SIZE = 88
"""Pixels of a thumbnail: four stand beside each other in a panel, sharp on a fine screen too."""

# What a face shows of itself in its digest: every part of it moves.
_PROBE = "1D+4C+9C+12E+20C+26E+43B+63B"
_VIEW = (6.0, 0.0)
_DETAIL = 1
_FINE = 2               # pixels drawn for one that is kept, each way
_SHOWN = ("brow_", "eye_", "nose_", "mouth_", "chin")
_ROOM = np.array([4.0, 9.0, 0.0])       # mm round those
_BACKGROUND = (236, 236, 236)


def face_digest(rig: Any) -> str:
    """Return what tells a face from any other: its shape, colours, and how it moves."""
    mesh = rig.mesh(_DETAIL)
    found = hashlib.sha256(f"{rig.name} {SIZE} {_VIEW} {_close(rig)} {sorted((rig.colours or {}).items())}".encode())
    for part in (mesh.vertices, mesh.faces, mesh.face_materials, rig.pose(_PROBE, detail=_DETAIL)):
        found.update(np.ascontiguousarray(part).tobytes())
    return found.hexdigest()[:16]


def _close(rig: Any) -> Camera:
    """Return a camera that shows what moves, from brow to chin; all of a face that does not say where that is."""
    vertices = rig.mesh(_DETAIL).vertices
    places = rig.landmark_points(vertices, detail=_DETAIL)
    shown = [at for name, at in places.items() if name.startswith(_SHOWN)]
    if len(shown) < 3:
        return frame(portrait(rig, vertices), size=(_FINE * SIZE,) * 2, view=_VIEW)
    low, high = np.min(shown, axis=0) - _ROOM, np.max(shown, axis=0) + _ROOM
    return frame(np.array(list(itertools.product(*zip(low, high, strict=True)))), size=(_FINE * SIZE,) * 2, view=_VIEW)


class Thumbnails:
    """Pictures below a folder. `ask` for them; a thread draws the latest asked for."""

    def __init__(self, folder: str | os.PathLike[str], fault: Callable[[Exception], None]) -> None:
        self._folder = Path(folder)
        self._latest = Latest("thumbnails", fault)

    def ask(self, rig: Any, wanted: Mapping[str, Mapping[str, float]], ready: Callable[[str, str], None]) -> None:
        """Have ``ready(name, data_url)`` called for every name -> units, in order; what was asked before is dropped."""
        self._latest.ask(partial(self._draw, rig, list(wanted.items()), ready))

    def settle(self, timeout: float = 60.0) -> bool:
        """Wait until all that was asked for is there."""
        return self._latest.settle(timeout)

    def close(self) -> None:
        """End its thread."""
        self._latest.close()

    def _draw(self, rig: Any, wanted: list[tuple[str, Mapping[str, float]]], ready: Callable[[str, str], None]) -> None:
        folder, renderer = self._folder / face_digest(rig), None
        for name, units in wanted:
            if self._latest.replaced:
                return
            script = canonical(units)
            path = folder / f"{hashlib.sha256(script.encode()).hexdigest()[:24]}.jpg"
            try:
                picture = path.read_bytes()
            except OSError:
                if renderer is None:
                    from facegen.render.render import Renderer

                    renderer = Renderer(rig, camera=_close(rig), detail=_DETAIL, threads=1, background=_BACKGROUND)
                pixels = renderer.draw(rig.pose(units or "neutral", detail=_DETAIL))
                picture = self._keep(pixels, path)
            ready(name, "data:image/jpeg;base64," + base64.b64encode(picture).decode())

    def _keep(self, pixels: Any, path: Path) -> bytes:
        """Return a picture as JPEG, kept if the disk lets us."""
        buffer = io.BytesIO()
        Image.fromarray(pixels[..., :3]).reduce(_FINE).save(buffer, "JPEG", quality=85)
        try:
            make_folder(path.parent)
            with whole_file(path) as draft:
                draft.write_bytes(buffer.getvalue())
        except FacegenError:
            pass                        # a full disk costs time, not the picture
        return buffer.getvalue()

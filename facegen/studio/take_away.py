"""What a person takes away from the Face tab: a picture, the movements as a file, the command that draws it again."""

from __future__ import annotations

import io
import shlex
from typing import Any

import numpy as np
from PIL import Image

from facegen.errors import InputError
from facegen.face.face import Face
from facegen.facs.expressions import Resolution
from facegen.facs.yamltext import yaml_text
from facegen.studio.page import Page
from facegen.studio.raw import whole_pose
from facegen.studio.work import FaceWork, Work

_SIZES = ("256", "512", "1024", "2048", "1920x1080")
_USUAL = FaceWork()


def command(face: FaceWork, *, size: str = "512", raw: str = "face.yaml", rig: str | None = None,
            person: str | None = None) -> str:
    """Return the command line that draws the face of a work; raw movements are in a file, which goes with it."""
    what = raw if face.raw or face.gaze else face.script
    parts = ["facegen", "render", what]
    parts += ["--face", rig or face.rig] if face.rig != _USUAL.rig else []
    parts += ["--person", person or face.person] if face.person and what != raw else []
    # A file holds the movements as they are shown, intensity and all.
    parts += ["--intensity", f"{face.intensity:g}"] if face.intensity != 1.0 and what != raw else []
    parts += ["--size", size] if size != "512" else []
    return shlex.join([*parts, "-o", "face.png"])


def movements(face: FaceWork, meaning: Resolution, rig: Any) -> str:
    """Return all that moves as the text of a deformation file: units, raw movements and gaze in one.

    InputError where nothing moves, and on an avatar where raw movements are in another unit of length.
    """
    every = meaning.deformation, *meaning.more
    found = whole_pose(rig if isinstance(rig, Face) else None, *every, units=meaning.deformation.units)
    if not found:
        raise InputError("file: nothing moves yet, so there is nothing to save")
    about = f"{face.script} on the face {face.rig}" + (f", as {face.person} does it" if face.person else "")
    about += f", at intensity {face.intensity:g}" if face.intensity != 1.0 else ""
    return yaml_text({"about": about, "source": "facegen studio", **found.as_dict()})


def picture(rig: Any, meaning: Resolution, size: str, view: tuple[float, float] = (0.0, 0.0)) -> bytes:
    """Return the face as facegen's renderer draws it, a PNG. size: "512" or "640x480"."""
    from facegen.render.render import render
    from facegen.render.wishes import parse_size

    pixels = render(rig, meaning, size=parse_size(size), view=view)
    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, "PNG")
    return buffer.getvalue()


def view_of(camera: Any) -> tuple[float, float]:
    """Return the yaw and pitch, degrees, from which a camera of the scene looks."""
    x, y, z = np.asarray(camera.position, float) - np.asarray(camera.look_at, float)
    return float(np.degrees(np.arctan2(x, z))), float(np.degrees(np.arctan2(y, np.hypot(x, z))))


class TakeAway:
    """Buttons and a text to copy."""

    def __init__(self, page: Page) -> None:
        self._page = page
        gui = page.client.gui
        with gui.add_folder("Take away", expand_by_default=False):
            self._size = gui.add_dropdown("Size", _SIZES, initial_value="1024", hint="Pixels of the picture.")
            self._as = gui.add_dropdown("Seen", ("as here", "from the front"), initial_value="as here")
            gui.add_button("Picture (PNG)", icon=None).on_click(page.calls(self._picture))
            gui.add_button("Movements (YAML)", hint="A deformation file: facegen render face.yaml draws it."
                           ).on_click(page.calls(self._movements))
            self._command = gui.add_text("Command", "", multiline=True,
                                         hint="Draws the same from a terminal. Copy it from here.")
            self._size.on_update(page.calls(lambda: self.refresh(page.work)))

    def _picture(self) -> None:
        view = view_of(self._page.client.camera) if self._as.value == "as here" else (0.0, 0.0)
        data = picture(self._page.rig, self._page.meaning(), self._size.value, view)
        self._page.client.send_file_download("face.png", data, save_immediately=True)

    def _movements(self) -> None:
        text = movements(self._page.work.face, self._page.meaning(), self._page.rig)
        self._page.client.send_file_download("face.yaml", text.encode(), save_immediately=True)

    def refresh(self, work: Work) -> None:
        """Show the command of a work."""
        face, desk, name = work.face, self._page.desk, self._page.name
        own = face.person is not None and face.person.endswith(".yaml")
        self._command.value = command(face, size=self._size.value, rig=desk.face_file(face.rig, name),
                                      person=str(desk.person_file(face.person, name)) if own else None)

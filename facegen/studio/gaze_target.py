"""A point in the scene that the eyes look at, to be dragged."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from facegen.studio.figure import SCALE
from facegen.studio.page import FACE, Page
from facegen.studio.work import FaceWork

_NAME = "/gaze"
_AHEAD = 180.0          # mm in front of the face: near enough to see, far enough to look at
_COLOUR = (61, 122, 158)
_RADIUS, _HANDLES = 0.055, 0.35      # in the scene


class GazeTarget:
    """A switch, the point, and a button that puts it where the viewer is."""

    def __init__(self, page: Page) -> None:
        self._page = page
        self._handles: tuple[Any, ...] = ()
        gui = page.client.gui
        self._on = gui.add_checkbox("Eyes follow a point", bool(page.work.face.gaze),
                                    hint="A blue point stands before the face. Drag it: both eyes look at it, whatever "
                                         "else moves them, and converge on what is near.")
        self._on.on_update(page.calls(self._switched))
        self._me = gui.add_button_group("Point", ("look at me", "straight ahead"))
        self._me.on_click(page.calls(self._put))

    def _switched(self) -> None:
        self._look(self._ahead() if self._on.value else None, "eyes follow a point" if self._on.value else "gaze free")

    def _put(self) -> None:
        if self._me.value == "straight ahead":
            self._look(self._ahead(), "look ahead")
            return
        figure = self._page.stage.figures[FACE]
        self._look(figure.unplace(self._page.client.camera.position), "look at me")

    def _ahead(self) -> np.ndarray:
        """Return a point before the middle of the eyes, mm."""
        centres = self._page.rig.eye_centres
        middle = np.zeros(3) if centres is None else centres.mean(axis=0)
        return middle + np.array([0.0, 0.0, _AHEAD])

    def _dragged(self) -> None:
        point = self._page.stage.figures[FACE].unplace(self._handles[0].position)
        self._look(point, "gaze", thing="gaze")

    def _look(self, point: np.ndarray | None, label: str, *, thing: str | None = None) -> None:
        gaze = {} if point is None else dict(zip("xyz", np.round(point, 2).tolist(), strict=True))
        self._page.change(label, thing=thing, face=replace(self._page.work.face, gaze=gaze))

    def refresh(self, face: FaceWork) -> None:
        """Show the point of a work, or take it away."""
        known = self._page.rig.eye_centres is not None
        self._on.disabled = not known
        self._on.value = bool(face.gaze)
        self._me.visible = bool(face.gaze)
        if not (face.gaze and known):
            for handle in self._handles:
                handle.remove()
            self._handles = ()
            return
        place = self._page.stage.figures[FACE].place([face.gaze[axis] for axis in "xyz"])
        if not self._handles:
            scene = self._page.client.scene
            control = scene.add_transform_controls(_NAME, scale=_HANDLES, disable_rotations=True, depth_test=False,
                                                   line_width=3.0, position=place)
            ball = scene.add_icosphere(f"{_NAME}/point", radius=_RADIUS, color=_COLOUR, cast_shadow=False,
                                       receive_shadow=False)
            control.on_update(self._page.calls(self._dragged))
            self._handles = (control,)
            self._ball = ball                   # goes with its parent
        elif not np.allclose(np.asarray(self._handles[0].position), place, atol=0.01 * SCALE):
            self._handles[0].position = place

"""The picture of one page: figures in viser's scene, drawn by a thread of their own, the latest pose first.

A slider that is dragged asks for sixty poses a second. What is asked for while one is worked out replaces what waited:
nothing queues, here or on the wire (viser keeps the latest update of each mesh).
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from facegen.geometry.mesh import Mesh
from facegen.studio.figure import SCALE, Figure
from facegen.studio.latest import Latest

Array = NDArray[np.float64]
Pose = Callable[[], Array]

LEAST = 1 / 30
"""Seconds from picture to picture: a browser shows no more, and the wire is not filled."""

DISTANCE = 700.0
"""Millimetres from the middle of a face to the camera, in front of it."""

_LENS = float(np.radians(28.0))         # that of a portrait
HALF_ANGLE = float(np.tan(_LENS / 2.0))
"""What the lens sees to each side of a square picture, for each mm of distance."""

_MIDDLE = (0.0, -15.0, 0.0)
_NEAR = 0.5             # of the scene: nearer would cost the depth its exactness
_BACKGROUND = 236


def set_scene(server: Any) -> None:
    """Give all pages of a viser server their light and where their camera begins: before any comes, for what is sent
    to a page that has just come may be overtaken by the page's own beginning."""
    scene = server.scene
    scene.set_up_direction("+y")
    scene.configure_default_lights(enabled=False)
    scene.configure_environment_map(hdri=None)
    scene.set_background_image(np.full((2, 2, 3), _BACKGROUND, np.uint8), format="png")
    scene.add_light_ambient("/lights/all", color=(255, 250, 245), intensity=1.1)
    for name, place, strength in (("key", (-3.0, 5.0, 7.0), 2.2), ("fill", (6.0, 1.0, 5.0), 0.9),
                                  ("rim", (0.0, 4.0, -7.0), 0.7)):
        scene.add_light_directional(f"/lights/{name}", color=(255, 252, 248), intensity=strength, position=place)
    camera, (position, at) = server.initial_camera, _view(_MIDDLE)
    camera.up, camera.position, camera.look_at, camera.fov, camera.near = (0.0, 1.0, 0.0), position, at, _LENS, _NEAR


def _view(at: ArrayLike, yaw: float = 0.0, pitch: float = 0.0, distance: float = DISTANCE
          ) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    """Return where the camera stands and looks, in the scene."""
    yaw, pitch = np.radians(yaw), np.radians(pitch)
    way = np.array([np.sin(yaw) * np.cos(pitch), np.sin(pitch), np.cos(yaw) * np.cos(pitch)])
    middle = np.asarray(at, np.float64) * SCALE
    return tuple((middle + way * distance * SCALE).tolist()), tuple(middle.tolist())


class Stage:
    """Figures by name. `put` and `remove` them, `request` poses; `on_shown` tells who rides along.

    fault: called with an exception that a pose raised.
    """

    def __init__(self, client: Any, fault: Callable[[Exception], None]) -> None:
        self.client = client
        self.figures: dict[str, Figure] = {}
        self._fault = fault
        self._latest = Latest("stage", fault)
        self._riders: dict[str, list[Callable[[Array], None]]] = {}
        self._wanted: dict[str, Pose] = {}
        self._asking = threading.Lock()             # who changes what is wanted
        self._drawing = threading.RLock()           # who changes figures

    def look(self, at: ArrayLike = _MIDDLE, *, yaw: float = 0.0, pitch: float = 0.0,
             distance: float = DISTANCE) -> None:
        """Turn the camera to a place, mm, from an angle, degrees: yaw to the subject's left, pitch up."""
        position, middle = _view(at, yaw, pitch, distance)
        with self.client.atomic():
            self.client.camera.position = position
            self.client.camera.look_at = middle

    # -- figures ------------------------------------------------------------------------------------------------
    def put(self, name: str, mesh: Mesh, *, colours: Any = None, offset: ArrayLike = (0.0, 0.0, 0.0),
            opacity: float | None = None) -> Figure:
        """Stand a mesh in the scene, instead of what had the name, and return its figure."""
        with self._drawing:
            self.remove(name)
            made = Figure(self.client.scene, name, mesh, colours=colours, offset=offset, opacity=opacity)
            self.figures[name] = made
            return made

    def remove(self, name: str) -> None:
        """Take a figure away, if there is one."""
        with self._drawing:
            with self._asking:
                self._wanted.pop(name, None)
            if name in self.figures:
                self.figures.pop(name).remove()

    def request(self, name: str, pose: Pose) -> None:
        """Have a figure show what ``pose() -> vertices (n, 3)`` gives, soon; the latest request wins."""
        with self._asking:
            self._wanted[name] = pose
        self._latest.ask(self._draw)

    def on_shown(self, name: str, call: Callable[[Array], None]) -> Callable[[], None]:
        """Have ``call(vertices)`` called after a figure was shown; return what stops it."""
        riders = self._riders.setdefault(name, [])
        riders.append(call)
        return lambda: riders.remove(call) if call in riders else None

    def settle(self, timeout: float = 10.0) -> bool:
        """Wait until nothing is asked for that is not shown; return whether that came about."""
        return self._latest.settle(timeout)

    def close(self) -> None:
        """End its thread."""
        self._latest.close()

    def _draw(self) -> None:
        """Show all that is wanted."""
        with self._asking:
            wanted, self._wanted = self._wanted, {}
        begun = time.monotonic()
        for name, pose in wanted.items():
            self._show(name, pose)
        if wanted:
            time.sleep(max(LEAST - (time.monotonic() - begun), 0.0))

    def _show(self, name: str, pose: Pose) -> None:
        try:
            vertices = pose()
            with self._drawing, self.client.atomic():
                figure = self.figures.get(name)
                if figure is None or vertices.shape != figure.vertices.shape:
                    return                                  # another face has taken its place
                figure.show(vertices)
                for call in tuple(self._riders.get(name, ())):
                    call(vertices)
            self.client.flush()
        except Exception as error:
            self._fault(error)

"""Marks on a figure for landmarks: balls that can be seen, hit by a ray, and dragged."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from facegen.studio.figure import SCALE

Array = NDArray[np.float64]
Colour = tuple[int, int, int]

GREEN, BLUE, ORANGE = (46, 160, 67), (50, 110, 230), (240, 110, 30)
"""What is confirmed, what is proposed, and what is asked for or chosen."""

# A click this many radii beside a ball's middle means the ball.
_MEANT = 1.5


@dataclass(frozen=True, eq=False)
class Mark:
    """``at`` (3,), of the scene; ``colour``; ``opacity`` 0..1."""

    at: Array
    colour: Colour
    opacity: float = 1.0


class Markers:
    """The balls by landmark. dragged: gives for a landmark what is called with viser's events of its ball."""

    def __init__(self, scene: Any, dragged: Callable[[str], Callable[[Any], None]]) -> None:
        self._scene, self._dragged = scene, dragged
        self._handles: dict[str, Any] = {}
        self.marks: dict[str, Mark] = {}
        self.radius = 1.6

    def show(self, marks: Mapping[str, Mark], radius: float) -> None:
        """Show these and no others. radius: mm."""
        for name in set(self._handles) - set(marks):
            self._handles.pop(name).remove()
        for name, mark in marks.items():
            handle, before = self._handles.get(name), self.marks.get(name)
            if handle is None:
                self._handles[name] = self._made(name, mark, radius)
                continue
            if not np.array_equal(before.at, mark.at):
                handle.position = tuple(mark.at)
            if before.colour != mark.colour:
                handle.color = mark.colour
            if before.opacity != mark.opacity:
                handle.opacity = mark.opacity
            if radius != self.radius:
                handle.radius = radius * SCALE
        self.marks, self.radius = dict(marks), radius

    def move(self, name: str, at: Array) -> None:
        """Show one elsewhere, while it is dragged."""
        self._handles[name].position = tuple(at)
        self.marks[name] = Mark(at, self.marks[name].colour, self.marks[name].opacity)

    def hit(self, origin: ArrayLike, direction: ArrayLike, depth: float) -> str | None:
        """Return the landmark whose ball a ray of the scene meets; not what lies farther than ``depth``."""
        start, way = np.asarray(origin, float), np.asarray(direction, float)
        way = way / np.linalg.norm(way)
        best, found = _MEANT * self.radius * SCALE, None
        for name, mark in self.marks.items():
            along = float((mark.at - start) @ way)
            beside = float(np.linalg.norm(mark.at - start - along * way))
            if 0 < along < depth + 2 * self.radius * SCALE and beside < best:
                best, found = beside, name
        return found

    def _made(self, name: str, mark: Mark, radius: float) -> Any:
        handle = self._scene.add_icosphere(
            f"/landmarks/{name}", radius * SCALE, mark.colour, subdivisions=2, opacity=mark.opacity,
            position=tuple(mark.at), cast_shadow=False, receive_shadow=False)
        handle.on_drag(self._dragged(name))
        return handle

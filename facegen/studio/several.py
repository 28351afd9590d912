"""Several faces side by side, in place of the page's own: what a table does on each of them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from facegen.studio.page import FACE, Page
from facegen.studio.stage import DISTANCE, HALF_ANGLE

APART = 235.0
"""Millimetres from middle to middle: heads of the base face's size, ears and hair included."""


class Several:
    """Figures that stand in for the page's while ``shown``; ``names``: of the faces."""

    def __init__(self, page: Page) -> None:
        self.page = page
        self.rigs: dict[str, Any] = {}
        self.shown = False

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the faces, from left to right."""
        return tuple(self.rigs)

    def show(self, rigs: dict[str, Any]) -> None:
        """Stand faces beside each other, instead of those that stood there."""
        stage = self.page.stage
        for name in self.rigs:
            stage.remove(_figure(name))
        again = self.shown and len(rigs) == len(self.rigs)
        self.rigs, self.shown = dict(rigs), True
        self.keep()
        for k, (name, rig) in enumerate(rigs.items()):
            stage.put(_figure(name), rig.mesh(), colours=rig.colours, offset=self._offset(k))
        if not again:
            aspect = float(getattr(self.page.client.camera, "aspect", 1.0))
            stage.look(distance=max(DISTANCE, APART * len(rigs) / (2.0 * HALF_ANGLE * aspect)))

    def hide(self) -> None:
        """Have the page's own face back."""
        if not self.shown:
            return
        self.shown = False
        for name in self.rigs:
            self.page.stage.remove(_figure(name))
        self.rigs = {}
        self.page.stage.figures[FACE].visible(True)
        self.page.stage.look()

    def keep(self) -> None:
        """Keep the page's own face out of the picture: another may have been put there."""
        if self.shown and FACE in self.page.stage.figures:
            self.page.stage.figures[FACE].visible(False)

    def pose(self, meaning: Callable[[Any], Any]) -> None:
        """Have each face show what ``meaning(rig)`` gives."""
        for name, rig in self.rigs.items():
            self.page.stage.request(_figure(name), lambda rig=rig: rig.pose(meaning(rig)))

    def _offset(self, k: int) -> tuple[float, float, float]:
        return ((k - (len(self.rigs) - 1) / 2) * APART, 0.0, 0.0)


def _figure(name: str) -> str:
    return f"several/{name}"

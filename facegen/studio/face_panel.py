"""An expression by hand: units, named expressions, script."""

from __future__ import annotations

from dataclasses import replace

from facegen.facs.notation import parse
from facegen.studio.page import Page
from facegen.studio.work import Work


class FacePanel:
    """An expression by hand."""

    def __init__(self, page: Page) -> None:
        self.page = page
        gui = page.client.gui
        self._script = gui.add_text("Action units", page.work.face.script)
        self._intensity = gui.add_slider("Intensity", 0.0, 1.0, 0.01, page.work.face.intensity)
        self._script.on_update(page.calls(self._written))
        self._intensity.on_update(page.calls(self._scaled))

    def _written(self) -> None:
        self.page.change("script", face=replace(self.page.work.face, units=parse(self._script.value), blend={}))

    def _scaled(self) -> None:
        self.page.change("intensity", thing="intensity",
                         face=replace(self.page.work.face, intensity=self._intensity.value))

    def refresh(self, work: Work) -> None:
        """Show a work."""
        self._script.value = work.face.script
        self._intensity.value = work.face.intensity

    def close(self) -> None:
        """Nothing runs."""

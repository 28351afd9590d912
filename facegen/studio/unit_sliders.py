"""The action units as sliders, by region; left and right linked or apart."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

from facegen.studio import unit_rows
from facegen.studio.page import Page
from facegen.studio.work import FaceWork

_OPEN = ("Brows", "Mouth and chin")     # the regions that are looked for first


class UnitSliders:
    """One folder a region; its title says how many of its units act."""

    def __init__(self, page: Page) -> None:
        self._page = page
        self._shown: FaceWork | None = None
        gui = page.client.gui
        self._apart = gui.add_checkbox("Left and right apart", page.work.face.apart,
                                       hint="One slider for a pair, or one for each side. A unit whose sides differ "
                                            "has two in any case. Left is the subject's left.")
        self._apart.on_update(page.calls(self._split))
        self._sliders = {}
        self._folders = []
        for title, rows in unit_rows.groups():
            folder = gui.add_folder(title, expand_by_default=title in _OPEN)
            self._folders.append((folder, title, rows))
            with folder:
                for row in rows:
                    slider = gui.add_slider(row.label, 0.0, 1.0, 0.01, 0.0, hint=row.hint, marks=(),
                                            visible=not row.part)
                    slider.on_update(page.calls(partial(self._moved, row)))
                    self._sliders[row] = slider

    def _split(self) -> None:
        self._page.change("left and right apart" if self._apart.value else "left and right linked",
                          face=replace(self._page.work.face, apart=self._apart.value))

    def _moved(self, row: unit_rows.Row) -> None:
        face = self._page.work.face
        units = unit_rows.moved(row, face.units, self._sliders[row].value)
        self._page.change(row.label.lower(), thing=row.code, face=replace(face, units=units, blend={}))

    def refresh(self, face: FaceWork) -> None:
        """Show the units of a work."""
        if self._shown is not None and (face.units, face.apart) == (self._shown.units, self._shown.apart):
            return
        self._shown = face
        self._apart.value = face.apart
        for row, slider in self._sliders.items():
            slider.value = unit_rows.weight(row, face.units)
            visible = unit_rows.shown(row, face.units, apart=face.apart)
            if slider.visible != visible:
                slider.visible = visible
        for folder, title, rows in self._folders:
            acting = len({row.code.lstrip("LRTB") for row in rows if unit_rows.weight(row, face.units) > 0.0})
            label = f"{title} · {acting}" if acting else title
            if folder.label != label:
                folder.label = label

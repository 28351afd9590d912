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
        self._visible: dict[unit_rows.Row, bool] = {}
        self._titles: dict[str, str] = {}
        self._folders = []
        for title, rows in unit_rows.groups():
            folder = gui.add_folder(title, expand_by_default=title in _OPEN)
            self._folders.append((folder, title, rows))
            with folder:
                for row in rows:
                    slider = gui.add_slider(row.label, 0.0, 1.0, 0.01, 0.0, hint=row.hint, marks=(),
                                            visible=not row.part)
                    slider.on_update(page.calls(partial(self._moved, row)))
                    self._sliders[row], self._visible[row] = slider, not row.part

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
        stand = unit_rows.Stand.of(face.units, apart=face.apart)
        for row, slider in self._sliders.items():
            slider.value = stand.weight(row)
            if stand.shows(row) != self._visible[row]:          # viser takes its time to find that nothing changed
                slider.visible = self._visible[row] = stand.shows(row)
        for folder, title, rows in self._folders:
            acting = len({row.number for row in rows if stand.weight(row) > 0.0})
            label = f"{title} · {acting}" if acting else title
            if label != self._titles.get(title, title):
                folder.label = self._titles[title] = label

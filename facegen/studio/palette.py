"""The named expressions as pictures to click on, searched, and mixed.

viser's pictures cannot be clicked, its buttons can: the thumbnail stands in the button, where an icon would.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

from facegen.facs.blend import blend
from facegen.facs.expression_table import Person
from facegen.studio.page import Page
from facegen.studio.seam import set_icon
from facegen.studio.thumbnails import Thumbnails
from facegen.studio.vocabulary import plain, search, vocabulary
from facegen.studio.work import FaceWork, Work

_EMPTY = "data:image/gif;base64,R0lGODlhAQABAAAAACH5BAEKAAEALAAAAAABAAEAAAICTAEAOw=="
_SHARE = 0.5            # of an expression that joins a mixture

KEPT = "thumbnails"
"""Folder of all works that holds the pictures."""


class Palette:
    """A search box, the pictures, and a slider for each expression of a mixture."""

    def __init__(self, page: Page) -> None:
        self._page = page
        self._thumbnails = Thumbnails(page.desk.store.folder / KEPT, page.fault)
        self._person: Person | None = None
        self._rig: Any = None
        self._buttons: dict[str, Any] = {}
        self._pictures: dict[str, str] = {}
        self._shares: dict[str, Any] = {}
        self._chosen_now: frozenset[str] = frozenset()
        gui = page.client.gui
        self._folder = gui.add_folder("Expressions")
        with self._folder:
            self._search = gui.add_text("Search", "", hint="A name or another word for it: joy, crying, smirk")
            self._search.on_update(page.calls(self._searched))
            self._mix = gui.add_checkbox("Click adds to the mixture", False,
                                         hint="Off: a click shows that expression alone. On: it joins what is shown, "
                                              "or leaves it.")
            self._grid = gui.add_folder(None)
            self._none = gui.add_markdown("", visible=False)
        self._mixture = gui.add_folder("Mixture", visible=False)

    def close(self) -> None:
        """End the drawing of thumbnails."""
        self._thumbnails.close()

    # -- what the person does -----------------------------------------------------------------------------------
    def _searched(self) -> None:
        found = search(vocabulary(self._person), self._search.value)
        for name, button in self._buttons.items():
            button.visible = name in found
        self._none.visible = not found
        if not found:
            self._none.content = (f"Nothing is called *{self._search.value.strip()}*. "
                                  "Try a feeling, or write units under **Script**.")

    def _chosen(self, name: str) -> None:
        face = self._page.work.face
        if not self._mix.value or not face.blend:
            shares = {} if name == "neutral" else {name: 1.0}
        elif name in face.blend:
            shares = {other: share for other, share in face.blend.items() if other != name}
        else:
            shares = {**face.blend, name: _SHARE}
        self._show(plain(name), shares)

    def _shared(self, name: str) -> None:
        shares = {**self._page.work.face.blend, name: self._shares[name].value}
        self._show(f"share of {plain(name)}", shares, thing=f"share {name}")

    def _show(self, label: str, shares: dict[str, float], *, thing: str | None = None) -> None:
        face = self._page.work.face
        units = blend(shares, person=self._page.person())
        self._page.change(label, thing=thing, face=replace(face, units=units, blend=shares))

    # -- what is shown ------------------------------------------------------------------------------------------
    def refresh(self, work: Work) -> None:
        """Show a work: its person's words, its face's pictures, its mixture."""
        face, rig = work.face, self._page.rig
        person = self._page.person()
        if not self._buttons or person != self._person:
            self._build(person)
            self._chosen_now = frozenset()
        elif rig is not self._rig:
            self._draw()
        self._rig = rig
        for name in self._chosen_now.symmetric_difference(face.blend):
            if name in self._buttons:
                self._picture(name, self._buttons[name], on=name in face.blend)
        self._chosen_now = frozenset(face.blend)
        self._mixed(face)

    def _build(self, person: Person | None) -> None:
        """Make the buttons of a person's words."""
        self._person = person
        words = vocabulary(person)
        gui = self._page.client.gui
        for name in [name for name in self._buttons if name not in words]:
            self._buttons.pop(name).remove()
        for row, (name, one) in enumerate(words.items()):
            if name in self._buttons:
                continue
            with self._grid:
                button = gui.add_button(plain(name), hint=one.about, order=row)
            button.on_click(self._page.calls(partial(self._chosen, name)))
            self._buttons[name] = button
            self._picture(name, button, on=False)
        self._draw()
        self._searched()

    def _draw(self) -> None:
        """Have the thumbnails drawn on this face."""
        words = vocabulary(self._person)
        self._thumbnails.ask(self._page.rig, {name: words[name].units for name in self._buttons if name in words},
                             self._drawn)

    def _drawn(self, name: str, picture: str) -> None:
        with self._page.lock:
            self._pictures[name] = picture
            if name in self._buttons:
                self._picture(name, self._buttons[name], on=name in self._page.work.face.blend)

    def _picture(self, name: str, button: Any, *, on: bool) -> None:
        html = f'<img class="fg-thumb{" fg-on" if on else ""}" alt="" src="{self._pictures.get(name, _EMPTY)}">'
        set_icon(button, html)

    def _mixed(self, face: FaceWork) -> None:
        """Show the sliders of a mixture."""
        gui = self._page.client.gui
        for name in [name for name in self._shares if name not in face.blend]:
            self._shares.pop(name).remove()
        for name, share in face.blend.items():
            if name not in self._shares:
                with self._mixture:
                    slider = gui.add_slider(plain(name).capitalize(), 0.0, 1.0, 0.01, share, marks=())
                slider.on_update(self._page.calls(partial(self._shared, name)))
                self._shares[name] = slider
            self._shares[name].value = share
        if self._mixture.visible != bool(face.blend):
            self._mixture.visible = bool(face.blend)

"""What an avatar is made of, and what the person says it is instead."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from facegen.studio.page import Page
from facegen.studio.work import AvatarWork

KIND_WORDS = {
    "skin": "Skin", "eye_L": "Left eye", "eye_R": "Right eye", "teeth_upper": "Upper teeth",
    "teeth_lower": "Lower teeth", "tongue": "Tongue", "mouth": "Inside of the mouth",
    "carried": "Lies on the skin: brow, lash, beard", "skull": "Keeps still: hair, hat, horns", "body": "Body",
}
"""Kind of piece -> words."""

# More rows than these help nobody; what is smaller is said in a line.
_ROWS = 24


class PiecesView:
    """A row for each piece: what it is called, and what it is taken for."""

    def __init__(self, page: Page, folder: Any) -> None:
        self.page, self._folder = page, folder
        self._rows: list[dict[str, object]] = []
        self._handles: list[Any] = []
        gui = page.client.gui
        with folder:
            self._about = gui.add_markdown("")
            self._forget = gui.add_button("Forget corrections", color="gray")
            self._forget.on_click(page.calls(lambda: self._change({})))
        self.show([], page.work.avatar)

    def show(self, rows: list[dict[str, object]], work: AvatarWork) -> None:
        """Show rows as `describe` gives them."""
        self._forget.visible = bool(work.pieces)
        if rows == self._rows and self._handles:
            return
        self._rows = rows
        for handle in self._handles:
            handle.remove()
        self._handles = []
        more = len(rows) - _ROWS
        self._about.content = ("Each piece moves as what it is. If a guess is wrong, say what it is instead."
                               + (f" The {more} smallest are not listed." if more > 0 else "")
                               if rows else "This is known when the points of step 2 are placed.")
        with self._folder:
            for row in rows[:_ROWS]:
                self._handles.append(self._row(row))

    def _row(self, row: dict[str, object]) -> Any:
        label = str(row["name"]).split("|")[0][:28] or "a piece"
        handle = self.page.client.gui.add_dropdown(
            label, tuple(KIND_WORDS.values()), initial_value=KIND_WORDS[row["kind"]],
            hint=f"{row['triangles']:,} triangles; {row['why']}")
        handle.on_update(self.page.calls(self._chosen(row, handle)))
        return handle

    def _chosen(self, row: dict[str, object], handle: Any) -> Callable[[], None]:
        def chosen() -> None:
            kind = next(kind for kind, words in KIND_WORDS.items() if words == handle.value)
            self._rows = []                                 # what it is taken for now is to be shown, whatever that is
            own = {str(number): kind for number in row["components"]}
            self._change({**self.page.work.avatar.pieces, **own})

        return chosen

    def _change(self, pieces: dict[str, str]) -> None:
        self._rows = []
        self.page.change("say what a piece is", avatar=replace(self.page.work.avatar, pieces=pieces))

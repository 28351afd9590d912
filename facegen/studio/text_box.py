"""A box whose text means something; a wrong text stays for mending, with what is wrong below."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from facegen.errors import FacegenError
from facegen.studio.page import Page


class TextBox:
    """read(text) -> what it means, or a FacegenError; write(meaning) -> text; changed(meaning): called when a person
    wrote something else that is right."""

    def __init__(self, page: Page, label: str, value: Any, *, read: Callable[[str], Any], write: Callable[[Any], str],
                 changed: Callable[[Any], None], hint: str, multiline: bool = False) -> None:
        self._read, self._write, self._changed, self._value = read, write, changed, value
        gui = page.client.gui
        self.box = gui.add_text(label, write(value), multiline=multiline, hint=hint)
        self._wrong = gui.add_markdown("", visible=False)
        self.box.on_update(page.calls(self._written))

    def _written(self) -> None:
        before = self._value
        try:
            self._value = self._read(self.box.value)
            self._changed(self._value)
        except FacegenError as error:
            self._value = before
            # A fence keeps the caret under its place.
            self._wrong.content = "**Not shown yet**\n```\n" + str(error).replace("```", "") + "\n```"
            self._wrong.visible = True
            return
        self._wrong.visible = False

    def refresh(self, value: Any) -> None:
        """Show what something else changed; a text that means the same, or is not right yet, stays as it is."""
        if value != self._value:
            self._value = value
            self.box.value = self._write(value)
            self._wrong.visible = False

"""Above the tabs: undo and redo, with their keys, for all of a page's work."""

from __future__ import annotations

from functools import partial
from typing import Any

from facegen.studio.history import History

UNDO, REDO = "Undo", "Redo"
_NOTHING = "Nothing done yet"

_KEYS = ((UNDO, "Z", "cmd/ctrl"), (REDO, "Z", "cmd/ctrl+shift"), (REDO, "Y", "cmd/ctrl"))

# Labels get the room that words need; viser gives 7 em, in which "Lip corners straight up, left" takes five lines.
# Buttons that hold a thumbnail become its frame, side by side.
_STYLE = """<style>
div:has(> .mantine-Text-root > label) { width: 42% !important; }
div:has(> button .fg-thumb) { display: inline-block; width: 25%; margin: 0 !important;
  padding: 2px !important; vertical-align: top; }
div:has(> div > button .fg-thumb) { max-height: 330px; overflow-y: auto; line-height: 0; }
button:has(.fg-thumb) { height: auto !important; padding: 0 !important; background: none !important;
  border: 1px solid #0002 !important; overflow: hidden; }
button:has(.fg-thumb):hover, button:has(.fg-thumb):focus-visible { border-color: #b05c48 !important; }
button:has(.fg-thumb) .mantine-Button-inner { display: block; }
button:has(.fg-thumb) .mantine-Button-section { margin: 0; display: block; width: 100%; }
button:has(.fg-thumb) .mantine-Button-section * { width: 100%; height: auto; margin: 0; }
button:has(.fg-thumb) .mantine-Button-label { display: block; font-size: 10px; line-height: 12px; height: 26px;
  padding: 1px 2px; color: #333; font-weight: 450; white-space: normal; overflow: hidden; text-align: center; }
.fg-thumb { display: block; width: 100%; height: auto; aspect-ratio: 1; background: #ececec; }
pre, pre code { white-space: pre-wrap; }
button:has(.fg-on) { outline: 2px solid #b05c48; outline-offset: -1px; }
</style>"""


class Steps:
    """The two buttons; `refresh` says what they would do."""

    def __init__(self, page: Any) -> None:
        self._page = page
        gui = page.client.gui
        gui.add_html(_STYLE)
        self._buttons = gui.add_button_group(_NOTHING, (UNDO, REDO), hint="Ctrl+Z and Ctrl+Shift+Z")
        self._buttons.on_click(page.calls(lambda: self._go(self._buttons.value)))
        for label, key, modifier in _KEYS:
            command = gui.add_command(label, hotkey=key, modifier=modifier)
            command.on_trigger(page.calls(partial(self._go, label)))

    def _go(self, label: str) -> None:
        (self._page.undo if label == UNDO else self._page.redo)()

    def refresh(self, history: History) -> None:
        """Show what can be taken back."""
        label = f"Last: {history.undoes}" if history.undoes else _NOTHING
        self._buttons.label = label
        again = f"; Ctrl+Shift+Z does {history.redoes} again" if history.redoes else ""
        back = f"Ctrl+Z takes {history.undoes} back" if history.undoes else "Nothing to take back"
        self._buttons.hint = back + again

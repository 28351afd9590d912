"""The units as a FACS script, live and to be edited."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from facegen.facs.notation import canonical, parse
from facegen.studio.page import Page
from facegen.studio.text_box import TextBox
from facegen.studio.work import Work


class ScriptBox:
    """One line, and what the face warns of below it."""

    def __init__(self, page: Page) -> None:
        self._page = page
        self._text = TextBox(
            page, "Script", dict(page.work.face.units), read=parse, write=canonical, changed=self._written,
            hint="The action units in FACS notation. Paste 6C+12D or R12A+R14A: A to E from a trace to the most, L and "
                 "R the subject's sides; 0 is the face at rest.")
        self._warnings = page.client.gui.add_markdown("", visible=False)

    def _written(self, units: Mapping[str, float]) -> None:
        self._page.change("script", thing="script", face=replace(self._page.work.face, units=units, blend={}))

    def refresh(self, work: Work) -> None:
        """Show a work."""
        self._text.refresh(dict(work.face.units))
        meaning = self._page.meaning()
        content = "\n".join(f"- {warning}" for warning in (*meaning.warnings, *self._page.rig.check(meaning)))
        if self._warnings.content != content:
            self._warnings.content = content
        self._warnings.visible = bool(content)

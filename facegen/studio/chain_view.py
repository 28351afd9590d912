"""From name to movement: every step of figure 10, live, and raw movements as text to edit."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from facegen.face.chain import chain
from facegen.facs.deformation import deformation_from_dict
from facegen.facs.expressions import Resolution
from facegen.facs.yamlfile import parse_yaml
from facegen.facs.yamltext import yaml_text
from facegen.studio.chain_words import chain_markdown
from facegen.studio.latest import Latest
from facegen.studio.page import Page
from facegen.studio.text_box import TextBox
from facegen.studio.work import Work

_PAUSE = 0.15           # seconds from text to text


def read_raw(text: str) -> Mapping[str, Any]:
    """Return the raw movements that a text says in YAML, {} for none; TableError or InputError says what is wrong."""
    data = parse_yaml(text, "movements")
    return {} if data is None else deformation_from_dict(data, source="movements").as_dict()


def write_raw(raw: Mapping[str, Any]) -> str:
    """Return raw movements as the text that `read_raw` takes."""
    return yaml_text(raw).strip() if raw else ""


class ChainView:
    """The steps, and the box."""

    def __init__(self, page: Page) -> None:
        self._page = page
        self._shown: tuple[Any, ...] | None = None
        self._words = Latest("chain", page.fault)
        gui = page.client.gui
        with gui.add_folder("From name to movement", expand_by_default=False):
            self._text = gui.add_markdown("")
            self._raw = TextBox(
                page, "Raw movements", dict(page.work.face.raw), read=read_raw, write=write_raw, changed=self._moved,
                multiline=True, hint="Deformation data on top of the units, in YAML as in a deformation file: "
                                     "jaw: {open: 10}. Points that you drag stand here too.")

    def _moved(self, raw: Mapping[str, Any]) -> None:
        rig = self._page.rig
        rig.check(rig.resolve(deformation_from_dict(raw)))      # names of points that this face lacks
        self._page.change("raw movements", thing="raw", face=replace(self._page.work.face, raw=raw))

    def refresh(self, work: Work) -> None:
        """Show a work."""
        face, rig = work.face, self._page.rig
        self._raw.refresh(dict(face.raw))
        now = self._page.meaning(), dict(face.blend), rig
        if now != self._shown:
            self._shown = now
            self._words.ask(lambda: self._say(*now, face.person))

    def _say(self, meaning: Resolution, shares: Mapping[str, float], rig: Any, person: str | None) -> None:
        self._text.content = chain_markdown(chain(meaning, rig, person), shares)
        time.sleep(_PAUSE)          # nobody reads faster, and a drag goes on

    def close(self) -> None:
        """End its thread."""
        self._words.close()

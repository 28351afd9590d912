"""The script of the units, and the chain of figure 10 from name to movement, live and to be edited as text."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from facegen.errors import FacegenError
from facegen.face.chain import chain, chain_lines
from facegen.facs.deformation import deformation_from_dict
from facegen.facs.notation import parse
from facegen.facs.yamlfile import parse_yaml
from facegen.studio.page import Page
from facegen.studio.vocabulary import plain
from facegen.studio.work import FaceWork, Work


class TextBox:
    """A box whose text means something; a wrong text stays for mending, with what is wrong below.

    read(text) -> the meaning, or a FacegenError. write(meaning) -> text. changed(meaning): called when a person wrote
    something else that is right.
    """

    def __init__(self, page: Page, label: str, value: Any, *, read: Any, write: Any, changed: Any, hint: str,
                 multiline: bool = False) -> None:
        self._page, self._read, self._write, self._changed = page, read, write, changed
        self._value = value
        gui = page.client.gui
        self.box = gui.add_text(label, write(value), multiline=multiline, hint=hint)
        self._wrong = gui.add_markdown("", visible=False)
        self.box.on_update(page.calls(self._written))

    def _written(self) -> None:
        try:
            value = self._read(self.box.value)
        except FacegenError as error:
            self._say(str(error))
            return
        self._say("")
        self._value = value
        self._changed(value)

    def _say(self, wrong: str) -> None:
        if wrong:
            self._wrong.content = f"**Not shown yet:**\n```\n{wrong.replace('```', '')}\n```"
        self._wrong.visible = bool(wrong)

    def refresh(self, value: Any) -> None:
        """Show a meaning that something else changed; what the person is writing stays."""
        if value != self._value:
            self._value = value
            self.box.value = self._write(value)
            self._say("")


def read_raw(text: str) -> Mapping[str, Any]:
    """Return the raw movements that a text says in YAML, {} for none; TableError or InputError says what is wrong."""
    data = parse_yaml(text, "movements")
    if data in (None, {}):
        return {}
    return deformation_from_dict(data, source="movements").as_dict()


def write_raw(raw: Mapping[str, Any]) -> str:
    """Return raw movements as the text that `read_raw` takes."""
    import yaml

    return yaml.safe_dump(dict(raw), sort_keys=False, default_flow_style=None, width=60).strip() if raw else ""


class ScriptBox:
    """The script, what it means step by step, and the raw movements on top."""

    def __init__(self, page: Page) -> None:
        self._page = page
        self._shown: tuple[Any, ...] | None = None
        gui = page.client.gui
        with gui.add_folder("Script"):
            self._script = TextBox(
                page, "Action units", dict(page.work.face.units), read=parse, write=_script, changed=self._scripted,
                hint="FACS notation. Paste 6C+12D or R12A+R14A: A to E from a trace to the most, L and R the subject's "
                     "sides. 0 is the face at rest.")
            self._names = gui.add_markdown("")
        with gui.add_folder("From name to movement", expand_by_default=False):
            self._chain = gui.add_markdown("")
            self._raw = TextBox(
                page, "Raw movements", dict(page.work.face.raw), read=read_raw, write=write_raw, changed=self._moved,
                multiline=True, hint="Deformation data on top of the units, in YAML as in a deformation file: "
                                     "jaw: {open: 10}. Points that you drag stand here too.")

    def _scripted(self, units: Mapping[str, float]) -> None:
        self._page.change("script", thing="script", face=replace(self._page.work.face, units=units, blend={}))

    def _moved(self, raw: Mapping[str, Any]) -> None:
        self._page.rig.check(self._page.rig.resolve(deformation_from_dict(raw) if raw else "neutral"))
        self._page.change("raw movements", thing="raw", face=replace(self._page.work.face, raw=raw))

    def refresh(self, work: Work) -> None:
        """Show a work."""
        face, rig = work.face, self._page.rig
        self._script.refresh(dict(face.units))
        self._raw.refresh(dict(face.raw))
        meaning = self._page.meaning()
        now = meaning, face.blend, rig
        if now == self._shown:
            return
        self._shown = now
        data = chain(meaning, rig, face.person)
        # What reads like markup is text here.
        text = "\n".join(chain_lines(data)).replace("```", "")
        self._chain.content = f"```\n{from_names(face)}{text}\n```"
        warnings = (*meaning.warnings, *rig.check(meaning))
        self._names.content = "\n".join(f"- {warning}" for warning in warnings)
        self._names.visible = bool(warnings)


def _script(units: Mapping[str, float]) -> str:
    return FaceWork(units=units).script


def from_names(face: FaceWork) -> str:
    """Return the first step of the chain as a line: the names that made the units, if any."""
    if not face.blend:
        return ""
    names = " + ".join(f"{share:.0%} {plain(name)}" for name, share in face.blend.items())
    return f"{names}{' of ' + face.person if face.person else ''}\n  becomes\n"


"""What the clip says: a text that espeak-ng reads, or written sounds."""

from __future__ import annotations

from typing import Any

from facegen.animation.espeak import installed
from facegen.errors import InputError
from facegen.facs.expression_table import Person
from facegen.studio import timeline
from facegen.studio.keys_view import Host
from facegen.studio.work import Work

_TEXT, _SOUNDS = "A text", "Sounds"
_KEYS = {_TEXT: "text", _SOUNDS: "phonemes"}
_USUAL = "en-us"
_MISSING = ("A text needs the program **espeak-ng**, which is not installed here: `apt install espeak-ng`, `brew "
            "install espeak-ng` or `winget install espeak-ng`, then start the studio again. Sounds work without it.")
_SILENT = "Written sounds move the mouth and have no voice."


class SpeechView:
    """A text or sounds, and how they are said."""

    def __init__(self, host: Host, gui: Any) -> None:
        self._host = host
        self._shown: Any = None
        calls = host.page.calls
        self._way = gui.add_dropdown("Says", tuple(_KEYS), initial_value=_TEXT,
                                     hint="A text has a voice; sounds, such as HH AH0 L OW1 or həˈloʊ, move the mouth "
                                          "without one.")
        self._way.on_update(calls(self._show_way))
        self._words = gui.add_text("Words", "", multiline=True)
        self._language = gui.add_text("Language", _USUAL, hint="en-us, en-gb, de, fr, es, it, ja ...")
        self._speed = gui.add_slider("How fast", 0.5, 2.0, 0.05, 1.0, marks=())
        self._at = gui.add_number("Begins at (s)", 0.0, min=0.0, step=0.1)
        self._effort = gui.add_slider("How wide", 0.0, 2.0, 0.05, 1.0, marks=(),
                                      hint="How wide the mouth opens; 1 is calm.")
        self._told = gui.add_markdown("")
        gui.add_button("Say it").on_click(calls(self._said))
        self._no = gui.add_button("Say nothing", color="gray", visible=False)
        self._no.on_click(calls(lambda: host.edit("say nothing", timeline.set_top(host.script, speech=None),
                                                  host.chosen)))
        self._show_way()

    def refresh(self, work: Work) -> None:
        """Show a work."""
        speech = work.clip.script.get("speech")
        self._no.visible = speech is not None
        if speech == self._shown or speech is None:
            self._shown = speech
            return
        self._shown = speech
        fields = speech if isinstance(speech, dict) else {"text": str(speech)}
        self._way.value = _SOUNDS if "phonemes" in fields else _TEXT
        self._words.value = str(fields.get("text", fields.get("phonemes", "")))
        self._language.value = str(fields.get("language", _USUAL))
        for handle, key, usual in ((self._speed, "speed", 1.0), (self._at, "at", 0.0), (self._effort, "effort", 1.0)):
            handle.value = float(fields.get(key, usual))
        self._show_way()

    def _show_way(self) -> None:
        text = self._way.value == _TEXT
        self._language.visible = text
        self._told.content = (_MISSING if not installed() else "") if text else _SILENT
        self._told.visible = bool(self._told.content)

    def _said(self) -> None:
        words = self._words.value.strip()
        if not words:
            raise InputError("words: write what is to be said first")
        self._host.edit(f"say {words[:20]}", say(self._host.script, _KEYS[self._way.value], words,
                                                 language=self._language.value.strip() or _USUAL,
                                                 speed=float(self._speed.value), at=float(self._at.value),
                                                 effort=float(self._effort.value),
                                                 person=self._host.page.person()), self._host.chosen)


def say(script: timeline.Script, way: str, words: str, *, language: str = _USUAL, speed: float = 1.0, at: float = 0.0,
        effort: float = 1.0, person: Person | None = None) -> dict[str, Any]:
    """Return the script with other speech; what is usual is not written, and a clip's length is what it needs.

    way: "text" or "phonemes".
    """
    made: dict[str, Any] = {way: words}
    if way == "text" and language != _USUAL:
        made["language"] = language
    for key, value, usual in (("speed", speed, 1.0), ("at", at, 0.0), ("effort", effort, 1.0)):
        if value != usual:
            made[key] = round(value, 3)
    script = timeline.set_top(script, speech=made)
    if "duration" not in script:
        return script
    # A length that was set would cut the sentence off.
    needs = timeline.read(timeline.shorten(script), person).duration
    return {**script, "duration": max(script["duration"], round(needs, 3))}

"""The timeline: a clip of one's own, or a recording, on one transport; keys, events, speech, text, files."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any

from facegen.animation.clip import Clip
from facegen.animation.motion import Motion
from facegen.errors import FacegenError
from facegen.facs.expression_table import Person
from facegen.studio import script_text, timeline
from facegen.studio.curves import curves
from facegen.studio.export_view import ExportView
from facegen.studio.keys_view import KeysView
from facegen.studio.page import Page
from facegen.studio.recording_view import RecordingView
from facegen.studio.sound_view import SoundView
from facegen.studio.speech_view import SpeechView
from facegen.studio.text_box import TextBox
from facegen.studio.timeline_picture import Chosen, Drawing
from facegen.studio.transport import Transport
from facegen.studio.work import SPEED, FaceWork, Work

_CLIP, _RECORDING = "My clip", "The recording"
_HELP = ("Make a face in the **Face** tab, choose a time here and key it; choose another time, make another face, key "
         "that. **Play** shows what lies between.")
_DRAWN = 0.2            # seconds from picture to picture of the timeline while it plays
_STEP = 0.01            # seconds of the time slider


class ClipPanel:
    """``chosen``: the key that is edited. The views ask it to `edit`, `seek` and for the `head`."""

    def __init__(self, page: Page) -> None:
        self.page = page
        self.folder = page.desk.store.folder_of(page.name)
        self.chosen: Chosen | None = None
        self.clip: Clip | None = None
        self.motion: Motion | None = None
        self._read: tuple[Any, ...] | None = None           # script, person, clip or fault
        self._stamp: Any = None
        self._by_hand = _hand(page.work.face)
        self._rig: Any = page.rig
        self._showing = False                               # whether the picture shows the clip
        self._drawing: Drawing | None = None
        self._drawn = 0.0
        self._make(page.client.gui)
        self.transport = Transport(page, told=self._told, began=self._began, stopped=self.sound.stop)

    def _make(self, gui: Any) -> None:
        calls, clip = self.page.calls, self.page.work.clip
        self._which = gui.add_dropdown("Plays", (_CLIP, _RECORDING), initial_value=_CLIP, visible=False)
        self._which.on_update(calls(self._chose_which))
        self._help = gui.add_markdown(_HELP)
        self._wrong = gui.add_markdown("", visible=False)
        self._picture = gui.add_html("")
        self._time = gui.add_slider("Time (s)", 0.0, timeline.NEW_LENGTH, _STEP, 0.0, marks=(),
                                    hint="Drag to see any moment. Keys are set at this time.")
        self._time.on_update(calls(self._scrubbed))
        self._play = gui.add_button("Play", hint="Or press Ctrl and the space bar.")
        self._play.on_click(calls(self._play_or_pause))
        gui.add_command("Play or pause", hotkey="space", modifier="cmd/ctrl").on_trigger(calls(self._play_or_pause))
        self._told_rate = gui.add_markdown("")
        with gui.add_folder("How it plays", expand_by_default=False):
            self._speed = gui.add_slider("Speed", *SPEED, 0.05, clip.speed, marks=(),
                                         hint="1 is as it is. Sound plays at 1 only.")
            self._speed.on_update(calls(self._other_way))
            self._loop = gui.add_checkbox("Round and round", clip.loop)
            self._loop.on_update(calls(self._other_way))
            self._heard = gui.add_checkbox("With sound", True, hint="What the clip says, if the browser plays sound.")
            self._heard.on_update(calls(self._hear))
            self.sound = SoundView(gui)
        self.keys = KeysView(self, gui)
        with gui.add_folder("Speech", expand_by_default=False):
            self.speech = SpeechView(self, gui)
        with gui.add_folder("Recording", expand_by_default=False):
            self.recording = RecordingView(self, gui)
        with gui.add_folder("Script as text", expand_by_default=False):
            self._text = TextBox(
                self.page, "Clip", dict(clip.script), read=self._understood, write=script_text.write,
                changed=lambda script: self.edit("script of the clip", script), multiline=True,
                hint="All of the clip, as facegen animate reads it from a file. What cannot be read stays for mending.")
        with gui.add_folder("Save as", expand_by_default=False):
            self.export = ExportView(self, gui)

    # -- what the views ask -------------------------------------------------------------------------------------
    @property
    def script(self) -> dict[str, Any]:
        """The clip's script."""
        return dict(self.page.work.clip.script)

    @property
    def head(self) -> float:
        """Where the head of time stands, seconds."""
        return round(self.transport.head, 3)

    def edit(self, label: str, script: dict[str, Any], chosen: Chosen | None = None, *,
             thing: str | None = None) -> None:
        """Have another script, one step of undo; FacegenError if it means nothing, and nothing changes."""
        self._understood_data(script)
        self.chosen = chosen
        self._showing = True
        self.page.change(label, thing=thing, clip=replace(self.page.work.clip, script=script, shown="clip"))
        if not script:
            self.page.show_face()

    def change(self, label: str, *, thing: str | None = None, **fields: Any) -> None:
        """Have other fields of the clip's work."""
        self.page.change(label, thing=thing, clip=replace(self.page.work.clip, **fields))

    def seek(self, t: float) -> None:
        """Stop and show a time; without a clip it is where the first key will be."""
        self._go(t)
        self._time.value = self._on_slider()
        self._show_head()

    def choose(self, chosen: Chosen | None) -> None:
        """Edit another key, and show its time."""
        self.chosen = chosen
        self._stamp = None
        self._showing = True
        for one in timeline.tracks(self.script):
            if chosen is not None and one.place == chosen.track:
                self.seek(timeline.time_of(one.items[chosen.index]))
        self.refresh(self.page.work)

    # -- what is shown ------------------------------------------------------------------------------------------
    def refresh(self, work: Work) -> None:
        """Show a work."""
        hand = _hand(work.face)
        if hand != self._by_hand:                       # the face was changed by hand: it is what is looked at
            self._by_hand, self._showing = hand, False
            was = self.transport.playing
            self.transport.stop()
            if was:
                self.page.show_face()
        person = self.page.person()
        self.recording.refresh(work)
        stamp = (work.clip, person, self.recording.playback, self.chosen)
        if stamp != self._stamp:
            self._stamp = stamp
            self._refresh_clip(work, person)
        if self._showing and (self._rig is not self.page.rig or not self.transport.playing):
            self.transport.show()
        self._rig = self.page.rig
        self._show_head()

    def _refresh_clip(self, work: Work, person: Person | None) -> None:
        clip, fault = self._meaning(work.clip.script, person)
        self.clip = clip
        playback = self.recording.playback
        plays = playback if work.clip.shown == "recording" else clip
        if plays is not self.motion or self._drawing is None:
            self.motion = plays
            self.transport.load(plays)
        several = timeline.tracks(work.clip.script) if work.clip.shown == "clip" else ()
        self._drawing = Drawing(self._length, None if plays is None else curves(plays), several, self.chosen)
        self._time.max = max(self._length, 2 * _STEP)
        if self._time.value > self._time.max:
            self._time.value = self._on_slider()
        self._which.visible = work.clip.recording is not None
        self._which.value = _RECORDING if work.clip.shown == "recording" else _CLIP
        self._help.visible = plays is None and not fault
        self._wrong.visible = bool(fault)
        self._wrong.content = f"**The clip cannot be played:**\n```\n{fault.replace('```', '')}\n```"
        self._speed.value, self._loop.value = work.clip.speed, work.clip.loop
        self._text.refresh(dict(work.clip.script))
        self.keys.refresh(work)
        self.speech.refresh(work)
        self.export.refresh(work)

    @property
    def _length(self) -> float:
        return timeline.NEW_LENGTH if self.motion is None else self.motion.duration

    def _meaning(self, script: Any, person: Person | None) -> tuple[Clip | None, str]:
        """Return a script's clip, or none and why; read once."""
        if not timeline.moves(script):
            return None, ""
        if self._read is None or self._read[0] != script or self._read[1] != person:
            try:
                self._read = script, person, timeline.read(script, person), ""
            except FacegenError as error:
                self._read = script, person, None, str(error)
        return self._read[2], self._read[3]

    def _understood_data(self, script: dict[str, Any]) -> None:
        if timeline.moves(script):
            person = self.page.person()
            self._read = script, person, timeline.read(script, person), ""

    def _understood(self, text: str) -> dict[str, Any]:
        script = script_text.read(text)
        if script:
            timeline.check_form(script)
            timeline.read(script, self.page.person())       # says what is missing as well
        return script

    def _show_head(self) -> None:
        head, playing = self.transport.head, self.transport.playing
        if playing:
            self._time.value = self._on_slider()
        self._play.label = "Pause" if playing else "Play"
        self._play.disabled = self.motion is None
        now = time.monotonic()
        if self._drawing is not None and (not playing or now - self._drawn >= _DRAWN):
            self._drawn = now
            content = self._drawing.at(head)
            if content != self._picture.content:
                self._picture.content = content
        rate = f", {self.transport.rate:.0f} pictures a second" if playing and self.transport.rate else ""
        length = f" of {self._length:.2f} s" if self.motion is not None else ""
        self._told_rate.content = f"{head:.2f}{length}{rate}"

    def _on_slider(self) -> float:
        return round(min(max(self.transport.head, 0.0), float(self._time.max)), 2)

    def _told(self) -> None:
        """Show how far it is; called by the transport, which waits for nobody."""
        if self.page.lock.acquire(timeout=_STEP):
            try:
                if self.transport.head >= self.transport.duration:      # it has stopped at the end
                    self._time.value = self._on_slider()
                self._show_head()
            finally:
                self.page.lock.release()

    def _began(self, t: float) -> None:
        self.sound.play(getattr(self.motion, "sound", None), t, self.page.work.clip.speed)

    # -- what is done -------------------------------------------------------------------------------------------
    def _scrubbed(self) -> None:
        # The slider is not set meanwhile: what a hand has just sent would be overtaken by what it sent before.
        self._go(float(self._time.value))
        self._show_head()

    def _go(self, t: float) -> None:
        self.transport.stop()
        if self.motion is None:
            self.transport.head = t
        else:
            self._showing = True
            self.transport.seek(t)

    def _play_or_pause(self) -> None:
        if self.transport.playing:
            self.transport.stop()
            self._time.value = self._on_slider()
        elif self.motion is not None:
            self._showing = True
            self.transport.play(speed=self.page.work.clip.speed, loop=self.page.work.clip.loop)
        self._show_head()

    def _other_way(self) -> None:
        playing = self.transport.playing
        self.transport.stop()
        self.change("how it plays", thing="how it plays", speed=float(self._speed.value), loop=bool(self._loop.value))
        if playing:
            self._play_or_pause()

    def _hear(self) -> None:
        self.sound.on = bool(self._heard.value)
        if not self.sound.on:
            self.sound.stop()

    def _chose_which(self) -> None:
        self._showing = True
        self.transport.stop()
        self.change("what plays", shown="recording" if self._which.value == _RECORDING else "clip")

    def shows_recording(self) -> None:
        """Look at a recording that has come."""
        self.seek(0.0)
        self.refresh(self.page.work)

    def close(self) -> None:
        """Nothing runs any more."""
        self.transport.close()
        self.recording.close()
        self.export.close()


def _hand(face: FaceWork) -> tuple[Any, ...]:
    """Return what is changed by hand, another face or person apart: a clip plays on any."""
    return face.units, face.raw, face.intensity, face.gaze

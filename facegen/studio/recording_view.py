"""A recording: opened, cleaned up, played on any face."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from facegen.animation.performance import Performance
from facegen.animation.playback import Playback
from facegen.errors import FacegenError
from facegen.studio import recordings
from facegen.studio.latest import Latest
from facegen.studio.picking import words_for
from facegen.studio.task import Stopped, Task, while_read
from facegen.studio.work import ClipWork, Work

_NO, _SECONDS, _PERCENT = "no", "by seconds of rest", "by what it mostly is"
_HOW = {_SECONDS: "0-1", _PERCENT: "5%"}
_SOFT = {"no": "", "some": "on", "more": "0.5,0.05"}
_HELP = ("A face that a tracker recorded: OpenFace, py-feat, LibreFace, Live Link Face or MediaPipe as CSV or JSON, "
         "facegen's own CSV and .fgp, or a .glb with an animation.")
_MOST_WARNINGS = 6


class RecordingView:
    """``playback``: what plays, None without a recording or before it is read."""

    def __init__(self, host: Any, gui: Any) -> None:
        self._host, self._page = host, host.page
        self.playback: Playback | None = None
        self._key: Any = None                       # of what is read
        self._fault = ""
        self._rig: Any = None                       # for which the warnings are
        self._task: Task | None = None              # what reads the file that came last
        self._at_work = 0                           # files that are read, or whose reading is being stopped
        self._reading = Latest("recording", self._page.fault)
        calls = self._page.calls
        self._told = gui.add_markdown(_HELP)
        self._upload = gui.add_upload_button("Open a recording", mime_type=",".join(recordings.TAKEN),
                                             hint="It stays on this machine, beside your work.")
        self._upload.on_upload(calls(self._uploaded))
        self._place = gui.add_folder("At work", visible=False)
        with gui.add_folder("Clean it up", visible=False) as self._clean:
            self._rest = gui.add_dropdown("Subtract the resting face", (_NO, *_HOW), initial_value=_NO,
                                          hint="Trackers take a face at rest for one that frowns or smiles a little.")
            self._rest.on_update(calls(self._chose_rest))
            self._when = gui.add_text("Which", "", hint="From-to in seconds, such as 0-1, or a percentile such as 5%.")
            self._when.on_update(calls(lambda: self._set(calibrate=self._when.value.strip())))
            self._head = gui.add_checkbox("Head and gaze as well", False)
            self._head.on_update(calls(lambda: self._set(calibrate_head=bool(self._head.value))))
            self._smooth = gui.add_dropdown("Take the jitter off", tuple(_SOFT), initial_value="no")
            self._smooth.on_update(calls(lambda: self._set(smooth=_SOFT[self._smooth.value])))
        with gui.add_folder("What the file does not say", expand_by_default=False):
            self._fps = gui.add_number("Frames a second", 0.0, min=0.0, step=1.0,
                                       hint="For files without times, such as py-feat's; 0: the file says it.")
            self._fps.on_update(calls(lambda: self._set(recorded_fps=float(self._fps.value))))
            self._face = gui.add_text("Which face", "", hint="Where several were recorded, its number; of a .glb, the "
                                                             "animation. Nothing: the one that is there longest.")
            self._face.on_update(calls(lambda: self._set(face_id=self._face.value.strip())))
        self._warned = gui.add_markdown("", visible=False)
        self._drop = gui.add_button("Close the recording", color="gray", visible=False)
        self._drop.on_click(calls(lambda: host.change("close the recording", recording=None, shown="clip")))

    def refresh(self, work: Work) -> None:
        """Show a work; a recording that is not read yet is read beside the page."""
        clip, rig = work.clip, self._page.rig
        key = _key(clip)
        if key != self._key:
            self._key, self.playback, self._fault = key, None, ""
            if clip.recording is not None:
                self._reading.ask(lambda: self._read(clip, key))
            self._show(clip, rig)
        elif rig is not self._rig:
            self._show(clip, rig)

    def _show(self, clip: ClipWork, rig: Any) -> None:
        self._rig = rig
        self._clean.visible = self._drop.visible = clip.recording is not None
        self._rest.value = _NO if not clip.calibrate else _PERCENT if "%" in clip.calibrate else _SECONDS
        self._when.value = clip.calibrate
        self._when.visible = self._head.visible = bool(clip.calibrate)
        self._head.value, self._fps.value, self._face.value = clip.calibrate_head, clip.recorded_fps, clip.face_id
        self._smooth.value = next((label for label, value in _SOFT.items() if value == clip.smooth), "some")
        self._told.content = _HELP
        warnings: list[str] = []
        if clip.recording is not None:
            self._told.content = f"**{clip.recording}** is being read ..."
        if self._fault:
            self._told.content = f"**{clip.recording}**\n```\n{self._fault.replace('```', '')}\n```"
        elif self.playback is not None:
            one = recordings.about(self.playback.performance)
            self._told.content = (f"**{clip.recording}**: {one['format']}, {one['seconds']:.1f} s, {one['frames']} "
                                  f"frames, {one['shapes']} shapes")
            warnings = [*self.playback.warnings]
            try:
                warnings += self.playback.check(rig)
            except FacegenError as error:
                warnings.append(str(error))
        more = [f"and {len(warnings) - _MOST_WARNINGS} more"] if len(warnings) > _MOST_WARNINGS else []
        self._warned.content = "\n".join(f"- ⚠ {words_for(each)}" for each in [*warnings[:_MOST_WARNINGS], *more])
        self._warned.visible = bool(warnings)

    def _read(self, clip: ClipWork, key: Any) -> None:
        """Read what is kept; runs beside the page."""
        try:
            found, fault = Playback(recordings.load(self._host.folder, clip, self._still_wanted)), ""
        except Stopped:
            return
        except FacegenError as error:
            found, fault = None, str(error)
        with self._page.lock:
            if self._key == key:
                self.playback, self._fault = found, fault
                self._show(clip, self._page.rig)
                self._host.refresh(self._page.work)

    def _still_wanted(self, seconds: float) -> None:
        if self._reading.replaced:
            raise Stopped

    # -- what is done -------------------------------------------------------------------------------------------
    def _uploaded(self) -> None:
        if self._task is not None:                  # of two that are opened, the second
            self._task.stop()
        given, clip = self._upload.value, replace(self._page.work.clip, calibrate="", smooth="", face_id="")

        def read(report: Any) -> tuple[str, Performance]:
            return recordings.keep(self._host.folder, given.name, given.content, clip, while_read(report))

        self._at_work += 1
        self._place.visible = True
        with self._place:
            self._task = Task(self._page, given.name[:60], read, lambda made: self._opened(clip, *made), self._ended)

    def _ended(self) -> None:
        self._at_work -= 1
        self._place.visible = self._at_work > 0

    def _opened(self, clip: ClipWork, name: str, found: Performance) -> None:
        clip = replace(clip, recording=name, shown="recording")
        self._key, self.playback, self._fault = _key(clip), Playback(found), ""
        self._host.transport.head = 0.0
        self._page.change(f"open {name}", clip=clip)
        self._show(clip, self._page.rig)
        self._host.shows_recording()

    def _chose_rest(self) -> None:
        self._set(calibrate=_HOW.get(self._rest.value, ""), calibrate_head=self._rest.value != _NO
                  and bool(self._head.value))

    def _set(self, **fields: Any) -> None:
        self._host.change("clean up the recording", **fields)

    def close(self) -> None:
        """End what runs."""
        self._reading.close()
        if self._task is not None:
            self._task.stop()


def _key(clip: ClipWork) -> tuple[Any, ...]:
    return (clip.recording, clip.recorded_fps, clip.face_id, clip.calibrate, clip.calibrate_head and clip.calibrate,
            clip.smooth)

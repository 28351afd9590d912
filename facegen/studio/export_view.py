"""The clip or the recording as a file to take away."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

from facegen.errors import InputError
from facegen.render.backends import RENDERERS
from facegen.render.wishes import parse_size
from facegen.studio.exports import FORMS, Made, Wish, export, form_of
from facegen.studio.limits import LIMITS, MEBIBYTE
from facegen.studio.take_away import view_of
from facegen.studio.task import Task
from facegen.studio.work import Work

_SIZES = ("256", "512", "720", "1080", "1280x720", "1920x1080")
_HERE, _FRONT = "as here", "from the front"
_VIEWS = {_FRONT: (0.0, 0.0), "half from the subject's left": (40.0, 0.0), "from the subject's left": (90.0, 0.0)}
_CLEAR = {"plain": "plain", "white": "white", "transparent": "transparent"}

class ExportView:
    """What, how large, how fast; a bar and a way to stop."""

    def __init__(self, host: Any, gui: Any) -> None:
        self._host, self._page = host, host.page
        self._task: Task | None = None
        calls = self._page.calls
        self._form = gui.add_dropdown("What", tuple(FORMS), initial_value=next(iter(FORMS)))
        self._form.on_update(calls(lambda: self.refresh(self._page.work)))
        self._size = gui.add_dropdown("Size (pixels)", _SIZES, initial_value="512")
        self._fps = gui.add_number("Pictures a second", 25.0, min=1.0, max=60.0, step=1.0)
        self._view = gui.add_dropdown("Seen", (*_VIEWS, _HERE), initial_value=_FRONT)
        self._ground = gui.add_dropdown("Background", tuple(_CLEAR), initial_value="plain",
                                        hint=".webp, .apng and numbered pictures can be transparent.")
        self._renderer = gui.add_dropdown("Drawn by", RENDERERS, initial_value="auto",
                                          hint="facegen's renderers: auto takes what is fastest here.")
        self._save = gui.add_button("Save")
        self._save.on_click(calls(self._start))
        self._place = gui.add_folder("Saving", visible=False)
        self._warned = gui.add_markdown("", visible=False)

    def refresh(self, work: Work) -> None:
        """Show a work."""
        form = form_of(self._form.value)
        for handle in (self._size, self._view, self._ground, self._renderer):
            handle.visible = form.is_drawn
        self._fps.visible = form.kind not in ("script", "sound")
        self._save.disabled = self._task is not None or self._host.motion is None

    def _start(self) -> None:
        motion, form = self._host.motion, form_of(self._form.value)
        if motion is None or self._task is not None:
            return
        wish, script = self._wish(), self._host.script
        name = _name(self._page.work)
        self._warned.visible = False

        def make(report: Any) -> tuple[Made, bytes]:
            with tempfile.TemporaryDirectory(prefix="facegen-studio-") as folder:
                made = export(motion, form, Path(folder), name, wish, report, script=script)
                if made.path.stat().st_size > LIMITS.download_bytes:
                    raise InputError(f"size: the file has {made.path.stat().st_size / MEBIBYTE:.0f} MB, more than a "
                                     "browser takes at once; take a smaller size, or use the command facegen animate")
                return made, made.path.read_bytes()

        self._place.visible = True
        with self._place:
            self._task = Task(self._page, f"{name}{form.suffix}", make, lambda made: self._sent(*made), self._ended)
        self.refresh(self._page.work)

    def _wish(self) -> Wish:
        page = self._page
        view = view_of(page.client.camera) if self._view.value == _HERE else _VIEWS[self._view.value]
        return Wish(page.desk.face_file(page.work.face.rig, page.name), parse_size(self._size.value),
                    float(self._fps.value), view, _CLEAR[self._ground.value], self._renderer.value)

    def _sent(self, made: Made, content: bytes) -> None:
        self._page.client.send_file_download(made.path.name, content, save_immediately=True)
        self._warned.content = "\n".join(f"- ⚠ {each}" for each in made.warnings)
        self._warned.visible = bool(made.warnings)

    def _ended(self) -> None:
        self._task, self._place.visible = None, False
        self.refresh(self._page.work)

    def close(self) -> None:
        """Stop what runs."""
        if self._task is not None:
            self._task.stop()


def _name(work: Work) -> str:
    """Return what the file is called: as the recording, or "clip"."""
    return Path(work.clip.recording).stem if work.clip.shown == "recording" and work.clip.recording else "clip"

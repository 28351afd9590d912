"""Blendshapes for the avatar: made, compared with the base face, tuned, used and taken away."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from facegen.blendshapes.recipes import SETS
from facegen.errors import FacegenError
from facegen.face.avatar import AvatarFace
from facegen.face.face import load_face
from facegen.studio import rigging
from facegen.studio.avatar_checks import set_names
from facegen.studio.avatar_file import Opened
from facegen.studio.avatar_scene import BESIDE, AvatarScene
from facegen.studio.latest import Latest
from facegen.studio.page import FACE, Page
from facegen.studio.picking import words_for
from facegen.studio.pieces_view import PiecesView
from facegen.studio.task import Task
from facegen.studio.tuning_view import TuningView
from facegen.studio.work import AvatarWork, FaceWork, Work
from facegen.transfer.rig import Rigged

RIGGED, TEMPLATE = "rigged", "template"
"""Figures: the avatar with blendshapes, and the base face beside it where the page's face is another."""

_SETS = {
    "units": ("Expressions of all kinds", "facegen's action units: with them every expression can be shown here."),
    "expressions": ("Expressions ready made", "One shape for each named expression, for programs that blend those."),
    "arkit": ("ARKit's 52", "What phones and most engines track and play."),
    "visemes": ("Visemes", "Mouths of speech sounds."),
    "vrm": ("VRM's presets", "What programs for VRM avatars ask for."),
}
# Half the width and height of a head with room about it, mm.
_HEAD = (100.0, 140.0)


class RiggingView:
    """The controls of step 3, made where the panel stands. used: called when the avatar becomes the page's face."""

    def __init__(self, page: Page, scene: AvatarScene, used: Callable[[], None]) -> None:
        self.page, self.scene, self._used = page, scene, used
        self.maker = rigging.RigMaker(page.desk.store.folder_of(page.name))
        self.task: Task | None = None               # what makes blendshapes or draws them
        self._face: Any = None                      # the avatar with its blendshapes, as last made
        self._warnings: tuple[str, ...] = ()
        self._seen: Any = None                      # what the figure shows or was asked to
        self._split: Any = None                     # what the pieces are of
        self._stamp: Any = None                     # what the controls show
        self._current = False                       # whether the file is what the work makes
        self._working = Latest("tuning", page.fault)
        self._splitting = Latest("pieces", page.fault)
        self._make(page.client.gui)

    def _make(self, gui: Any) -> None:
        calls = self.page.calls
        self._state = gui.add_markdown("")
        with gui.add_folder("Which shapes", expand_by_default=False):
            self._sets = {}
            for name in SETS:
                label, hint = _SETS[name]
                self._sets[name] = box = gui.add_checkbox(label, False, hint=hint)
                box.on_update(calls(self._chosen_sets))
        self._rig = gui.add_button("Make blendshapes")
        self._rig.on_click(calls(self._start))
        self._place = gui.add_folder("At work", visible=False)
        self._told = gui.add_markdown("", visible=False)
        self._use = gui.add_button("Use this face", hint="The Face tab and the timeline then move this avatar.")
        self._use.on_click(calls(self._use_it))
        self._compare = gui.add_checkbox("Compare with facegen's face", False, hint="Both side by side show what the "
                                         "Face tab says.")
        self._compare.on_update(calls(self._compared))
        self._download = gui.add_button("Download the avatar")
        self._download.on_click(calls(self._take))
        self._sheet = gui.add_button("Download a sheet of its expressions", color="gray")
        self._sheet.on_click(calls(self._draw))
        with gui.add_folder("Tune", expand_by_default=False) as self._tune:
            self.tuning = TuningView(self.page)
        self.pieces = PiecesView(self.page, gui.add_folder("Pieces", expand_by_default=False))

    # -- what is shown ------------------------------------------------------------------------------------------
    @property
    def compares(self) -> bool:
        """Whether the avatar with blendshapes stands in the picture instead of the bare one."""
        return bool(self._compare.value) and self._face is not None

    def forget(self) -> None:
        """Another avatar has come."""
        self._face, self._warnings, self._seen, self._split = None, (), None, None
        self._compare.value = False
        self.tuning.told.content = ""

    def refresh(self, work: Work) -> None:
        """Show a work."""
        opened = self.scene.opened
        stamp = (work.avatar, opened, self._face, self.task)
        if stamp != self._stamp:                    # a slider of the face that is dragged changes nothing of this
            self._current = opened is not None and self.maker.is_made(work.avatar, opened)
            self._find(opened)
            self._stamp = (work.avatar, opened, self._face, self.task)
            self._refresh_controls(work.avatar)
        chosen = set_names(work.avatar.sets)
        for name, box in self._sets.items():
            box.value = name in chosen
        self.tuning.refresh(work.avatar)
        self._use.disabled = opened is not None and work.face.rig == opened.output
        self._show(work)

    def _find(self, opened: Opened | None) -> None:
        """Have what was made before the page was loaded again."""
        if self._face is None and opened is not None and self.maker.is_there(opened):
            try:
                self._face = self.page.desk.face(opened.output, self.page.name)
            except FacegenError as error:
                self.page.say(str(error), "The avatar cannot be read", colour="red")

    def _refresh_controls(self, avatar: AvatarWork) -> None:
        opened, made = self.scene.opened, self._face is not None
        left = len(rigging.missing(avatar))
        self._place.visible = self.task is not None
        self._rig.disabled = self.task is not None or opened is None or bool(left)
        self._sheet.disabled = self.task is not None
        self._rig.label = "Make blendshapes again" if made else "Make blendshapes"
        self._state.content = _state(opened is not None, left, made, self._current)
        for handle in (self._use, self._compare, self._download, self._sheet, self._tune):
            handle.visible = made
        self._told.content = "\n".join(f"- ⚠ {words_for(each)}" for each in self._warnings)
        self._told.visible = bool(self._warnings)
        self._split_pieces(avatar)

    def _show(self, work: Work) -> None:
        """Stand the figures that are compared in the picture, and have them pose."""
        stage = self.page.stage
        if not self.compares:
            for name in (RIGGED, TEMPLATE):
                stage.remove(name)
            if self._seen is not None:              # what was looked at ends
                self._seen = None
                self.page.show_face()
            return
        if RIGGED not in stage.figures:
            self._stand(self._face.mesh())
        if (work.face.rig == FaceWork().rig) == (TEMPLATE in stage.figures):
            self._stand_template(work)
        self._pose(work)

    def _stand(self, mesh: Any) -> None:
        self.page.stage.put(RIGGED, mesh, colours=self._face.colours, offset=BESIDE)

    def _stand_template(self, work: Work) -> None:
        if work.face.rig == FaceWork().rig:
            self.page.stage.remove(TEMPLATE)
        else:
            base = self.page.desk.face(FaceWork().rig, self.page.name)
            self.page.stage.put(TEMPLATE, base.mesh(), offset=-BESIDE)

    def _pose(self, work: Work) -> None:
        face = work.face if self.tuning.look is None else self.tuning.look
        wanted = (face, self.page.person(), work.avatar, self._face)
        if wanted == self._seen:
            return
        self._seen = wanted
        if self.tuning.look is None:
            person = self.page.person()
            self.page.show_face()

            def means(rig: Any) -> Any:
                return face.meaning(person, rig)
        else:
            looked, own = load_face().resolve(face), self.page.rig
            self.page.stage.request(FACE, lambda: own.pose(looked))

            def means(rig: Any) -> Any:
                return looked
        if TEMPLATE in self.page.stage.figures:
            base = self.page.desk.face(FaceWork().rig, self.page.name)
            self.page.stage.request(TEMPLATE, lambda: base.pose(means(base)))
        rigged, opened = self._face, self.scene.opened
        if self._current or rigging.missing(work.avatar):
            if self.page.stage.figures[RIGGED].mesh is not rigged.mesh():
                self._stand(rigged.mesh())
            self.page.stage.request(RIGGED, lambda: rigged.pose(means(rigged)))
        else:
            self._working.ask(lambda: self._tune_to(work.avatar, opened, rigged, means(rigged)))

    def _tune_to(self, avatar: AvatarWork, opened: Any, face: AvatarFace, meaning: Any) -> None:
        """Show what the choices make of an expression; runs beside the page."""
        try:
            mesh, found = self.maker.shown(avatar, opened, face, meaning)
        except FacegenError as error:
            self.page.fault(error)
            return
        with self.page.lock:
            if self.page.work.avatar is not avatar or not self.compares:
                return
            if len(self.page.stage.figures[RIGGED].vertices) != len(mesh.vertices):
                self._stand(mesh)
            names = ", ".join(found.fresh[:6]) + (" ..." if len(found.fresh) > 6 else "")
            self.tuning.told.content = (f"Computed anew for this picture: {names or 'nothing'}. **Make blendshapes "
                                        "again** writes the file.")
            self.page.stage.request(RIGGED, lambda: mesh.vertices)

    def _compared(self) -> None:
        self.page.refresh()
        if self.compares:
            heads = 2 if self.page.work.face.rig == FaceWork().rig else 3
            self.scene.turn(np.array([BESIDE[0] / 2 if heads == 2 else 0.0, -15.0, -40.0]),
                            ((heads - 1) * BESIDE[0] / 2 + _HEAD[0], _HEAD[1]))

    def _split_pieces(self, avatar: AvatarWork) -> None:
        """Have the pieces found beside the page, once the points are placed."""
        opened = self.scene.opened
        of = (opened, avatar.landmarks, avatar.pieces)
        if of == self._split:
            return
        self._split = of
        if opened is None or rigging.missing(avatar):
            self.pieces.show([], avatar)
            return

        def split() -> None:
            try:
                rows = rigging.pieces(avatar, opened)
            except FacegenError as error:           # wrong points, a wrong correction: said, and the page goes on
                self.page.fault(error)
                return
            with self.page.lock:
                if self._split is of:
                    self.pieces.show(rows, self.page.work.avatar)

        self._splitting.ask(split)

    # -- what is done -------------------------------------------------------------------------------------------
    def _chosen_sets(self) -> None:
        chosen = ",".join(name for name, box in self._sets.items() if box.value)
        self.page.change("choose shapes", avatar=replace(self.page.work.avatar, sets=chosen))

    def _start(self) -> None:
        avatar, opened = self.page.work.avatar, self.scene.opened
        rigging.check_ready(avatar)
        self._run("Blendshapes", lambda report: self.maker.make(avatar, opened, report), self._finished)

    def _run(self, title: str, job: Callable[[Any], Any], done: Callable[[Any], None]) -> None:
        """Run a task, one at a time."""
        if self.task is not None:
            return
        with self._place:
            self.task = Task(self.page, title, job, done, self._ended)
        self.refresh(self.page.work)

    def _ended(self) -> None:
        self.task = None
        self.refresh(self.page.work)

    def _finished(self, made: Rigged) -> None:
        self._face, self._warnings, self._seen = AvatarFace(made.avatar), made.warnings, None
        self.tuning.told.content = ""
        self.page.stage.remove(RIGGED)
        self._compare.value = True
        self.page.say(f"{len(made.names)} blendshapes", "The avatar is ready", colour="green")
        self.page.faces_changed()
        self._compared()

    def _use_it(self) -> None:
        self._compare.value = False
        self._used()
        self.page.change("use the avatar", face=replace(self.page.work.face, rig=self.scene.opened.output))
        self.page.stage.look()

    def _take(self) -> None:
        self._send(self.maker.path(self.scene.opened))

    def _send(self, path: Path) -> None:
        self.page.client.send_file_download(path.name, path.read_bytes(), save_immediately=True)

    def _draw(self) -> None:
        face, opened, folder = self._face, self.scene.opened, self.maker.folder

        self._run("Sheet", lambda report: rigging.preview(face, folder, opened, report), self._send)

    def settle(self) -> bool:
        """Wait for what runs beside the page."""
        return self._working.settle(60.0) and self._splitting.settle(60.0)

    def close(self) -> None:
        """End what runs."""
        if self.task is not None:
            self.task.stop()
        self._working.close()
        self._splitting.close()


def _state(opened: bool, left: int, made: bool, current: bool) -> str:
    """Return in words how far the avatar is."""
    if not opened:
        return "First open an avatar."
    if left:
        return f"First place the {left} missing points in step 2." if left > 1 else \
            "First place the missing point in step 2."
    if made and not current:
        return "Something has changed since the blendshapes were made: **make them again** to have it in the file."
    return "The avatar has its blendshapes." if made else "Everything is there."

"""An avatar gets its blendshapes: open it, place its landmarks, rig it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from facegen.fileio.textfile import make_folder, save_text
from facegen.studio import picking
from facegen.studio.apart import Waits
from facegen.studio.avatar_file import (
    COLOURS,
    FOLDER,
    TAKEN,
    called,
    keep,
    keep_colours,
    keep_from,
    lost_colours,
    open_avatar,
)
from facegen.studio.avatar_scene import AvatarScene
from facegen.studio.page import Page
from facegen.studio.picker_view import PickerView
from facegen.studio.rigging_view import RiggingView
from facegen.studio.task import Task, while_read
from facegen.studio.work import AvatarWork, Work
from facegen.transfer.landmarks import load_landmarks
from facegen.transfer.rig import avatar_names

_NONE = "-"
_DIRECTIONS = {"x": "+x", "-x": "-x", "y": "+y", "-y": "-y", "z": "+z", "-z": "-z"}
_HELP = ("Open the head of a character. Then show where its eyes, brows, nose, mouth and chin are, and it gets the "
         "same expressions as facegen's own face.")


class AvatarPanel:
    """Three steps, one below the other."""

    def __init__(self, page: Page) -> None:
        self.page = page
        self.folder = page.desk.store.folder_of(page.name)
        self.scene = AvatarScene(page)
        self._last: AvatarWork | None = None        # what is shown
        self._task: Task | None = None              # what reads a file
        gui = page.client.gui
        with gui.add_folder("1 Avatar") as self._first:
            self._make_open(gui)
        with gui.add_folder("2 Landmarks"):
            self.picker = PickerView(page, self.scene)
            with gui.add_folder("Landmarks as a file", expand_by_default=False):
                self._make_files(gui)
        with gui.add_folder("3 Blendshapes"):
            self.rigging = RiggingView(page, self.scene, self.picker.stop)

    def _make_open(self, gui: Any) -> None:
        calls = self.page.calls
        self._about = gui.add_markdown(_HELP)
        self._upload = gui.add_upload_button(
            "Open an avatar", mime_type=",".join((*TAKEN, COLOURS)), hint=f"A file that ends in {', '.join(TAKEN)}, or "
            f"the colours of an OBJ file ({COLOURS}). It stays on this machine, beside your work.")
        self._upload.on_upload(calls(self._uploaded))
        self._shelf = gui.add_dropdown("Or from a folder", (_NONE, *self._on_shelf()), initial_value=_NONE,
                                       visible=bool(self._on_shelf()),
                                       hint="Files of the folders that the studio was started with.")
        self._shelf.on_update(calls(self._taken))
        self._ours = gui.add_dropdown("Or try one", (_NONE, *avatar_names()), initial_value=_NONE,
                                      hint="Heads that come with facegen, still without blendshapes.")
        self._ours.on_update(calls(self._chosen))
        self._seen = gui.add_checkbox("Show it in the picture", True)
        self._seen.on_update(calls(lambda: self.refresh(self.page.work)))
        with gui.add_folder("It lies down or looks away", expand_by_default=False) as self._axes:
            self._up = gui.add_dropdown("Up in the file", tuple(_DIRECTIONS.values()), initial_value="+y",
                                        hint="Programs differ: many files have +y up, some +z.")
            self._front = gui.add_dropdown("It looks to", tuple(_DIRECTIONS.values()), initial_value="+z")
            for handle in (self._up, self._front):
                handle.on_update(calls(self._turned))

    def _make_files(self, gui: Any) -> None:
        calls = self.page.calls
        self._save = gui.add_button("Save landmarks", hint="A small text file, for another day and for facegen rig.")
        self._save.on_click(calls(self._save_landmarks))
        self._load = gui.add_upload_button("Load landmarks", mime_type=".yaml,.yml")
        self._load.on_upload(calls(self._load_landmarks))
        self._clear = gui.add_button("Remove all points")
        self._clear.on_click(calls(self._remove_all))

    # -- what is shown ------------------------------------------------------------------------------------------
    def refresh(self, work: Work) -> None:
        """Show a work."""
        if work.avatar is not self._last:           # a slider of the face that is dragged changes nothing of this
            self._last = work.avatar
            if self.scene.open(work.avatar):
                self.picker.forget()
                self.rigging.forget()
        self._refresh_file(work.avatar)
        opened = self.scene.opened
        is_face = opened is not None and work.face.rig == opened.output and not self.picker.wishes
        self.scene.show(work.avatar, bool(self._seen.value) and not self.rigging.compares and not is_face)
        self.picker.refresh(work)
        self.rigging.refresh(work)

    def _refresh_file(self, avatar: AvatarWork) -> None:
        opened = self.scene.opened
        self._about.content = opened.summary if opened else _HELP
        self._ours.value = avatar.file if avatar.file in avatar_names() else _NONE
        self._shelf.value = _NONE
        self._up.value, self._front.value = _DIRECTIONS[avatar.up], _DIRECTIONS[avatar.front]
        for handle in (self._seen, self._axes):
            handle.visible = opened is not None
        self._save.disabled = self._clear.disabled = not avatar.landmarks

    def _again(self) -> None:
        """Read the avatar again: its file has changed."""
        self._last = None
        self.refresh(self.page.work)

    # -- step 1 -------------------------------------------------------------------------------------------------
    def _on_shelf(self) -> tuple[str, ...]:
        return self.page.desk.shelf.names(TAKEN)

    def _uploaded(self) -> None:
        given = self._upload.value
        if given.name.lower().endswith(COLOURS):
            self.scene.mesh                                 # noqa: B018 - told if there is no avatar yet
            keep_colours(self.folder, self.scene.opened, given.name, given.content)
            self._again()
        else:
            self._read(given.name, lambda waits: keep(self.folder, given.name, given.content, waits))

    def _taken(self) -> None:
        if self._shelf.value != _NONE:
            path = self.page.desk.shelf.resolve(self._shelf.value, TAKEN)
            self._read(path.name, lambda waits: keep_from(self.folder, path, waits))

    def _read(self, title: str, job: Callable[[Waits], str]) -> None:
        """Read a file beside the page and open it; of two that are opened, the second."""
        if self._task is not None:
            self._task.stop()
        with self._first:
            self._task = Task(self.page, title[:60], lambda report: job(while_read(report)), self._opened)

    def _chosen(self) -> None:
        if self._ours.value != _NONE:
            self._opened(self._ours.value)

    def _opened(self, name: str) -> None:
        self._seen.value = True
        self.picker.forget()
        self.rigging.forget()
        self.picker.start()
        keeps = self.page.work.avatar
        fresh = AvatarWork(file=name, symmetric=keeps.symmetric, sets=keeps.sets)
        self.page.change(f"open {name}", avatar=self._facing(fresh))
        self._again()                                       # the same name may be another file
        colours = lost_colours(self.scene.opened)
        if colours is not None:
            self.page.say(f"They are in {colours}: open that file too.", "Colours are missing")

    def _facing(self, avatar: AvatarWork) -> AvatarWork:
        """Return the work with the axes that a file is known to have: VRM 0.x avatars look to -z."""
        return replace(avatar, front="-z") if open_avatar(self.folder, avatar.file).avatar.is_vrm0 else avatar

    def _turned(self) -> None:
        keys = {label: key for key, label in _DIRECTIONS.items()}
        avatar = replace(self.page.work.avatar, up=keys[self._up.value], front=keys[self._front.value])
        self.page.change("turn the avatar", avatar=avatar)

    # -- landmarks as a file ------------------------------------------------------------------------------------
    def _save_landmarks(self) -> None:
        avatar = self.page.work.avatar
        text = picking.file_text(avatar, self.scene.opened.avatar.digest)
        self.page.client.send_file_download(f"{Path(avatar.file).stem}.yaml", text.encode(), save_immediately=True)

    def _load_landmarks(self) -> None:
        given, mesh = self._load.value, self.scene.mesh
        path = make_folder(self.folder / FOLDER) / "landmarks.yaml"
        save_text(given.content.decode("utf-8", "replace"), path)
        opened = self.scene.opened
        with called(path, given.name):
            found = load_landmarks(path, mesh, mesh_name=opened.path.name, digest=opened.avatar.digest,
                                   partial=True)
        avatar = replace(self.page.work.avatar, landmarks=picking.as_places(found))
        self.page.change("load landmarks", avatar=avatar)
        left, count = len(picking.missing(avatar)), len(found.names)
        more = f"; {left} needed one{'s are' if left > 1 else ' is'} missing." if left else "."
        self.page.say(f"{count} point{'s' * (count != 1)}{more}", "Landmarks loaded")

    def _remove_all(self) -> None:
        self.page.change("remove all points", avatar=replace(self.page.work.avatar, landmarks={}, skipped={}))

    def close(self) -> None:
        """End what runs."""
        if self._task is not None:
            self._task.stop()
        self.picker.close()
        self.rigging.close()

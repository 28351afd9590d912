"""What all pages share: faces that are loaded, and where works are kept."""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

from facegen.errors import InputError, nearest
from facegen.face.face import load_face
from facegen.face.named import face_names
from facegen.facs.expression_table import Person, load_person, people
from facegen.fileio.textfile import make_folder
from facegen.studio.files import Shelf
from facegen.studio.recent import Recent
from facegen.studio.store import Store

FACES = "faces"
"""Folder of a work that holds its own rigged avatars."""

PEOPLE = "people"
"""Folder of a work that holds its own people's tables."""

RIGGED = (".glb", ".vrm")
"""What their names end in."""

_AVATARS = "avatars"
_FACES = 8              # in memory, beside those that pages show: what a few people go back to
_FILE = re.compile(r"[\w][\w -]{0,59}\.yaml")


class Desk:
    """Safe to call from several threads; faces are shared, so nobody may change them.

    folder: where works are kept. ``store``: the works. ``shelf``: files of this machine that pages may open.
    """

    def __init__(self, folder: str | os.PathLike[str], shelf: Shelf | None = None) -> None:
        self.store, self.shelf = Store(make_folder(folder)), shelf or Shelf()
        self._faces: Recent[Any] = Recent(_FACES)
        self._made: set[str] = set()                # shipped avatars that have their blendshapes

    def face_names(self, work: str) -> tuple[str, ...]:
        """Return the faces that a page can show: shipped faces and avatars, and what was rigged there."""
        from facegen.transfer.rig import avatar_names

        own = self.store.folder / work / FACES
        rigged = sorted(path.name for path in own.glob("*") if path.suffix in RIGGED)
        return (*face_names(), *avatar_names(), *rigged)

    def face(self, name: str, work: str, *, wait: Callable[[str], None] = lambda why: None) -> Any:
        """Return a face by name, loaded once while a page shows it and a while longer. A shipped avatar is rigged when
        it is asked for.

        wait: called with the reason, if it takes more than a moment. InputError for an unknown name.
        """
        if name not in self.face_names(work):
            raise InputError(f"face: unknown face '{name}'{nearest(name, self.face_names(work))}")
        own = self.store.folder / work / FACES / name
        if own.suffix in RIGGED:
            return self._faces.get((own, own.stat().st_mtime_ns), lambda: load_face(own))
        return self._faces.get(name, lambda: load_face(name) if name in face_names() else self._rigged(name, wait))

    def face_file(self, name: str, work: str) -> str:
        """Return what `facegen.load_face` takes for a face that `face` gave: its name, or its file's path."""
        if Path(name).suffix in RIGGED:
            return str(self.store.folder / work / FACES / name)
        return name if name in face_names() else str(self.store.folder / _AVATARS / f"{name}.glb")

    def people(self, work: str) -> tuple[str, ...]:
        """Return the people that a page can choose: shipped ones by name, its own by their file's name."""
        return (*people(), *sorted(path.name for path in (self.store.folder / work / PEOPLE).glob("*.yaml")))

    def person(self, name: str | None, work: str) -> Person | None:
        """Return a person by a name of `people`, as their file is now; nobody for None.

        InputError for an unknown name, TableError for a file that will not do.
        """
        if name is None:
            return None
        if name not in self.people(work):
            raise InputError(f"person: unknown person '{name}'{nearest(name, self.people(work))}")
        return load_person(self.person_file(name, work) if name.endswith(".yaml") else name)

    def person_file(self, name: str, work: str) -> Path:
        """Return where the table of a person of the work's own, "ada.yaml", is kept; InputError if that is no name."""
        if not _FILE.fullmatch(name):
            raise InputError(f"person: expected a name of letters, digits, _ and -, got {name.removesuffix('.yaml')!r}")
        return self.store.folder_of(work) / PEOPLE / name

    def _rigged(self, name: str, wait: Callable[[str], None]) -> Any:
        """Return a shipped avatar with blendshapes."""
        from facegen.transfer.rig import rig

        path = make_folder(self.store.folder / _AVATARS) / f"{name}.glb"
        if name not in self._made:
            wait(f"{name} gets its blendshapes; the first time this takes a few seconds.")
            # Made anew by each server: another version of facegen makes another.
            rig(name, path, sets=["units", "arkit", "visemes"])
            self._made.add(name)
        return load_face(path)

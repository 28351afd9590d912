"""What all pages share: faces that are loaded, and where works are kept."""

from __future__ import annotations

import os
import re
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

from facegen.errors import InputError, nearest
from facegen.face.face import load_face
from facegen.face.named import face_names
from facegen.facs.expression_table import Person, load_person, people
from facegen.fileio.textfile import make_folder
from facegen.studio.files import Shelf
from facegen.studio.store import Store

FACES = "faces"
"""Folder of a work that holds its own rigged avatars."""

PEOPLE = "people"
"""Folder of a work that holds its own people's tables."""

RIGGED = (".glb", ".vrm")
"""What their names end in."""

_AVATARS = "avatars"
_FILE = re.compile(r"[\w][\w -]{0,59}\.yaml")


class Desk:
    """Safe to call from several threads; faces are shared, so nobody may change them.

    folder: where works are kept. ``store``: the works. ``shelf``: files of this machine that pages may open.
    """

    def __init__(self, folder: str | os.PathLike[str], shelf: Shelf | None = None) -> None:
        self.store, self.shelf = Store(make_folder(folder)), shelf or Shelf()
        self._faces: dict[Path | str, Any] = {}
        self._locks: dict[Path | str, threading.Lock] = {}
        self._lock = threading.Lock()

    def face_names(self, work: str) -> tuple[str, ...]:
        """Return the faces that a page can show: shipped faces and avatars, and what was rigged there."""
        from facegen.transfer.rig import avatar_names

        own = self.store.folder / work / FACES
        rigged = sorted(path.name for path in own.glob("*") if path.suffix in RIGGED)
        return (*face_names(), *avatar_names(), *rigged)

    def face(self, name: str, work: str, *, wait: Callable[[str], None] = lambda why: None) -> Any:
        """Return a face by name, loaded once. A shipped avatar is rigged when it is first asked for.

        wait: called with the reason, if it takes more than a moment. InputError for an unknown name.
        """
        if name not in self.face_names(work):
            raise InputError(f"face: unknown face '{name}'{nearest(name, self.face_names(work))}")
        own = self.store.folder / work / FACES / name
        key = own if own.suffix in RIGGED else name
        with self._lock:
            lock = self._locks.setdefault(key, threading.Lock())
        with lock:                              # who asks second waits and finds it
            changed = own.stat().st_mtime_ns if key is own else None
            found = self._faces.get(key)
            if found is None or found[0] != changed:
                self._faces[key] = found = changed, self._load(key, wait)
        return found[1]

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

    def _load(self, key: Path | str, wait: Callable[[str], None]) -> Any:
        if isinstance(key, Path) or key in face_names():
            return load_face(key)
        from facegen.transfer.rig import rig

        folder = make_folder(self.store.folder / _AVATARS)
        path = folder / f"{key}.glb"
        wait(f"{key} gets its blendshapes; the first time this takes a few seconds.")
        # Made anew by each server: another version of facegen makes another.
        rig(key, path, sets=["units", "arkit", "visemes"])
        return load_face(path)

"""Works on disk: saved a moment after each change, found again after a reload or a crash."""

from __future__ import annotations

import json
import os
import threading
from collections.abc import Callable
from pathlib import Path

from facegen.errors import FileError, TableError
from facegen.facs.yamlfile import read_data
from facegen.fileio.textfile import make_folder, save_text
from facegen.studio.work import Work

DELAY = 0.3
"""Seconds that a change may wait to be saved: a slider that is dragged writes a few files a second, not sixty."""

_FILE = "work.json"


class Store:
    """The works below a folder, one folder each. Safe to call from several threads."""

    def __init__(self, folder: str | os.PathLike[str]) -> None:
        self.folder = make_folder(folder)
        self._waiting: dict[str, Work] = {}
        self._lock = threading.Lock()
        self._writing = threading.Lock()
        self._timer: threading.Timer | None = None
        self._failing: set[str] = set()
        self._failed: Callable[[str, Exception], None] = lambda name, error: None

    def on_failure(self, call: Callable[[str, Exception], None]) -> None:
        """Have ``call(name, error)`` called when a work could not be saved, once until it can be again."""
        self._failed = call

    def folder_of(self, name: str) -> Path:
        """Return the folder of a work, private to this user, made if need be."""
        folder = make_folder(self.folder / name)
        try:
            folder.chmod(0o700)
        except OSError as error:
            raise FileError(f"{folder}: cannot be made private: {error.strerror or error}") from error
        return folder

    def load(self, name: str) -> tuple[Work, str | None]:
        """Return a work, new if there is none yet, and what to tell its owner.

        A file that cannot be read is set aside, never overwritten.
        """
        with self._lock:
            if name in self._waiting:
                return self._waiting[name], None
        path = self.folder / name / _FILE
        if not path.exists():
            return Work(), None
        try:
            return Work.read(read_data(path), str(path)), None
        except (FileError, TableError) as error:
            aside = path.with_name(f"{path.stem}-{os.urandom(3).hex()}.unreadable")
            os.replace(path, aside)
            return Work(), f"The last work could not be read and was set aside as {aside}: {error}"

    def save(self, name: str, work: Work) -> None:
        """Have a work saved within `DELAY`; the latest of several wins."""
        with self._lock:
            self._waiting[name] = work
            if self._timer is None:
                self._timer = threading.Timer(DELAY, self.flush)
                self._timer.daemon = True
                self._timer.start()

    def flush(self) -> None:
        """Save now what waits."""
        with self._writing:
            with self._lock:
                waiting, self._timer = dict(self._waiting), None
            for name, work in waiting.items():
                try:
                    self.folder_of(name)
                    save_text(json.dumps(work.plain(), indent=1), self.folder / name / _FILE)
                except (FileError, TypeError, ValueError) as error:     # it waits on, and the next change tries again
                    if name not in self._failing:
                        self._failing.add(name)
                        self._failed(name, error)
                    continue
                self._failing.discard(name)
                with self._lock:
                    if self._waiting.get(name) is work:
                        del self._waiting[name]

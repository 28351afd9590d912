"""Files of this machine that a page may open: those in folders that were named when the studio was started."""

from __future__ import annotations

import os
import stat
from collections.abc import Iterable, Iterator
from pathlib import Path

from facegen.errors import FileError, InputError, nearest
from facegen.facs.yamlfile import SUFFIXES as DATA
from facegen.fileio.avatar import READABLE as AVATARS
from facegen.studio.limits import MEBIBYTE, Limits

OPENED = (*AVATARS, *DATA, ".csv")
_LISTED = 500           # files in a list, because a person reads it
_DEEP = 4               # folders below a named one that are looked into


class Shelf:
    """The folders from which pages may open files, and nothing beside them.

    ::

        shelf = Shelf(["~/heads"])
        shelf.names()                       # ("heads/anna.glb", "heads/old/bert.obj")
        shelf.resolve("heads/anna.glb")     # the path

    A name begins with its folder's own. Raises FileError for a folder that is none.
    """

    def __init__(self, folders: Iterable[str | os.PathLike[str]] = (), limits: Limits | None = None) -> None:
        self._limits, self._roots = limits or Limits(), {}
        for folder in folders:
            path = Path(folder).expanduser()
            if not path.is_dir():
                raise FileError(f"{path}: is no folder; expected one with files that pages may open")
            path, number = path.resolve(), 1
            if path in self._roots.values():
                continue
            label = own = path.name or "root"
            while label in self._roots:
                label = f"{own}-{(number := number + 1)}"
            self._roots[label] = path

    def names(self, suffixes: Iterable[str] = OPENED) -> tuple[str, ...]:
        """Return the names of what can be opened, in order; at most 500."""
        suffixes, found = tuple(suffixes), []
        for label, root in sorted(self._roots.items()):
            for path in _below(root, _DEEP):
                if path.suffix.lower() in suffixes and self._inside(path, root):
                    found.append(f"{label}/{path.relative_to(root).as_posix()}")
                    if len(found) == _LISTED:
                        return tuple(found)
        return tuple(found)

    def resolve(self, name: str, suffixes: Iterable[str] = OPENED) -> Path:
        """Return the path of a file by its name. Raises InputError for a name that is none, FileError for a file that
        is not opened: one outside, no regular file, of another kind, too large."""
        suffixes = tuple(suffixes)
        steps = name.split("/") if isinstance(name, str) else [""]
        # A backslash and a colon part names elsewhere; what cannot be a name is not looked up.
        bad = len(steps) < 2 or any(step in ("", ".", "..") or set(step) & set('\\:\0') for step in steps)
        if bad or steps[0] not in self._roots:
            raise InputError(f"file: {ascii(name)[:100]} is none that this studio opens"
                             f"{'' if bad else nearest(name, self.names(suffixes))}")
        root = self._roots[steps[0]]
        path = root.joinpath(*steps[1:])
        if path.suffix.lower() not in suffixes:
            raise FileError(f"{name}: expected a file that ends in {', '.join(suffixes)}")
        if not self._inside(path, root):
            raise FileError(f"{name}: there is no such file in the folder")
        size = path.stat().st_size
        if size > self._limits.file_bytes:
            raise FileError(f"{name}: {_large(size, self._limits)}")
        return path.resolve()

    @staticmethod
    def _inside(path: Path, root: Path) -> bool:
        """Return whether it is a regular file that lies below a folder, wherever links lead."""
        try:
            real = path.resolve(strict=True)
            return real.is_relative_to(root) and stat.S_ISREG(real.stat().st_mode)
        except (OSError, ValueError, RuntimeError):
            return False


def _below(folder: Path, deep: int) -> Iterator[Path]:
    """Yield the files below a folder, without links to folders and what is hidden."""
    try:
        entries = sorted(folder.iterdir())
    except OSError:
        return
    for path in entries:
        if path.name.startswith("."):
            continue
        if path.is_dir():
            if deep > 0 and not path.is_symlink():
                yield from _below(path, deep - 1)
        else:
            yield path


def _large(size: int, limits: Limits) -> str:
    return (f"has {size / MEBIBYTE:.1f} MiB; the studio opens files of up to {limits.file_bytes / MEBIBYTE:.0f} MiB "
            "(facegen's commands open larger ones)")

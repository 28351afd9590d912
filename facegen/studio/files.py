"""Files that a page may open: those in folders that were named when the studio was started, and what it sent itself."""

from __future__ import annotations

import os
import secrets
import shutil
import stat
import tempfile
import unicodedata
from collections.abc import Iterable, Iterator
from pathlib import Path

from facegen.errors import FileError, InputError, nearest
from facegen.facs.yamlfile import SUFFIXES as DATA
from facegen.fileio.avatar import READABLE as AVATARS
from facegen.fileio.textfile import make_folder
from facegen.studio.limits import MEBIBYTE, Limits

OPENED = (*AVATARS, *DATA, ".csv")
_LISTED = 500           # files in a list, because a person reads it
_DEEP = 4               # folders below a named one that are looked into
_NAME = 80              # characters of a file's name that are kept
_FILES = 64             # that one work keeps
_RESERVED = {"con", "prn", "aux", "nul", *(f"{port}{i}" for port in ("com", "lpt") for i in range(10))}


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


class Uploads:
    """What pages of one work sent, each file in a folder of its own that only this user can read.

    folder: where they are kept; by default somewhere temporary, that `close` removes.
    """

    def __init__(self, folder: str | os.PathLike[str] | None = None, limits: Limits | None = None) -> None:
        self._limits, self._temporary = limits or Limits(), folder is None
        self.folder = Path(tempfile.mkdtemp(prefix="facegen-studio-")) if folder is None else make_folder(folder)
        self.folder.chmod(0o700)

    def keep(self, name: str, content: bytes, suffixes: Iterable[str] = OPENED) -> Path:
        """Write a file that a page sent, under as much of its name as is harmless; return its path.

        Raises FileError for a file of another kind, one that is too large, or one too many.
        """
        name = safe_name(name, suffixes)
        if len(content) > self._limits.file_bytes:
            raise FileError(f"{name}: {_large(len(content), self._limits)}")
        held = [path.stat().st_size for path in self.folder.glob("*/*")]
        if len(held) >= _FILES or sum(held) + len(content) > 8 * self._limits.file_bytes:
            raise FileError(f"{name}: this work has {len(held)} files with {sum(held) / MEBIBYTE:.0f} MiB, and no more "
                            "fit; open it in a new tab")
        own = self.folder / secrets.token_hex(8)
        try:
            own.mkdir(0o700)
            descriptor = os.open(own / name, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
            with open(descriptor, "wb") as file:
                file.write(content)
        except OSError as error:
            shutil.rmtree(own, ignore_errors=True)
            raise FileError(f"{name}: cannot be kept: {error.strerror or error}") from error
        return own / name

    def drop(self, path: Path) -> None:
        """Remove a file that was kept."""
        if path.parent.parent == self.folder:
            shutil.rmtree(path.parent, ignore_errors=True)

    def close(self) -> None:
        """Remove what was kept somewhere temporary."""
        if self._temporary:
            shutil.rmtree(self.folder, ignore_errors=True)

    def __enter__(self) -> Uploads:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def safe_name(name: str, suffixes: Iterable[str] = OPENED) -> str:
    """Return a stranger's name of a file as one that is only a name, with its suffix; FileError for another suffix."""
    suffixes = tuple(suffixes)
    last = unicodedata.normalize("NFC", name).replace("\\", "/").rpartition("/")[2]
    stem, dot, suffix = last.rpartition(".")
    suffix = (dot + suffix).lower()
    if suffix not in suffixes:
        raise FileError(f"{ascii(last)[1:-1][:_NAME]}: expected a file that ends in {', '.join(suffixes)}")
    stem = "".join(letter if letter.isalnum() or letter in "-_ ." else "_" for letter in stem).strip(" .")
    stem = stem.encode("utf-8", "ignore")[:_NAME].decode("utf-8", "ignore").strip(" .") or "file"
    if stem.partition(".")[0].casefold() in _RESERVED:
        stem = f"_{stem}"
    return stem + suffix


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

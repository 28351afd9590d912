"""Avatars that a person opened: kept in the folder of the work, read with limits, and the shipped ones by name."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

import numpy as np

from facegen.errors import FileError, InputError
from facegen.fileio.avatar import AvatarFile, load_avatar
from facegen.fileio.gltf_read import GltfScene
from facegen.fileio.obj import ObjFile
from facegen.fileio.textfile import make_folder, whole_file
from facegen.studio.apart import Waits, patient
from facegen.studio.limits import LIMITS, MEBIBYTE
from facegen.studio.reading import read_avatar_safely
from facegen.studio.recent import Recent
from facegen.transfer.rig import avatar_files, avatar_names

T = TypeVar("T")

FOLDER = "avatar"
"""Folder of a work that holds what was opened there."""

TAKEN = (".obj", ".glb", ".vrm", ".ply", ".stl", ".gltf")

COLOURS = ".mtl"
"""What the name of an OBJ file's colours ends in."""

_COLOURS = MEBIBYTE     # bytes: colours are a few lines
_UNSAFE = re.compile(r"[^\w.-]+")
_LONGEST = 60

# Avatars in memory: those of a few steps of undo.
_recent: Recent[AvatarFile] = Recent(4)


@dataclass(frozen=True, eq=False)
class Opened:
    """``name`` as the work has it, ``path``, ``avatar`` as its file has it."""

    name: str
    path: Path
    avatar: AvatarFile

    @property
    def summary(self) -> str:
        """What it is, in a line."""
        mesh = self.avatar.mesh
        parts = "1 part" if len(mesh.parts) == 1 else f"{len(mesh.parts)} parts"
        own = f", {len(self.avatar.shapes)} blendshapes of its own" if self.avatar.shapes else ""
        return f"**{self.name}**: {len(mesh.faces):,} triangles, {parts}{own}"

    @property
    def output(self) -> str:
        """The name of the file that it gets with blendshapes: a VRM stays one."""
        return f"{Path(self.name).stem}{'.vrm' if self.path.suffix.lower() == '.vrm' else '.glb'}"


def safe_name(name: str, taken: tuple[str, ...] = TAKEN, kind: str = "an avatar") -> str:
    """Return a file's name without what could lead out of a folder; InputError for a kind that is not taken."""
    base = str(name).replace("\\", "/").rsplit("/", 1)[-1]
    stem, dot, suffix = base.rpartition(".")
    suffix = f"{dot}{suffix}".lower()
    if suffix not in taken:
        raise InputError(f"file: expected {kind} that ends in {', '.join(taken)}, got '{base[:_LONGEST]}'")
    stem = _UNSAFE.sub("_", stem).strip("._") or kind.split()[-1]
    return stem[:_LONGEST] + suffix


def keep(folder: Path, name: str, content: bytes, waits: Waits = patient) -> str:
    """Keep a file that came from a browser in a work's folder and return its name there; InputError if it is too much.

    Another file of the same name stays: who undoes goes back to it. The file is read before it is kept, by a process of
    its own. waits: see `facegen.studio.apart.ask`.
    """
    name = safe_name(name)
    if len(content) > LIMITS.file_bytes:
        raise InputError(f"file: '{name}' has {len(content) / MEBIBYTE:.0f} MB, the studio takes up to "
                         f"{LIMITS.file_bytes / MEBIBYTE:.0f}; leave out pictures and clothes, or use the command "
                         "facegen rig")
    place = make_folder(folder / FOLDER)
    kept, found = keep_read(place, name, content, lambda path: _read(path, waits), "the avatar ", _taken)
    _recent.put(_key(place / kept), _moved(found, place / kept))
    return kept


def keep_read(place: Path, name: str, content: bytes, read: Callable[[Path], T], what: str,
              taken: Callable[[Path, str], bool] = lambda place, name: False) -> tuple[str, T]:
    """Keep a file in a folder, under a name that is free, once ``read(path)`` took it; return that name and what was
    read. What cannot be read is told by the name it came with, and leaves nothing."""
    kept = _free(place, name, content, taken)
    with whole_file(place / kept, what) as draft:
        trial = draft.with_suffix(Path(name).suffix)            # readers go by it
        try:
            trial.write_bytes(content)
            with called(trial, name):
                found = read(trial)
            trial.replace(draft)
        finally:
            trial.unlink(missing_ok=True)
    return kept, found


def _free(place: Path, name: str, content: bytes, taken: Callable[[Path, str], bool]) -> str:
    """Return a name that is free in a folder, or that of the same file there. taken: whether more forbids a name."""
    path, number = Path(name), 1
    while taken(place, name) or ((place / name).exists() and (place / name).read_bytes() != content):
        number += 1
        name = f"{path.stem}-{number}{path.suffix}"
    return name


def _taken(place: Path, name: str) -> bool:
    """Return whether another avatar's blendshapes would go into the same file: cat.obj's and cat.ply's into cat.glb."""
    stem = Path(name).stem
    return stem in avatar_names() or any(one.name != name and one.stem == stem and one.suffix in TAKEN
                                         for one in place.iterdir())


def keep_from(folder: Path, path: Path, waits: Waits = patient) -> str:
    """Keep a copy of a file of this machine, and of its colours, in a work's folder; as `keep`."""
    name = keep(folder, path.name, path.read_bytes(), waits)
    opened = open_avatar(folder, name)
    for library in _libraries(opened.avatar):
        beside = path.parent / library
        if beside.is_file() and beside.stat().st_size <= _COLOURS:
            keep_colours(folder, opened, library, beside.read_bytes())
    return name


def keep_colours(folder: Path, opened: Opened, name: str, content: bytes) -> None:
    """Keep the colours (.mtl) of an OBJ file beside it; InputError if they are not that file's, or too much."""
    base = str(name).replace("\\", "/").rsplit("/", 1)[-1]
    if base not in _libraries(opened.avatar):
        wanted = ", ".join(_libraries(opened.avatar))
        raise InputError(f"file: '{base[:_LONGEST]}' has no colours of {opened.name}"
                         + (f", which has them in {wanted}" if wanted else ", which names no file of colours"))
    if len(content) > _COLOURS:
        raise InputError(f"file: '{base}' is too large for a list of colours")
    with whole_file(folder / FOLDER / base, "the colours ") as draft:
        draft.write_bytes(content)
    _recent.forget(_key(opened.path))


def lost_colours(opened: Opened) -> str | None:
    """Return the name of the file with an OBJ file's colours, if it is not there."""
    libraries = _libraries(opened.avatar)
    return libraries[0] if libraries and not opened.avatar.colours else None


def _libraries(avatar: AvatarFile) -> list[str]:
    """Return the names of files with colours that an OBJ file names and that lie beside it."""
    lines = avatar.source.libraries if isinstance(avatar.source, ObjFile) else ()
    names = [name.replace("\\", "/").rsplit("/", 1)[-1] for line in lines for name in (line, *line.split())]
    return [name for name in dict.fromkeys(names) if name.lower().endswith(COLOURS) and not set(name) & set(":\0")
            and not name.startswith(".")]


@contextmanager
def called(path: Path, name: str) -> Iterator[None]:
    """Have errors say a file's own name instead of where it is kept."""
    try:
        yield
    except InputError as error:
        raise InputError(str(error).replace(str(path), name).replace(path.name, name)) from None


def open_avatar(folder: Path, name: str) -> Opened:
    """Return an avatar that was kept in a work's folder, or a shipped one by name; InputError or FileError."""
    if name in avatar_names():
        path = avatar_files(name, None)[0]
        return Opened(name, path, _recent.get(_key(path), lambda: load_avatar(path)))
    path = folder / FOLDER / safe_name(name)
    if not path.is_file():
        raise FileError(f"avatar: '{name}' is no longer in the folder of this work; open it again")
    return Opened(name, path, _recent.get(_key(path), lambda: _read(path)))


def _key(path: Path) -> tuple[Path, int]:
    return path, path.stat().st_mtime_ns


def _read(path: Path, waits: Waits = patient) -> AvatarFile:
    """Return what a process of its own reads of a file that a person sent."""
    found = read_avatar_safely(path, LIMITS, waits)
    _check(found, path.name)
    return found


def _moved(avatar: AvatarFile, path: Path) -> AvatarFile:
    """Return an avatar whose file has another path."""
    source = avatar.source
    if isinstance(source, GltfScene):
        source = replace(source, file=replace(source.file, path=path))
    return replace(avatar, path=path, source=source)


def _check(avatar: AvatarFile, name: str) -> None:
    mesh = avatar.mesh
    if not len(mesh.faces):
        raise InputError(f"'{name}' has no triangles: there is nothing to put a face on")
    used = mesh.vertices[np.unique(mesh.faces)]
    bad = int((~np.isfinite(used).all(axis=1)).sum())
    if bad:
        raise InputError(f"'{name}': {bad} of {len(used)} vertices are NaN or infinite; export it again")
    if not np.ptp(used, axis=0).max() > 0:
        raise InputError(f"'{name}': all vertices lie on one place; export it again")

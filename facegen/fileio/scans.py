"""PLY and STL files, read by trimesh: the only place that imports it for reading."""

from __future__ import annotations

import io
import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from facegen.errors import FileError, InputError
from facegen.fileio.binfile import read_bytes
from facegen.geometry.mesh import Mesh

_STL_HEAD, _STL_TRIANGLE = 84, 50                   # bytes of a binary STL file


def read_scan(path: Path) -> tuple[Mesh, NDArray[np.float64] | None, bytes]:
    """Return the mesh of a PLY or STL file, its vertex colours (n, 3) sRGB 0..255 if any, and its bytes.

    Vertices keep their number and order; an STL file's triangles share none. Raises FileError for the file and
    InputError if trimesh is not installed.
    """
    kind = path.suffix.lower()[1:]
    trimesh = _trimesh(kind)
    raw = read_bytes(path, what="avatar", kind=f"a {kind.upper()} file")
    _check_sizes(path, kind, raw)
    options = {"fix_texture": False, "skip_materials": True} if kind == "ply" else {}
    try:
        found = trimesh.load(io.BytesIO(raw), file_type=kind, process=False, maintain_order=True, **options)
    except Exception as error:                      # whatever a broken file makes its parsers raise
        raise FileError(f"{path}: cannot be read as a {kind.upper()} file "
                        f"({type(error).__name__}: {str(error)[:100]})") from None
    vertices, faces = np.asarray(getattr(found, "vertices", ())), np.asarray(getattr(found, "faces", ()))
    if not vertices.size or not faces.size:
        raise FileError(f"{path}: holds no triangles; expected a surface, not points or lines")
    if vertices.ndim != 2 or vertices.shape[1] != 3 or faces.ndim != 2 or faces.shape[1] != 3:
        raise FileError(f"{path}: expected triangles in space, got vertices {vertices.shape}, faces {faces.shape}")
    if not np.isfinite(vertices).all():
        bad = np.flatnonzero(~np.isfinite(vertices).all(axis=1))
        raise FileError(f"{path}: {len(bad)} vertices are NaN or infinite, the first is number {bad[0]}")
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise FileError(f"{path}: faces refer to vertices {faces.min()}..{faces.max()}; there are {len(vertices)}")
    return Mesh.of(vertices, faces), _colours(found, len(vertices)), raw


def _trimesh(kind: str) -> Any:
    """Return trimesh, or raise InputError that says how to get it."""
    try:
        import trimesh
    except ImportError as error:
        raise InputError(f"avatar: .{kind} files need trimesh, which is not installed: "
                         "pip install \"facegen[avatars]\" (.obj, .glb, .gltf and .vrm work without)") from error
    return trimesh


def _check_sizes(path: Path, kind: str, raw: bytes) -> None:
    """Raise FileError if a file says that it has more than its bytes can hold, before memory is taken for it."""
    if not raw:
        raise FileError(f"{path}: is empty")
    if kind == "ply":
        head = raw[:raw.find(b"end_header") if b"end_header" in raw else 0]
        for name, count in re.findall(rb"element\s+(\S+)\s+(\d+)", head):
            if len(count) > 12 or int(count) > len(raw):
                raise FileError(f"{path}: says that it has {count[:20].decode()} of '{name[:20].decode('latin-1')}', "
                                f"but has only {len(raw):,} bytes")
    elif len(raw) >= _STL_HEAD and not raw.lstrip().startswith(b"solid"):
        count = int.from_bytes(raw[80:84], "little")
        if _STL_HEAD + _STL_TRIANGLE * count > len(raw):
            raise FileError(f"{path}: says that it has {count:,} triangles, but has only {len(raw):,} bytes; it is "
                            "truncated")


def _colours(found: Any, count: int) -> NDArray[np.float64] | None:
    visual = getattr(found, "visual", None)
    if getattr(visual, "kind", None) != "vertex":
        return None
    colours = np.asarray(visual.vertex_colors, dtype=np.float64)
    return colours[:, :3].copy() if colours.ndim == 2 and len(colours) == count else None

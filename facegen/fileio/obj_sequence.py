"""Shapes as a folder of OBJ files: the avatar's own lines, with only the coordinates of moved vertices changed."""

from __future__ import annotations

import math
import os
import re
import shutil
from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from facegen.errors import FileError, InputError
from facegen.fileio.gltf_local import size_of
from facegen.fileio.obj import ObjFile, format_obj
from facegen.fileio.textfile import make_folder
from facegen.geometry.mesh import Mesh

# The three numbers of a "v" line; a backslash may stand at the end of a line that goes on in the next.
_GAP = rb"(?:[ \t\f\v]|\\(?:\r\n|\n|\r))"
_VERTEX = re.compile(rb"(?:\A(?:\xef\xbb\xbf)?|(?<=[\r\n]))" + _GAP + rb"*v" + _GAP + rb"+([^\s\\]+)" + _GAP
                     + rb"+([^\s\\]+)" + _GAP + rb"+([^\s\\]+)")
NEUTRAL = "neutral"
# Windows keeps these names for devices; colons and the like are no part of a name there.
_FORBIDDEN = re.compile(r'[\x00-\x1f/\\:*?"<>|]|^\.|[. ]$|^(?:con|prn|aux|nul|com\d|lpt\d)$', re.IGNORECASE)
_LONGEST = 120
# Because this share of the avatar's size is below what its float32 copies in other programs can hold.
_FINEST = 1e-8


def check_names(names: Iterable[str]) -> None:
    """Raise InputError for shapes that cannot each be a file of that name, on any system."""
    seen = {}
    for name in names:
        if _FORBIDDEN.search(name) or len(name) > _LONGEST:
            raise InputError(f"shapes: '{name[:80]}' cannot be the name of a file; write a .glb or .npz file, or give "
                             "it another name")
        if name.casefold() in seen:
            raise InputError(f"shapes: '{seen[name.casefold()]}' and '{name}' would be the same file on many systems; "
                             "write a .glb or .npz file")
        seen[name.casefold()] = name


def save_sequence(folder: Path, mesh: Mesh, source: ObjFile | None, shapes: Mapping[str, NDArray[np.float64]]) -> Path:
    """Write ``neutral.obj`` and one OBJ file a shape (n, 3) into a folder and return it.

    source: an OBJ file whose lines are kept; without one the mesh is written plainly. Other files in the folder stay.
    All files are written elsewhere first and then moved in. Raises InputError for a name, FileError for the folder.
    """
    check_names(shapes)
    if any(np.any(shape) for name, shape in shapes.items() if name.casefold() == NEUTRAL):
        raise InputError(f"shapes: '{NEUTRAL}' moves the avatar, but {NEUTRAL}.obj is the avatar in rest; rename it")
    decimals = _decimals(mesh)
    rewriter = _Rewriter(source, decimals) if source is not None else None
    draft = folder.with_name(f".{folder.name}.{os.urandom(4).hex()}.part")
    try:
        draft.mkdir()
        for name, shape in {NEUTRAL: np.zeros_like(mesh.vertices), **shapes}.items():
            data = rewriter.moved(mesh.vertices, shape) if rewriter else \
                format_obj(mesh.with_vertices(mesh.vertices + shape), decimals=decimals).encode()
            (draft / f"{name}.obj").write_bytes(data)
        if not folder.exists():
            os.replace(draft, folder)
        else:
            make_folder(folder)
            for file in sorted(draft.iterdir()):
                os.replace(file, folder / file.name)
    except OSError as error:
        raise FileError(f"{folder}: the OBJ files cannot be written: {error.strerror or error}") from error
    finally:
        shutil.rmtree(draft, ignore_errors=True)
    return folder


def _decimals(mesh: Mesh) -> int:
    """Return how many decimals coordinates of the avatar's size need."""
    size = size_of(mesh.vertices)
    return min(max(0, math.ceil(-math.log10(_FINEST * size))), 30) if size > 0 else 6


class _Rewriter:
    """Puts other coordinates into the text of an OBJ file. Vertices that do not move keep every character."""

    def __init__(self, source: ObjFile, decimals: int) -> None:
        spans = [match.span(group) for match in _VERTEX.finditer(source.raw) for group in (1, 2, 3)]
        if len(spans) != source.mesh.vertices.size:
            raise InputError("shapes: the lines of this OBJ file cannot be told apart, so its text cannot be kept; "
                             "write a .glb or .npz file")
        self._numbers = [source.raw[start:stop] for start, stop in spans]
        ends = [0, *(stop for _, stop in spans)]
        starts = [*(start for start, _ in spans), len(source.raw)]
        self._between = [source.raw[end:start] for end, start in zip(ends, starts, strict=True)]
        self._form = f"%.{decimals}f"

    def moved(self, vertices: NDArray[np.float64], shape: NDArray[np.float64]) -> bytes:
        """Return the file's bytes with vertices (n, 3) moved by (n, 3)."""
        numbers = list(self._numbers)
        rows = np.flatnonzero((shape != 0).any(axis=1))
        words = " ".join([self._form] * (3 * len(rows))) % tuple((vertices[rows] + shape[rows]).ravel().tolist())
        for row, three in zip(rows.tolist(), zip(*[iter(words.encode().split())] * 3, strict=True), strict=True):
            numbers[3 * row:3 * row + 3] = three
        pieces = [b""] * (2 * len(numbers) + 1)
        pieces[::2], pieces[1::2] = self._between, numbers
        return b"".join(pieces)

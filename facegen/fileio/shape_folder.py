"""A folder of OBJ files as an avatar with shapes: ``neutral.obj`` and one a shape, as `save_avatar` writes them."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

import numpy as np

from facegen.errors import FileError
from facegen.fileio.avatar import AvatarFile, load_avatar
from facegen.fileio.obj import read_obj
from facegen.fileio.obj_sequence import NEUTRAL


def load_shape_folder(folder: str | os.PathLike[str]) -> AvatarFile:
    """Return the neutral of a folder, with every other OBJ file of it as a shape of its name, in alphabetical order.

    Raises FileError: no folder, no ``neutral.obj``, no other OBJ file, or one with other vertices or faces.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise FileError(f"{folder}: expected a folder with {NEUTRAL}.obj and an OBJ file for each shape")
    files = {path.stem: path for path in sorted(folder.glob("*")) if path.suffix.lower() == ".obj"}
    if NEUTRAL not in files:
        raise FileError(f"{folder}: {NEUTRAL}.obj is missing, the face in rest; the other OBJ files are its shapes")
    neutral = load_avatar(files.pop(NEUTRAL))
    if not files:
        raise FileError(f"{folder}: beside {NEUTRAL}.obj it has no OBJ file, so no shape")
    digest, shapes = hashlib.sha256(neutral.digest.encode()), {}
    for name, path in files.items():
        found = read_obj(path)
        if len(found.mesh.vertices) != len(neutral.mesh.vertices):
            raise FileError(f"{path}: has {len(found.mesh.vertices)} vertices, {NEUTRAL}.obj has "
                            f"{len(neutral.mesh.vertices)}; a shape has the same vertices in the same order")
        if not all(map(np.array_equal, found.polygons, neutral.source.polygons)):
            raise FileError(f"{path}: has other faces than {NEUTRAL}.obj, so its vertices may stand in another "
                            "order; export both from the same mesh")
        shapes[name] = found.mesh.vertices - neutral.mesh.vertices
        digest.update(name.encode() + found.raw)
    return AvatarFile(folder, "obj", neutral.mesh, neutral.colours, neutral.vertex_colours, shapes,
                      digest=digest.hexdigest(), source=neutral.source)

"""Adopting a head with a look at the result: `facegen.adopt`."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

from facegen.adoption.adopt import Adopted
from facegen.adoption.adopt import adopt as make
from facegen.face.face import load_face
from facegen.fileio.images import check_image_path
from facegen.jobs.preview import save_face_preview


def adopt(head: str | Path, output: str | os.PathLike[str], *, landmarks: str | Path | None = None,
          name: str | None = None, hair: bool = False, pieces: Mapping[str, str] | None = None, force: bool = False,
          preview: str | os.PathLike[str] | None = None) -> Adopted:
    """Make a parametric face out of a human head's mesh and write its folder.

    head: the path of a .obj, .glb, .gltf, .vrm, .ply or .stl file, or the name of a shipped avatar. output: a folder,
    new or empty; with ``force`` one that holds a face is replaced. landmarks: their file (docs/landmarks.md); a shipped
    avatar has its own. name: the face's; the folder's without.
    hair: give a head without hair the base face's. pieces: part, material or number of a component -> kind, as in
    `rig`. preview: where a sheet of pictures goes that shows it (.png, .webp, .jpg). Raises InputError and its
    children; nothing is written then. ::

        facegen.adopt("me.obj", "me", landmarks="me.yaml", preview="me.png")
        facegen.load_face("me").pose("happiness")
    """
    if preview is not None:
        check_image_path(preview)
    made = make(head, output, landmarks=landmarks, name=name, hair=hair, pieces=pieces, force=force)
    if preview is not None:
        save_face_preview(load_face(made.path), preview)
    return made

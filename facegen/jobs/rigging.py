"""Rigging with a look at the result: `facegen.rig`."""

from __future__ import annotations

import inspect
import os
from pathlib import Path
from typing import Any

from facegen.face.avatar import AvatarFace
from facegen.fileio.images import check_image_path
from facegen.jobs.preview import save_preview
from facegen.transfer.rig import Rigged
from facegen.transfer.rig import rig as make


def rig(avatar: str | Path, output: str | Path, *, preview: str | os.PathLike[str] | None = None,
        **options: Any) -> Rigged:
    """Give an avatar blendshapes and write it.

    preview: where a sheet of pictures goes that shows them (.png, .webp, .jpg). Everything else: see
    `facegen.transfer.rig.rig`. Raises InputError and its children; nothing is written then. ::

        facegen.rig("cat.obj", "cat.glb", landmarks="cat.yaml", preview="cat.png")
        facegen.load_face("cat.glb").pose("happiness")
    """
    if preview is not None:
        check_image_path(preview)
    made = make(avatar, output, **options)
    if preview is not None:
        save_preview(AvatarFace(made.avatar), preview)
    return made


_of_make = inspect.signature(make)
rig.__signature__ = _of_make.replace(parameters=[
    *_of_make.parameters.values(), inspect.signature(rig).parameters["preview"]])

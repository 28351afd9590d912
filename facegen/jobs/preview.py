"""A sheet of pictures that shows what an avatar's blendshapes do: what to look at after rigging."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from facegen.errors import InputError
from facegen.face.avatar import AvatarFace
from facegen.face.face import Face
from facegen.face.loader import FINEST
from facegen.face.rig import Rig
from facegen.fileio.images import check_image_path, contact_sheet, save_image
from facegen.progress import Progress, counted, silent
from facegen.render.render import Renderer

EXPRESSIONS = {**{name: name for name in ("happiness", "sadness", "surprise", "fear", "anger", "disgust", "contempt")},
               "eyes shut": "43E", "jaw open": "27E", "smile, left": "L12E", "look left": "61E"}
"""Label -> what is shown if the blendshapes can make it."""

VIEWS = ((0.0, 0.0), (35.0, 0.0))
POSES, ROW = 20, 4      # on a sheet, with the neutral; in a row of it
# Because so many vertices, evenly taken, say which shapes are unlike each other.
_SPEAKERS = 4000
# The finest level of a parametric face: a person's wrinkles are what one looks for.
_DETAIL = FINEST
# Because a shape of which no more than this share is new, squared, shows nothing new.
_SAID = 0.01


def save_preview(face: AvatarFace, path: str | os.PathLike[str], *, size: int = 192, progress: Progress = silent
                 ) -> Path:
    """Draw the neutral, expressions, and the blendshapes that say the most, each from two views; return the path.

    size: pixels of each picture. progress: called before each pose. The sheet appears whole or not at all. Raises
    InputError or FileError. ::

        save_preview(facegen.load_face("cat.glb"), "cat.png")
    """
    return save_poses(face, telling_poses(face), path, size=size, progress=progress)


def save_face_preview(face: Face, path: str | os.PathLike[str], *, size: int = 192) -> Path:
    """Draw a parametric face, its neutral and expressions, each from two views; return the path. As `save_preview`."""
    poses = {"neutral": face.pose(detail=_DETAIL)}
    poses |= {label: face.pose(what, detail=_DETAIL) for label, what in EXPRESSIONS.items()}
    return save_poses(face, poses, path, size=size, detail=_DETAIL)


def save_poses(face: Rig, poses: Mapping[str, NDArray], path: str | os.PathLike[str], *, size: int = 192,
               detail: int | None = None, progress: Progress = silent) -> Path:
    """Draw poses, label -> vertices (n, 3), each from two views, as one sheet; return the path."""
    path = check_image_path(path)
    around = np.concatenate(list(poses.values()))
    renderers = [Renderer(face, size=size, view=view, around=around, detail=detail) for view in VIEWS]
    drawn = [[renderer.draw(vertices) for renderer in renderers]
             for vertices in counted(progress, "drawing", list(poses.values()))]
    labels = [f"{name} {view[0]:g},{view[1]:g}" if any(view) else name for name in poses for view in VIEWS]
    pictures = [picture for both in drawn for picture in both]
    return save_image(contact_sheet(pictures, labels, ROW * len(VIEWS)), path)


def telling_poses(face: AvatarFace, count: int = POSES) -> dict[str, NDArray[np.float64]]:
    """Return name -> vertices (n, 3) of the neutral, of the expressions that an avatar can make, and of blendshapes up
    to ``count`` in all."""
    rest = face.mesh().vertices
    shown = {label: face.pose(what) for label, what in EXPRESSIONS.items() if _can_make(face, what)}
    poses = {"neutral": rest, **dict(list(shown.items())[:count - 1])}
    own = {shape: name for name, (shape, _) in face.known.items()}
    for name in telling_shapes(face, count - len(poses), besides=list(shown.values())):
        corrects = own.get(face.known[name][1].minus) if name in face.known else None
        weights = {name: 1.0} if corrects is None else {corrects: 1.0, name: 1.0}   # alone it means nothing
        poses[" + ".join(weights)] = face.pose_shapes(weights)
    return poses


def _can_make(face: AvatarFace, expression: str) -> bool:
    """Return whether an expression comes out as what it is."""
    try:
        return not face.check(face.resolve(expression))
    except InputError:              # no blendshape has a name that is understood
        return False


def telling_shapes(face: AvatarFace, count: int, *, besides: Sequence[NDArray] = ()) -> list[str]:
    """Return the blendshapes that say the most, in the file's order: each time the one that moves most in a way that no
    sum of those before does (Cholesky decomposition of their products, with pivots). besides: poses (n, 3) that are
    shown anyway."""
    rest = face.mesh().vertices
    rows = np.unique(np.linspace(0, len(rest) - 1, _SPEAKERS).astype(int))
    every = [*besides, *(face.pose_shapes({name: 1.0}) for name in face.shapes)]
    moves = np.array([(vertices[rows] - rest[rows]).ravel() for vertices in every])
    products = moves @ moves.T
    least = _SAID * products.diagonal()
    chosen: list[int] = []
    for step in range(len(besides) + max(count, 0)):
        worth = np.where(products.diagonal() > least, products.diagonal(), 0.0)
        best = step if step < len(besides) else len(besides) + int(worth[len(besides):].argmax())
        if worth[best] <= 0.0:
            if step < len(besides):
                continue
            break
        chosen.append(best - len(besides))
        products = products - np.outer(products[best], products[best]) / products[best, best]
        products[best] = products[:, best] = 0.0
    return [face.shapes[i] for i in sorted(chosen) if i >= 0]

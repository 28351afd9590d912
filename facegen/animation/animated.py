"""Clips and recordings as animations in glTF files: of an avatar in its own file, of the parametric face in a new one.

The parametric face gets the shapes that are needed: those of a recording by their names, for a clip the units that
move. Shapes go straight where the parametric face turns lids, jaw and eyes, so between rest and full weight the file
differs from the face a little; the head turns on a joint, as on the face.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from facegen.animation.motion import Motion
from facegen.blendshapes.recipes import Recipe, shape_set
from facegen.face.avatar import AvatarFace
from facegen.face.avatar_notes import METRE
from facegen.face.colours import CLAY, COLOURS
from facegen.face.face import Face, load_face
from facegen.face.head import rotation
from facegen.face.motion import shape_motion
from facegen.fileio.avatar import ANIMATED, AvatarFile, save_animated, with_shapes
from facegen.fileio.gltf_animate import Keys
from facegen.fileio.gltf_neck import Neck
from facegen.fileio.textfile import check_place
from facegen.progress import Progress, counted, silent, within

Array = NDArray[np.float64]

_DETAIL = 2             # of the parametric face in a file: what a picture of 512 pixels shows
_SKULL = ("hair", "brows")


@dataclass(frozen=True, eq=False)
class Animated:
    """What was written: ``path``, ``keys``: how many its animation has, ``names`` of the animated shapes, and
    ``warnings``."""

    path: Path
    keys: int
    names: tuple[str, ...]
    warnings: tuple[str, ...]


def save_animation(motion: Motion, path: str | os.PathLike[str], *, face: str | os.PathLike[str] = "akimoto",
                   fps: float = 25.0, detail: int | None = None, progress: Progress = silent) -> Animated:
    """Write a clip or a recording as an animation of blendshape weights (.glb, .gltf, .vrm).

    A recording keeps its own frames, the first at 0 s; a clip gets ``fps`` of them a second. The animation has the name
    of the file. detail: of the parametric face. Raises InputError, or FileError for the path, before anything is
    written. progress: called before each key.
    """
    path = check_place(path, ANIMATED)
    times, rig = motion.key_times(fps), load_face(face)
    cues, shown = [motion.cue(t) for t in times.tolist()], motion.shown
    if isinstance(rig, AvatarFace):
        avatar, weight = rig, rig.neck_weight if rig.notes.framed else None
    else:
        motion.check(rig)               # what this face cannot show is said before long work
        avatar, weight = as_avatar(rig, shown.recipes(cues), _DETAIL if detail is None else detail)
        shown = shown.on_recipes
    warnings = [*motion.check(avatar)]
    weigh = shown.weights_on(avatar)
    found = [weigh(cue) for cue in counted(within(progress, 0.0, 0.9), "making the keys", cues)]
    progress("writing the animation", 0.9)
    weights = avatar.corrected(np.array([one for one, _ in found]))
    head = np.array([turn for _, turn in found])
    keys, neck = _keys(path.stem, times, weights, head, avatar), _neck(avatar, weight)
    path, turned = save_animated(avatar.file, path, keys, neck=neck)
    if keys.turn is not None:
        warnings = [one for one in warnings if "neck" not in one]       # a joint may turn what facegen cannot
        if not turned:
            warnings.append(f"{avatar.path.name} has no joint that turns its head, and none can be added, so the head "
                            "does not turn in the file")
    return Animated(path, len(times), keys.names, tuple(dict.fromkeys(warnings)))


def as_avatar(face: Face, recipes: Mapping[str, Recipe], detail: int) -> tuple[AvatarFace, Array]:
    """Return the parametric face as an avatar in metres with some shapes, all units if there are none, and how much of
    the head's turn each of its vertices (n, 1) makes."""
    recipes = recipes or shape_set("units")
    mesh = face.mesh(detail)
    marks = face.landmark_points(mesh.vertices, detail=detail)
    notes = {
        "version": 1, "frame": {"scale": METRE, "rotation": np.eye(3).tolist(), "offset": [0.0, 0.0, 0.0]},
        "landmarks": {name: (at / METRE).tolist() for name, at in marks.items()},
        "neck": (face.neck / METRE).tolist(), "sets": sorted({one.set for one in recipes.values()}),
        "shapes": {name: {"set": one.set} for name, one in recipes.items()},
        "pieces": {part: "skull" if part in _SKULL else part for part in mesh.parts}}
    colours = {name: COLOURS.get(name, CLAY) for name in mesh.materials}
    file = AvatarFile(Path(f"{face.name}.glb"), "obj", mesh.with_vertices(mesh.vertices / METRE), colours)
    motion = shape_motion(face, recipes, detail=detail) / METRE
    file, rows = with_shapes(file, dict(zip(recipes, motion, strict=True)), notes=notes)
    return AvatarFace(file), face.neck_weight(detail)[rows]


def _keys(name: str, times: Array, weights: Array, head: Array, avatar: AvatarFace) -> Keys:
    """Return the keys of the shapes that move, and of the head if it does, in the file's axes and units."""
    moving = np.flatnonzero(weights.any(axis=0))
    if not len(moving):
        moving = np.arange(len(avatar.shapes))
    names = tuple(avatar.shapes[k] for k in moving)
    if not head.any():
        return Keys(name, times, names, weights[:, moving])
    axes, scale = avatar.notes.rotation, avatar.notes.scale
    return Keys(name, times, names, weights[:, moving], axes.T @ rotation(head) @ axes, head[:, 3:] * axes[2] / scale)


def _neck(avatar: AvatarFace, weight: Array | None) -> Neck | None:
    if weight is None:
        return None
    notes = avatar.notes
    return Neck((avatar.neck - notes.offset) @ notes.rotation / notes.scale, weight[:, 0])

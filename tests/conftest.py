"""Avatars made of the base face itself: what its shapes should look like is then known."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from facegen.blendshapes.recipes import shape_set
from facegen.face.face import load_face
from facegen.face.motion import shape_motion
from facegen.fileio.avatar import AvatarFile, save_avatar
from facegen.fileio.kept import VARIABLE

RIG_DETAIL = 1
NECK = [0.0, -70.0, -75.0]


@pytest.fixture(scope="session", autouse=True)
def _own_cache(tmp_path_factory):
    """Nothing is kept in the folder of whoever runs the tests, nor found there."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(VARIABLE, str(tmp_path_factory.mktemp("cache")))
        yield


@pytest.fixture(scope="session")
def rig_of():
    """Return a function: sets of shapes -> AvatarFile of the base face, in metres or as told."""
    face = load_face()
    mesh = face.mesh(RIG_DETAIL)
    pieces = {part: "skull" if part in ("hair", "brows") else part for part in mesh.parts}
    marks = face.landmark_points(mesh.vertices, detail=RIG_DETAIL)

    def make(*sets: str, notes: bool = True, scale: float = 1e-3, rotation=None, offset=(0.0, 0.0, 0.0),
             name: str = "rig", rename=lambda shape: shape, colours=None) -> AvatarFile:
        turn = np.eye(3) if rotation is None else np.asarray(rotation, float)
        recipes = {shape: one for kind in sets for shape, one in shape_set(kind).items()}
        motion = shape_motion(face, recipes, detail=RIG_DETAIL)

        def there(places):
            return scale * (np.asarray(places) @ turn.T) + np.asarray(offset)

        written = {}
        if notes:
            back = {"scale": 1 / scale, "rotation": turn.T.tolist(),
                    "offset": (-(1 / scale) * (turn.T @ np.asarray(offset))).tolist()}
            written = {"version": 1, "frame": back, "sets": list(sets), "neck": there(NECK).tolist(),
                       "landmarks": {mark: there(at).tolist() for mark, at in marks.items()},
                       "shapes": {rename(shape): {"set": one.set} for shape, one in recipes.items()}, "pieces": pieces}
        return AvatarFile(Path(f"{name}.glb"), "glb", mesh.with_vertices(there(mesh.vertices)),
                          shapes={rename(shape): scale * (motion[row] @ turn.T) for row, shape in enumerate(recipes)},
                          notes=written, digest="0" * 64, colours=colours or {})

    return make


@pytest.fixture(scope="session")
def rig_file(rig_of, tmp_path_factory):
    """Return a function: sets of shapes -> path of a GLB file of the base face."""
    made: dict = {}

    def path(*sets: str, **how) -> Path:
        key = (sets, tuple(sorted(how.items())))
        if key not in made:
            one = rig_of(*sets, **how)
            target = tmp_path_factory.mktemp("rigs") / f"{'-'.join(sets)}.glb"
            made[key] = save_avatar(AvatarFile(Path("x.obj"), "obj", one.mesh), target, one.shapes, notes=one.notes)
        return made[key]

    return path

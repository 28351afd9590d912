"""A little change of an avatar is a little change of its shapes; and a mouth's motion is the mouth's own."""

from dataclasses import replace

import numpy as np
import pytest

from facegen.blendshapes.recipes import shape_sets
from facegen.face.face import load_face
from facegen.fileio.avatar import load_avatar
from facegen.geometry.mesh import Mesh
from facegen.transfer.landmarks import load_landmarks
from facegen.transfer.part_motion import MEMBERS, PartMotion, spread
from facegen.transfer.rig import avatar_path
from facegen.transfer.template import template_of
from facegen.transfer.transfer import transfer

SHAPES = ("AU10_L", "AU12_L", "AU20_L", "AU18", "AU27")


def with_fin(mesh: Mesh) -> Mesh:
    """Return a mesh with a triangle at the back of its skin drawn out to a point, of new vertices."""
    skin = mesh.parts.index("skin")
    rows = np.flatnonzero(mesh.face_parts == skin)
    back = rows[mesh.vertices[mesh.faces[rows]].mean(axis=1)[:, 2].argmin()]
    a, b, c = mesh.faces[back]
    n = len(mesh.vertices)
    tip = mesh.vertices[[a, b, c]].mean(axis=0) - [0, 0, 0.15 * np.ptp(mesh.vertices[:, 1])]
    return replace(mesh, vertices=np.vstack([mesh.vertices, tip]),
                   faces=np.vstack([mesh.faces, [[a, b, n], [b, c, n], [c, a, n]]]).astype(mesh.faces.dtype),
                   face_parts=np.append(mesh.face_parts, [skin] * 3),
                   face_materials=np.append(mesh.face_materials, [mesh.face_materials[back]] * 3))


@pytest.mark.parametrize("name", ["horse", "cat"])
def test_a_fin_on_the_back_of_the_head_leaves_the_face_as_it_is(name):
    path = avatar_path(name)
    mesh = load_avatar(path).mesh
    landmarks = load_landmarks(path.with_name("landmarks.yaml"), mesh)
    template = template_of(load_face(), {shape: one for shape, one in shape_sets(["units"]).items() if shape in SHAPES})
    without, found = (transfer(one, landmarks, template).shapes for one in (mesh, with_fin(mesh)))
    for shape in SHAPES:
        largest = np.linalg.norm(without[shape], axis=1).max()
        assert np.linalg.norm(found[shape][:len(mesh.vertices)] - without[shape], axis=1).max() < 0.05 * largest, shape


def test_a_nose_has_no_say_at_the_mouth_nor_a_mouth_at_the_nose(template):
    """On a muzzle they are turned against each other."""
    marks = template.landmarks

    def moved(part: str, at: str) -> np.ndarray:
        """Return the matrices at a part's landmarks where one part alone is scaled by two."""
        matrices = {one: np.eye(3) * (2.0 if one == part else 1.0) for one in MEMBERS}
        turns = {one: np.eye(3) for one in MEMBERS}
        places = np.array([marks[name] for name in MEMBERS[at] if name in marks])
        return spread(PartMotion(matrices, turns, turns), marks, places)[0][:, 0, 0]

    for part, other in (("nose", "mouth"), ("mouth", "nose")):
        assert np.abs(moved(part, other) - 1.0).max() < 1e-9
        assert moved(part, part).min() > 1.4

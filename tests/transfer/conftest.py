"""The template of all units, made once, and copies of it with other triangles."""

from types import SimpleNamespace

import numpy as np
import pytest

from facegen.face.face import load_face
from facegen.facs.tables import load_units
from facegen.geometry.closest import ClosestPoints
from facegen.geometry.operators import Surface
from facegen.transfer.template import template_of


@pytest.fixture(scope="session")
def template():
    shapes = {name: SimpleNamespace(deformation=(deformation,), minus=None)
              for name, deformation in load_units().basis.items() if not deformation.head}
    return template_of(load_face(), shapes)


@pytest.fixture(scope="session")
def remeshed(template):
    """Return a function: share of the triangles -> (surface, true motion (k, n, 3)), the face in other triangles.

    The mouth is open while edges collapse: touching lips would be joined.
    """
    simplify = pytest.importorskip("fast_simplification").simplify
    made = {}

    def make(share):
        if share not in made:
            pose = template.surface.vertices + template.motion[template.names.index("27")]
            faces, points = template.surface.faces, pose
            for _ in range(1 if share < 1.5 else 2):
                points, faces = _halved(points, faces)
            count = int(share * len(template.surface.faces))
            points, faces = simplify(points.astype(np.float32), faces, target_count=count)
            used, faces = np.unique(faces, return_inverse=True)
            opened = Surface(pose, template.surface.faces)
            feet = ClosestPoints(opened)(points[used].astype(float))
            corners = template.surface.faces[feet.faces]
            surface = Surface(np.einsum("nc,nci->ni", feet.weights, template.surface.vertices[corners]),
                              faces.reshape(-1, 3).astype(np.int32))
            made[share] = surface, np.einsum("nc,knci->kni", feet.weights, template.motion[:, corners])
        return made[share]

    return make


def _halved(points, faces):
    edges, of_side = Surface(points, faces).edges
    ab, bc, ca = (of_side.reshape(-1, 3) + len(points)).T
    a, b, c = faces.T
    more = np.concatenate([points, points[edges].mean(axis=1)])
    return more, np.concatenate([np.stack(t, 1) for t in ((a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca))])

"""The template of all units, and copies of it with other triangles, whose true motion is known."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
from numpy.typing import NDArray

from facegen.face.face import load_face
from facegen.face.motion import joined
from facegen.facs.tables import load_units
from facegen.geometry.closest import ClosestPoints
from facegen.geometry.mesh import Mesh, merge
from facegen.geometry.operators import Surface
from facegen.transfer.template import DETAIL, Template, template_of


def template_of_units() -> Template:
    """Return the base face as the template of every unit but the head's."""
    return template_of(load_face(), {name: SimpleNamespace(deformation=(deformation,), minus=None)
                                     for name, deformation in load_units().basis.items() if not deformation.head})


def remesh(template: Template, share: float) -> tuple[Surface, NDArray]:
    """Return the face in other triangles, ``share`` times as many, and its true motion (k, n, 3).

    The mouth is open while edges collapse: touching lips would be joined. ImportError without fast_simplification.
    """
    from fast_simplification import simplify

    pose = template.surface.vertices + template.motion[template.names.index("27")]
    faces, points = template.surface.faces, pose
    for _ in range(1 if share < 1.5 else 2):
        points, faces = _halved(points, faces)
    points, faces = simplify(points.astype(np.float32), faces,
                             target_count=int(share * len(template.surface.faces)))
    used, faces = np.unique(faces, return_inverse=True)
    feet = ClosestPoints(Surface(pose, template.surface.faces))(points[used].astype(float))
    corners = template.surface.faces[feet.faces]
    surface = Surface(np.einsum("nc,nci->ni", feet.weights, template.surface.vertices[corners]),
                      faces.reshape(-1, 3).astype(np.int32))
    return surface, np.einsum("nc,knci->kni", feet.weights, template.motion[:, corners])


def remesh_all(template: Template, share: float) -> tuple[Mesh, NDArray, NDArray]:
    """Return the face with all its parts in other triangles, its true motion (k, n, 3), and which vertices
    (n,) are the skin's. ImportError without fast_simplification."""
    from fast_simplification import simplify

    face = load_face()
    whole = face.mesh(DETAIL)
    several = [(one,) for name, one in load_units().basis.items() if not one.head]
    motion = face.pose_controls(joined(face, several), detail=DETAIL) - whole.vertices
    skin, true = remesh(template, share)
    meshes, trues = [Mesh.of(skin.vertices, skin.faces)], [true]
    for part in whole.parts[1:]:
        rows, own = np.unique(whole.faces[whole.face_parts == whole.parts.index(part)], return_inverse=True)
        surface = Surface(whole.vertices[rows], own.reshape(-1, 3).astype(np.int32))
        points, faces = _halved(surface.vertices, surface.faces)
        points, faces = simplify(points.astype(np.float32), faces.astype(np.int32),
                                 target_count=int(share * len(surface.faces)))
        used, faces = np.unique(faces, return_inverse=True)
        feet = ClosestPoints(surface)(points[used].astype(float))
        corners = rows[surface.faces[feet.faces]]
        meshes.append(Mesh.of(np.einsum("nc,nci->ni", feet.weights, whole.vertices[corners]), faces.reshape(-1, 3),
                              material=part, part=part))
        trues.append(np.einsum("nc,knci->kni", feet.weights, motion[:, corners]))
    own = np.arange(sum(map(len, (mesh.vertices for mesh in meshes)))) < len(skin.vertices)
    return merge(meshes), np.concatenate(trues, axis=1), own


def errors(found: NDArray, true: NDArray) -> tuple[float, NDArray]:
    """Return the RMS error of all shapes and of each (k,), as shares of the motion."""
    e, t = ((x**2).sum(axis=(1, 2)) for x in (found - true, true))
    return np.sqrt(e.sum() / t.sum()), np.sqrt(e / t)


def _halved(points: NDArray, faces: NDArray) -> tuple[NDArray, NDArray]:
    edges, of_side = Surface(points, faces).edges
    ab, bc, ca = (of_side.reshape(-1, 3) + len(points)).T
    a, b, c = faces.T
    more = np.concatenate([points, points[edges].mean(axis=1)])
    return more, np.concatenate([np.stack(t, 1) for t in ((a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca))])

"""What the transfer is given: the shipped human in any number of triangles, its landmarks in their places."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from facegen.data import meshes_dir
from facegen.fileio.obj import format_obj, load_obj
from facegen.geometry.mesh import Mesh
from facegen.geometry.normals import vertex_normals
from facegen.geometry.subdivision import loop_once
from facegen.transfer.landmarks import load_landmarks


def decimated_human(folder: Path, triangles: int) -> Path:
    """Write the shipped human with about so many triangles, as an OBJ file with its landmarks beside; return its path.

    Subdivided by Loop's rule until it has more, then each part's edges collapsed.
    """
    from fast_simplification import simplify

    home = meshes_dir() / "avatars" / "human"
    mesh = load_obj(home / "human.obj")
    marks = load_landmarks(home / "landmarks.yaml", mesh)
    points, faces, of = mesh.vertices, mesh.faces, mesh.face_parts
    while len(faces) < 1.5 * triangles:
        fine = loop_once(len(points), faces, np.empty((0, 2), int))
        points, faces, of = fine.matrix @ points, fine.faces, of[fine.parent_face]
    normals = vertex_normals(points, faces)
    share = triangles / len(faces)
    found: list[tuple[NDArray, NDArray]] = []
    for part in range(len(mesh.parts)):
        rows, local = np.unique(faces[of == part], return_inverse=True)
        few, corners = simplify(points[rows].astype(np.float32), local.reshape(-1, 3).astype(np.int32),
                                target_count=int(share * (of == part).sum()))
        kept, corners = np.unique(corners, return_inverse=True)
        found.append((few[kept].astype(float), corners.reshape(-1, 3)))
    starts = np.cumsum([0, *(len(part) for part, _ in found[:-1])])
    small = np.concatenate([corners + start for (_, corners), start in zip(found, starts, strict=True)])
    owner = np.repeat(np.arange(len(found)), [len(corners) for _, corners in found])
    result = Mesh(np.concatenate([part for part, _ in found]), small, mesh.parts, owner, mesh.parts, owner)
    own = vertex_normals(result.vertices, small)
    lines = ["landmarks:"]
    vertices = marks.corners[np.arange(len(marks.names)), marks.barycentric.argmax(axis=1)]
    for name, vertex in zip(marks.names, vertices, strict=True):    # the nearest, on the lip that faces the same way
        away = np.linalg.norm(result.vertices - points[vertex], axis=1)
        lines.append(f"  {name}: {np.where(own @ normals[vertex] > 0.5, away, np.inf).argmin()}")
    path = folder / f"human-{triangles}.obj"
    path.write_text(format_obj(result, decimals=4), encoding="utf-8")
    path.with_suffix(".yaml").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path

"""Landmarks: the named places that people label on pictures of faces, as data beside a mesh.

Left and right are the subject's. A place is a vertex of the mesh, a place on one of its triangles, or the nearest
place on a part to a point; it goes with the surface, through every pose and at every level of detail.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from facegen.errors import nearest
from facegen.face.attach import attach
from facegen.facs.validate import Entry
from facegen.facs.yamlfile import read_data
from facegen.geometry.mesh import Mesh


def _sides(*names: str) -> tuple[str, ...]:
    return tuple(f"{name}_{side}" for name in names for side in "LR")


REQUIRED = (
    *_sides("brow_inner", "brow_mid", "brow_outer", "eye_inner", "eye_outer", "eye_upper", "eye_lower"),
    "nose_tip", "nose_bridge", *_sides("nose_wing"),
    *_sides("mouth_corner"), "mouth_top", "mouth_inner_top", "mouth_inner_bottom", "mouth_bottom", "chin",
)
OPTIONAL = (
    *_sides("eye_upper_inner", "eye_upper_outer", "eye_lower_inner", "eye_lower_outer", "eye_center"),
    "nose_base", *_sides("mouth_upper", "mouth_lower", "jaw", "jaw_angle", "temple"),
    "head_top", "head_back", "neck",
)
NAMES = REQUIRED + OPTIONAL
_FARTHEST = 1e6     # in the mesh's units, as for every place of a face
_SUM = 1e-6         # how far barycentric weights may be from one: files round


@dataclass(frozen=True)
class Landmark:
    """One place. ``face`` (row of the coarse triangles) with ``weights`` of its corners, or ``at``, to be snapped to
    the surface of ``part``."""

    face: int = -1
    weights: tuple[float, float, float] = (1.0, 0.0, 0.0)
    at: tuple[float, float, float] | None = None
    part: str | None = None


def read_landmarks(path: Path, mesh_name: str, n_vertices: int, faces: NDArray[np.int32],
                   parts: Sequence[str] = ()) -> dict[str, Landmark]:
    """Return the landmarks in a file, in the order of `NAMES`.

    mesh_name, n_vertices, faces (m, 3): the coarse mesh that they are on. parts: what else may carry one.
    Raises TableError (unknown or missing names, indices that the mesh does not have) or FileError.
    """
    mesh, entries = landmark_entries(path)
    if mesh is not None and mesh.text() != mesh_name:
        raise mesh.fail(f"the landmarks are of the mesh '{mesh.text()}', the face uses '{mesh_name}'")
    return {name: read_landmark(entry, n_vertices, faces, parts) for name, entry in entries.items()}


def landmark_entries(path: Path | str, *, partial: bool = False) -> tuple[Entry | None, dict[str, Entry]]:
    """Return what a landmark file says of its mesh (or None) and its landmarks, not yet read, in the order of `NAMES`.

    partial: required ones may be missing. The file may say how sure it is of each (``confidence``: 0 to 1), which is
    checked and left at that. Raises TableError (unknown names; all missing ones at once) or FileError.
    """
    top = Entry(read_data(path), str(path)).fields(required=("landmarks",),
                                                   optional=("mesh", "about", "source", "confidence"))
    for name, entry in top["confidence"].items() if "confidence" in top else ():
        if name not in NAMES:
            raise entry.fail(f"unknown landmark '{name}'{nearest(name, NAMES)}")
        entry.number(0.0, 1.0)
    found = {}
    for name, entry in top["landmarks"].items():
        if name not in NAMES:
            raise entry.fail(f"unknown landmark '{name}'{nearest(name, NAMES)}")
        found[name] = entry
    missing = [f"'{name}'" for name in REQUIRED if name not in found]
    if missing and not partial:
        raise top["landmarks"].fail(f"the landmark{'s' * (len(missing) > 1)} {', '.join(missing)} "
                                    f"{'are' if len(missing) > 1 else 'is'} missing")
    return top.get("mesh"), {name: found[name] for name in NAMES if name in found}


def read_landmark(entry: Entry, n_vertices: int, faces: NDArray[np.int32], parts: Sequence[str]) -> Landmark:
    """Return one landmark of a file: a vertex, a point, or a place on a triangle of a mesh."""
    if isinstance(entry.value, list):
        return Landmark(at=entry.vector(_FARTHEST))
    if not isinstance(entry.value, Mapping):
        vertex = entry.index(n_vertices, "a vertex")
        rows, corners = np.nonzero(faces == vertex)
        if not len(rows):
            raise entry.fail(f"no triangle uses the vertex {vertex}")
        weights = [0.0, 0.0, 0.0]
        weights[corners[0]] = 1.0
        return Landmark(int(rows[0]), tuple(weights))
    if "part" in entry.value:
        fields = entry.fields(required=("part", "at"))
        return Landmark(at=fields["at"].vector(_FARTHEST), part=fields["part"].choice(parts, "part"))
    fields = entry.fields(required=("face", "barycentric"))
    weights = fields["barycentric"].vector(1.0)
    if min(weights) < 0 or abs(sum(weights) - 1.0) > _SUM:
        raise fields["barycentric"].wrong("three weights of 0 or more that sum to one")
    return Landmark(fields["face"].index(len(faces), "a triangle"), weights)


def landmark_weights(landmarks: Mapping[str, Landmark], mesh: Mesh, level: int) -> sparse.csr_array:
    """Return the weights (k, n) of a mesh's vertices that place the landmarks on its surface.

    mesh: the coarse mesh's skin after ``level`` refinements by `loop_once`, its triangles first, and the parts.
    """
    matrix = sparse.lil_array((len(landmarks), len(mesh.vertices)))
    for row, one in enumerate(landmarks.values()):
        if one.at is None:
            face, weights = one.face, one.weights
            for _ in range(level):
                face, weights = _refined(face, weights)
            for vertex, weight in zip(mesh.faces[face], weights, strict=True):
                matrix[row, vertex] = weight
        else:
            faces = mesh.faces[mesh.face_parts == mesh.parts.index(one.part or mesh.parts[0])]
            used, local = np.unique(faces, return_inverse=True)
            near = attach(np.array([one.at]), mesh.vertices[used], local.reshape(-1, 3),
                          sparse.csr_array(sparse.identity(len(used), format="csr")))
            matrix[row, used[near.indices]] = near.data
    return sparse.csr_array(matrix)


def _refined(face: int, weights: tuple[float, float, float]) -> tuple[int, tuple[float, float, float]]:
    """Return the same place on one of the four triangles that `loop_once` makes of a triangle a, b, c:
    (a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca)."""
    u, v, w = weights
    if u >= 0.5:
        return 4 * face, (2 * u - 1, 2 * v, 2 * w)
    if v >= 0.5:
        return 4 * face + 1, (2 * v - 1, 2 * w, 2 * u)
    if w >= 0.5:
        return 4 * face + 2, (2 * w - 1, 2 * u, 2 * v)
    return 4 * face + 3, (1 - 2 * w, 1 - 2 * u, 1 - 2 * v)

"""Where markers and landmarks sit on a rig: weights of its mesh's vertices."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from facegen.errors import InputError, nearest
from facegen.face.face import Face
from facegen.face.landmarks import Landmark, landmark_weights, read_landmark
from facegen.facs.validate import Entry
from facegen.fitting.rigs import Rig
from facegen.geometry.closest import ClosestPoints
from facegen.geometry.mesh import Mesh
from facegen.geometry.operators import Surface

# Kinds of pieces, and parts of the parametric face, that lie behind lids and lips or on top of the skin.
_NOT_SKIN = ("eye", "teeth", "tongue", "mouth", "hair", "brows", "skull", "carried", "body")


def skin_faces(face: Rig, mesh: Mesh) -> NDArray[np.int32]:
    """Return the triangles (m, 3) of a rig's skin; all, if it does not say which they are."""
    others = [part for part in mesh.parts if part.startswith(_NOT_SKIN)] if isinstance(face, Face) else \
        [part for part in face.notes.parts(*_NOT_SKIN) if part in mesh.parts]
    keep = ~np.isin(mesh.face_parts, [mesh.parts.index(part) for part in others])
    return mesh.faces[keep] if keep.any() else mesh.faces


def landmark_rows(face: Rig) -> tuple[tuple[str, ...], sparse.csr_array]:
    """Return the names of a rig's landmarks and the weights (k, n) that place them."""
    weights = face.landmark_weights(2) if isinstance(face, Face) else face.landmark_weights()
    return face.landmarks, sparse.csr_array(weights)


def marker_rows(face: Rig, markers: Mapping[str, Any], source: str = "markers") -> sparse.csr_array:
    """Return the weights (p, n) of the vertices of ``face.mesh()`` that place markers.

    markers: name -> where it sits: the name of a landmark, a vertex, ``{"face": 812, "barycentric": [0.2, 0.5, 0.3]}``,
    or a point in mm, which the nearest place of the skin is taken for. None: the landmark of the marker's own name.
    Raises InputError, or TableError that names ``source`` and the marker.
    """
    mesh, (known, rows) = face.mesh(), landmark_rows(face)
    n, snapped, places = len(mesh.vertices), {}, []
    for name, value in markers.items():
        entry = Entry(value, source, name)
        if value is None or isinstance(value, str):
            word = name if value is None else value
            if word not in known:
                where = f"the face '{face.name}' has no landmark '{word}'" if known else \
                    f"the face '{face.name}' has no landmarks"
                raise entry.fail(f"{where}{nearest(word, known)}; give a vertex, a place on a triangle or a point")
            places.append(rows[[known.index(word)]])
            continue
        one = read_landmark(entry, n, mesh.faces, mesh.parts)
        if one.at is not None and one.part is None:
            snapped[len(places)] = one.at
            places.append(sparse.csr_array((1, n)))
        else:
            places.append(landmark_weights({name: one}, mesh, 0))
    if not places:
        raise InputError("markers: expected one or more, got none")
    found = sparse.lil_array(sparse.vstack(places))
    if snapped:
        faces = skin_faces(face, mesh)
        feet = ClosestPoints(Surface(mesh.vertices, faces))(np.array(list(snapped.values())))
        for row, triangle, corners in zip(snapped, feet.faces, feet.weights, strict=True):
            found[row, faces[triangle]] = corners
    return sparse.csr_array(found)


def cage_rows(face: Face, places: Mapping[str, Landmark]) -> sparse.csr_array:
    """Return the weights (p, n) for places on a parametric face's cage."""
    return landmark_weights(places, face.mesh(2), 2)

"""The base face as what is laid on an avatar to find its landmarks: its front, and the smooth ways it may bend.

The ways are the eigenvectors of the bending energy (eq. 10 of Onizuka et al. 2018, as `hinge_energy` gives it): the
lowest are the face moved and stretched as a whole, higher ones bend smaller parts. A face laid on another one is then
a small dense system however many triangles the avatar has, and a click is answered at once.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from facegen.face.face import load_face
from facegen.geometry.normals import vertex_normals
from facegen.geometry.operators import Surface, hinge_energy
from facegen.transfer.template import skin_places

Array = NDArray[np.float64]

# Because at this level the face's front has about 800 vertices, 8 mm apart: as fine as what the ways can bend.
_DETAIL = 1
# The face's front ends this far behind the eyes, mm: ears and the back of the head are hair on most avatars.
_FRONT = -45.0
# So many ways to bend, of each coordinate.
_WAYS = 72
# Millimetres: the eyes' opening is a hole in the front that nothing is laid on.
_TINY = 1e-12


@dataclass(frozen=True, eq=False)
class FaceModel:
    """``surface``: the front of the face, n vertices, mm. ``normals`` (n, 3); ``ways`` (n, k), orthonormal by area,
    and ``stiffness`` (k,) of each, the bending energy of one millimetre. ``names`` and ``placing`` (l, n): where
    landmarks lie on it. ``rest``: name -> place (3,), mm, of all landmarks, also those behind the front."""

    surface: Surface
    normals: Array
    areas: Array
    ways: Array
    stiffness: Array
    names: tuple[str, ...]
    placing: sparse.csr_array
    rest: Mapping[str, Array]


@cache
def face_model() -> FaceModel:
    """Return the base face's front; it is made once."""
    face = load_face()
    mesh = face.mesh(_DETAIL)
    faces = mesh.faces[mesh.face_parts == 0]
    whole = Surface(mesh.vertices[:faces.max() + 1], faces)
    places = skin_places(face, whole, _DETAIL)
    front = whole.corners[..., 2].min(axis=1) > _FRONT
    inside = whole.normals[:, 2] < -0.3                    # what turns inward, in nostrils and behind lids
    kept = faces[front & ~inside]
    rows, local = np.unique(kept, return_inverse=True)
    surface = Surface(whole.vertices[rows], local.reshape(-1, 3).astype(np.int32))
    own = np.full(len(whole.vertices), -1)
    own[rows] = np.arange(len(rows))
    names = [name for name, (corners, weights) in places.items() if (own[corners[weights > 0]] >= 0).all()]
    placing = sparse.lil_array((len(names), len(rows)))
    for row, name in enumerate(names):
        corners, weights = places[name]
        for corner, weight in zip(corners, weights, strict=True):
            if weight > 0:
                placing[row, own[corner]] += weight
    placing = sparse.csr_array(placing)
    rest = {**face.landmark_points(mesh.vertices, detail=_DETAIL),
            **dict(zip(names, placing @ surface.vertices, strict=True))}
    ways, stiffness = _ways(surface)
    return FaceModel(surface, vertex_normals(surface.vertices, surface.faces), surface.vertex_areas, ways, stiffness,
                     tuple(names), placing, rest)


def _ways(surface: Surface) -> tuple[Array, Array]:
    """Return the ways (n, k) and their stiffness (k,): H u = stiffness M u, M the vertices' areas."""
    root = 1 / np.sqrt(np.maximum(surface.vertex_areas, _TINY))
    energy = hinge_energy(surface).toarray()
    energy = root[:, None] * energy * root
    from scipy.linalg import eigh

    values, vectors = eigh(energy, subset_by_index=[0, _WAYS - 1])
    return root[:, None] * vectors, np.maximum(values, 0.0)

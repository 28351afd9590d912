"""Where an avatar's landmarks lie on its surface, so that they go along with every pose.

The notes give places. The nearest place of the surface is meant, but two kinds of places touch another surface: lids
and lips what lies behind them, and closed lips each other. Parts behind are left out as far as they are noted, and
which lip is which shows when the jaw opens.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from facegen.face.avatar_notes import Notes
from facegen.geometry.closest import ClosestPoints
from facegen.geometry.mesh import Mesh
from facegen.geometry.operators import Surface

# Kinds of pieces that lie behind lids and lips.
_BEHIND = ("eye", "teeth", "tongue", "mouth")
# Landmarks on the two lips where they touch, and whether the jaw takes that lip along.
_LIPS = {"mouth_inner_top": False, "mouth_inner_bottom": True}
# Vertices this much farther than the nearest one, as a share of the mouth's width, may be meant as well.
_AS_NEAR = 0.02
# Lips that the jaw moves apart by less than this share of the mouth's width are not told apart.
_APART = 0.1


def placing(notes: Notes, mesh: Mesh, opened: Callable[[], NDArray[np.float64] | None]) -> sparse.csr_array:
    """Return the weights (k, n) of the vertices of a mesh that place the notes' landmarks.

    opened: gives how the vertices (n, 3) move when the jaw opens, or None if they cannot; asked for only if needed.
    """
    names = list(notes.landmarks)
    weights = sparse.lil_array((len(names), len(mesh.vertices)))
    hidden = [mesh.parts.index(part) for part in notes.parts(*_BEHIND) if part in mesh.parts]
    outside = ~np.isin(mesh.face_parts, hidden)
    if not outside.any():
        outside[:] = True
    for behind, faces in ((True, mesh.faces), (False, mesh.faces[outside])):
        rows = [row for row, name in enumerate(names) if name.startswith("eye_center") == behind]
        if rows:
            feet = ClosestPoints(Surface(mesh.vertices, faces))(np.array([notes.landmarks[names[r]] for r in rows]))
            for row, face, corners in zip(rows, feet.faces, feet.weights, strict=True):
                weights[row, faces[face]] = corners
    for name, vertex in _lips(notes, mesh, mesh.faces[outside], opened).items():
        weights[names.index(name), :] = 0.0
        weights[names.index(name), vertex] = 1.0
    return sparse.csr_array(weights)


def _lips(notes: Notes, mesh: Mesh, faces: NDArray, opened: Callable[[], NDArray | None]) -> dict[str, int]:
    """Return the vertices that the lips' landmarks are, where the two lips touch."""
    at = notes.landmarks
    if not {*_LIPS, "mouth_corner_L", "mouth_corner_R"} <= set(at):
        return {}
    width = float(np.linalg.norm(at["mouth_corner_L"] - at["mouth_corner_R"]))
    if np.linalg.norm(at["mouth_inner_top"] - at["mouth_inner_bottom"]) > _AS_NEAR * width:
        return {}
    moves = opened()
    if moves is None:
        return {}
    used, found = np.unique(faces), {}
    for name, goes in _LIPS.items():
        far = np.linalg.norm(mesh.vertices[used] - at[name], axis=1)
        near = used[far <= far.min() + _AS_NEAR * width]
        drop = -moves[near, 1]
        if np.ptp(drop) < _APART * width:
            return {}
        found[name] = int(near[drop.argmax() if goes else drop.argmin()])
    return found

"""The person's own brows, hair, beard and glasses: pieces of the head's mesh that ride on the face."""

from __future__ import annotations

from collections.abc import Container, Sequence

import numpy as np

from facegen.geometry.mesh import Mesh
from facegen.transfer.apart import Apart
from facegen.transfer.piece_names import words_of
from facegen.transfer.pieces import Piece

_WORDS = {"brow": "brows", "brows": "brows", "eyebrow": "brows", "eyebrows": "brows", "hair": "hair", "hairs": "hair"}
_RIDING = ("carried", "skull")


def own_parts(mesh: Mesh, apart: Apart, taken: Container[str]) -> dict[str, Mesh]:
    """Return name -> mesh of what rides on the person's skin, in the working frame. taken: names of other parts."""
    named: dict[str, list[Piece]] = {}
    for piece in apart.pieces:
        if piece.kind in _RIDING:
            words = words_of(piece.name.split("|")[0]) | words_of(piece.name)
            name = next((part for word, part in _WORDS.items() if word in words), "")
            if not name:
                name = "_".join(piece.name.split("|")[0].split()) or "worn"
                name = f"{name}_own" if name in taken else name
            named.setdefault(name, []).append(piece)
    return {name: _mesh(name, pieces, mesh, apart) for name, pieces in named.items()}


def _mesh(name: str, pieces: Sequence[Piece], mesh: Mesh, apart: Apart) -> Mesh:
    rows = np.sort(np.concatenate([piece.faces for piece in pieces]))
    used, faces = np.unique(apart.faces[rows], return_inverse=True)
    materials = tuple(name if name in ("brows", "hair") else one for one in mesh.materials)
    return Mesh(apart.vertices[used], faces.reshape(-1, 3), materials, mesh.face_materials[rows], (name,),
                np.zeros(len(rows), np.int32))

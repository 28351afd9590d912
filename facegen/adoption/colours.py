"""The person's colours, as far as the file of the head knows them: skin, lips, brows and hair."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from facegen.fileio.avatar import AvatarFile
from facegen.geometry.mesh import Mesh
from facegen.transfer.apart import Apart
from facegen.transfer.piece_names import words_of

# Millimetres round the tip of the nose that are face.
_FACE = 60.0
_LIPS = ("mouth_top", "mouth_bottom", "mouth_upper_L", "mouth_upper_R", "mouth_lower_L", "mouth_lower_R")
# Of the skin's colour, where the file does not tell lips or nostrils apart: the base face's own shares.
_SHARES = {"lips": (0.85, 0.60, 0.66), "nostril": (0.60, 0.47, 0.46)}
# Two colours nearer than this are one.
_SAME = 12.0
# Word of a material's name -> of which kind of piece it must be, and what we call it.
_NAMED = {"lip": ("skin", "lips"), "lips": ("skin", "lips"), "iris": ("eye", "iris"), "irises": ("eye", "iris")}
# Of the iris' colour, its dark rim.
_LIMBUS = 0.6


def colours_of(source: AvatarFile, apart: Apart, own: Mapping[str, Mesh]) -> dict[str, list[float]]:
    """Return material -> sRGB 0..255 of a face that is made of a file's head; nothing where the file says nothing.

    apart: the head's mesh taken apart. own: the parts that ride on it.
    """
    result = {}
    of_face = _of_triangles(source)
    if of_face is not None:
        mesh, rows = source.mesh, apart.skin.numbers
        rows = rows[np.isfinite(of_face[rows]).all(axis=1)]
        middles = apart.vertices[apart.faces[rows]].mean(axis=1)
        rows = rows[np.linalg.norm(middles - apart.points["nose_tip"], axis=1) < _FACE]
        if len(rows):
            skin = np.median(of_face[rows], axis=0)
            lips = np.array([of_face[face] for name, face in
                             zip(apart.landmarks.names, apart.landmarks.faces, strict=True) if name in _LIPS])
            lips = lips[np.isfinite(lips).all(axis=1)]
            found = np.median(lips, axis=0) if len(lips) else skin
            result = {"skin": skin, **{name: skin * share for name, share in _SHARES.items()}}
            if np.linalg.norm(found - skin) > _SAME:
                result["lips"] = found
        result |= _named(source, apart)
        for part in own.values():
            for index, material in enumerate(part.materials):
                shown = mesh.materials[index]
                if (part.face_materials == index).any() and shown in source.colours:
                    result[material] = np.array(source.colours[shown][:3])
    return {name: np.round(colour, 1).tolist() for name, colour in result.items()}


def _named(source: AvatarFile, apart: Apart) -> dict[str, NDArray]:
    """Return the colours of materials that are named after what they are: lips on the skin, irises on the eyes."""
    result = {}
    for piece in apart.pieces:
        for index in np.unique(source.mesh.face_materials[piece.faces]):
            name = source.mesh.materials[index]
            for word in words_of(name) & _NAMED.keys() if name in source.colours else ():
                kind, ours = _NAMED[word]
                if piece.kind.startswith(kind):
                    result[ours] = np.array(source.colours[name][:3], float)
    if "iris" in result:
        result["limbus"] = result["iris"] * _LIMBUS
    return result


def _of_triangles(source: AvatarFile) -> NDArray[np.float64] | None:
    """Return the colour (m, 3) of each triangle, NaN where it is unknown; None if all are."""
    mesh = source.mesh
    if source.vertex_colours is not None:
        return np.asarray(source.vertex_colours, float)[mesh.faces].mean(axis=1)
    if not source.colours:
        return None
    of_material = np.array([source.colours.get(name, (np.nan,) * 3)[:3] for name in mesh.materials], float)
    return of_material[mesh.face_materials]

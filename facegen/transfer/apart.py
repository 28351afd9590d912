"""A mesh with landmarks taken apart: welded, in pieces, and its skin as a surface that carries the landmarks."""

from __future__ import annotations

from collections.abc import Container, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from facegen.geometry.closest import ClosestPoints
from facegen.geometry.mesh import Mesh
from facegen.geometry.operators import Surface
from facegen.transfer.alignment import Similarity
from facegen.transfer.landmarks import Landmarks
from facegen.transfer.pieces import Piece, face_names, find_pieces
from facegen.transfer.skin_mesh import SkinMesh, skin_mesh
from facegen.transfer.weld import weld


@dataclass(frozen=True, eq=False)
class Apart:
    """``vertices`` (u, 3), welded, in the working frame, mm; ``own`` (n,): which of them each of the mesh is; ``faces``
    (m, 3) over them. ``points``: landmark -> place (3,). ``pieces``, as the file has them; ``skin``, put in order.
    ``landmarks``: kept for `places`."""

    vertices: NDArray[np.float64]
    own: NDArray[np.int64]
    faces: NDArray[np.int64]
    points: Mapping[str, NDArray[np.float64]]
    pieces: tuple[Piece, ...]
    skin: SkinMesh
    landmarks: Landmarks

    @property
    def rows(self) -> NDArray[np.int64]:
        """The skin's vertices (n,) among all."""
        return self.skin.rows

    @property
    def surface(self) -> Surface:
        """The skin over those alone."""
        return self.skin.surface

    @property
    def solid(self) -> tuple[Piece, ...]:
        """The pieces, of the skin only the triangles that are in order."""
        return tuple(replace(piece, faces=self.skin.numbers) if piece.kind == "skin" else piece
                     for piece in self.pieces)

    def places(self, names: Container[str]) -> dict[str, tuple[NDArray, NDArray]]:
        """Return those of the landmarks that are in ``names`` as vertices of the skin and weights: their own triangle
        where that is skin, else the nearest place (brows are often pieces of their own)."""
        local = np.full(self.own.max() + 1, -1)
        local[self.rows] = np.arange(len(self.rows))
        marks, result, elsewhere = self.landmarks, {}, []
        for name, corners, weights in zip(marks.names, marks.corners, marks.barycentric, strict=True):
            if name not in names:
                continue
            here = local[self.own[corners]]
            if (here[weights > 0] >= 0).all():
                result[name] = (np.maximum(here, 0), weights)
            else:
                elsewhere.append(name)
        if elsewhere:
            feet = ClosestPoints(self.surface)(np.array([self.points[name] for name in elsewhere]))
            result |= {name: (self.surface.faces[face], weights)
                       for name, face, weights in zip(elsewhere, feet.faces, feet.weights, strict=True)}
        return result


def take_apart(mesh: Mesh, landmarks: Landmarks, frame: Similarity, *,
               explicit: Mapping[str, str] | None = None) -> Apart:
    """Return a mesh taken apart. frame: from its axes and units to the working frame. explicit: as in `find_pieces`."""
    turned = frame.apply(mesh.vertices)
    vertices, own = weld(turned, mesh.faces)
    faces, points = own[mesh.faces], landmarks.points(turned)
    pieces = find_pieces(vertices, faces, points, names=face_names(mesh), explicit=explicit)
    numbers = np.concatenate([piece.faces for piece in pieces if piece.kind == "skin"])
    skin = skin_mesh(vertices, faces[numbers], numbers, points)
    return Apart(vertices, own, faces, points, pieces, skin, landmarks)

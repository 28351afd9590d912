"""The base face as what a person's is made from: its data, its cage and its finest surface."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from facegen.data import meshes_dir
from facegen.face.face import Face, load_face
from facegen.face.loader import FINEST
from facegen.facs.yamlfile import read_data
from facegen.fileio.obj import load_obj
from facegen.geometry.mesh import Mesh
from facegen.geometry.operators import Surface
from facegen.geometry.subdivision import loop_levels
from facegen.transfer.sides import side_fields
from facegen.transfer.template import DETAIL, skin_places

BASE = "akimoto"


@dataclass(frozen=True, eq=False)
class Base:
    """``data``: what its face.yaml says. ``cage`` of c vertices; ``matrix`` (n, c): from there to its smooth surface at
    the finest level; ``surface`` of n vertices, at rest on the eyeballs, with the ``parents`` of its triangles on the
    cage; ``coarse``: its first vertices, those of the transfer's template. All in mm."""

    folder: Path
    face: Face
    data: Mapping[str, Any]
    cage: Mesh
    matrix: sparse.csr_array
    surface: Surface
    parents: NDArray[np.int32]
    coarse: Surface
    coarse_places: Mapping[str, tuple[NDArray, NDArray]]

    @property
    def landmarks(self) -> dict[str, NDArray[np.float64]]:
        """Places (3,) of the landmarks on the skin."""
        return {name: weights @ self.coarse.vertices[rows] for name, (rows, weights) in self.coarse_places.items()}

    @cached_property
    def sides(self) -> NDArray[np.float64]:
        """Which side of lids and lips each vertex (n,) of the surface lies on: `side_fields`."""
        return side_fields(self.surface, skin_places(self.face, self.surface, FINEST))

    def point(self, name: str) -> int:
        """Return the cage's vertex that a feature point is."""
        return self.data["points"][name]["vertex"]

    @property
    def margins(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """The cage's vertices of the two eyes' lid margins, each all round from corner to corner and back."""
        names = ("eye_inner", "lid_upper_inner", "lid_upper_mid", "lid_upper_outer_mid", "lid_upper_outer", "eye_outer",
                 "lid_lower_outer", "lid_lower_outer_mid", "lid_lower_mid", "lid_lower_inner")
        left, right = (np.array([self.point(f"{name}_{side}") for name in names]) for side in "LR")
        return left, right

    @property
    def seam(self) -> NDArray[np.int64]:
        """The cage's vertices (k, 2) of the line where upper and lower lip meet, without the corners."""
        names = ("", "_inner_L", "_side_L", "_outer_L", "_inner_R", "_side_R", "_outer_R")
        return np.array([[self.point(f"lip_{lip}{name}") for lip in ("upper", "lower")] for name in names])


@cache
def base_face() -> Base:
    """Return the base face; it is read once."""
    folder = meshes_dir() / BASE
    face, data = load_face(BASE), read_data(folder / "face.yaml")
    cage = load_obj(folder / data["cage"])
    finest = loop_levels(len(cage.vertices), cage.faces, np.array(data["creases"]), FINEST, corners=data["corners"])[-1]
    levels = {}
    for detail in (DETAIL, FINEST):
        mesh = face.mesh(detail)
        faces = mesh.faces[mesh.face_parts == 0]
        levels[detail] = Surface(mesh.vertices[:faces.max() + 1], faces)
    return Base(folder, face, data, cage, finest.matrix, levels[FINEST], finest.parent_face, levels[DETAIL],
                skin_places(face, levels[DETAIL], DETAIL))

"""A new glTF file of a mesh: one node a part, one material a colour, smooth normals; units and axes as they are.

Khronos, "glTF 2.0 Specification", sections 3.7 and 3.9.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from facegen.fileio.gltf_append import Appended
from facegen.fileio.gltf_file import GltfFile
from facegen.fileio.srgb import to_linear
from facegen.geometry.mesh import Mesh
from facegen.geometry.normals import vertex_normals

_UNKNOWN = (200.0, 200.0, 200.0)                    # sRGB of a material without a colour: light grey
_ROUGHNESS = 0.7                                    # skin in diffuse light: no plastic shine
# A viewer needs a unit normal everywhere; a vertex without triangles shows none, so any will do.
_UP = (0.0, 1.0, 0.0)


def new_file(path: Path, mesh: Mesh, colours: Mapping[str, Any], vertex_colours: NDArray[np.float64] | None, *,
             scale: float = 1.0) -> tuple[GltfFile, NDArray[np.int64]]:
    """Return a glTF file of a mesh, not yet written, and which vertex of the mesh each of its vertices is.

    Vertices that no triangle uses are left out; those on the border of two parts stand in both. scale: what the nodes
    scale by; the file's positions are the mesh's divided by it.
    """
    found: dict[str, Any] = {"asset": {"version": "2.0", "generator": "facegen"}, "scene": 0, "scenes": [{}],
                             "nodes": [], "meshes": []}
    out = Appended(GltfFile(path, "glb", found, (), b"", ""))
    found = out.json
    found["materials"] = [_material(name, colours.get(name), vertex_colours is not None) for name in mesh.materials]
    normals = _smooth_normals(mesh)
    kept = []
    for p, part in enumerate(mesh.parts):
        of_part = mesh.face_parts == p
        if not of_part.any():
            continue
        rows, faces = np.unique(mesh.faces[of_part], return_inverse=True)
        faces = faces.reshape(-1, 3)
        attributes = {"POSITION": out.floats(mesh.vertices[rows] / scale, "VEC3", bounds=True, vertex=True),
                      "NORMAL": out.floats(normals[rows], "VEC3", vertex=True)}
        if vertex_colours is not None:
            attributes["COLOR_0"] = out.floats(to_linear(vertex_colours[rows]), "VEC3", vertex=True)
        primitives = [{"attributes": attributes, "indices": out.indices(faces[mesh.face_materials[of_part] == m],
                                                                        len(rows)), "material": int(m)}
                      for m in np.unique(mesh.face_materials[of_part])]
        found["meshes"].append({"name": part, "primitives": primitives})
        found["nodes"].append({"name": part, "mesh": len(found["meshes"]) - 1,
                               **({"scale": [scale] * 3} if scale != 1.0 else {})})
        kept.append(rows)
    found["scenes"][0]["nodes"] = list(range(len(found["nodes"])))
    found, data = out.finished()
    return GltfFile(path, "glb", found, (data,), b"", ""), np.concatenate(kept)


def _material(name: str, colour: Any, coloured_vertices: bool) -> dict[str, Any]:
    light = (1.0, 1.0, 1.0) if coloured_vertices else to_linear(_UNKNOWN if colour is None else colour).tolist()
    return {"name": name, "doubleSided": True,
            "pbrMetallicRoughness": {"baseColorFactor": [*light, 1.0], "metallicFactor": 0.0,
                                     "roughnessFactor": _ROUGHNESS}}


def _smooth_normals(mesh: Mesh) -> NDArray[np.float64]:
    """Return unit normals (n, 3), smooth also where vertices lie on each other: at seams, in a soup of triangles."""
    places, of = np.unique(mesh.vertices, axis=0, return_inverse=True)
    normals = vertex_normals(places, of.ravel()[mesh.faces])[of.ravel()]
    normals[(normals == 0).all(axis=1)] = _UP
    return normals

"""How the normals of a glTF file's meshes change when shapes move them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from facegen.fileio.gltf_accessors import Accessors
from facegen.fileio.gltf_local import Motion
from facegen.fileio.gltf_normals import TurningNormals
from facegen.fileio.gltf_read import triangles
from facegen.fileio.jsontree import Tree
from facegen.forked import for_each

Turning = dict[tuple[int, int, str], Motion]
"""How normals change, by POSITION accessor, NORMAL accessor and name of the shape."""
Moved = Mapping[int, Mapping[str, Motion]]
"""POSITION accessor -> name of the shape -> motion."""

# Triangles whose normals are made by one process at a time: fewer are not worth another one.
_AT_A_TIME = 150_000


class MeshNormals:
    """The primitives of one mesh that have normals, as one surface."""

    def __init__(self, primitives: Iterable[Tree], accessors: Accessors) -> None:
        self._starts: dict[tuple[int, int], int] = {}
        points, normals, faces, total = [np.zeros((0, 3))], [np.zeros((0, 3))], [np.zeros((0, 3), np.int64)], 0
        for primitive in primitives:
            position, normal = (primitive["attributes"].get(name) for name in ("POSITION", "NORMAL"))
            if position is None or normal is None:
                continue
            key, place = (position.integer(), normal.integer()), accessors.floats(position, "VEC3")
            if key not in self._starts:
                self._starts[key] = total
                points.append(place)
                normals.append(accessors.floats(normal, "VEC3", count=len(place)))
                total += len(place)
            faces.append(triangles(primitive, accessors, len(place)) + self._starts[key])
        self._ends = [*list(self._starts.values())[1:], total]
        self.triangles = sum(map(len, faces))
        self._surface = TurningNormals(np.concatenate(points), np.concatenate(normals), np.concatenate(faces))

    def turning(self, moved: Moved, name: str) -> Turning:
        """Return how the normals change in one of the shapes."""
        own = [(first, moved[key[0]][name]) for key, first in self._starts.items() if name in moved[key[0]]]
        if not own:
            return {}
        rows, change = self._surface.change(np.concatenate([first + motion.rows for first, motion in own]),
                                            np.concatenate([motion.values for _, motion in own]))
        result = {}
        for (key, first), end in zip(self._starts.items(), self._ends, strict=True):
            low, high = np.searchsorted(rows, [first, end])
            result[*key, name] = Motion(rows[low:high] - first, change[low:high])
        return result


def turn_all(meshes: Iterable[tuple[MeshNormals, Moved]], names: Iterable[str]) -> list[Turning]:
    """Return of each mesh and what moves it how its normals change in shapes of some names.

    All meshes at once, since one alone is seldom worth another process.
    """
    parts: list[tuple[int, MeshNormals, Moved, list[str]]] = []
    result: list[Turning] = []
    names = list(names)
    for number, (mesh, moved) in enumerate(meshes):
        own = [name for name in names if any(name in motions for motions in moved.values())]
        each = max(1, _AT_A_TIME // max(mesh.triangles, 1))
        parts += [(number, mesh, moved, own[start:start + each]) for start in range(0, len(own), each)]
        result.append({})

    def work(i: int) -> list[Turning]:
        _, mesh, moved, some = parts[i]
        return [mesh.turning(moved, name) for name in some]

    for (number, *_), found in zip(parts, for_each(len(parts), work), strict=True):
        for turning in found:
            result[number] |= turning
    return result

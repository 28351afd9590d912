"""A glTF file as one mesh in the world, with the morph targets that it has.

Khronos, "glTF 2.0 Specification", sections 3.7.2 (meshes, morph targets) and 3.7.3 (skins).
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from facegen.errors import FileError
from facegen.fileio.gltf_accessors import Accessors
from facegen.fileio.gltf_colours import Colours, as_screen, mean_colour
from facegen.fileio.gltf_file import GltfFile, compression_of, read_gltf, refuse_compressed
from facegen.fileio.gltf_scene import FARTHEST, Scene, joint_matrices, skinned, within_reach
from facegen.fileio.jsontree import Tree
from facegen.geometry.mesh import Mesh

# Because a file can show one mesh many times at no cost: the largest avatars have a tenth of these.
_MOST_VERTICES, _MOST_TRIANGLES, _MOST_PRIMITIVES = 5_000_000, 10_000_000, 10_000
# Vertices times morph targets: 0.7 GB in memory; 50,000 vertices with 500 targets stay below.
_MOST_MOVES = 30_000_000
_POINTS_OR_LINES, _TRIANGLES, _STRIP, _FAN = range(4), 4, 5, 6


@dataclass(frozen=True, eq=False)
class Block:
    """One POSITION accessor as one node shows it: rows start..stop of the mesh.

    ``linear``: (3, 3), or (n, 3, 3) for a skin: turns motion in the file's space of the mesh into motion in the world.
    ``primitives``: those of the mesh that use the accessor. ``part``: the node's name in the mesh.
    """

    node: int
    part: str
    mesh: int
    accessor: int
    primitives: tuple[int, ...]
    start: int
    stop: int
    linear: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class GltfScene:
    """What a glTF file shows; arrays as in AvatarFile. ``blocks``: where its vertices come from."""

    file: GltfFile
    mesh: Mesh
    blocks: tuple[Block, ...]
    colours: dict[str, tuple[float, ...]]
    vertex_colours: NDArray[np.float64] | None
    shapes: dict[str, NDArray[np.float64]]
    notes: dict[str, Any]


def read_scene(path: Path) -> GltfScene:
    """Read a .glb, .vrm or .gltf file. Raises FileError, which names the place in the file's JSON."""
    return scene_of(read_gltf(path))


def scene_of(file: GltfFile) -> GltfScene:
    """Return what a glTF file shows. Raises FileError, which names the place in the file's JSON."""
    return _Reader(file).result()


def target_names(mesh: Tree, primitive: Tree, part: str) -> list[str]:
    """Return the names of a primitive's morph targets, each once: the mesh's, the primitive's, or made up."""
    count = len(primitive.items("targets"))
    given: list[Any] = []
    for owner in (mesh, primitive):
        extras = owner.value.get("extras")
        names = extras.get("targetNames") if isinstance(extras, dict) else None
        if isinstance(names, list) and len(names) > len(given):
            given = names
    names: dict[str, None] = {}
    for i in range(count):
        name = given[i] if i < len(given) and isinstance(given[i], str) and given[i] else f"{part}:target_{i}"
        names.setdefault(name if name not in names else f"{name}#{i}")
    return list(names)


def part_name(node: Tree, mesh: Tree, number: int) -> str:
    """Return what the part is called that a node shows: the node's name, or the mesh's."""
    return _name(node) or _name(mesh) or f"node {number}"


def triangles(primitive: Tree, accessors: Accessors, count: int) -> NDArray[np.int64]:
    """Return a primitive's triangles (m, 3); none if it is made of points or lines."""
    mode = primitive["mode"].integer(0, _FAN) if primitive.get("mode") else _TRIANGLES
    if mode in _POINTS_OR_LINES:
        return np.zeros((0, 3), dtype=np.int64)
    reference = primitive.get("indices")
    if reference is None:
        index = np.arange(count)
    else:
        if accessors.count(reference) > 3 * _MOST_TRIANGLES:
            raise reference.error(f"{accessors.count(reference):,} indices; facegen reads {3 * _MOST_TRIANGLES:,}")
        index = accessors.integers(reference, "SCALAR")[:, 0].astype(np.int64)
        if index.max() >= count:
            bad = np.flatnonzero(index >= count)
            raise reference.error(f"{len(bad)} indices are past the end, the first is number {bad[0]}: "
                                  f"{index[bad[0]]} of {count} vertices")
    if mode == _TRIANGLES:
        if len(index) % 3:
            raise primitive.error(f"{len(index)} corners make no whole number of triangles")
        return index.reshape(-1, 3)
    if len(index) < 3:
        raise primitive.error(f"{len(index)} corners make no triangle")
    if mode == _FAN:
        return np.stack([np.full(len(index) - 2, index[0]), index[1:-1], index[2:]], axis=1)
    strip = np.stack([index[:-2], index[1:-1], index[2:]], axis=1)
    strip[1::2, 1:] = strip[1::2, :0:-1]            # every other triangle of a strip is turned over
    return strip


class _Reader:
    def __init__(self, file: GltfFile) -> None:
        self.tree = file.tree
        self.file, self.accessors, self.scene = file, Accessors(file), Scene(file.tree)
        self.meshes, self.materials = file.tree.items("meshes"), file.tree.items("materials")
        self.colours = Colours(self.tree, self.accessors)
        self.count = 0                              # vertices so far
        self.triangle_count = self.primitive_count = 0
        self.vertices: list[NDArray[np.float64]] = []
        self.faces: list[NDArray[np.int64]] = []
        self.face_materials: list[int] = []         # one a primitive, as are the parts
        self.face_parts: list[int] = []
        self.parts: dict[str, int] = {}
        self.material_names: dict[int, str] = {}
        self.blocks: list[Block] = []
        self.targets: list[tuple[Block, Tree, list[str], NDArray[np.int64]]] = []
        self.light: dict[int, NDArray[np.float64]] = {}
        self.light_varies = False
        self.own_light: dict[int, list[tuple[NDArray, NDArray, NDArray] | None]] = {}     # by material

    def result(self) -> GltfScene:
        for number in self.scene.shown:
            if self.scene.nodes[number].get("mesh"):
                self._add_node(number)
        if not self.faces:
            raise FileError(f"{self.file.path}: shows no triangles; expected a mesh in the file's scene")
        vertices = np.concatenate(self.vertices)
        sizes = [len(faces) for faces in self.faces]
        names = _unique(self.material_names)
        row = {number: i for i, number in enumerate(names)}
        mesh = Mesh(vertices, np.concatenate(self.faces), tuple(names.values()),
                    np.repeat([row[number] for number in self.face_materials], sizes), tuple(self.parts),
                    np.repeat(self.face_parts, sizes))
        vertex_colours = as_screen(self.light, self.count) if self.light_varies else None
        return GltfScene(self.file, mesh, tuple(self.blocks), self._material_colours(names), vertex_colours,
                         self._shapes(), self._notes())

    def _notes(self) -> dict[str, Any]:
        extras = self.tree["asset"].value.get("extras")
        notes = extras.get("facegen") if isinstance(extras, dict) else None
        return notes if isinstance(notes, dict) else {}

    # -- nodes ----------------------------------------------------------------------------------------------
    def _add_node(self, number: int) -> None:
        node = self.scene.nodes[number]
        mesh = self.meshes[node["mesh"].index(len(self.meshes), "mesh")]
        part = part_name(node, mesh, number)
        part = part if part not in self.parts else f"{part}#{number}"
        joints = None
        if node.get("skin"):
            joints = joint_matrices(self.tree, node["skin"], self.scene.world, self.accessors)
        users: dict[int, list[int]] = {}            # POSITION accessor -> primitives
        primitives = mesh.items("primitives")
        self.primitive_count += len(primitives)
        if self.primitive_count > _MOST_PRIMITIVES:
            raise node.error(f"more than {_MOST_PRIMITIVES:,} primitives in all, which facegen does not read")
        for i, primitive in enumerate(primitives):
            if name := compression_of(primitive):
                raise refuse_compressed(primitive, name)
            if primitive["attributes"].get("POSITION"):
                reference = primitive["attributes"]["POSITION"]
                users.setdefault(self.accessors.index(reference), []).append(i)
        blocks = [self._block(number, part, accessor, [primitives[i] for i in which], tuple(which), joints)
                  for accessor, which in users.items()]
        self._add_primitives(mesh, part, primitives, blocks)

    def _block(self, number: int, part: str, accessor: int, primitives: list[Tree], which: tuple[int, ...],
               joints: NDArray | None) -> Block:
        attributes = primitives[0]["attributes"]
        count = self.accessors.count(attributes["POSITION"])
        if self.count + count > _MOST_VERTICES:
            raise attributes["POSITION"].error(f"more than {_MOST_VERTICES:,} vertices in all, which facegen does not "
                                               "read")
        points = self.accessors.floats(attributes["POSITION"], "VEC3").astype(np.float64)
        matrix = None if joints is None else skinned(attributes, joints, count, self.accessors)
        if matrix is None:
            matrix = self.scene.world[number]
        linear, offset = matrix[..., :3, :3], matrix[..., :3, 3]
        world = apply_linear(linear, points) + offset
        if not within_reach(world).all():
            raise self.scene.nodes[number].error(f"takes vertices beyond {FARTHEST:g}")
        mesh = self.scene.nodes[number]["mesh"].integer()
        block = Block(number, part, mesh, accessor, which, self.count, self.count + count, linear)
        self.blocks.append(block)
        self.vertices.append(world)
        self.count += count
        return block

    def _add_primitives(self, mesh: Tree, part: str, primitives, blocks: list[Block]) -> None:
        of = {i: block for block in blocks for i in block.primitives}
        for i, primitive in enumerate(primitives):
            if i not in of:
                continue
            block, count = of[i], of[i].stop - of[i].start
            faces = triangles(primitive, self.accessors, count)
            self.triangle_count += len(faces)
            if self.triangle_count > _MOST_TRIANGLES:
                raise primitive.error(f"more than {_MOST_TRIANGLES:,} triangles in all, which facegen does not read")
            if primitive.items("targets"):
                rows = np.unique(faces) if len(faces) else np.arange(count)
                self.targets.append((block, primitive, target_names(mesh, primitive, part), rows))
            if not len(faces):
                continue
            if np.median(np.linalg.det(block.linear)) < 0:
                faces = faces[:, ::-1]              # a mirrored node turns its triangles over (3.7.4)
            self.face_parts.append(self.parts.setdefault(part, len(self.parts)))
            self.faces.append(faces + block.start)
            self._add_colour(primitive, block, count, faces)

    def _add_colour(self, primitive: Tree, block: Block, count: int, faces: NDArray[np.int64]) -> None:
        number, material = -1, None
        if primitive.get("material"):
            number = primitive["material"].index(len(self.materials), "material")
            material = self.materials[number]
        self.material_names[number] = (_name(material) or f"material {number}") if material else "default"
        self.face_materials.append(number)
        light, varies = self.colours.of_vertices(primitive["attributes"], material, count)
        points = self.vertices[-1] if block is self.blocks[-1] else self.vertices[self.blocks.index(block)]
        self.own_light.setdefault(number, []).append(None if light is None else (light, faces, points))
        if light is None:
            return
        self.light_varies |= varies
        if block.start not in self.light:
            self.light[block.start] = light
        else:                                       # another primitive on the same vertices: its own corners only
            rows = np.unique(faces)
            self.light[block.start] = self.light[block.start].copy()
            self.light[block.start][rows] = light[rows]

    def _material_colours(self, names: dict[int, str]) -> dict[str, tuple[float, ...]]:
        """Return the mean sRGB colour of each material that is known, over its triangles."""
        result = {}
        for number, name in names.items():
            known = [one for one in self.own_light[number] if one is not None]
            if number < 0 or len(known) < len(self.own_light[number]):
                continue
            firsts = np.cumsum([0] + [len(light) for light, _, _ in known])
            corners = np.concatenate([faces + first for (_, faces, _), first in zip(known, firsts[:-1], strict=True)])
            result[name] = mean_colour(np.concatenate([light for light, _, _ in known]), corners,
                                       np.concatenate([points for _, _, points in known]))
        return result

    # -- morph targets --------------------------------------------------------------------------------------
    def _shapes(self) -> dict[str, NDArray[np.float64]]:
        names = dict.fromkeys(name for _, _, names, _ in self.targets for name in names)
        if len(names) * self.count > _MOST_MOVES:
            raise FileError(f"{self.file.path}: {len(names)} morph targets on {self.count:,} vertices; facegen reads "
                            f"at most {_MOST_MOVES:,} moves in all")
        shapes = {name: np.zeros((self.count, 3)) for name in names}
        filled: dict[tuple[int, str], int] = {}     # block and name -> the accessor that filled it
        for block, primitive, own, rows in self.targets:
            for name, target in zip(own, primitive.items("targets"), strict=True):
                if (reference := target.get("POSITION")) is None:
                    continue
                accessor, key = self.accessors.index(reference), (block.start, name)
                if key not in filled:
                    self._fill(shapes[name], block, reference, np.arange(block.stop - block.start))
                elif filled[key] != accessor:       # a primitive with vertices shared and targets of its own
                    self._fill(shapes[name], block, reference, rows)
                filled[key] = accessor
        return shapes

    def _fill(self, shape: NDArray[np.float64], block: Block, reference: Tree, rows: NDArray[np.int64]) -> None:
        moved = self.accessors.floats(reference, "VEC3", count=block.stop - block.start)
        world = apply_linear(block.linear, moved.astype(np.float64))
        if not within_reach(world).all():
            raise reference.error(f"takes vertices beyond {FARTHEST:g}")
        shape[block.start + rows] = world[rows]


def apply_linear(linear: NDArray[np.float64], vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return vectors (..., n, 3) turned by one matrix (3, 3) or by one each (n, 3, 3)."""
    if linear.ndim == 2:
        return vectors @ linear.T
    return np.einsum("nij,...nj->...ni", linear, vectors)


def _name(tree: Tree) -> str:
    """Return the name of a node, mesh or material; empty if it has none."""
    name = tree.value.get("name") if isinstance(tree.value, dict) else None
    return name.strip() if isinstance(name, str) else ""


def _unique(names: dict[int, str]) -> dict[int, str]:
    """Return names by number in the file, ascending, that differ: a second of a name gets its number."""
    result: dict[int, str] = {}
    taken: set[str] = set()
    for number, name in sorted(names.items()):
        result[number] = name if name not in taken else f"{name}#{number}"
        taken.add(result[number])
    return result

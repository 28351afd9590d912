"""Morph targets appended to a glTF file: everything else in it stays.

Khronos, "glTF 2.0 Specification", section 3.7.2.2 (morph targets): all primitives of a mesh have the same targets in
the same order, and names stand in ``mesh.extras.targetNames``.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from facegen.errors import InputError
from facegen.fileio.gltf_accessors import Accessors
from facegen.fileio.gltf_animations import pad_weights
from facegen.fileio.gltf_append import STEPS, Appended, is_ours
from facegen.fileio.gltf_local import STILL, Inverse, Motion, same_motions, size_of
from facegen.fileio.gltf_mesh_normals import MeshNormals, Turning, turn_all
from facegen.fileio.gltf_read import Block, GltfScene, target_names
from facegen.fileio.jsontree import Tree
from facegen.fileio.vrm import add_expressions

# Because quantised steps must not be seen: half a step is at most this share of the avatar's size.
_COARSEST_ERROR = 2.5e-4


@dataclass(eq=False)
class _Use:
    """Nodes that show one mesh and move it alike. ``motions``: accessor -> name -> motion. ``turning``: of normals."""

    nodes: list[int]
    blocks: list[Block]
    motions: dict[int, dict[str, Motion]]
    names: list[str] = field(default_factory=list)
    turning: Turning = field(default_factory=dict)


def with_targets(scene: GltfScene, shapes: Mapping[str, NDArray[np.float64]], *, notes: Mapping[str, Any],
                 normals: bool, quantise: bool, expressions: Mapping[str, Mapping[str, float]]
                 ) -> tuple[dict[str, Any], bytes]:
    """Return the JSON and the buffer of a scene's file with the shapes (n, 3) as morph targets.

    A mesh gets the shapes that move it; a shape that moves nothing goes where most shapes are. Raises InputError for a
    name that the file uses for a morph target of its own, and for motion that the file cannot hold.
    """
    return _Writer(scene, new_shapes(scene, shapes), normals, quantise).result(notes, expressions)


def new_shapes(scene: GltfScene, shapes: Mapping[str, NDArray[np.float64]]) -> dict[str, NDArray[np.float64]]:
    """Return the shapes without those that the file has already; InputError for one that it has otherwise."""
    tolerance = 4 * STILL * size_of(scene.mesh.vertices)
    theirs = foreign_names(scene)
    result = {}
    for name, shape in shapes.items():
        if name not in theirs:
            result[name] = shape
        elif np.abs(shape - scene.shapes[name]).max(initial=0.0) > tolerance:
            raise name_taken(scene, name)
    return result


def name_taken(scene: GltfScene, name: str) -> InputError:
    """Return the error for a shape whose name the file uses for something else."""
    return InputError(f"shapes: {scene.file.path} has a morph target '{name}' of its own, which is kept; give yours "
                      f"another name, for example 'facegen_{name}', or remove the file's")


def foreign_names(scene: GltfScene) -> set[str]:
    """Return the names of the file's morph targets that facegen did not write."""
    found, tree, result = scene.file.json, scene.file.tree, set()
    for block in scene.blocks:
        mesh = tree.items("meshes")[block.mesh]
        for i in block.primitives:
            primitive = mesh.items("primitives")[i]
            targets = primitive.items("targets")
            for name, target in zip(target_names(mesh, primitive, block.part), targets, strict=True):
                if not all(is_ours(found, accessor) for accessor in target.value.values()):
                    result.add(name)
    return result & set(scene.shapes)


class _Writer:
    def __init__(self, scene: GltfScene, shapes: Mapping[str, NDArray], normals: bool, quantise: bool) -> None:
        self.scene, self.shapes, self.normals, self.quantise = scene, shapes, normals, quantise
        self.tree = scene.file.tree
        self.accessors = Accessors(scene.file)
        self.out = Appended(scene.file)
        self.quantised = False
        self.places: dict[str, list[tuple[int, int]]] = {}      # shape -> node and target
        self.counts: dict[int, tuple[int, int]] = {}            # node -> targets before and now

    def result(self, notes: Mapping[str, Any], expressions: Mapping[str, Mapping[str, float]]
               ) -> tuple[dict[str, Any], bytes]:
        uses = self._uses()
        if self.normals:
            self._turn_normals(uses)
        for mesh, found in uses.items():
            self._write_uses(mesh, found)
        pad_weights(self.out, self.tree, self.accessors, self.counts)
        add_expressions(self.out.json, expressions, self._all_places())
        if self.quantised:
            self.out.require("KHR_mesh_quantization")
        if notes:
            asset = self.out.json["asset"]
            asset["extras"] = {**_extras(self.tree["asset"]), "facegen": dict(notes)}
        return self.out.finished()

    # -- who moves what -------------------------------------------------------------------------------------
    def _uses(self) -> dict[int, list[_Use]]:
        """Return for each mesh the nodes that move it alike."""
        nodes: dict[int, list[Block]] = {}
        for block in self.scene.blocks:
            nodes.setdefault(block.node, []).append(block)
        uses: dict[int, list[_Use]] = {}
        for node, blocks in nodes.items():
            motions = {block.accessor: Inverse(self.scene, block).motions(self.shapes) for block in blocks}
            counts = {block.accessor: block.stop - block.start for block in blocks}
            alike = uses.setdefault(blocks[0].mesh, [])
            for use in alike:
                if same_motions(use.motions, motions, counts, self._tolerance(blocks)):
                    use.nodes.append(node)
                    break
            else:
                alike.append(_Use([node], blocks, motions))
        every = [use for found in uses.values() for use in found]
        for use in every:
            moving = {name for motions in use.motions.values() for name in motions}
            use.names = [name for name in self.shapes if name in moving]
        moving = {name for use in every for name in use.names}
        if still := [name for name in self.shapes if name not in moving]:
            home = max(every, key=lambda use: len(use.names))
            home.names = [name for name in self.shapes if name in home.names or name in still]
        return uses

    def _turn_normals(self, uses: Mapping[int, list[_Use]]) -> None:
        turned: list[tuple[_Use, MeshNormals]] = []
        for mesh, alike in uses.items():
            primitives = self.tree.items("meshes")[mesh].items("primitives")
            normals = MeshNormals(filter(self._needs_normals, primitives), self.accessors)
            turned += [(use, normals) for use in alike]
        found = turn_all([(normals, use.motions) for use, normals in turned], self.shapes)
        for (use, _), turning in zip(turned, found, strict=True):
            use.turning = turning

    def _tolerance(self, blocks: list[Block]) -> float:
        """Return how much two instances' motions may differ in the mesh's space by rounding alone."""
        linear = blocks[0].linear.reshape(-1, 3, 3)
        scale = np.linalg.norm(linear, axis=(1, 2)).max()
        return 4 * STILL * size_of(self.scene.mesh.vertices) / max(float(scale), STILL)

    def _write_uses(self, mesh: int, uses: list[_Use]) -> None:
        """Write the targets of all that show one mesh: those that move it otherwise get a copy of it."""
        original = self.out.json["meshes"][mesh]
        pristine = copy.deepcopy(original) if len(uses) > 1 else {}
        for i, use in enumerate(uses):
            target, users = original, use.nodes
            if i:
                target = copy.deepcopy(pristine)
                self.out.json["meshes"].append(target)
                for node in use.nodes:
                    self.out.json["nodes"][node]["mesh"] = len(self.out.json["meshes"]) - 1
            else:                                   # nodes that are not shown keep the original
                shown = {block.node for block in self.scene.blocks}
                users = use.nodes + [node for node, one in enumerate(self.out.json["nodes"])
                                     if one.get("mesh") == mesh and node not in shown]
            self._write_mesh(target, self.tree.items("meshes")[mesh], use, users)

    # -- one mesh -------------------------------------------------------------------------------------------
    def _write_mesh(self, target: dict[str, Any], mesh: Tree, use: _Use, nodes: list[int]) -> None:
        primitives = mesh.items("primitives")
        before = len(primitives[0].items("targets"))
        if any(len(one.items("targets")) != before for one in primitives):
            raise mesh.error("its primitives differ in the number of their morph targets, which glTF forbids")
        names = target_names(mesh, primitives[0], use.blocks[0].part)
        for name in use.names:
            if name not in names:
                names.append(name)
        ours = [name for name in self.shapes if name in names]      # also those of ours that now move nothing here
        if not ours:
            return
        for primitive in primitives:
            if primitive["attributes"].get("POSITION") is None:
                raise primitive.error("has no POSITION, so its mesh cannot have morph targets")
        made: dict[tuple[Any, ...], int] = {}
        for i, primitive in enumerate(primitives):
            targets = target["primitives"][i].setdefault("targets", [])
            targets += [{} for _ in range(len(names) - len(targets))]
            block = next(one for one in use.blocks if i in one.primitives)
            for name in ours:
                targets[names.index(name)] = self._target(primitive, block, name, use, made)
            if "targetNames" in _extras(primitive):
                target["primitives"][i]["extras"]["targetNames"] = names
        extras = _extras(mesh)
        target["extras"] = {**extras, "targetNames": names}
        weights = [one.number() for one in mesh.items("weights")] or [0] * before
        target["weights"] = weights + [0] * (len(names) - len(weights))
        for node in nodes:
            self.counts[node] = before, len(names)
            if "weights" in self.out.json["nodes"][node]:
                own = [one.number() for one in self.tree.items("nodes")[node].items("weights")]
                self.out.json["nodes"][node]["weights"] = own + [0] * (len(names) - len(own))
        for node in use.nodes:
            for k, name in enumerate(names):
                self.places.setdefault(name, []).append((node, k))

    def _target(self, primitive: Tree, block: Block, name: str, use: _Use, made: dict) -> dict[str, int]:
        """Return a primitive's target: accessors, each made once for primitives that share their vertices."""
        count = block.stop - block.start
        key = (block.accessor, name)
        if key not in made:
            motion = use.motions[block.accessor].get(name, _NONE)
            if self.quantise:
                self._check_step(motion, name, block)
            made[key] = self._accessor(count, motion, bounds=True)
        result = {"POSITION": made[key]}
        normal = primitive["attributes"].get("NORMAL")
        if normal is not None and self._needs_normals(primitive):
            key = (block.accessor, normal.integer(), name)
            if key not in made:
                made[key] = self._accessor(count, use.turning.get(key, _NONE), bounds=False)
            result["NORMAL"] = made[key]
        return result

    def _needs_normals(self, primitive: Tree) -> bool:
        """Return whether our targets name normals: as the file's own do, since viewers want all alike."""
        own = [target.value for target in primitive.items("targets")
               if not all(is_ours(self.scene.file.json, accessor) for accessor in target.value.values())]
        if own:
            return any("NORMAL" in target for target in own)
        return self.normals

    def _accessor(self, count: int, motion: Motion, *, bounds: bool) -> int:
        # A normal may change by up to 2, which a normalised short cannot hold: those few shapes keep floats.
        quantise = self.quantise and np.abs(motion.values).max(initial=0.0) <= 1.0
        self.quantised |= quantise and len(motion.rows) > 0
        return self.out.motion(count, motion.rows, motion.values, bounds=bounds, quantise=quantise)

    def _check_step(self, motion: Motion, name: str, block: Block) -> None:
        """Raise InputError if motion of a block cannot be held in steps of 1 / STEPS from -1 to 1."""
        largest = float(np.abs(motion.values).max(initial=0.0))
        if largest > 1.0:
            raise InputError(f"quantise: '{name}' moves node {block.node} by {largest:.4g} of its units, but quantised "
                             "motion reaches 1 only; write without quantise, or scale the avatar to metres first")
        scale = float(np.linalg.norm(block.linear, axis=(-2, -1)).max())
        size = size_of(self.scene.mesh.vertices)
        if len(motion.rows) and scale / (2 * STEPS) > _COARSEST_ERROR * size:
            raise InputError(f"quantise: steps of 1/{STEPS} unit are too coarse for an avatar of {size:.4g} units; "
                             "write without quantise")

    def _all_places(self) -> dict[str, list[tuple[int, int]]]:
        """Return where each shape is, also those that the file had and that were not written now."""
        result = {name: list(places) for name, places in self.places.items()}
        for block in self.scene.blocks:
            mesh = self.tree.items("meshes")[block.mesh]
            primitive = mesh.items("primitives")[block.primitives[0]]
            for k, name in enumerate(target_names(mesh, primitive, block.part)):
                if (block.node, k) not in result.setdefault(name, []):
                    result[name].append((block.node, k))
        return result


_NONE = Motion(np.zeros(0, dtype=np.int64), np.zeros((0, 3), dtype=np.float32))


def _extras(tree: Tree) -> dict[str, Any]:
    """Return the extras of something in the file; FileError if they are no object, which can take no names."""
    extras = tree.get("extras")
    if extras is None:
        return {}
    extras.members()
    return extras.value

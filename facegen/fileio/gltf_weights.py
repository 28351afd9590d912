"""Read the weights of morph targets, and the turn of the head, from an animation of a glTF file.

Khronos, "glTF 2.0 Specification", section 3.11, and KHR_animation_pointer.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from facegen.errors import FileError, InputError, nearest
from facegen.fileio.gltf_accessors import Accessors
from facegen.fileio.gltf_curves import Curve, read_curve
from facegen.fileio.gltf_file import read_gltf
from facegen.fileio.gltf_read import part_name, target_names
from facegen.fileio.jsontree import Tree

NECK = "neck"
"""``extras.facegen`` of the joint that turns the head in files of our own."""

_POINTER = re.compile(r"/(nodes|meshes)/(0|[1-9][0-9]{0,8})/weights", re.ASCII)
# Weights of one name on several meshes that differ by less are the same, rounded.
_SAME = 1e-5


@dataclass(frozen=True, eq=False)
class WeightAnimation:
    """One animation: ``weights`` (n, k) of the ``names`` at ``times`` (n,), straight between them.

    ``turn``: (n, 4) quaternions x, y, z, w of our neck joint, in the file's axes, or None. ``name``: the animation's.
    ``notes``: what facegen wrote into the file. ``warnings``: what was left out.
    """

    name: str
    times: NDArray[np.float64]
    names: tuple[str, ...]
    weights: NDArray[np.float64]
    turn: NDArray[np.float64] | None
    notes: dict
    warnings: tuple[str, ...]


def read_weight_animation(path: str | os.PathLike[str], animation: str | int | None = None) -> WeightAnimation:
    """Return an animation of morph target weights in a .glb, .gltf or .vrm file.

    animation: its name, or its number counted from 0; by default the first that has weights. Every interpolation is
    read; a step becomes two times, the first just before it, and a cubic spline becomes straight pieces within 1e-4.
    Raises FileError for the file, InputError for an animation that is not there.
    """
    reader = _Reader(Path(path))
    return reader.result(animation)


class _Reader:
    def __init__(self, path: Path) -> None:
        file = read_gltf(path)
        self.path, self.tree, self.accessors = path, file.tree, Accessors(file)
        self.nodes, self.meshes = self.tree.items("nodes"), self.tree.items("meshes")
        self.animations = self.tree.items("animations")
        self.warnings: list[str] = []

    def result(self, wanted: str | int | None) -> WeightAnimation:
        number, others = self._chosen(wanted)
        animation = self.animations[number]
        curves: dict[str, tuple[str, Curve, int]] = {}          # name -> where it was first, its curve and column
        turn: Curve | None = None
        taken: set[tuple] = set()
        for channel in animation.items("channels"):
            for key, owner, names in self._targets(channel):
                if key in taken:
                    raise channel.error("animates what another channel of this animation animates already")
                taken.add(key)
                sampler = self._sampler(animation, channel)
                if names is None:
                    turn = read_curve(sampler, 4, "VEC4", self.accessors)
                    continue
                curve = read_curve(sampler, len(names), "SCALAR", self.accessors)
                for column, name in enumerate(names):
                    self._add(curves, name, owner, curve, column)
        if not curves:
            raise animation.error("animates no weights of morph targets that facegen can read")
        if others:
            self.warnings.append(f"of {len(others) + 1} animations with weights, {self._name(number)} is read; "
                                 f"the others: {', '.join(map(self._name, others[:5]))}")
        used = list({id(curve): curve for _, curve, _ in curves.values()}.values()) + ([turn] if turn else [])
        times = np.unique(np.concatenate([curve.times for curve in used]))
        at = {id(curve): curve.at(times) for curve in used}
        weights = np.stack([at[id(curve)][:, column] for _, curve, column in curves.values()], axis=1)
        extras = self.tree["asset"].value.get("extras")
        notes = extras.get("facegen") if isinstance(extras, dict) else None
        return WeightAnimation(self._name(number), times, tuple(curves), weights,
                               None if turn is None else _unit(at[id(turn)], animation),
                               notes if isinstance(notes, dict) else {}, tuple(dict.fromkeys(self.warnings)))

    def _chosen(self, wanted: str | int | None) -> tuple[int, list[int]]:
        """Return the animation that is wanted, and which others have weights if none was named."""
        having = [k for k, one in enumerate(self.animations) if self._has_weights(one)]
        if not having:
            raise FileError(f"{self.path}: has no animation of morph target weights "
                            f"({len(self.animations)} animations in all)")
        if wanted is None:
            return having[0], having[1:]
        if isinstance(wanted, int) and not isinstance(wanted, bool):
            if wanted not in having:
                raise InputError(f"animation: expected one of {', '.join(map(str, having))} (counted from 0), "
                                 f"got {wanted}")
            return wanted, []
        names = {self._name(k): k for k in reversed(having)}
        if wanted not in names:
            raise InputError(f"animation: {self.path.name} has no animation {wanted!r} with weights"
                             f"{nearest(str(wanted), names)} (it has {', '.join(sorted(names))})")
        return names[str(wanted)], []

    def _has_weights(self, animation: Tree) -> bool:
        paths = [channel["target"] for channel in animation.items("channels")]
        return any(one["path"].text() == "weights" or _pointer(one) is not None for one in paths)

    def _name(self, number: int) -> str:
        name = self.animations[number].get("name")
        return name.text() if name and isinstance(name.value, str) and name.value else f"animation {number}"

    def _targets(self, channel: Tree) -> Iterator[tuple[tuple, str, list[str] | None]]:
        """Yield what a channel animates, if that is for us: a key, what it is called, and the names of its weights
        (None: the turn of our neck)."""
        target = channel["target"]
        path, pointer = target["path"].text(), _pointer(target)
        if pointer is not None:
            kind, number = pointer
            at = (target["extensions"]["KHR_animation_pointer"])["pointer"]
            things = self.nodes if kind == "nodes" else self.meshes
            if number >= len(things):
                raise at.error(f"refers to {kind} {number}; the file has {len(things)}")
            found = self._of_node(number, at) if kind == "nodes" else \
                self._of_mesh(self.meshes[number], f"mesh {number}")
        elif path in ("weights", "rotation") and target.get("node"):
            number = target["node"].index(len(self.nodes), "node")
            if path == "rotation":
                if _is_neck(self.nodes[number]):
                    yield ("turn", number), "neck", None
                return
            kind, found = "nodes", self._of_node(number, target["node"])
        else:
            return
        if found is not None:
            yield (kind, number), *found

    def _of_node(self, number: int, place: Tree) -> tuple[str, list[str]] | None:
        node = self.nodes[number]
        if not node.get("mesh"):
            self.warnings.append(f"{place.place}: node {number} has no mesh whose weights could move; left out")
            return None
        mesh = self.meshes[node["mesh"].index(len(self.meshes), "mesh")]
        return self._of_mesh(mesh, part_name(node, mesh, number))

    def _of_mesh(self, mesh: Tree, part: str) -> tuple[str, list[str]] | None:
        primitives = mesh.items("primitives")
        names = target_names(mesh, primitives[0], part) if len(primitives) else []
        if not names:
            self.warnings.append(f"{part}: has no morph targets whose weights could move; left out")
            return None
        return part, names

    def _sampler(self, animation: Tree, channel: Tree) -> Tree:
        samplers = animation.items("samplers")
        return samplers[channel["sampler"].index(len(samplers), "sampler")]

    def _add(self, curves: dict, name: str, owner: str, curve: Curve, column: int) -> None:
        """Keep a curve by its name: parts of one face move alike, and where they do not, the first is kept."""
        if name not in curves:
            curves[name] = owner, curve, column
            return
        first, other, its = curves[name]
        times = np.unique(np.concatenate([curve.times, other.times]))
        if np.abs(curve.at(times)[:, column] - other.at(times)[:, its]).max() > _SAME:
            self.warnings.append(f"{name}: moves otherwise on {owner} than on {first}, whose weights are read")


def _pointer(target: Tree) -> tuple[str, int] | None:
    """Return whose weights a target points to (KHR_animation_pointer): "nodes" or "meshes", and which."""
    extensions = target.get("extensions")
    pointer = extensions.get("KHR_animation_pointer") if extensions else None
    found = _POINTER.fullmatch(pointer["pointer"].text()) if pointer else None
    return (found[1], int(found[2])) if found else None


def _is_neck(node: Tree) -> bool:
    extras = node.value.get("extras") if isinstance(node.value, dict) else None
    return isinstance(extras, dict) and extras.get("facegen") == NECK


def _unit(quaternions: NDArray[np.float64], animation: Tree) -> NDArray[np.float64]:
    lengths = np.linalg.norm(quaternions, axis=1, keepdims=True)
    if lengths.min() < 1e-6:
        raise animation.error("turns the neck by a rotation of length zero")
    return quaternions / lengths

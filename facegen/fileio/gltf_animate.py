"""An animation of morph target weights, and of the head, appended to a glTF file: everything else in it stays.

Khronos, "glTF 2.0 Specification", section 3.11: one channel a node, which gives the weights of all targets of its mesh
at each key; keys ascend in float32.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from facegen.fileio.gltf_append import Appended
from facegen.fileio.gltf_file import GltfFile
from facegen.fileio.gltf_neck import Joint, Neck, add_neck, own_joint
from facegen.fileio.gltf_read import GltfScene, target_names

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Keys:
    """What is animated: ``weights`` (n, k) of morph targets by name at ascending ``times`` (n,), seconds from 0 on.

    ``turn``: (n, 3, 3) rotations of the head and ``shift`` (n, 3) its way forward, in the file's axes and units, or
    None. ``name``: of the animation.
    """

    name: str
    times: Array
    names: tuple[str, ...]
    weights: Array
    turn: Array | None = None
    shift: Array | None = None


def with_animation(scene: GltfScene, keys: Keys, neck: Neck | None) -> tuple[dict[str, Any], bytes, bool]:
    """Return the JSON and the buffer of a scene's file with an animation, and whether the head turns in it.

    Targets that are not animated keep the weight that the file gives them. neck: where the head turns if the file has
    no joint for it.
    """
    keys = _ascending(keys)
    out = Appended(scene.file)
    animation: dict[str, Any] = {"name": _free_name(scene.file, keys.name), "samplers": [], "channels": []}
    clock = out.floats(keys.times, "SCALAR", bounds=True)
    made: dict[bytes, int] = {}

    def channel(node: int, path: str, values: Array, kind: str) -> None:
        values = np.ascontiguousarray(values, "<f4")
        key = kind.encode() + values.tobytes()
        if key not in made:
            animation["samplers"].append({"input": clock, "output": out.floats(values, kind)})
            made[key] = len(animation["samplers"]) - 1
        animation["channels"].append({"sampler": made[key], "target": {"node": node, "path": path}})

    for node, weights in _weights_of(scene, keys):
        channel(node, "weights", weights.ravel(), "SCALAR")
    joint = _joint(out, scene, neck) if keys.turn is not None else None
    if joint is not None:
        channel(joint.node, "rotation", quaternions(joint.before @ keys.turn @ joint.after), "VEC4")
        if joint.place is not None and keys.shift is not None and keys.shift.any():
            channel(joint.node, "translation", joint.place + keys.shift, "VEC3")
    if animation["channels"]:
        out.json.setdefault("animations", []).append(animation)
    return *out.finished(), joint is not None


def _weights_of(scene: GltfScene, keys: Keys) -> list[tuple[int, Array]]:
    """Return the nodes with animated targets and the weights (n, t) of all their targets."""
    tree, found = scene.file.tree, []
    column = {name: k for k, name in enumerate(keys.names)}
    for node, block in {block.node: block for block in reversed(scene.blocks)}.items():
        mesh = tree.items("meshes")[block.mesh]
        primitive = mesh.items("primitives")[0]
        names = target_names(mesh, primitive, block.part)
        if not set(names) & set(column):
            continue
        weights = np.tile(_resting(tree.items("nodes")[node], mesh, len(names)), (len(keys.times), 1))
        for target, name in enumerate(names):
            if name in column:
                weights[:, target] = keys.weights[:, column[name]]
        found.append((node, weights))
    return sorted(found, key=lambda one: one[0])


def _resting(node: Any, mesh: Any, count: int) -> Array:
    """Return the weights (t,) that a node gives its mesh without an animation."""
    for owner in (node, mesh):
        if owner.get("weights"):
            return np.array(owner["weights"].numbers(count))
    return np.zeros(count)


def _joint(out: Appended, scene: GltfScene, neck: Neck | None) -> Joint | None:
    return own_joint(scene) or (None if neck is None else add_neck(out, scene, neck))


def _ascending(keys: Keys) -> Keys:
    """Return the keys without those that float32 cannot tell from the one before."""
    times = keys.times.astype(np.float32)
    kept = np.flatnonzero(np.diff(times, prepend=np.float32(-1.0)) > 0.0)
    if len(kept) == len(times):
        return keys
    some = {name: None if (value := getattr(keys, name)) is None else value[kept]
            for name in ("times", "weights", "turn", "shift")}
    return replace(keys, **some)


def _free_name(file: GltfFile, name: str) -> str:
    taken = {one.value.get("name") for one in file.tree.items("animations")}
    return next(one for k in range(1, len(taken) + 3) if (one := name if k == 1 else f"{name} {k}") not in taken)


def quaternions(turns: Array) -> Array:
    """Return unit quaternions (n, 4) as x, y, z, w of rotations (n, 3, 3), each the nearer one to that before it.

    Based on: S. Shepperd, "Quaternion from rotation matrix", 1978: by the largest of its components.
    """
    found = np.empty((len(turns), 4))
    diagonal = np.einsum("nii->ni", turns)
    size = np.concatenate([2 * diagonal - diagonal.sum(axis=1, keepdims=True), diagonal.sum(axis=1, keepdims=True)], 1)
    largest = size.argmax(axis=1)
    for k, (turn, i) in enumerate(zip(turns, largest, strict=True)):
        root = np.sqrt(1.0 + size[k, i])
        if i == 3:
            xyz = [turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]
            found[k] = [*(one / (2 * root) for one in xyz), root / 2]
        else:
            j, m = (i + 1) % 3, (i + 2) % 3
            found[k, i] = root / 2
            found[k, j], found[k, m] = ((turn[i, j] + turn[j, i]) / (2 * root), (turn[i, m] + turn[m, i]) / (2 * root))
            found[k, 3] = (turn[m, j] - turn[j, m]) / (2 * root)
    found /= np.linalg.norm(found, axis=1, keepdims=True)
    signs = np.sign(np.einsum("ni,ni->n", found[1:], found[:-1]))
    found[1:] *= np.cumprod(np.where(signs < 0, -1.0, 1.0))[:, None]
    return found

"""A joint that turns the head in a glTF file: the file's own, or a neck that is added.

The neck is linear blend skinning with two joints, one that rests and one that turns,

    v -> (1 - w) v + w (R (v - p) + p),

which is how facegen turns a head (`facegen.face.head`), so that a viewer shows the same.

Khronos, "glTF 2.0 Specification", section 3.7.3 (skins); VRMC_vrm and VRM 0.x, humanoid.
"""

from __future__ import annotations

import copy
import re
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from facegen.fileio.gltf_append import Appended
from facegen.fileio.gltf_read import GltfScene
from facegen.fileio.gltf_scene import Scene
from facegen.fileio.gltf_weights import NECK

_HEAD = re.compile(r"(?:.*[:|_.-])?head", re.IGNORECASE)
_TURNS = ("rotation", "translation", "scale", "matrix")

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Neck:
    """Where and how the head turns, in the axes and units of a file: ``pivot`` (3,), and ``weight`` (n,) of its mesh's
    vertices, 1 where all of the turn is made."""

    pivot: Array
    weight: Array


@dataclass(frozen=True, eq=False)
class Joint:
    """A node that turns the head: its own rotation is ``before`` @ turn @ ``after``, each (3, 3). ``place``: (3,) where
    it is in its parent, if it may be moved too."""

    node: int
    before: Array
    after: Array
    place: Array | None = None


def own_joint(scene: GltfScene) -> Joint | None:
    """Return the joint that turns the head in this file already: ours, a VRM avatar's head, or one called head."""
    tree = scene.file.tree
    nodes = tree.items("nodes")
    for number, node in enumerate(nodes):
        extras = node.value.get("extras")
        if isinstance(extras, dict) and extras.get("facegen") == NECK:
            return Joint(number, np.eye(3), np.eye(3), np.array(node["translation"].numbers(3)))
    joints = {joint.index(len(nodes), "node") for skin in tree.items("skins") for joint in skin.items("joints")}
    number = _of_vrm(scene.file.json)
    if number not in joints:
        number = next((one for one in sorted(joints) if isinstance(nodes[one].value.get("name"), str)
                       and _HEAD.fullmatch(nodes[one].value["name"].strip())), None)
    if number is None or nodes[number].get("matrix"):
        return None
    world = Scene(tree).world
    parent = next((k for k, node in enumerate(nodes) if number in [c.integer() for c in node.items("children")]), None)
    above = np.eye(3) if parent is None else _rotation(world[parent, :3, :3])
    rest = _rotation(world[number, :3, :3])
    return Joint(number, above.T, rest)


def add_neck(out: Appended, scene: GltfScene, neck: Neck) -> Joint | None:
    """Add a neck to a file without skins; None, and nothing, if other animations move its parts, or it has a skin."""
    found, tree = out.json, scene.file.tree
    if tree.items("skins") or any(channel["target"]["path"].text() in _TURNS for one in tree.items("animations")
                                  for channel in one.items("channels")):
        return None
    world = Scene(tree).world
    body = len(found["nodes"])
    found["nodes"] += [{"name": "facegen body", "children": [body + 1]},
                       {"name": "facegen neck", "translation": neck.pivot.tolist(), "extras": {"facegen": NECK}}]
    if found.get("scenes"):
        found["scenes"][found.get("scene", 0)].setdefault("nodes", []).append(body)
    skins = found.setdefault("skins", [])
    shown: set[int] = set()
    for node in dict.fromkeys(block.node for block in scene.blocks):
        blocks = [block for block in scene.blocks if block.node == node]
        number = found["nodes"][node]["mesh"]
        if number in shown:                         # its vertices lie elsewhere, so it needs weights of its own
            found["meshes"].append(copy.deepcopy(found["meshes"][number]))
            number = found["nodes"][node]["mesh"] = len(found["meshes"]) - 1
        shown.add(number)
        for block in blocks:
            attributes = _attributes(out, neck.weight[block.start:block.stop])
            for i in block.primitives:
                found["meshes"][number]["primitives"][i]["attributes"].update(attributes)
        away = np.eye(4)
        away[:3, 3] = -neck.pivot
        bind = np.stack([world[node], away @ world[node]]).transpose(0, 2, 1).reshape(2, 16)
        skins.append({"joints": [body, body + 1], "skeleton": body, "inverseBindMatrices": out.floats(bind, "MAT4")})
        found["nodes"][node]["skin"] = len(skins) - 1
        if not found["nodes"][node].get("children"):        # a skinned mesh does not heed its node's place
            for key in _TURNS:
                found["nodes"][node].pop(key, None)
    return Joint(body + 1, np.eye(3), np.eye(3), neck.pivot)


def _attributes(out: Appended, weight: Array) -> dict[str, int]:
    """Return the accessors of joints and weights for vertices that make so much (n,) of the turn."""
    share = np.clip(weight, 0.0, 1.0).astype(np.float32)
    both = np.zeros((len(share), 4), np.float32)
    both[:, 0], both[:, 1] = np.float32(1.0) - share, share
    joints = np.zeros((len(share), 4), np.uint8)
    joints[:, 1] = share > 0.0                      # a joint of weight 0 must be joint 0
    whole = share == 1.0
    joints[whole, 0], joints[whole, 1], both[whole, 0], both[whole, 1] = 1, 0, 1.0, 0.0
    return {"JOINTS_0": out.joints(joints), "WEIGHTS_0": out.floats(both, "VEC4", vertex=True)}


def _of_vrm(found: dict[str, Any]) -> int | None:
    """Return the node of a VRM avatar's head, or None."""
    extensions = found.get("extensions")
    for name in ("VRMC_vrm", "VRM"):
        humanoid = extensions.get(name, {}).get("humanoid") if isinstance(extensions, dict) and isinstance(
            extensions.get(name, {}), dict) else None
        bones = humanoid.get("humanBones") if isinstance(humanoid, dict) else None
        if isinstance(bones, list):                 # VRM 0.x
            bones = {one.get("bone"): one for one in bones if isinstance(one, dict)}
        head = bones.get("head") if isinstance(bones, dict) else None
        if isinstance(head, dict) and isinstance(head.get("node"), int):
            return head["node"]
    return None


def _rotation(matrix: Array) -> Array:
    """Return the rotation nearest to a matrix (3, 3)."""
    left, _, right = np.linalg.svd(matrix)
    if np.linalg.det(left @ right) < 0.0:
        left[:, -1] = -left[:, -1]
    return left @ right

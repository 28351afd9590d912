"""Where a glTF file puts its meshes: the node tree, transforms and skins.

Khronos, "glTF 2.0 Specification", sections 3.5.2-3.5.3 (hierarchy, transformations) and 3.7.3 (skins).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from facegen.fileio.gltf_accessors import Accessors
from facegen.fileio.jsontree import Tree

# Because each node costs a matrix and some time: the largest avatars have a few thousand.
_MOST_NODES = 100_000
# Because a quaternion shorter than this has no direction that its float32 numbers could tell.
_NO_TURN = 1e-6
# Because products of three such numbers, as in a determinant, stay far from what a double holds.
FARTHEST = 1e30


class Scene:
    """The nodes of the scene that a viewer shows first.

    ``shown``: their indices, ascending. ``world``: (nodes, 4, 4) matrices of all nodes.
    """

    def __init__(self, tree: Tree) -> None:
        self.nodes = tree.items("nodes")
        if len(self.nodes) > _MOST_NODES:
            raise tree["nodes"].error(f"{len(self.nodes):,} nodes; facegen reads {_MOST_NODES:,} at most")
        self._children = [[child.index(len(self.nodes), "node") for child in node.items("children")]
                          for node in self.nodes]
        roots = self._roots()
        with np.errstate(all="ignore"):             # what overflows is found below
            self.world = self._world(roots)
        bad = np.flatnonzero(~within_reach(self.world.reshape(-1, 16)))
        if len(bad):
            raise self.nodes[bad[0]].error(f"its transform goes beyond {FARTHEST:g}")
        self.shown = self._shown(tree, roots)

    def _roots(self) -> list[int]:
        """Return the nodes without a parent; FileError for a node with two parents."""
        parents = np.zeros(len(self.nodes), dtype=int)
        for node, children in zip(self.nodes, self._children, strict=True):
            for child in children:
                parents[child] += 1
                if parents[child] > 1:
                    raise node["children"].error(f"node {child} has two parents: the nodes must form trees")
        return np.flatnonzero(parents == 0).tolist()

    def _world(self, roots: list[int]) -> NDArray[np.float64]:
        local = [_local(node) for node in self.nodes]
        world = np.full((len(self.nodes), 4, 4), np.nan)
        order = list(roots)
        for root in roots:
            world[root] = local[root]
        for node in order:                          # grows while it is walked: no recursion, any depth
            for child in self._children[node]:
                world[child] = world[node] @ local[child]
                order.append(child)
        if len(order) < len(self.nodes):
            lost = min(set(range(len(self.nodes))) - set(order))
            raise self.nodes[lost].error("is its own ancestor: the nodes must form trees")
        return world

    def _shown(self, tree: Tree, roots: list[int]) -> list[int]:
        scenes = tree.items("scenes")
        if scenes:
            number = tree["scene"].index(len(scenes), "scene") if tree.get("scene") else 0
            roots = [node.index(len(self.nodes), "node") for node in scenes[number].items("nodes")]
        order = list(dict.fromkeys(roots))
        for node in order:
            order += self._children[node]
        return sorted(set(order))


def within_reach(rows: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return for each row of numbers (n, k) whether all are finite and not absurd."""
    return (np.abs(rows) <= FARTHEST).all(axis=1)


def _local(node: Tree) -> NDArray[np.float64]:
    """Return a node's own 4 x 4 matrix."""
    result = np.eye(4)
    if node.get("matrix"):
        return np.array(node["matrix"].numbers(16)).reshape(4, 4).T
    if node.get("rotation"):
        result[:3, :3] = _turned(node["rotation"])
    if node.get("scale"):
        result[:3, :3] *= node["scale"].numbers(3)
    if node.get("translation"):
        result[:3, 3] = node["translation"].numbers(3)
    return result


def _turned(tree: Tree) -> NDArray[np.float64]:
    """Return the rotation matrix of a quaternion x, y, z, w."""
    quaternion = np.array(tree.numbers(4))
    length = np.abs(quaternion).max()
    if length < _NO_TURN:
        raise tree.error("a rotation of length zero")
    quaternion /= length                            # first, so that squares stay finite
    return rotations(quaternion / np.sqrt(quaternion @ quaternion))


def rotations(quaternions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the rotation matrices (..., 3, 3) of unit quaternions (..., 4) as x, y, z, w."""
    x, y, z, w = np.moveaxis(quaternions, -1, 0)
    rows = [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w),
            2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w),
            2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]
    return np.stack(rows, axis=-1).reshape(*x.shape, 3, 3)


def joint_matrices(tree: Tree, skin: Tree, world: NDArray[np.float64], accessors: Accessors) -> NDArray[np.float64]:
    """Return (joints, 4, 4): where a skin in rest takes the points of its mesh, joint by joint."""
    skins = tree.items("skins")
    one = skins[skin.index(len(skins), "skin")]
    joints = [joint.index(len(world), "node") for joint in one.items("joints")]
    if not joints:
        raise one["joints"].error("a skin needs one joint at least")
    matrices = world[joints]
    if bind := one.get("inverseBindMatrices"):
        count = accessors.count(bind)
        if count < len(joints):
            raise bind.error(f"{count} matrices for {len(joints)} joints")
        inverse = accessors.floats(bind, "MAT4")[:len(joints)].astype(np.float64)
        matrices = matrices @ inverse.reshape(-1, 4, 4).transpose(0, 2, 1)
    if not within_reach(matrices.reshape(-1, 16)).all():
        raise one.error(f"its joints go beyond {FARTHEST:g}")
    return matrices


def skinned(attributes: Tree, joints: NDArray[np.float64], count: int, accessors: Accessors
            ) -> NDArray[np.float64] | None:
    """Return the blended matrix of each vertex (count, 4, 4), or None if the primitive names no joints."""
    members = attributes.members()
    sets = [i for i in range(len(members)) if f"JOINTS_{i}" in members and f"WEIGHTS_{i}" in members]
    if not sets:
        return None
    which = np.concatenate([accessors.integers(members[f"JOINTS_{i}"], "VEC4", count=count) for i in sets], axis=1)
    weights = np.concatenate([accessors.floats(members[f"WEIGHTS_{i}"], "VEC4", count=count) for i in sets], axis=1)
    weights = weights.astype(np.float64)
    if which[weights != 0].max(initial=0) >= len(joints):
        raise members["JOINTS_0"].error(f"refers to joint {which[weights != 0].max()}; the last is {len(joints) - 1}")
    total = weights.sum(axis=1, keepdims=True)
    weights = np.divide(weights, total, out=np.zeros_like(weights), where=total != 0)
    weights[total[:, 0] == 0, 0] = 1.0              # as viewers do: a vertex without weights hangs on its first joint
    which = np.where(weights != 0, which, 0)
    if which.max() >= len(joints):
        raise members["JOINTS_0"].error(f"refers to joint {which.max()}; the last is {len(joints) - 1}")
    flat = joints.reshape(-1, 16)
    result = np.zeros((count, 16))
    for column, weight in zip(which.T, weights.T, strict=True):
        result += weight[:, None] * flat[column]
    return result.reshape(count, 4, 4)

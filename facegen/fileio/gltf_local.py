"""Motion in the world, turned back into the space of the meshes that a glTF file holds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from facegen.errors import InputError
from facegen.fileio.gltf_read import Block, GltfScene, apply_linear

# Because a float32 coordinate of the avatar's size cannot be told from one that is nearer: such motion is none.
STILL = 2.0 ** -24
# Because a transform that squeezes one direction this much more than another cannot be turned back in float32.
_FLAT = 1e-7


@dataclass(frozen=True, eq=False)
class Motion:
    """What a shape does to a block, in the mesh's own space: ``values`` (k, 3) float32 at ascending ``rows`` (k,)."""

    rows: NDArray[np.int64]
    values: NDArray[np.float32]

    def full(self, count: int) -> NDArray[np.float64]:
        """Return the motion of all ``count`` vertices."""
        result = np.zeros((count, 3))
        result[self.rows] = self.values
        return result


def size_of(vertices: NDArray[np.float64]) -> float:
    """Return the longest side of the box around points (n, 3)."""
    return float(np.ptp(vertices, axis=0).max()) if len(vertices) else 0.0


class Inverse:
    """Turns motion in the world back, for one block of a scene."""

    def __init__(self, scene: GltfScene, block: Block) -> None:
        self.block, self.scene = block, scene
        self.still = STILL * size_of(scene.mesh.vertices)
        linear = block.linear
        sizes = np.linalg.norm(linear, axis=(-2, -1))
        with np.errstate(all="ignore"):
            self.flat = ~(np.abs(np.linalg.det(linear)) > _FLAT * sizes ** 3)
        inverse = np.empty_like(linear)
        if linear.ndim == 2:
            inverse = np.linalg.pinv(linear) if self.flat else np.linalg.inv(linear)
        else:
            inverse[~self.flat] = np.linalg.inv(linear[~self.flat])
            inverse[self.flat] = np.linalg.pinv(linear[self.flat])
        self.inverse = inverse

    def motions(self, shapes: Mapping[str, NDArray[np.float64]]) -> dict[str, Motion]:
        """Return what each shape that moves the block does to it. InputError for motion that the file cannot show."""
        result = {}
        for name, shape in shapes.items():
            world = shape[self.block.start:self.block.stop]
            x, y, z = np.abs(world).T
            rows = np.flatnonzero((x > self.still) | (y > self.still) | (z > self.still))
            if len(rows):
                motion = self._turned_back(name, rows, world[rows])
                if len(motion.rows):
                    result[name] = motion
        return result

    def _turned_back(self, name: str, rows: NDArray[np.int64], world: NDArray[np.float64]) -> Motion:
        each = self.block.linear.ndim == 3
        with np.errstate(all="ignore"):             # what overflows is found below
            local = apply_linear(self.inverse[rows] if each else self.inverse, world)
        flat = self.flat[rows] if each else np.broadcast_to(self.flat, len(rows))
        if flat.any():
            linear = self.block.linear[rows] if each else self.block.linear
            lost = (np.abs(apply_linear(linear, local) - world) > self.still).any(axis=1) & flat
            # A vertex that the file collapses into a point cannot be seen, so nothing is lost there.
            collapsed = np.broadcast_to(np.abs(linear).max(axis=(-2, -1)) <= _FLAT, len(rows))
            if (lost & ~collapsed).any():
                vertex = rows[np.flatnonzero(lost & ~collapsed)[0]] + self.block.start
                raise InputError(f"shapes: '{name}' moves vertex {vertex} where node {self.block.node} of the file is "
                                 "flattened by its transform (a scale of 0), so no morph target can hold the motion; "
                                 "apply the transform in the program that wrote the file")
            rows, local = rows[~collapsed], local[~collapsed]
        with np.errstate(over="ignore"):
            values = local.astype(np.float32)
        if not np.isfinite(values).all():
            raise InputError(f"shapes: '{name}' moves node {self.block.node} farther than float32 numbers reach")
        return Motion(rows, values)


def same_motions(one: Mapping[int, Mapping[str, Motion]], other: Mapping[int, Mapping[str, Motion]],
                 counts: Mapping[int, int], tolerance: float) -> bool:
    """Return whether two nodes move their common mesh alike: motions by accessor and name."""
    for accessor, count in counts.items():
        if set(one[accessor]) != set(other[accessor]):
            return False
        for name, motion in one[accessor].items():
            if np.abs(motion.full(count) - other[accessor][name].full(count)).max() > tolerance:
                return False
    return True

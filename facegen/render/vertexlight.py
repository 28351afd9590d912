"""What light reaches each vertex in a look, whoever draws it: baked for each pose or kept, and the key's shadow."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from facegen.geometry.camera import Camera
from facegen.geometry.mesh import Mesh
from facegen.geometry.normals import vertex_normals
from facegen.render.request import Look
from facegen.render.scene import Scene
from facegen.render.shading import baked_light
from facegen.render.shadow import with_shadows

Bake = Callable[[NDArray[np.float64], NDArray | None], NDArray[np.float32]]


class VertexLight:
    """Shares of ambient and lights (n, 1 + lights) for poses of one mesh.

    bake: gives them for vertices (n, 3) and their normals, or None for normals not yet known; by default NumPy's bake.
    """

    def __init__(self, neutral: Mesh, camera: Camera, scene: Scene, look: Look, bake: Bake | None = None) -> None:
        self.neutral, self.camera, self.scene, self.shadows = neutral, camera, scene, look.shadows
        self.posed = look.occlusion == "posed"
        self.still = not (self.posed or self.shadows)       # the same in every pose
        self._bake = bake or self._with_numpy
        self._kept = np.ones((len(neutral.vertices), 1 + len(scene.lights)), np.float32)
        if look.occlusion == "neutral":
            self._kept = self._bake(neutral.vertices, None)

    def of(self, vertices: NDArray[np.float64], normals: NDArray | None) -> NDArray[np.float32]:
        """Return the shares in a pose; ``normals`` (n, 3) are asked for only if ``posed``."""
        light = self._bake(vertices, normals) if self.posed else self._kept
        if self.shadows:
            light = with_shadows(light, self.neutral.with_vertices(vertices), self.camera, self.scene)
        return light

    def _with_numpy(self, vertices: NDArray[np.float64], normals: NDArray | None) -> NDArray[np.float32]:
        if normals is None:
            normals = vertex_normals(vertices, self.neutral.faces)
        return baked_light(self.neutral.with_vertices(vertices), normals, self.camera, self.scene)

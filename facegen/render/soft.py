"""The NumPy renderer: the Z-buffer drawn in bands, each pixel's light computed once where that is enough."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from facegen.geometry.camera import Camera
from facegen.geometry.mesh import Mesh
from facegen.geometry.normals import vertex_normals
from facegen.render.request import Look
from facegen.render.scene import Scene
from facegen.render.shading import from_srgb, shade, surface, to_srgb
from facegen.render.vertexlight import VertexLight
from facegen.render.zbuffer import scan, seen_by

# Samples held at once: the picture is drawn in bands, so that its size does not decide the memory.
_BAND_SAMPLES = 2**18
# Share of the scene's depth within a pixel above which its four samples are shaded one by one.
DEPTH_STEP = 0.01


class SoftBackend:
    """Draws poses of one mesh for one camera, with NumPy alone."""

    def __init__(self, neutral: Mesh, camera: Camera, scene: Scene, look: Look) -> None:
        self.neutral, self.camera, self.scene, self.look = neutral, camera, scene, look
        self._behind = background_rows(look.background, scene, camera.height)
        self._light = VertexLight(neutral, camera, scene, look)

    def draw(self, vertices: NDArray[np.float64]) -> NDArray[np.uint8]:
        """Return the picture (h, w, 4) of checked vertices (n, 3)."""
        mesh, camera, scene, look = self.neutral.with_vertices(vertices), self.camera, self.scene, self.look
        normals = vertex_normals(mesh.vertices, mesh.faces) if self._light.posed or not look.flat else None
        prepared = surface(mesh, camera, scene, flat=look.flat, light=self._light.of(mesh.vertices, normals),
                           normals=normals)
        width, height = camera.width, camera.height
        triangles = seen_by(camera, mesh, samples=4)
        picture = np.empty((height, width, 4), np.uint8)
        rows = max(1, _BAND_SAMPLES // (4 * width))
        for top in range(0, height, rows):
            bottom = min(top + rows, height)
            light, cover = _band(triangles, prepared, camera, scene, top, bottom)
            picture[top:bottom] = _finished(light, cover, self._behind[top:bottom], look.background == "transparent")
        return picture


def _band(triangles, prepared, camera, scene, top, bottom) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return premultiplied linear light (3, rows, width) and coverage (rows, width) of some pixel rows.

    Samples of a pixel that see one continuous piece of one material are shaded once, in their middle.
    """
    ids, nearness = scan(triangles, top, bottom)
    rows, samples, width = ids.shape
    light = np.zeros((3, rows, width), np.float32)
    cover = (ids >= 0).mean(axis=1, dtype=np.float32)
    whole = (ids[:, :1] == ids[:, 1:]).all(axis=1) & (ids[:, 0] >= 0)
    y, x = np.nonzero(whole)
    light[:, y, x] = shade(prepared, camera, scene, ids[y, 0, x], x + np.float32(0.5), y + np.float32(top + 0.5))

    y, x = np.nonzero((cover > 0) & ~whole)
    ids, nearness = ids[y, :, x], nearness[y, :, x]                              # (k, samples)
    free = ids >= 0
    kind = np.where(free, prepared.material[ids], -1)
    across, down = np.array(triangles.sample_x, np.float32), (np.arange(samples, dtype=np.float32) + 0.5) / samples
    for leader in range(samples):
        k = np.flatnonzero(free[:, leader])
        near = np.abs(nearness[k] - nearness[k, leader, None]) < np.float32(DEPTH_STEP)
        same = (ids[k] == ids[k, leader, None]) | (near & (kind[k] == kind[k, leader, None]))
        group = (free[k] & same).astype(np.float32)
        count = group.sum(axis=1)
        colours = shade(prepared, camera, scene, ids[k, leader], x[k] + group @ across / count,
                        top + y[k] + group @ down / count)
        light[:, y[k], x[k]] += colours * (count / samples)
        free[k] &= group == 0
    return light, cover


def _finished(light, cover, behind, transparent) -> NDArray[np.uint8]:
    """Return the band (rows, width, 4) over its background (rows, 3): resolved in linear light, then sRGB."""
    out = np.empty((*cover.shape, 4), np.uint8)
    if transparent:
        light = light / np.maximum(cover, np.float32(1e-6))
        out[..., 3] = np.rint(cover * 255)
    else:
        light = light + behind.T[:, :, None] * (1 - cover)
        out[..., 3] = 255
    out[..., :3] = np.moveaxis(to_srgb(light), 0, -1)
    return out


def background_rows(background: str | tuple[float, float, float], scene: Scene, height: int) -> NDArray[np.float32]:
    """Return the linear colour (height, 3) behind each row of pixels; "transparent" has none: zeros."""
    if background == "transparent":
        return np.zeros((height, 3), np.float32)
    if not isinstance(background, str):
        return np.tile(from_srgb(background), (height, 1))
    share = ((np.arange(height) + 0.5) / height)[:, None]
    high, low = (np.array(c, np.float64) for c in scene.background)
    return np.array([from_srgb(tuple(c)) for c in high + (low - high) * share])

"""The compiled renderer: the pictures of `soft`, many times faster, where numba is installed."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from functools import cache

import numpy as np
from numpy.typing import NDArray

from facegen.geometry.camera import Camera
from facegen.geometry.mesh import Mesh
from facegen.geometry.normals import vertex_normals
from facegen.render import kernels
from facegen.render.occlusion import light_shares, visibility
from facegen.render.request import Look
from facegen.render.scene import Scene
from facegen.render.shading import CAVITY, DARKEST, light_directions, material_rows, srgb_table, to_srgb, unit
from facegen.render.soft import background_rows

# Steps of the table for a power of openness; linear between them.
_POWER_STEPS = 1024
# Pictures with fewer pixels are drawn by one thread: handing out the bands would cost more than it saves.
_WORTH_THREADS = 256 * 256


class FastBackend:
    """Draws poses of one mesh for one camera with the kernels of numba; buffers and constants are kept."""

    def __init__(self, neutral: Mesh, camera: Camera, scene: Scene, look: Look) -> None:
        self.neutral, self.camera, self.scene, self.look = neutral, camera, scene, look
        n, m, lights = len(neutral.vertices), len(neutral.faces), len(scene.lights)
        self._faces = np.ascontiguousarray(neutral.faces)
        self._adjacency, self._ring = _rings(self._faces, n)
        self._cam = np.array([*camera.rotation.ravel(), *camera.target, camera.distance, camera.scale, *camera.offset,
                              camera.orthographic, camera.near], np.float64)
        focal = camera.scale * camera.distance
        self._view = np.array([*camera.offset, 1 / focal, camera.orthographic], np.float32)
        self._material = material_rows(neutral, scene)
        self._inside = len(neutral.materials)
        towards = light_directions(scene)
        self._lamps = np.array([(*way, *lamp.colour, lamp.highlight)
                                for way, lamp in zip(towards, scene.lights, strict=True)], np.float32).reshape(-1, 7)
        self._sky = np.array([*scene.ground, *np.subtract(scene.sky, scene.ground), *unit(scene.window)], np.float32)
        self._behind = background_rows(look.background, scene, camera.height)
        self._behind_bytes = np.full((camera.height, 4), 255, np.uint8)
        self._behind_bytes[:, :3] = to_srgb(self._behind)
        self._transparent = look.background == "transparent"
        if self._transparent:
            self._behind_bytes[:] = 0
        self._towards = towards @ camera.rotation
        self._spreads = np.array([lamp.spread for lamp in scene.lights])
        self._light = np.ones((n, 1 + lights), np.float32)
        if look.occlusion == "neutral":
            normals = vertex_normals(neutral.vertices, neutral.faces)
            self._light = light_shares(visibility(neutral), normals, neutral.faces, self._towards, self._spreads)
        bands = -(-camera.height // kernels.BAND_ROWS)
        self._threads = 1 if camera.width * camera.height < _WORTH_THREADS else min(_cores(), bands)
        self._proj, self._snapped, self._depth = np.empty((n, 3)), np.empty((n, 2), np.int32), np.empty(n)
        self._kind, self._first, self._last = np.empty(m, np.int16), np.empty(m, np.int32), np.empty(m, np.int32)
        self._starts = np.empty(bands + 1, np.int64)
        self._scratch = [_Scratch(n, m, lights) for _ in range(self._threads)]

    def draw(self, vertices: NDArray[np.float64]) -> NDArray[np.uint8]:
        """Return the picture (h, w, 4) of checked vertices (n, 3)."""
        vertices = np.ascontiguousarray(vertices, np.float64)
        width, height = self.camera.width, self.camera.height
        kernels.project(vertices, self._cam, self._proj, self._snapped, self._depth)
        items = kernels.bin_triangles(self._faces, self._snapped, self._depth, width, height,
                                      self.neutral.face_materials, self._inside, self._kind, self._first, self._last,
                                      self._starts)
        light, normals = self._light, None
        if self.look.occlusion == "posed":
            normals = np.empty_like(vertices)
            kernels.all_normals(vertices, self._adjacency, self._ring, normals)
            light = light_shares(visibility(self.neutral.with_vertices(vertices)), normals, self._faces,
                                 self._towards, self._spreads)
            normals = normals @ self.camera.rotation.T
        picture = np.empty((height, width, 4), np.uint8)

        def bands(thread: int) -> None:
            own = self._scratch[thread]
            own.begin(light, normals)
            kernels.draw_bands(
                thread, len(self._starts) - 1, self._threads, items, self._starts, vertices, self._faces, self._proj,
                self._snapped, self._depth, self._kind, self._inside, self._cam, self.look.flat, normals is not None,
                self._adjacency, self._ring, own.attributes, own.vertex_ready, own.planes, own.ready, self._material,
                self._lamps, self._sky, self._view, _powers(), srgb_table(), self._behind, self._behind_bytes,
                self._transparent, picture)

        if self._threads == 1:
            bands(0)
        else:
            list(_pool(self._threads).map(bands, range(self._threads)))
        return picture


class _Scratch:
    """What one thread works out about vertices and triangles while it draws a picture."""

    def __init__(self, n: int, m: int, lights: int) -> None:
        self.attributes = np.zeros((n, 4 + lights), np.float32)          # normal in camera axes, light shares
        self.vertex_ready, self.ready = np.empty(n, np.uint8), np.empty(m, np.uint8)
        self.planes = np.empty((m, 14), np.float32)

    def begin(self, light: NDArray[np.float32], normals: NDArray | None) -> None:
        self.attributes[:, 3:] = light
        if normals is not None:
            self.attributes[:, :3] = normals
        self.vertex_ready[:] = 0
        self.ready[:] = 0


def _rings(faces: NDArray[np.int32], count: int) -> tuple[NDArray[np.int64], NDArray[np.int32]]:
    """Return for each vertex where its entries start, and (3m, 2) the next and the previous corner of its triangles."""
    corner = faces.ravel()
    order = np.argsort(corner, kind="stable")
    ring = np.stack([np.roll(faces, -1, axis=1).ravel(), np.roll(faces, 1, axis=1).ravel()], axis=1)[order]
    starts = np.zeros(count + 1, np.int64)
    np.cumsum(np.bincount(corner, minlength=count), out=starts[1:])
    return starts, np.ascontiguousarray(ring, np.int32)


@cache
def _powers() -> NDArray[np.float32]:
    """Return how much ambient light comes in by openness 0..1, as `shading.shade` computes it."""
    openness = np.arange(_POWER_STEPS + 2) / _POWER_STEPS
    return (DARKEST + (1 - DARKEST) * openness**CAVITY).astype(np.float32)


@cache
def _pool(threads: int) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(threads, thread_name_prefix="facegen-bands")


def _cores() -> int:
    """Return how many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1

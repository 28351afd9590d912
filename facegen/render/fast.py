"""The compiled renderer: the pictures of `soft`, many times faster, where numba is installed."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache

import numpy as np
from numpy.typing import NDArray

from facegen.geometry.camera import Camera
from facegen.geometry.mesh import Mesh
from facegen.render import bake_kernels, kernels
from facegen.render.occlusion import (
    DIRECTIONS,
    GRID,
    POINTS_A_CELL,
    directions,
    frame_of,
    in_cells,
    light_lobes,
    sequence,
)
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
        self._transparent = look.background == "transparent"
        ground = np.full((camera.height, 4), 0 if self._transparent else 255, np.uint8)
        ground[:, :3] = to_srgb(self._behind)
        self._blank = np.tile(ground[:, None, :], (1, camera.width, 1))
        if self._transparent:
            self._blank[:] = 0
        self._lobes, self._faint = light_lobes(towards @ camera.rotation,
                                               np.array([lamp.spread for lamp in scene.lights]))
        bands = -(-camera.height // kernels.BAND_ROWS)
        small = camera.width * camera.height < _WORTH_THREADS
        self._threads = 1 if small else min(look.threads or _cores(), bands)
        self._proj, self._snapped, self._depth = np.empty((n, 3)), np.empty((n, 2), np.int32), np.empty(n)
        self._kind, self._first, self._last = np.empty(m, np.int16), np.empty(m, np.int32), np.empty(m, np.int32)
        self._starts = np.empty(bands + 1, np.int64)
        self._scratch = [_Scratch(n, m, lights) for _ in range(self._threads)]
        self._light = np.ones((n, 1 + lights), np.float32)
        if look.occlusion == "neutral":
            self._light = self._baked(neutral.vertices)[0]

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
            light, normals = self._baked(vertices)
            normals = normals @ self.camera.rotation.T
        picture = self._blank.copy()

        def bands(thread: int) -> None:
            own = self._scratch[thread]
            own.begin(light, normals)
            kernels.draw_bands(
                thread, len(self._starts) - 1, self._threads, items, self._starts, vertices, self._faces, self._proj,
                self._snapped, self._depth, self._kind, self._inside, self._cam, self.look.flat, normals is not None,
                self._adjacency, self._ring, own.attributes, own.vertex_ready, own.planes, own.ready, self._material,
                self._lamps, self._sky, self._view, _powers(), srgb_table(), self._behind,
                self._transparent, picture.view(np.uint32)[..., 0])

        self._share_out(bands)
        return picture

    def _baked(self, vertices: NDArray[np.float64]) -> tuple[NDArray[np.float32], NDArray[np.float64]]:
        """Return each vertex's light shares (n, 1 + lights) and normal (n, 3) in world axes."""
        normals = np.empty((len(vertices), 3))
        kernels.all_normals(vertices, self._adjacency, self._ring, normals)
        local, facing = in_cells(vertices), normals.astype(np.float32)
        points = bake_kernels.surface_points(local, self._faces, _sequence())
        seen = np.empty((len(vertices), DIRECTIONS), np.float32)
        self._share_out(lambda thread: bake_kernels.visible(points, local, facing, _frames(), thread, self._threads,
                                                            seen))
        light = np.empty((len(vertices), 1 + len(self._lamps)), np.float32)
        bake_kernels.shares(seen, facing, self._faces, np.ascontiguousarray(directions().T),
                            np.ascontiguousarray(self._lobes.T), self._faint, light)
        return light, normals

    def _share_out(self, work: Callable[[int], None]) -> None:
        """Have each thread do its share; the kernels let go of the interpreter's lock."""
        if self._threads == 1:
            work(0)
        else:
            list(_pool(self._threads).map(work, range(self._threads)))


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
def _frames() -> NDArray[np.float32]:
    return np.stack([frame_of(way) for way in directions()[:DIRECTIONS // 2]])


@cache
def _sequence() -> NDArray[np.float32]:
    # No triangle asks for more: the grid itself has no more cells.
    return sequence(int(GRID * GRID * POINTS_A_CELL))


@cache
def _pool(threads: int) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(threads, thread_name_prefix="facegen-bands")


def _cores() -> int:
    """Return how many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1

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
from facegen.render.request import Look, available_cores
from facegen.render.scene import Scene
from facegen.render.shading import (
    CAVITY,
    DARKEST,
    light_directions,
    material_rows,
    srgb_table,
    to_srgb,
    unit,
    vertex_albedo,
)
from facegen.render.soft import background_rows
from facegen.render.vertexlight import VertexLight

# Steps of the table for a power of openness; linear between them.
_POWER_STEPS = 1024
# Pictures with fewer pixels are drawn by one thread: handing out the bands would cost more than it saves.
_WORTH_THREADS = 256 * 256


class FastBackend:
    """Draws poses of one mesh for one camera with the kernels of numba; buffers and constants are kept.

    The buffers are shared by all draws: one caller at a time.
    """

    def __init__(self, neutral: Mesh, camera: Camera, scene: Scene, look: Look) -> None:
        self.neutral, self.camera, self.scene, self.look = neutral, camera, scene, look
        n, m, lights = len(neutral.vertices), len(neutral.faces), len(scene.lights)
        self._faces = np.ascontiguousarray(neutral.faces)
        self._cam = np.array([*camera.rotation.ravel(), *camera.target, camera.distance, camera.scale, *camera.offset,
                              camera.orthographic, camera.near], np.float64)
        focal = camera.scale * camera.distance
        self._view = np.array([*camera.offset, 1 / focal, camera.orthographic], np.float32)
        self._material = material_rows(neutral, scene)
        self._inside = len(neutral.materials)
        self._colours = vertex_albedo(neutral)
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
        self._starts, self._columns = np.empty(bands + 1, np.int64), np.empty((bands, 2), np.int64)
        self._normals, self._attributes = np.zeros((n, 3), np.float32), np.empty((n, 4 + lights), np.float32)
        self._work = np.empty(6 * kernels.CHUNK, np.float32)
        # What each thread works out about the triangles that it sees: planes, and which are done.
        self._scratch = [(np.empty((m, 16), np.float32), np.empty(m, np.uint8)) for _ in range(self._threads)]
        self._light = VertexLight(neutral, camera, scene, look, self._baked)

    def draw(self, vertices: NDArray[np.float64]) -> NDArray[np.uint8]:
        """Return the picture (h, w, 4) of checked vertices (n, 3)."""
        vertices = _own(vertices)
        width, height = self.camera.width, self.camera.height
        kernels.project(vertices, self._cam, self._proj, self._snapped, self._depth)
        items = kernels.bin_triangles(self._faces, self._snapped, self._depth, width, height,
                                      self.neutral.face_materials, self._inside, self._kind, self._first, self._last,
                                      self._starts, self._columns)
        if self._light.posed or not self.look.flat:
            kernels.all_normals(vertices, self._faces, self._work, self._normals)
        light = self._light.of(vertices, self._normals)
        kernels.fill_attributes(self._normals, light, self._cam, self._attributes)
        picture = self._blank.copy()

        def bands(thread: int) -> None:
            planes, ready = self._scratch[thread]
            ready[:] = 0
            kernels.draw_bands(
                thread, len(self._starts) - 1, self._threads, items, self._starts, self._columns, vertices,
                self._faces, self._proj, self._snapped, self._depth, self._kind, self._inside, self._cam,
                self.look.flat, self._attributes, self._colours, planes, ready, self._material, self._lamps,
                self._sky, self._view, _powers(), srgb_table(), self._behind, self._transparent,
                picture.view(np.uint32)[..., 0])

        self._share_out(bands)
        return picture

    def _baked(self, vertices: NDArray[np.float64], normals: NDArray[np.float32] | None) -> NDArray[np.float32]:
        """Return each vertex's shares of light (n, 1 + lights)."""
        if normals is None:
            vertices, normals = _own(vertices), self._normals
            kernels.all_normals(vertices, self._faces, self._work, normals)
        local = in_cells(vertices)
        points = bake_kernels.surface_points(local, self._faces, _sequence())
        seen = np.empty((len(vertices), DIRECTIONS), np.float32)
        self._share_out(lambda thread: bake_kernels.visible(points, local, normals, _frames(), thread, self._threads,
                                                            seen))
        light = np.empty((len(vertices), 1 + len(self._lamps)), np.float32)
        bake_kernels.shares(seen, normals, self._faces, np.ascontiguousarray(directions().T),
                            np.ascontiguousarray(self._lobes.T), self._faint, light)
        return light

    def _share_out(self, work: Callable[[int], None]) -> None:
        """Have each thread do its share; the kernels let go of the interpreter's lock."""
        if self._threads == 1:
            work(0)
        else:
            list(_pool(self._threads, os.getpid()).map(work, range(self._threads)))


def _own(vertices: NDArray) -> NDArray[np.float64]:
    """Return a copy: a read-only array would be another type to the compiler, and all be compiled twice."""
    return np.array(vertices, np.float64, order="C")


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
def _pool(threads: int, process: int) -> ThreadPoolExecutor:
    """Return the threads of a process: a forked child inherits the object, but none that works."""
    return ThreadPoolExecutor(threads, thread_name_prefix="facegen-bands")


def _cores() -> int:
    """Return how many threads may draw: as many as there are cores, or as everybody is told to take."""
    told = os.environ.get("OMP_NUM_THREADS", "")
    return max(1, int(told)) if told.isdecimal() else available_cores()

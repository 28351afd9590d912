"""How much of its surroundings each vertex sees: ambient occlusion and soft shadows from depth views.

The mesh is seen from 64 directions. In each view a coarse grid keeps the nearest of many points of the
surface; a vertex that lies behind its cell is hidden from that direction. The table of what is seen serves
the ambient light (all directions) and, weighted towards a light, that light's soft shadow.
"""

from __future__ import annotations

import hashlib
from collections import OrderedDict
from functools import cache

import numpy as np
from numpy.typing import NDArray

from facegen.geometry.mesh import Mesh
from facegen.geometry.normals import vertex_normals

DIRECTIONS = 64
# Cells along the diameter of a sphere round the mesh: 2 mm on a head.
GRID = 176
# Points of the surface a cell's area, so that few cells stay empty where the surface faces the view.
POINTS_A_CELL = 2.0
# A vertex is lifted off its own surface by this many cells, and a slanted surface is allowed to rise by
# this many cells within one cell before it counts as hiding itself.
LIFT = 0.7
SLOPE = 0.7
# ... up to this cosine; beyond it the slope would hide nothing at all.
STEEPEST = 0.35
# From barely hidden to hidden, in cells: softens the steps of the grid.
SOFT = 1.5
# Directions flatter over the surface than this (cosine) say little: the surface's own slope decides there.
FLATTEST = 0.08
_KEPT = 8
# Cells left free round the grid, for the lift.
_BORDER = 2
_cache: OrderedDict[bytes, NDArray[np.float32]] = OrderedDict()


@cache
def directions() -> NDArray[np.float32]:
    """Return the (64, 3) directions: half a Fibonacci spiral over the sphere, and the opposite of each."""
    k = np.arange(DIRECTIONS // 2) + 0.5
    height, turn = 1 - 2 * k / DIRECTIONS, np.pi * (1 + 5**0.5) * k
    ring = np.sqrt(1 - height**2)
    half = np.stack([ring * np.cos(turn), height, ring * np.sin(turn)], axis=1)
    return np.concatenate([half, -half]).astype(np.float32)


def visibility(mesh: Mesh) -> NDArray[np.float32]:
    """Return (n, 64): how far each vertex sees out in each direction, 0 hidden .. 1 free.

    The last few meshes' tables are kept, so that frames of a rig that share a bake pay once.
    """
    digest = hashlib.blake2b(mesh.vertices.tobytes(), digest_size=16)
    digest.update(mesh.faces.tobytes())
    key = digest.digest()
    if key not in _cache:
        _cache[key] = _bake(mesh)
        while len(_cache) > _KEPT:
            _cache.popitem(last=False)
    _cache.move_to_end(key)
    return _cache[key]


def light_shares(seen: NDArray[np.float32], normals: NDArray, faces: NDArray, towards: NDArray,
                 spreads: NDArray) -> NDArray[np.float32]:
    """Return (n, 1 + k): ambient openness, and the share of each of k soft lights that reaches a vertex.

    seen: (n, 64) from `visibility`. normals: (n, 3), those of the baked mesh. towards: (k, 3) unit vectors
    to the lights in the mesh's axes. spreads: (k,) sharpness of the lobe round each. Openness is the
    cosine-weighted share of the hemisphere that is free; a light asks only directions above the surface,
    and where its lobe has none the openness stands in.
    """
    ways = directions()
    cosine = np.asarray(normals, np.float32) @ ways.T - np.float32(FLATTEST)
    np.maximum(cosine, 0, out=cosine)
    ambient = np.einsum("nd,nd->n", seen, cosine) / np.maximum(cosine.sum(axis=1), np.float32(1e-6))
    lobes, faint = light_lobes(towards, spreads)
    above = np.minimum(4 * cosine, 1)
    reach = ((seen * above) @ lobes + faint * ambient[:, None]) / (above @ lobes + faint)
    return _smoothed(np.concatenate([ambient[:, None], reach], axis=1), faces)


def light_lobes(towards: NDArray, spreads: NDArray) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return how much each direction counts for each light (64, k), and the weight (k,) of openness beside them."""
    lobes = np.exp(np.asarray(spreads, np.float32) * (directions() @ np.asarray(towards, np.float32).T - 1))
    return lobes, np.float32(0.02) * lobes.sum(axis=0)


def in_cells(vertices: NDArray[np.float64]) -> NDArray[np.float32]:
    """Return vertices (n, 3) in cells of the grid, whose middle is the mesh's centre."""
    centre = (vertices.min(axis=0) + vertices.max(axis=0)) / 2
    radius = np.sqrt(((vertices - centre) ** 2).sum(axis=1).max()) or 1.0
    return ((vertices - centre) * ((GRID / 2 - _BORDER) / radius)).astype(np.float32)


def _bake(mesh: Mesh) -> NDArray[np.float32]:
    vertices = mesh.vertices
    local = in_cells(vertices)
    normals = vertex_normals(vertices, mesh.faces).astype(np.float32)
    points = _surface_points(local, mesh.faces).T.copy()
    tested = (local + np.float32(LIFT) * normals).T.copy()
    seen = np.empty((DIRECTIONS, len(vertices)), np.float32)
    half = DIRECTIONS // 2
    for k, way in enumerate(directions()[:half]):
        axes = frame_of(way)
        slant = np.clip(np.abs(normals @ way), np.float32(STEEPEST), 1)
        allowance = np.float32(SLOPE) * np.sqrt(1 - slant**2) / slant
        index, height = _cells(axes @ points)
        own_index, own_height = _cells(axes @ tested)
        for row, sign in ((k, 1), (k + half, -1)):                # the opposite view shares the cells
            depth = np.full(GRID * GRID, -np.inf, np.float32)
            np.maximum.at(depth, index, height if sign > 0 else -height)
            _fill_holes(depth.reshape(GRID, GRID))
            above = depth[own_index] - sign * own_height - allowance
            seen[row] = 1 - np.clip(above / np.float32(SOFT), 0, 1)
    return np.ascontiguousarray(seen.T)


def _surface_points(vertices: NDArray, faces: NDArray) -> NDArray[np.float32]:
    """Return points all over the surface: the vertices, and in each triangle as many as its area asks for.

    Based on: M. Roberts, "The unreasonable effectiveness of quasirandom sequences", 2018 (the R2 sequence).
    """
    # Each triangle has the same points whatever its place in the list and its first corner.
    a, b, c = (vertices[corner] for corner in np.sort(faces, axis=1).T)
    area = np.sqrt((np.cross(b - a, c - a) ** 2).sum(axis=1)) / 2
    count = np.ceil(area * POINTS_A_CELL).astype(np.int64)
    owner = np.repeat(np.arange(len(faces)), count)
    k = np.arange(len(owner)) - np.repeat(np.cumsum(count) - count, count)
    u, v = sequence(int(count.max(initial=0)))[k].T[..., None]
    inner = a[owner] + u * (b - a)[owner] + v * (c - a)[owner]
    return np.concatenate([vertices, inner])


def sequence(count: int) -> NDArray[np.float32]:
    """Return the first points (count, 2) that fill a triangle evenly, as shares of its two edges."""
    u, v = np.multiply.outer((0.7548776662466927, 0.5698402909980532), np.arange(count) + 0.5) % 1
    over = u + v > 1
    return np.stack([np.where(over, 1 - u, u), np.where(over, 1 - v, v)], axis=1).astype(np.float32)


def frame_of(way: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return rows (across, along, towards): a frame whose last axis is the direction."""
    return frame_round(way, np.array([0, 0, 1] if abs(way[2]) < 0.7 else [1, 0, 0], np.float32))


def frame_round(way: NDArray, helper: NDArray) -> NDArray:
    """Return rows (across, along, way) of a right-handed frame; across is at right angles to the helper too."""
    across = np.cross(helper, way)
    across /= np.sqrt(across @ across)
    return np.stack([across, np.cross(way, across), way])


def _cells(local: NDArray[np.float32]) -> tuple[NDArray[np.intp], NDArray[np.float32]]:
    """Return the cell of the flattened grid that each point of (3, k) falls in, and its height."""
    middle = np.float32(GRID / 2)
    return (np.floor(local[1] + middle) * np.float32(GRID) + (local[0] + middle)).astype(np.intp), local[2]


def _fill_holes(depth: NDArray[np.float32]) -> None:
    """Give an empty cell between two filled ones, across or along, the lower of the two, in place."""
    inner = depth[1:-1, 1:-1]
    across = np.minimum(depth[1:-1, :-2], depth[1:-1, 2:])
    along = np.minimum(depth[:-2, 1:-1], depth[2:, 1:-1])
    np.copyto(inner, np.maximum(across, along), where=np.isneginf(inner))


def _smoothed(values: NDArray[np.float32], faces: NDArray) -> NDArray[np.float32]:
    """Return values (n, k) averaged half with the triangles round each vertex: takes the grid's noise off."""
    n = len(values)
    means = values[faces].mean(axis=1)
    index = faces.ravel()
    degree = np.bincount(index, minlength=n)
    round_it = np.stack([np.bincount(index, np.repeat(column, 3), minlength=n) for column in means.T], axis=1)
    round_it /= np.maximum(degree, 1)[:, None]
    return np.where(degree[:, None] > 0, (values + round_it) / 2, values).astype(np.float32)

"""The bake of `occlusion` compiled by numba: the same directions, points and grid, tens of times faster."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from facegen.render.kernels import OPTIONS
from facegen.render.occlusion import FLATTEST, GRID, LIFT, POINTS_A_CELL, SLOPE, SOFT, STEEPEST

_CELLS = GRID * GRID
_MIDDLE = np.float32(GRID / 2)
_EMPTY = np.float32(-1e30)


@njit(**OPTIONS)
def surface_points(local, faces, sequence):
    """Return (3, k): the vertices, and in each triangle as many points of the sequence as its area asks for."""
    n, m = len(local), len(faces)
    counts, total = np.empty(m, np.int64), n
    for t in range(m):
        a, b, c = faces[t, 0], faces[t, 1], faces[t, 2]
        ux, uy, uz = local[b, 0] - local[a, 0], local[b, 1] - local[a, 1], local[b, 2] - local[a, 2]
        vx, vy, vz = local[c, 0] - local[a, 0], local[c, 1] - local[a, 1], local[c, 2] - local[a, 2]
        x, y, z = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        area = np.float32(math.sqrt(x * x + y * y + z * z)) * np.float32(POINTS_A_CELL / 2)
        counts[t] = min(np.int64(math.ceil(area)), len(sequence))
        total += counts[t]
    points = np.empty((3, total), np.float32)
    for v in range(n):
        for axis in range(3):
            points[axis, v] = local[v, axis]
    at = n
    for t in range(m):
        a, b, c = sorted3(faces[t, 0], faces[t, 1], faces[t, 2])
        for axis in range(3):
            base, along, across = local[a, axis], local[b, axis] - local[a, axis], local[c, axis] - local[a, axis]
            for k in range(counts[t]):
                points[axis, at + k] = base + sequence[k, 0] * along + sequence[k, 1] * across
        at += counts[t]
    return points


@njit(**OPTIONS)
def sorted3(a, b, c):
    """Return three numbers in order: a triangle's points must not depend on its first corner."""
    low, high = min(a, b, c), max(a, b, c)
    return low, a + b + c - low - high, high


@njit(**OPTIONS)
def visible(points, local, normals, frames, first, step, seen):
    """Fill the columns of seen (n, 2 k) that belong to the directions first, first + step, ... and their opposites.

    frames (k, 3, 3): rows across, along and towards of each direction. See `occlusion._bake`.
    """
    grid, filled = np.empty((2, _CELLS), np.float32), np.empty((2, _CELLS), np.float32)
    count, n, half = points.shape[1], len(local), len(frames)
    chunk = 1024
    cell, height = np.empty(chunk, np.int32), np.empty(chunk, np.float32)
    px, py, pz = points[0], points[1], points[2]
    for k in range(first, half, step):
        r = frames[k]
        r00, r01, r02, r10, r11, r12 = r[0, 0], r[0, 1], r[0, 2], r[1, 0], r[1, 1], r[1, 2]
        r20, r21, r22 = r[2, 0], r[2, 1], r[2, 2]
        grid[:] = _EMPTY
        for begin in range(0, count, chunk):
            size = np.uint64(min(chunk, count - begin))
            x, y, z = px[begin:begin + chunk], py[begin:begin + chunk], pz[begin:begin + chunk]
            for i in range(size):
                across = r00 * x[i] + r01 * y[i] + r02 * z[i]
                along = r10 * x[i] + r11 * y[i] + r12 * z[i]
                height[i] = r20 * x[i] + r21 * y[i] + r22 * z[i]
                # Both are positive: to cut is to round down.
                cell[i] = np.int32(np.int32(along + _MIDDLE) * np.int32(GRID) + np.int32(across + _MIDDLE))
            for i in range(size):
                c = np.uint64(cell[i])
                grid[0, c] = max(grid[0, c], height[i])
                grid[1, c] = max(grid[1, c], -height[i])
        for side in range(2):
            for c in range(_CELLS):
                filled[side, c] = grid[side, c]
                if grid[side, c] == _EMPTY and GRID < c < _CELLS - GRID - 1:
                    filled[side, c] = max(min(grid[side, c - 1], grid[side, c + 1]),
                                          min(grid[side, c - GRID], grid[side, c + GRID]))
        for v in range(n):
            nx, ny, nz = normals[v, 0], normals[v, 1], normals[v, 2]
            x, y = local[v, 0] + np.float32(LIFT) * nx, local[v, 1] + np.float32(LIFT) * ny
            z = local[v, 2] + np.float32(LIFT) * nz
            slant = min(max(abs(r20 * nx + r21 * ny + r22 * nz), np.float32(STEEPEST)), np.float32(1))
            allowance = np.float32(SLOPE) * np.float32(math.sqrt(np.float32(1) - slant * slant)) / slant
            own = r20 * x + r21 * y + r22 * z
            c = (np.int64(r10 * x + r11 * y + r12 * z + _MIDDLE) * GRID
                 + np.int64(r00 * x + r01 * y + r02 * z + _MIDDLE))
            front, back = filled[0, c] - own - allowance, filled[1, c] + own - allowance
            seen[v, k] = np.float32(1) - min(max(front * np.float32(1 / SOFT), np.float32(0)), np.float32(1))
            seen[v, k + half] = np.float32(1) - min(max(back * np.float32(1 / SOFT), np.float32(0)), np.float32(1))


@njit(**OPTIONS)
def shares(seen, normals, faces, ways, lobes, faint, light):
    """Fill light (n, 1 + k): see `occlusion.light_shares`. ways (3, d), lobes (k, d), faint (k,)."""
    n, directions, lamps = len(seen), np.uint64(ways.shape[1]), len(lobes)
    raw, cosine, reach = np.empty((n, 1 + lamps), np.float32), np.empty(ways.shape[1], np.float32), np.float32(0)
    for v in range(n):
        nx, ny, nz, row = normals[v, 0], normals[v, 1], normals[v, 2], seen[v]
        total = free = np.float32(0)
        for d in range(directions):
            value = max(nx * ways[0, d] + ny * ways[1, d] + nz * ways[2, d] - np.float32(FLATTEST), np.float32(0))
            cosine[d] = min(np.float32(4) * value, np.float32(1))
            total += value
            free += value * row[d]
        openness = free / max(total, np.float32(1e-6))
        raw[v, 0] = openness
        for k in range(lamps):
            total = reach = np.float32(0)
            for d in range(directions):
                share = cosine[d] * lobes[k, d]
                total += share
                reach += share * row[d]
            raw[v, 1 + k] = (reach + faint[k] * openness) / (total + faint[k])
    # Half of each value comes from the triangles around it: takes the grid's noise off.
    degree = np.zeros(n, np.int32)
    light[:] = 0
    for t in range(len(faces)):
        a, b, c = faces[t, 0], faces[t, 1], faces[t, 2]
        for k in range(1 + lamps):
            mean = (raw[a, k] + raw[b, k] + raw[c, k]) * np.float32(1 / 3)
            light[a, k] += mean
            light[b, k] += mean
            light[c, k] += mean
        degree[a] += 1
        degree[b] += 1
        degree[c] += 1
    for v in range(n):
        for k in range(1 + lamps):
            light[v, k] = (raw[v, k] + light[v, k] / np.float32(degree[v])) / 2 if degree[v] else raw[v, k]

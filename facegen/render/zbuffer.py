"""The Z-buffer: which triangle is in front at each sample of the picture, exactly.

Corners are snapped to 1/256 pixel and spans are solved without rounding, so a sample on a shared edge
belongs to exactly one triangle: the rows of an edge are half open (top in, bottom out), and so are the
spans (left in, right out) - the top-left rule. One edge gives one rational crossing a row, the same for
both its triangles.

The integers are kept in float64, whose division is faster and here still exact: coordinates stay below 2^23
sub-pixels, so products stay below 2^53, and a quotient that is no whole number misses one by at least
2^-31, far more than its rounding error.

Four samples a pixel lie on a rotated grid: each of four sub-rows has one sample, each at its own x.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from facegen.geometry.camera import Camera
from facegen.geometry.mesh import Mesh

SUBPIXELS = 256
# The samples' x within their pixel, in sub-pixels, one for each sub-row from the top.
PATTERNS = {1: (128,), 4: (96, 224, 32, 160)}
# Coordinates are held within this, so that all products are exact; the largest picture has 4096 pixels a
# side.
_FARTHEST_PIXEL = 2.0**14
# Depth takes the upper 31 bits of a sample's key, the triangle's index the lower 32.
_DEPTH_STEPS = float(2**31 - 1)
_LOW_BITS = np.int64(2**32 - 1)


@dataclass(frozen=True, eq=False)
class Triangles:
    """Triangles ready to be scanned: corners sorted downwards, one plane of nearness each.

    x, y: (k, 3) float64, whole sub-pixels. plane: (k, 3) float64, nearness at the top corner and its change
    a pixel rightwards and downwards. ids: (k,) int64, the triangle's index in the mesh.
    """

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    plane: NDArray[np.float64]
    ids: NDArray[np.int64]
    width: int
    height: int
    samples: int

    @property
    def sample_x(self) -> tuple[float, ...]:
        """The samples' x within their pixel, 0..1, from the upper sub-row to the lower."""
        return tuple(x / SUBPIXELS for x in PATTERNS[self.samples])


def seen_by(camera: Camera, mesh: Mesh, *, samples: int) -> Triangles:
    """Return a mesh's triangles ready to be scanned for a camera's picture."""
    return prepare(_nearness_points(mesh.vertices, camera), mesh.faces, width=camera.width, height=camera.height,
                   samples=samples)


def _nearness_points(vertices: NDArray, camera: Camera) -> NDArray[np.float64]:
    """Return vertices (n, 3) as `prepare` wants them: pixels x and y, nearness within 0.01..0.99, NaN before the
    near plane."""
    projected = camera.project(vertices)
    in_front = projected[:, 2] > camera.near
    near = camera.nearness(projected[:, 2])
    low, high = (near[in_front].min(), near[in_front].max()) if in_front.any() else (0.0, 1.0)
    # Kept off 0, which means "nothing" in the buffer.
    projected[:, 2] = np.where(in_front, 0.01 + 0.98 * (near - low) / max(high - low, 1e-12), np.nan)
    return projected


def prepare(points: NDArray, faces: NDArray, *, width: int, height: int, samples: int = 4) -> Triangles:
    """Return the triangles that can be seen, ready to be scanned.

    points: (n, 3), x and y in pixels and nearness scaled to 0..1 (1 = nearest); a vertex with NaN nearness
    lies before the near plane, and triangles that use it are left out. faces: (m, 3). samples: 1 or 4 a
    pixel.
    """
    snapped = np.rint(np.clip(points[:, :2], -_FARTHEST_PIXEL, _FARTHEST_PIXEL) * SUBPIXELS)
    x, y, near = snapped[:, 0][faces], snapped[:, 1][faces], points[:, 2][faces]
    twice_area = (x[:, 1] - x[:, 0]) * (y[:, 2] - y[:, 0]) - (x[:, 2] - x[:, 0]) * (y[:, 1] - y[:, 0])
    inside = ((x.max(axis=1) > 0) & (x.min(axis=1) < width * SUBPIXELS)
              & (y.max(axis=1) > 0) & (y.min(axis=1) < height * SUBPIXELS))
    ids = np.flatnonzero(inside & (twice_area != 0) & ~np.isnan(near).any(axis=1))
    x, y, near = x[ids], y[ids], near[ids]
    order = np.argsort(y, axis=1, kind="stable")
    x, y, near = (np.take_along_axis(a, order, axis=1) for a in (x, y, near))

    (bx, cx), (by, cy) = ((x[:, 1:] - x[:, :1]) / SUBPIXELS).T, ((y[:, 1:] - y[:, :1]) / SUBPIXELS).T
    bn, cn = (near[:, 1:] - near[:, :1]).T
    area = bx * cy - cx * by
    plane = np.stack([near[:, 0], (bn * cy - cn * by) / area, (cn * bx - bn * cx) / area], axis=1)
    return Triangles(x, y, plane, ids, width, height, samples)


def scan(triangles: Triangles, top: int = 0, bottom: int | None = None
         ) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
    """Return who is in front in the pixel rows top..bottom: triangle ids and nearness, (rows, samples,
    width).

    ids is -1 and nearness 0 where nothing is hit. At equal nearness the higher index wins.
    """
    t = triangles
    bottom = t.height if bottom is None else bottom
    row, start, count, owner = _spans(t, top * t.samples, bottom * t.samples)
    keys = np.zeros((bottom - top) * t.samples * t.width, dtype=np.int64)

    # Nearness at the span's first sample and its step a pixel.
    sample_x = start + np.array(t.sample_x)[row % t.samples] - t.x[owner, 0] / SUBPIXELS
    sample_y = (row + 0.5) / t.samples - t.y[owner, 0] / SUBPIXELS
    plane = t.plane[owner]
    step = plane[:, 1] * _DEPTH_STEPS
    first = (plane[:, 0] + plane[:, 2] * sample_y) * _DEPTH_STEPS + step * sample_x

    ends = np.cumsum(count)
    along = np.arange(ends[-1] if len(ends) else 0) - np.repeat(ends - count, count)
    depth = np.repeat(first, count)
    depth += np.repeat(step, count) * along
    np.clip(depth, 1.0, _DEPTH_STEPS, out=depth)
    key = depth.astype(np.int64)
    key <<= 32
    key |= np.repeat(t.ids[owner], count)
    along += np.repeat((row - top * t.samples) * t.width + start, count)
    np.maximum.at(keys, along, key)

    shape = (bottom - top, t.samples, t.width)
    ids = np.where(keys > 0, keys & _LOW_BITS, -1).astype(np.int32)
    return ids.reshape(shape), ((keys >> 32).astype(np.float32) / np.float32(_DEPTH_STEPS)).reshape(shape)


def _spans(t: Triangles, first_row: int, end_row: int) -> tuple[NDArray, NDArray, NDArray, NDArray]:
    """Return the non-empty spans: sub-row, first pixel, pixel count, position of the triangle in ``t``."""
    pitch = SUBPIXELS // t.samples
    begin = np.maximum(np.ceil((t.y[:, 0] - pitch // 2) / pitch).astype(np.int64), first_row)
    end = np.minimum(np.ceil((t.y[:, 2] - pitch // 2) / pitch).astype(np.int64), end_row)
    counts = np.maximum(end - begin, 0)
    owner = np.repeat(np.arange(len(counts)), counts)
    row = np.arange(len(owner)) - np.repeat(np.cumsum(counts) - counts - begin, counts)

    centre = row * pitch + pitch // 2
    shift = np.array(PATTERNS[t.samples], dtype=float)[row % t.samples]
    x, y = t.x[owner], t.y[owner]
    # The short side is a-b above the middle corner and b-c below it.
    below = centre >= y[:, 1]
    short = _crossing(np.where(below, x[:, 1], x[:, 0]), np.where(below, y[:, 1], y[:, 0]),
                      np.where(below, x[:, 2], x[:, 1]), np.where(below, y[:, 2], y[:, 1]), centre, shift)
    long = _crossing(x[:, 0], y[:, 0], x[:, 2], y[:, 2], centre, shift)
    start = np.maximum(np.minimum(short, long), 0).astype(np.int64)
    count = np.minimum(np.maximum(short, long), t.width).astype(np.int64) - start
    hit = np.flatnonzero(count > 0)
    return row[hit], start[hit], count[hit], owner[hit]


def _crossing(x0: NDArray, y0: NDArray, x1: NDArray, y1: NDArray, centre: NDArray, shift: NDArray) -> NDArray:
    """Return the first pixel whose sample is at or right of the edge (x0, y0)-(x1, y1), y0 < y1: exact."""
    fall = y1 - y0
    return np.ceil(((x0 - shift) * fall + (centre - y0) * (x1 - x0)) / (SUBPIXELS * fall))


def twice_area(projected: NDArray) -> NDArray[np.float64]:
    """Return twice the signed area, in pixels, of projected triangles (m, 3 corners, 3)."""
    (ax, ay), (bx, by) = ((projected[:, k, :2] - projected[:, 0, :2]).T for k in (1, 2))
    return ax * by - bx * ay

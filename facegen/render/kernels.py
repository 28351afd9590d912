"""The renderer's inner loops, compiled by numba: the same algorithm as `zbuffer` and `shading`, a band at a time.

A band is some rows of pixels, small enough that its buffers stay in the processor's cache. In a band every triangle
is scanned in blocks of four pixels by four samples: sixteen lanes of one integer edge function. Then each pixel is
resolved; what must be shaded is gathered in chunks of one material, and a chunk is lit in plain loops over flat
arrays, which the compiler turns into vector instructions. Normals and planes are worked out only for triangles
that own a pixel.

Integers are spelt np.int32(...) everywhere on purpose: numba widens sums to 64 bits, which halves the lanes.

A camera is here an array ``cam`` (18,): nine of its rotation, three of its target, its distance, scale and offset x, y,
1 if it is orthographic, and its near plane's depth.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from facegen.render.shading import BOUNCE, INSIDE_LIGHT, SHOULDER, WINDOW_FULL, WINDOW_GONE
from facegen.render.soft import DEPTH_STEP
from facegen.render.zbuffer import PATTERNS

# Because NaN and infinity must keep their meaning, nnan and ninf are left out.
_FAST = {"contract", "reassoc", "arcp", "nsz", "afn"}
OPTIONS = {"cache": True, "nogil": True, "fastmath": _FAST, "error_model": "numpy"}

BAND_ROWS = 16
CHUNK = 256
DEPTHS = 2.0**31 - 2
# Indices are unsigned: a signed one may count from the end, and the test for that stops vectorisation.
_LANES = np.uint64(16)
_ROW_BLOCK = 32                           # a block in the buffer: 16 depths, then 16 triangles
_BLOCK = np.uint64(_ROW_BLOCK)
_STEP = np.int64(DEPTH_STEP * DEPTHS)
_LANE_X = np.array([256 * (lane >> 2) + PATTERNS[4][lane & 3] for lane in range(16)], np.int32)
_LANE_Y = np.array([32 + 64 * (lane & 3) for lane in range(16)], np.int32)
# A point to be shaded is its row in the band, its column, and the mask of the samples it stands for: it lies in
# their middle, and their number is its share of the pixel.
_ROW_SHIFT, _ROW_MASK = 16, 2**16 - 1
_MASKS = [[s for s in range(4) if mask >> s & 1] or [0] for mask in range(16)]
_SPOT_X = np.array([np.mean([PATTERNS[4][s] / 256 for s in mask]) for mask in _MASKS], np.float32)
_SPOT_Y = np.array([np.mean([(s + 0.5) / 4 for s in mask]) for mask in _MASKS], np.float32)
_SHARE = np.array([len(mask) / 4 for mask in _MASKS], np.float32)
_FIRST = np.array([0, 0, 1, 0, 2, 0, 1, 0, 3, 0, 1, 0, 2, 0, 1, 0], np.uint64)       # the first sample of a mask
# Beyond this many sub-pixels (96 pixels) an edge function may leave 32 bits.
_SMALL = 96 * 256
_FARTHEST = 2.0**14
# A depth plane steeper than this, in depths a sub-pixel, belongs to a triangle seen edge on.
_STEEP = 2.0**40
# ... and one gentler than this cannot leave 32 bits within a block.
_GENTLE = 2.0**20

# Rows of a chunk's flat work array. The lights' shares come last, as many as there are, and after them red, green and
# blue of the albedo where vertices have colours. Where they have none, ``colours`` is None to the compiler, which
# leaves all that out.
WORK_ROWS = 17
(_NX, _NY, _NZ, _VX, _VY, _VZ, _NV, _FREE, _R, _G, _B, _SR, _SG, _SB, _X, _Y, _REACH) = (
    np.uint64(CHUNK * row) for row in range(WORK_ROWS))
_CHUNK = np.uint64(CHUNK)
# Small unsigned numbers, for indices.
(_P0, _P1, _P2, _P3, _P4, _P5, _P6, _P7, _P8, _P9, _P10, _P11, _P12, _P13) = (
    np.uint64(k) for k in range(14))
_P16, _P17 = np.uint64(16), np.uint64(17)


@njit(**OPTIONS)
def project(vertices, cam, proj, snapped, depth):
    """Fill proj (n, 3): pixel x, y, depth in units; snapped (n, 2) sub-pixels; depth (n,): -1 before the near plane."""
    ortho, near = cam[16] != 0.0, cam[17]
    low, high = np.inf, -np.inf
    for v in range(len(vertices)):
        x, y, z = vertices[v, 0] - cam[9], vertices[v, 1] - cam[10], vertices[v, 2] - cam[11]
        a = cam[0] * x + cam[1] * y + cam[2] * z
        b = cam[3] * x + cam[4] * y + cam[5] * z
        w = cam[12] - (cam[6] * x + cam[7] * y + cam[8] * z)
        zoom = cam[13] if ortho else cam[13] * cam[12] / max(w, near)
        proj[v, 0], proj[v, 1], proj[v, 2] = cam[14] + zoom * a, cam[15] - zoom * b, w
        for k in range(2):
            snapped[v, k] = np.int32(np.rint(min(max(proj[v, k], -_FARTHEST), _FARTHEST) * 256.0))
        nearness = -w if ortho else 1.0 / max(w, near)
        depth[v] = nearness
        if w > near:
            low, high = min(low, nearness), max(high, nearness)
    span = max(high - low, 1e-12)
    for v in range(len(vertices)):
        depth[v] = (0.01 + 0.98 * (depth[v] - low) / span) * DEPTHS if proj[v, 2] > near else -1.0


@njit(**OPTIONS)
def bin_triangles(faces, snapped, depth, width, height, face_materials, inside, kind, first, last, starts, columns):
    """Fill kind (m,) with materials (``inside`` for back faces) and return the triangles of each band, in order.

    columns (bands, 2): the first and the last block of four pixels that a band's triangles may touch.
    """
    bands = len(starts) - 1
    starts[:] = 0
    columns[:, 0], columns[:, 1] = width >> 2, -1
    for t in range(len(faces)):
        a, b, c = faces[t, 0], faces[t, 1], faces[t, 2]
        first[t], last[t] = 0, -1
        if depth[a] < 0.0 or depth[b] < 0.0 or depth[c] < 0.0:
            continue
        xa, xb, xc = np.int64(snapped[a, 0]), np.int64(snapped[b, 0]), np.int64(snapped[c, 0])
        ya, yb, yc = np.int64(snapped[a, 1]), np.int64(snapped[b, 1]), np.int64(snapped[c, 1])
        area = (xb - xa) * (yc - ya) - (xc - xa) * (yb - ya)
        top, bottom = max((min(ya, yb, yc) + 31) >> 8, 0), min((max(ya, yb, yc) - 33) >> 8, height - 1)
        left, right = max((min(xa, xb, xc) + 31) >> 8, 0), min((max(xa, xb, xc) - 32) >> 8, width - 1)
        if area == 0 or top > bottom or left > right:
            continue
        # Counter-clockwise for the viewer is clockwise in pixels, whose y runs down.
        kind[t] = inside if area > 0 else face_materials[t]
        first[t], last[t] = top // BAND_ROWS, bottom // BAND_ROWS
        for band in range(first[t], last[t] + 1):
            starts[band + 1] += 1
            columns[band, 0], columns[band, 1] = min(columns[band, 0], left >> 2), max(columns[band, 1], right >> 2)
    for band in range(bands):
        starts[band + 1] += starts[band]
    items = np.empty(starts[bands], np.int32)
    at = starts[:-1].copy()
    for t in range(len(faces)):
        for band in range(first[t], last[t] + 1):
            items[at[band]] = t
            at[band] += 1
    return items


def _rows(integer, lane_depth):
    """Return the loop over a triangle's blocks for edge functions of one integer type."""

    @njit(**OPTIONS)
    def rows(buffer, at, pitch, height, count, e0, e1, e2, dx0, dx1, dx2, dy0, dy1, dy2, z, zx, zy, triangle):
        a0, a1, a2, b0, b1, b2 = integer(dx0), integer(dx1), integer(dx2), integer(dy0), integer(dy1), integer(dy2)
        s0, s1, s2 = integer(-1024 * dy0), integer(-1024 * dy1), integer(-1024 * dy2)
        step = _wrapped(1024.0 * zx)
        for row in range(height):
            p, near = at, _wrapped(z + 256.0 * row * zy)
            f0, f1, f2 = integer(e0 + row * 256 * dx0), integer(e1 + row * 256 * dx1), integer(e2 + row * 256 * dx2)
            for _ in range(count):
                for lane in range(_LANES):
                    # What does not change from block to block is taken out of the loop by the compiler.
                    x, y = _LANE_X[lane], _LANE_Y[lane]
                    inside = (integer(f0 + integer(integer(a0 * y) - integer(b0 * x)))
                              | integer(f1 + integer(integer(a1 * y) - integer(b1 * x)))
                              | integer(f2 + integer(integer(a2 * y) - integer(b2 * x))))
                    here, old = np.int32(near + lane_depth(zx * x + zy * y)), buffer[p + lane]
                    take = (inside >= 0) & (here >= old)
                    buffer[p + lane] = here if take else old
                    buffer[p + _LANES + lane] = triangle if take else buffer[p + _LANES + lane]
                f0, f1, f2, near = integer(f0 + s0), integer(f1 + s1), integer(f2 + s2), np.int32(near + step)
                p += _BLOCK
            at += pitch

    return rows


@njit(**OPTIONS)
def _wrapped(value):
    """Return a depth's lower 32 bits: sums of such parts are right wherever the whole is in range."""
    return np.int32(np.int64(value))


_narrow, _wide = _rows(np.int32, np.int32), _rows(np.int64, _wrapped)


@njit(**OPTIONS)
def _scan(buffer, faces, snapped, depth, triangle, top, bottom, width):
    """Draw a triangle into the band's rows top..bottom.

    Corners are whole sub-pixels, so the edge functions are exact: with the top-left rule a sample on a shared edge
    belongs to one of its triangles.
    """
    a, b, c = faces[triangle, 0], faces[triangle, 1], faces[triangle, 2]
    xa, xb, xc = np.int64(snapped[a, 0]), np.int64(snapped[b, 0]), np.int64(snapped[c, 0])
    ya, yb, yc = np.int64(snapped[a, 1]), np.int64(snapped[b, 1]), np.int64(snapped[c, 1])
    za, zb, zc = depth[a], depth[b], depth[c]
    area = (xb - xa) * (yc - ya) - (xc - xa) * (yb - ya)
    if area < 0:
        xb, xc, yb, yc, zb, zc, area = xc, xb, yc, yb, zc, zb, -area
    low, high = min(xa, xb, xc), max(xa, xb, xc)
    up, down = min(ya, yb, yc), max(ya, yb, yc)
    first, last = max((up + 31) >> 8, top), min((down - 33) >> 8, bottom - 1)
    left, right = max((low + 31) >> 8, 0) >> 2, min((high - 32) >> 8, width - 1) >> 2
    if first > last or left > right:
        return
    dx0, dy0, dx1, dy1, dx2, dy2 = xb - xa, yb - ya, xc - xb, yc - yb, xa - xc, ya - yc
    scale = 1.0 / area
    zx, zy = ((zc - za) * dy0 + (zb - za) * dy2) * -scale, ((zc - za) * dx0 + (zb - za) * dx2) * scale
    if abs(zx) > _STEEP or abs(zy) > _STEEP:
        zx = zy = 0.0
    # A sample exactly on an edge is inside only if the edge is a left or a top one.
    bias0 = 0 if dy0 < 0 or (dy0 == 0 and dx0 > 0) else -1
    bias1 = 0 if dy1 < 0 or (dy1 == 0 and dx1 > 0) else -1
    bias2 = 0 if dy2 < 0 or (dy2 == 0 and dx2 > 0) else -1
    x, y = 1024 * left, 256 * first
    e0 = dx0 * (y - ya) - dy0 * (x - xa) + bias0
    e1 = dx1 * (y - yb) - dy1 * (x - xb) + bias1
    e2 = dx2 * (y - yc) - dy2 * (x - xc) + bias2
    z = za + zx * (x - xa) + zy * (y - ya)
    pitch = np.uint64(((width + 3) >> 2) * _ROW_BLOCK)
    at = np.uint64((first - top) * ((width + 3) >> 2) + left) * _BLOCK
    if high - low <= _SMALL and down - up <= _SMALL and abs(zx) + abs(zy) < _GENTLE:
        _narrow(buffer, at, pitch, last - first + 1, right - left + 1, e0, e1, e2,
                dx0, dx1, dx2, dy0, dy1, dy2, z, zx, zy, np.int32(triangle))
    else:
        _wide(buffer, at, pitch, last - first + 1, right - left + 1, e0, e1, e2,
              dx0, dx1, dx2, dy0, dy1, dy2, z, zx, zy, np.int32(triangle))


@njit(**OPTIONS)
def _angle(sine, cosine):
    """Return atan2 for a sine of 0 or more, within 1e-5: what weighs a triangle needs no more.

    Based on: the odd minimax polynomial of the arc tangent on 0..1, as in Hastings, "Approximations for digital
    computers", 1955.
    """
    size = abs(cosine)
    ratio = min(sine, size) / max(max(sine, size), np.float32(1e-30))
    s = ratio * ratio
    angle = ratio * (np.float32(0.99997726) + s * (np.float32(-0.33262347) + s * (np.float32(0.19354346) + s * (
        np.float32(-0.11643287) + s * (np.float32(0.05265332) + s * np.float32(-0.01172120))))))
    if sine > size:
        angle = np.float32(0.5 * math.pi) - angle
    return np.float32(math.pi) - angle if cosine < 0 else angle


@njit(**OPTIONS)
def all_normals(vertices, faces, work, normals):
    """Fill normals (n, 3) float32, world axes: the triangles' normals, each by its angle at the vertex.

    work (6 * CHUNK,): two edges of each triangle of a chunk, which become its unit normal and its angles.
    """
    normals[:] = 0
    m = np.uint64(len(faces))
    for first in range(np.uint64(0), m, _CHUNK):
        count = min(m - first, _CHUNK)
        for i in range(count):
            a, b, c = (np.uint64(faces[first + i, _P0]), np.uint64(faces[first + i, _P1]),
                       np.uint64(faces[first + i, _P2]))
            for k in range(_P3):
                work[k * _CHUNK + i] = vertices[b, k] - vertices[a, k]
                work[(_P3 + k) * _CHUNK + i] = vertices[c, k] - vertices[a, k]
        for i in range(count):
            ux, uy, uz = work[i], work[_CHUNK + i], work[_P2 * _CHUNK + i]
            vx, vy, vz = work[_P3 * _CHUNK + i], work[_P4 * _CHUNK + i], work[_P5 * _CHUNK + i]
            nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
            size = np.float32(math.sqrt(nx * nx + ny * ny + nz * nz))
            uv = ux * vx + uy * vy + uz * vz
            at_a = _angle(size, uv)
            at_b = _angle(size, ux * ux + uy * uy + uz * uz - uv)
            scale = np.float32(1) / max(size, np.float32(1e-30))
            work[i], work[_CHUNK + i], work[_P2 * _CHUNK + i] = nx * scale, ny * scale, nz * scale
            work[_P3 * _CHUNK + i], work[_P4 * _CHUNK + i] = at_a, at_b
            work[_P5 * _CHUNK + i] = np.float32(math.pi) - at_a - at_b
        for i in range(count):
            for corner in range(_P3):
                v = np.uint64(faces[first + i, corner])
                weight = work[(_P3 + corner) * _CHUNK + i]
                normals[v, _P0] += weight * work[i]
                normals[v, _P1] += weight * work[_CHUNK + i]
                normals[v, _P2] += weight * work[_P2 * _CHUNK + i]
    for v in range(np.uint64(len(normals))):
        nx, ny, nz = normals[v, _P0], normals[v, _P1], normals[v, _P2]
        scale = np.float32(1) / max(np.float32(math.sqrt(nx * nx + ny * ny + nz * nz)), np.float32(1e-30))
        normals[v, _P0], normals[v, _P1], normals[v, _P2] = nx * scale, ny * scale, nz * scale


@njit(**OPTIONS)
def fill_attributes(normals, light, cam, attributes):
    """Fill attributes (n, 4 + lights): the normal in camera axes, then the shares of light."""
    shares = light.shape[1]
    for v in range(np.uint64(len(attributes))):
        attributes[v, _P0], attributes[v, _P1], attributes[v, _P2] = _turned(
            cam, normals[v, _P0], normals[v, _P1], normals[v, _P2])
        for k in range(np.uint64(shares)):
            attributes[v, _P3 + k] = light[v, k]


@njit(**OPTIONS)
def _prepare(t, vertices, faces, proj, cam, flat, planes, ready):
    """Work out what shading asks of a triangle that owns a pixel: its corners' weights as functions of the pixel.

    The functions are those of `shading._corner_weights`. planes (m, 16): nine coefficients, the origin's x and y,
    and for flat shading the normal.
    """
    t = np.uint64(t)
    a, b, c = np.uint64(faces[t, _P0]), np.uint64(faces[t, _P1]), np.uint64(faces[t, _P2])
    ox, oy = proj[a, _P0], proj[a, _P1]
    ortho, near = cam[_P16] != 0.0, cam[_P17]
    wa = 1.0 if ortho else max(proj[a, _P2], near)
    wb = 1.0 if ortho else max(proj[b, _P2], near)
    wc = 1.0 if ortho else max(proj[c, _P2], near)
    xb, yb = (proj[b, _P0] - ox) * wb, (proj[b, _P1] - oy) * wb
    xc, yc = (proj[c, _P0] - ox) * wc, (proj[c, _P1] - oy) * wc
    whole = wa * (xb * yc - yb * xc)
    scale = 1.0 / whole if whole != 0.0 else 1.0
    planes[t, _P0] = (yb * wc - wb * yc) * scale
    planes[t, _P1] = (wb * xc - xb * wc) * scale
    planes[t, _P2] = (xb * yc - yb * xc) * scale
    planes[t, _P3], planes[t, _P4] = yc * wa * scale, -xc * wa * scale
    planes[t, _P6], planes[t, _P7] = -wa * yb * scale, wa * xb * scale
    planes[t, _P9], planes[t, _P10] = ox, oy
    if flat:
        ux, uy, uz = (vertices[b, _P0] - vertices[a, _P0], vertices[b, _P1] - vertices[a, _P1],
                      vertices[b, _P2] - vertices[a, _P2])
        vx, vy, vz = (vertices[c, _P0] - vertices[a, _P0], vertices[c, _P1] - vertices[a, _P1],
                      vertices[c, _P2] - vertices[a, _P2])
        planes[t, _P11], planes[t, _P12], planes[t, _P13] = _turned(
            cam, uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx)
    ready[t] = 1


@njit(**OPTIONS)
def _turned(cam, x, y, z):
    """Return a vector in camera axes."""
    return (cam[_P0] * x + cam[_P1] * y + cam[_P2] * z, cam[_P3] * x + cam[_P4] * y + cam[_P5] * z,
            cam[_P6] * x + cam[_P7] * y + cam[_P8] * z)


@njit(**OPTIONS)
def _gather(count, kind, entry, target, top, work, faces, attributes, colours, planes, material, flat, back, powers):
    """Interpolate normal and light shares of a chunk's points into the work array."""
    shares = np.uint64(attributes.shape[1] - 4)
    power, lifted = np.float32(1) - material[kind, 9], material[kind, 9] != 0.0
    sign = np.float32(-1) if back else np.float32(1)
    for i in range(np.uint64(count)):
        t = np.uint64(entry[i])
        place = target[i]
        x = np.float32((place & _ROW_MASK) >> 4) + _SPOT_X[np.uint64(place & 15)]
        y = np.float32((place >> _ROW_SHIFT) + top) + _SPOT_Y[np.uint64(place & 15)]
        dx, dy = x - planes[t, _P9], y - planes[t, _P10]
        u = max(planes[t, _P0] * dx + planes[t, _P1] * dy + planes[t, _P2], np.float32(0))
        v = max(planes[t, _P3] * dx + planes[t, _P4] * dy, np.float32(0))
        w = max(planes[t, _P6] * dx + planes[t, _P7] * dy, np.float32(0))
        scale = np.float32(1) / max(u + v + w, np.float32(1e-20))
        u, v, w = u * scale, v * scale, w * scale
        a, b, c = np.uint64(faces[t, _P0]), np.uint64(faces[t, _P1]), np.uint64(faces[t, _P2])
        if flat:
            work[_NX + i], work[_NY + i], work[_NZ + i] = (
                sign * planes[t, _P11], sign * planes[t, _P12], sign * planes[t, _P13])
        else:
            work[_NX + i] = sign * (u * attributes[a, _P0] + v * attributes[b, _P0] + w * attributes[c, _P0])
            work[_NY + i] = sign * (u * attributes[a, _P1] + v * attributes[b, _P1] + w * attributes[c, _P1])
            work[_NZ + i] = sign * (u * attributes[a, _P2] + v * attributes[b, _P2] + w * attributes[c, _P2])
        work[_X + i], work[_Y + i] = x, y
        if colours is not None:
            row = _REACH + shares * _CHUNK + i
            if back:
                for band in range(_P3):
                    work[row + band * _CHUNK] = material[kind, band]
            else:
                for band in range(_P3):
                    work[row + band * _CHUNK] = u * colours[a, band] + v * colours[b, band] + w * colours[c, band]
        openness = u * attributes[a, _P3] + v * attributes[b, _P3] + w * attributes[c, _P3]
        for k in range(shares):
            at = _P4 + k
            work[_REACH + k * _CHUNK + i] = (
                u * attributes[a, at] + v * attributes[b, at] + w * attributes[c, at])
        if lifted:
            openness = max(openness, np.float32(0)) ** power
            for k in range(shares):
                work[_REACH + k * _CHUNK + i] = max(work[_REACH + k * _CHUNK + i], np.float32(0)) ** power
        if back:
            work[_FREE + i] = np.float32(INSIDE_LIGHT)
            for k in range(shares):
                work[_REACH + k * _CHUNK + i] = np.float32(0)
        else:
            at = min(max(openness, np.float32(0)), np.float32(1)) * np.float32(len(powers) - 2)
            cell = _cell(at, len(powers) - 1)
            work[_FREE + i] = powers[cell] + (at - np.float32(np.int32(cell))) * (powers[cell + _P1] - powers[cell])


@njit(**OPTIONS)
def _light(count, look, lamps, sky, view, colours, work):
    """Turn a chunk's normals and shares into colours, rows _R, _G, _B: see `shading.shade`."""
    count = np.uint64(count)
    own = _REACH + np.uint64(len(lamps)) * _CHUNK
    one, zero, half = np.float32(1), np.float32(0), np.float32(0.5)
    ortho = view[3] != 0.0
    for i in range(count):
        nx, ny, nz = work[_NX + i], work[_NY + i], work[_NZ + i]
        scale = one / max(np.float32(math.sqrt(nx * nx + ny * ny + nz * nz)), np.float32(1e-12))
        nx, ny, nz = nx * scale, ny * scale, nz * scale
        right, down = (work[_X + i] - view[0]) * view[2], (work[_Y + i] - view[1]) * view[2]
        length = one / np.float32(math.sqrt(right * right + down * down + one))
        vx, vy, vz = -right * length, down * length, length
        if ortho:
            vx, vy, vz = zero, zero, one
        work[_NX + i], work[_NY + i], work[_NZ + i] = nx, ny, nz
        work[_VX + i], work[_VY + i], work[_VZ + i] = vx, vy, vz
        work[_NV + i] = nx * vx + ny * vy + nz * vz
        up, free = half + half * ny, work[_FREE + i]
        lost = np.float32(BOUNCE) * (one - free)
        if colours is None:
            red, green, blue = look[0], look[1], look[2]
        else:
            red, green, blue = work[own + i], work[own + _CHUNK + i], work[own + _P2 * _CHUNK + i]
        work[_R + i] = (sky[0] + sky[3] * up) * free / (one - red * lost)
        work[_G + i] = (sky[1] + sky[4] * up) * free / (one - green * lost)
        work[_B + i] = (sky[2] + sky[5] * up) * free / (one - blue * lost)
        work[_SR + i] = zero
        work[_SG + i] = zero
        work[_SB + i] = zero
    wr, wg, wb = one / (one + look[3]), one / (one + look[4]), one / (one + look[5])
    sharpness = look[7] * np.float32(1 / 1024)
    for k in range(len(lamps)):
        tx, ty, tz, lr, lg, lb = lamps[k, 0], lamps[k, 1], lamps[k, 2], lamps[k, 3], lamps[k, 4], lamps[k, 5]
        shine = look[6] * lamps[k, 6]
        row = _REACH + np.uint64(k) * _CHUNK
        for i in range(count):
            facing = tx * work[_NX + i] + ty * work[_NY + i] + tz * work[_NZ + i]
            across = tx * work[_VX + i] + ty * work[_VY + i] + tz * work[_VZ + i]
            reach = work[row + i]
            # |light + viewer|^2 = 2 + 2 light . viewer; exp(-x) as (1 - x / 1024)^1024.
            size = np.float32(math.sqrt(max(np.float32(2) + np.float32(2) * across, np.float32(1e-12))))
            lobe = max(one - sharpness * (one - (facing + work[_NV + i]) / size), zero)
            lobe = lobe * lobe
            lobe = lobe * lobe
            lobe = lobe * lobe
            lobe = lobe * lobe
            lobe = lobe * lobe
            lobe = lobe * lobe
            lobe = lobe * lobe
            lobe = lobe * lobe
            lobe = lobe * lobe
            lobe = lobe * lobe
            lobe = lobe * min(max(facing * np.float32(4), zero), one) * reach * shine
            work[_R + i] += lr * reach * max((facing + look[3]) * wr, zero)
            work[_G + i] += lg * reach * max((facing + look[4]) * wg, zero)
            work[_B + i] += lb * reach * max((facing + look[5]) * wb, zero)
            work[_SR + i] += lr * lobe
            work[_SG + i] += lg * lobe
            work[_SB + i] += lb * lobe
    if look[8] != 0.0:
        tx, ty, tz = sky[6], sky[7], sky[8]
        for i in range(count):
            facing = tx * work[_NX + i] + ty * work[_NY + i] + tz * work[_NZ + i]
            across = tx * work[_VX + i] + ty * work[_VY + i] + tz * work[_VZ + i]
            size = np.float32(math.sqrt(max(np.float32(2) + np.float32(2) * across, np.float32(1e-12))))
            share = ((facing + work[_NV + i]) / size - np.float32(WINDOW_GONE)) * np.float32(
                1 / (WINDOW_FULL - WINDOW_GONE))
            bright = look[8] * min(max(share, zero), one)
            work[_SR + i] += bright
            work[_SG + i] += bright
            work[_SB + i] += bright
    shoulder, room = np.float32(SHOULDER), np.float32(1 - SHOULDER)
    for c in range(3):
        row, shine_row, albedo = _R + np.uint64(c) * _CHUNK, _SR + np.uint64(c) * _CHUNK, look[c]
        for i in range(count):
            if colours is not None:
                albedo = work[own + np.uint64(c) * _CHUNK + i]
            value = work[row + i] * albedo + work[shine_row + i]
            above = max(value - shoulder, zero)
            work[row + i] = min(value, shoulder) + above * room / (above + room)


@njit(**OPTIONS)
def draw_bands(start, stop, step, items, starts, columns, vertices, faces, proj, snapped, depth, kind, inside, cam,
               flat, attributes, colours, planes, ready, material, lamps, sky, view, powers, encode, behind,
               transparent, picture):
    """Draw the bands start, start + step, ... before stop over picture (h, w) uint32, which holds the background."""
    height, width = picture.shape
    row_blocks = (width + 3) >> 2
    buffer = np.empty(BAND_ROWS * row_blocks * _ROW_BLOCK, np.int32)
    colour = np.empty(BAND_ROWS * row_blocks * 16, np.float32)             # r, g, b, cover of each pixel
    kinds = len(material)
    entry, target = np.empty((kinds, CHUNK), np.int32), np.empty((kinds, CHUNK), np.int32)
    filled = np.zeros(kinds, np.int64)
    work = np.empty((WORK_ROWS + len(lamps) + 3) * CHUNK, np.float32)
    for band in range(start, stop, step):
        if starts[band] == starts[band + 1]:
            continue
        top, bottom = band * BAND_ROWS, min((band + 1) * BAND_ROWS, height)
        left, right = columns[band, 0], columns[band, 1] + 1
        for row in range(0, row_blocks * (bottom - top), row_blocks):
            buffer[_ROW_BLOCK * (row + left):_ROW_BLOCK * (row + right)] = 0
            colour[16 * (row + left):16 * (row + right)] = 0
        for k in range(starts[band], starts[band + 1]):
            _scan(buffer, faces, snapped, depth, items[k], top, bottom, width)
        left, right = 4 * left, min(4 * right, width)
        for row in range(bottom - top):
            for x in range(left, right):
                p = np.uint64((row * row_blocks + (x >> 2)) * _ROW_BLOCK + 4 * (x & 3))
                if (buffer[p] | buffer[p + _P1] | buffer[p + _P2] | buffer[p + _P3]) == 0:
                    continue
                left_over = 15
                while left_over:
                    sample = _FIRST[left_over]
                    at = p + sample
                    if buffer[at] == 0:
                        left_over &= left_over - 1
                        continue
                    t = buffer[at + _LANES]
                    own = np.int64(kind[np.uint64(t)])
                    mask = _group(buffer, p, sample, t, own, kind, left_over)
                    left_over &= ~mask
                    n = np.uint64(filled[own])
                    entry[own, n], target[own, n] = t, (row << _ROW_SHIFT) + (x << 4) + mask
                    filled[own] = n + _P1
                    if not ready[np.uint64(t)]:
                        _prepare(t, vertices, faces, proj, cam, flat, planes, ready)
                    if n + _P1 == _CHUNK:
                        _flush(own, filled, entry, target, top, row_blocks, work, faces, attributes, colours, planes,
                               material, flat, inside, powers, lamps, sky, view, colour)
        for own in range(kinds):
            if filled[own]:
                _flush(own, filled, entry, target, top, row_blocks, work, faces, attributes, colours, planes,
                       material, flat, inside, powers, lamps, sky, view, colour)
        _finish(colour, row_blocks, top, bottom, left, right, behind, encode, transparent, picture)


@njit(**OPTIONS)
def _group(buffer, p, sample, t, own, kind, left_over):
    """Return which of a pixel's samples see the same surface as this one: its triangle, or its material as near."""
    q = p + _LANES
    if left_over == 15 and (buffer[q + _P1] == t and buffer[q + _P2] == t and buffer[q + _P3] == t
                            and min(buffer[p + _P1], buffer[p + _P2], buffer[p + _P3]) > 0):
        return 15
    nearest, mask = np.int64(buffer[p + sample]), 0
    for other in range(np.uint64(0), _P4):
        here, also = buffer[p + other], buffer[q + other]
        if here > 0 and left_over >> np.int64(other) & 1 and (also == t or (
                kind[np.uint64(also)] == own and abs(here - nearest) < _STEP)):
            mask |= 1 << np.int64(other)
    return mask


@njit(**OPTIONS)
def _flush(kind, filled, entry, target, top, row_blocks, work, faces, attributes, colours, planes, material, flat,
           inside, powers, lamps, sky, view, colour):
    """Shade the chunk of a material and add it to the band's colours."""
    count = filled[kind]
    _gather(count, kind, entry[kind], target[kind], top, work, faces, attributes, colours, planes, material, flat,
            kind == inside, powers)
    _light(count, material[kind], lamps, sky, view, colours, work)
    places, pitch = target[kind], 16 * row_blocks
    for i in range(np.uint64(count)):
        place = places[i]
        at = np.uint64((place >> _ROW_SHIFT) * pitch + 4 * ((place & _ROW_MASK) >> 4))
        share = _SHARE[np.uint64(place & 15)]
        colour[at] += share * work[_R + i]
        colour[at + _P1] += share * work[_G + i]
        colour[at + _P2] += share * work[_B + i]
        colour[at + _P3] += share
    filled[kind] = 0


@njit(**OPTIONS)
def _cell(value, count):
    """Return a value's place in a table, held inside as an integer: NaN must not lead out of it."""
    return np.uint64(min(max(np.int32(min(value, np.float32(count))), 0), count - 1))


@njit(**OPTIONS)
def _finish(colour, row_blocks, top, bottom, left, right, behind, encode, transparent, picture):
    """Put the band's colours over the background and encode them, alpha in the highest byte."""
    one, scale, half = np.float32(1), np.float32(len(encode) - 1), np.float32(0.5)
    for row in range(bottom - top):
        y = np.uint64(top + row)
        br, bg, bb = behind[y, _P0], behind[y, _P1], behind[y, _P2]
        for x in range(left, right):
            at = np.uint64(4 * (row * 4 * row_blocks + x))
            r, g, b, cover = colour[at], colour[at + _P1], colour[at + _P2], colour[at + _P3]
            if cover == np.float32(0):
                continue
            alpha = np.uint32(255)
            if cover != one:
                if transparent:
                    r, g, b = r / cover, g / cover, b / cover
                    alpha = np.uint32(cover * np.float32(255) + half)
                else:
                    free = one - cover
                    r, g, b = r + free * br, g + free * bg, b + free * bb
            red = np.uint32(encode[_cell(r * scale + half, len(encode))])
            green = np.uint32(encode[_cell(g * scale + half, len(encode))])
            blue = np.uint32(encode[_cell(b * scale + half, len(encode))])
            picture[y, np.uint64(x)] = red | green << np.uint32(8) | blue << np.uint32(16) | alpha << np.uint32(24)

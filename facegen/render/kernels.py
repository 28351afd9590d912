"""The renderer's inner loops, compiled by numba: the same algorithm as `zbuffer` and `shading`, a band at a time.

A band is some rows of pixels, small enough that its buffers stay in the processor's cache. In a band every triangle
is scanned in blocks of four pixels by four samples: sixteen lanes of one integer edge function. Then each pixel is
resolved; what must be shaded is gathered in chunks of one material, and a chunk is lit in plain loops over flat
arrays, which the compiler turns into vector instructions. Normals and planes are worked out only for triangles
that own a pixel.

Integers are spelt np.int32(...) everywhere on purpose: numba widens sums to 64 bits, which halves the lanes.
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
_options = {"cache": True, "nogil": True, "fastmath": _FAST, "error_model": "numpy"}

BAND_ROWS = 16
CHUNK = 256
DEPTHS = 2.0**31 - 2
_LANES = 16
_BLOCK = 2 * _LANES                       # depths, then triangles
_STEP = np.int64(DEPTH_STEP * DEPTHS)
_SAMPLE_X = np.array(PATTERNS[4], np.int64)
_SAMPLE_Y = np.array([32, 96, 160, 224], np.int64)
# Beyond this many sub-pixels (96 pixels) an edge function may leave 32 bits.
_SMALL = 96 * 256
_FARTHEST = 2.0**14
# A depth plane steeper than this, in depths a sub-pixel, belongs to a triangle seen edge on.
_STEEP = 2.0**40

# Rows of a chunk's flat work array. The lights' shares come last, as many as there are.
(_NX, _NY, _NZ, _VX, _VY, _VZ, _NV, _FREE, _R, _G, _B, _SR, _SG, _SB, _X, _Y, _REACH) = range(17)
WORK_ROWS = 17


@njit(**_options)
def project(vertices, cam, proj, snapped, depth):
    """Fill proj (n, 3: pixel x, y, depth in units), snapped (n, 2) sub-pixels and depth (n,), -1 before the near plane."""
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


@njit(**_options)
def bin_triangles(faces, snapped, depth, width, height, face_materials, inside, kind, first, last, starts):
    """Fill kind (m,) with materials (``inside`` for back faces) and return the triangles of each band, in order."""
    bands = len(starts) - 1
    starts[:] = 0
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
    for band in range(bands):
        starts[band + 1] += starts[band]
    items = np.empty(starts[bands], np.int32)
    at = starts[:-1].copy()
    for t in range(len(faces)):
        for band in range(first[t], last[t] + 1):
            items[at[band]] = t
            at[band] += 1
    return items


def _blocks(integer):
    """Return the loop over a row's blocks for edge functions of one integer type."""

    @njit(**_options)
    def blocks(buffer, offsets, depths, at, count, e0, e1, e2, s0, s1, s2, z, step, triangle):
        for block in range(count):
            p = at + _BLOCK * block
            for lane in range(_LANES):
                inside = (integer(e0 + offsets[lane]) | integer(e1 + offsets[_LANES + lane])
                          | integer(e2 + offsets[2 * _LANES + lane]))
                here, old = np.int32(z + depths[lane]), buffer[p + lane]
                take = (inside >= 0) & (here >= old)
                buffer[p + lane] = here if take else old
                buffer[p + _LANES + lane] = triangle if take else buffer[p + _LANES + lane]
            e0, e1, e2, z = integer(e0 + s0), integer(e1 + s1), integer(e2 + s2), np.int32(z + step)

    return blocks


_narrow, _wide = _blocks(np.int32), _blocks(np.int64)


@njit(**_options)
def _wrapped(value):
    """Return a depth's lower 32 bits: sums of such parts are right wherever the whole is in range."""
    return np.int32(np.int64(value))


@njit(**_options)
def _scan(buffer, offsets, offsets64, depths, faces, snapped, depth, triangle, top, bottom, width, columns):
    """Draw a triangle into the band's rows top..bottom; ``columns`` (2,) grows to the blocks touched.

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
    columns[0], columns[1] = min(columns[0], left), max(columns[1], right)

    zx = ((zb - za) * (yc - ya) - (zc - za) * (yb - ya)) / area
    zy = ((zc - za) * (xb - xa) - (zb - za) * (xc - xa)) / area
    if abs(zx) > _STEEP or abs(zy) > _STEEP:
        zx = zy = 0.0
    small = high - low <= _SMALL and down - up <= _SMALL
    dx0, dy0, dx1, dy1, dx2, dy2 = xb - xa, yb - ya, xc - xb, yc - yb, xa - xc, ya - yc
    # A sample exactly on an edge is inside only if the edge is a left or a top one.
    bias0 = 0 if dy0 < 0 or (dy0 == 0 and dx0 > 0) else -1
    bias1 = 0 if dy1 < 0 or (dy1 == 0 and dx1 > 0) else -1
    bias2 = 0 if dy2 < 0 or (dy2 == 0 and dx2 > 0) else -1
    for lane in range(_LANES):
        x, y = 256 * (lane >> 2) + _SAMPLE_X[lane & 3], _SAMPLE_Y[lane & 3]
        depths[lane] = _wrapped(zx * x + zy * y)
        o0, o1, o2 = dx0 * y - dy0 * x + bias0, dx1 * y - dy1 * x + bias1, dx2 * y - dy2 * x + bias2
        if small:
            offsets[lane], offsets[_LANES + lane], offsets[2 * _LANES + lane] = np.int32(o0), np.int32(o1), np.int32(o2)
        else:
            offsets64[lane], offsets64[_LANES + lane], offsets64[2 * _LANES + lane] = o0, o1, o2
    x, row_blocks = 1024 * left, (width + 3) >> 2
    for row in range(first, last + 1):
        y = 256 * row
        e0 = dx0 * (y - ya) - dy0 * (x - xa)
        e1 = dx1 * (y - yb) - dy1 * (x - xb)
        e2 = dx2 * (y - yc) - dy2 * (x - xc)
        z, step = _wrapped(za + zx * (x - xa) + zy * (y - ya)), _wrapped(1024.0 * zx)
        at = ((row - top) * row_blocks + left) * _BLOCK
        if small:
            _narrow(buffer, offsets, depths, at, right - left + 1, np.int32(e0), np.int32(e1), np.int32(e2),
                    np.int32(-1024 * dy0), np.int32(-1024 * dy1), np.int32(-1024 * dy2), z, step, np.int32(triangle))
        else:
            _wide(buffer, offsets64, depths, at, right - left + 1, e0, e1, e2,
                  -1024 * dy0, -1024 * dy1, -1024 * dy2, z, step, np.int32(triangle))


@njit(**_options)
def _angle(sine, cosine):
    """Return atan2 for a sine of 0 or more, within 2e-6: what weighs a triangle needs no more.

    Based on: the odd minimax polynomial of the arc tangent on 0..1, as in Hastings, "Approximations for digital
    computers", 1955.
    """
    size = abs(cosine)
    ratio = min(sine, size) / max(max(sine, size), 1e-300)
    s = ratio * ratio
    angle = ratio * (0.99997726 + s * (-0.33262347 + s * (0.19354346 + s * (
        -0.11643287 + s * (0.05265332 + s * -0.01172120)))))
    if sine > size:
        angle = 0.5 * math.pi - angle
    return math.pi - angle if cosine < 0.0 else angle


@njit(**_options)
def _normal(vertices, starts, ring, v, out):
    """Write the unit normal of a vertex, world axes: its triangles' normals, each by its angle there."""
    x, y, z = vertices[v, 0], vertices[v, 1], vertices[v, 2]
    nx = ny = nz = 0.0
    for k in range(starts[v], starts[v + 1]):
        p, q = ring[k, 0], ring[k, 1]
        ax, ay, az = vertices[p, 0] - x, vertices[p, 1] - y, vertices[p, 2] - z
        bx, by, bz = vertices[q, 0] - x, vertices[q, 1] - y, vertices[q, 2] - z
        cx, cy, cz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
        size = math.sqrt(cx * cx + cy * cy + cz * cz)
        if size > 0.0:
            weight = _angle(size, ax * bx + ay * by + az * bz) / size
            nx, ny, nz = nx + weight * cx, ny + weight * cy, nz + weight * cz
    size = math.sqrt(nx * nx + ny * ny + nz * nz)
    scale = 1.0 / size if size > 0.0 else 0.0
    out[0], out[1], out[2] = nx * scale, ny * scale, nz * scale


@njit(**_options)
def all_normals(vertices, starts, ring, normals):
    """Fill normals (n, 3) of all vertices, world axes."""
    for v in range(len(vertices)):
        _normal(vertices, starts, ring, v, normals[v])


@njit(**_options)
def _prepare(t, vertices, faces, proj, cam, flat, starts, ring, known, attributes, vertex_ready, planes, ready, scratch):
    """Work out what shading asks of a triangle: corner weights as functions of the pixel, and normals.

    The functions are those of `shading._corner_weights`. planes (m, 14): nine coefficients, the origin's x and y,
    and for flat shading the normal.
    """
    a, b, c = faces[t, 0], faces[t, 1], faces[t, 2]
    ox, oy = proj[a, 0], proj[a, 1]
    ortho, near = cam[16] != 0.0, cam[17]
    wa = 1.0 if ortho else max(proj[a, 2], near)
    wb = 1.0 if ortho else max(proj[b, 2], near)
    wc = 1.0 if ortho else max(proj[c, 2], near)
    xb, yb, xc, yc = (proj[b, 0] - ox) * wb, (proj[b, 1] - oy) * wb, (proj[c, 0] - ox) * wc, (proj[c, 1] - oy) * wc
    whole = wa * (xb * yc - yb * xc)
    scale = 1.0 / whole if whole != 0.0 else 1.0
    p = planes[t]
    p[0], p[1], p[2] = (yb * wc - wb * yc) * scale, (wb * xc - xb * wc) * scale, (xb * yc - yb * xc) * scale
    p[3], p[4], p[5] = yc * wa * scale, -xc * wa * scale, 0.0
    p[6], p[7], p[8] = -wa * yb * scale, wa * xb * scale, 0.0
    p[9], p[10] = ox, oy
    if flat:
        ux, uy, uz = vertices[b, 0] - vertices[a, 0], vertices[b, 1] - vertices[a, 1], vertices[b, 2] - vertices[a, 2]
        vx, vy, vz = vertices[c, 0] - vertices[a, 0], vertices[c, 1] - vertices[a, 1], vertices[c, 2] - vertices[a, 2]
        scratch[0], scratch[1], scratch[2] = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        for k in range(3):
            p[11 + k] = cam[3 * k] * scratch[0] + cam[3 * k + 1] * scratch[1] + cam[3 * k + 2] * scratch[2]
    elif not known:
        for corner in range(3):
            v = faces[t, corner]
            if not vertex_ready[v]:
                _normal(vertices, starts, ring, v, scratch)
                for k in range(3):
                    attributes[v, k] = (cam[3 * k] * scratch[0] + cam[3 * k + 1] * scratch[1]
                                        + cam[3 * k + 2] * scratch[2])
                vertex_ready[v] = 1
    ready[t] = 1


@njit(**_options)
def _gather(count, kind, entry, spot, work, faces, attributes, planes, material, flat, back, powers):
    """Interpolate normal and light shares of a chunk's points into the work array."""
    columns = attributes.shape[1]
    lift = material[kind, 9]
    blend = np.empty(columns, np.float32)
    for i in range(count):
        t = entry[i]
        x, y = spot[2 * i], spot[2 * i + 1]
        p = planes[t]
        dx, dy = x - p[9], y - p[10]
        u = max(p[0] * dx + p[1] * dy + p[2], np.float32(0))
        v = max(p[3] * dx + p[4] * dy + p[5], np.float32(0))
        w = max(p[6] * dx + p[7] * dy + p[8], np.float32(0))
        scale = np.float32(1) / max(u + v + w, np.float32(1e-20))
        u, v, w = u * scale, v * scale, w * scale
        a, b, c = attributes[faces[t, 0]], attributes[faces[t, 1]], attributes[faces[t, 2]]
        for k in range(columns):
            blend[k] = u * a[k] + v * b[k] + w * c[k]
        if flat:
            for k in range(3):
                blend[k] = p[11 + k]
        sign = np.float32(-1) if back else np.float32(1)
        work[_NX * CHUNK + i], work[_NY * CHUNK + i], work[_NZ * CHUNK + i] = sign * blend[0], sign * blend[1], sign * blend[2]
        work[_X * CHUNK + i], work[_Y * CHUNK + i] = x, y
        if back:
            work[_FREE * CHUNK + i] = np.float32(INSIDE_LIGHT)
            for k in range(4, columns):
                work[(_REACH + k - 4) * CHUNK + i] = np.float32(0)
            continue
        if lift != 0.0:
            for k in range(3, columns):
                blend[k] = max(blend[k], np.float32(0)) ** (np.float32(1) - lift)
        at = min(max(blend[3], np.float32(0)), np.float32(1)) * np.float32(len(powers) - 2)
        cell = np.int32(at)
        share = at - np.float32(cell)
        work[_FREE * CHUNK + i] = powers[cell] + share * (powers[cell + 1] - powers[cell])
        for k in range(4, columns):
            work[(_REACH + k - 4) * CHUNK + i] = blend[k]


@njit(**_options)
def _light(count, look, lamps, sky, view, work):
    """Turn a chunk's normals and shares into colours, rows _R, _G, _B: see `shading.shade`."""
    one, zero, half = np.float32(1), np.float32(0), np.float32(0.5)
    ortho = view[3] != 0.0
    for i in range(count):
        nx, ny, nz = work[_NX * CHUNK + i], work[_NY * CHUNK + i], work[_NZ * CHUNK + i]
        scale = one / max(np.float32(math.sqrt(nx * nx + ny * ny + nz * nz)), np.float32(1e-12))
        nx, ny, nz = nx * scale, ny * scale, nz * scale
        right, down = (work[_X * CHUNK + i] - view[0]) * view[2], (work[_Y * CHUNK + i] - view[1]) * view[2]
        length = one / np.float32(math.sqrt(right * right + down * down + one))
        vx, vy, vz = -right * length, down * length, length
        if ortho:
            vx, vy, vz = zero, zero, one
        work[_NX * CHUNK + i], work[_NY * CHUNK + i], work[_NZ * CHUNK + i] = nx, ny, nz
        work[_VX * CHUNK + i], work[_VY * CHUNK + i], work[_VZ * CHUNK + i] = vx, vy, vz
        work[_NV * CHUNK + i] = nx * vx + ny * vy + nz * vz
        up, free = half + half * ny, work[_FREE * CHUNK + i]
        lost = np.float32(BOUNCE) * (one - free)
        work[_R * CHUNK + i] = (sky[0] + sky[3] * up) * free / (one - look[0] * lost)
        work[_G * CHUNK + i] = (sky[1] + sky[4] * up) * free / (one - look[1] * lost)
        work[_B * CHUNK + i] = (sky[2] + sky[5] * up) * free / (one - look[2] * lost)
        work[_SR * CHUNK + i] = zero
        work[_SG * CHUNK + i] = zero
        work[_SB * CHUNK + i] = zero
    wr, wg, wb = one / (one + look[3]), one / (one + look[4]), one / (one + look[5])
    sharpness = look[7] * np.float32(1 / 1024)
    for k in range(len(lamps)):
        tx, ty, tz, lr, lg, lb = lamps[k, 0], lamps[k, 1], lamps[k, 2], lamps[k, 3], lamps[k, 4], lamps[k, 5]
        shine = look[6] * lamps[k, 6]
        row = (_REACH + k) * CHUNK
        for i in range(count):
            facing = tx * work[_NX * CHUNK + i] + ty * work[_NY * CHUNK + i] + tz * work[_NZ * CHUNK + i]
            across = tx * work[_VX * CHUNK + i] + ty * work[_VY * CHUNK + i] + tz * work[_VZ * CHUNK + i]
            reach = work[row + i]
            # |light + viewer|^2 = 2 + 2 light . viewer; exp(-x) as (1 - x / 1024)^1024.
            size = np.float32(math.sqrt(max(np.float32(2) + np.float32(2) * across, np.float32(1e-12))))
            lobe = max(one - sharpness * (one - (facing + work[_NV * CHUNK + i]) / size), zero)
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
            work[_R * CHUNK + i] += lr * reach * max((facing + look[3]) * wr, zero)
            work[_G * CHUNK + i] += lg * reach * max((facing + look[4]) * wg, zero)
            work[_B * CHUNK + i] += lb * reach * max((facing + look[5]) * wb, zero)
            work[_SR * CHUNK + i] += lr * lobe
            work[_SG * CHUNK + i] += lg * lobe
            work[_SB * CHUNK + i] += lb * lobe
    if look[8] != 0.0:
        tx, ty, tz = sky[6], sky[7], sky[8]
        for i in range(count):
            facing = tx * work[_NX * CHUNK + i] + ty * work[_NY * CHUNK + i] + tz * work[_NZ * CHUNK + i]
            across = tx * work[_VX * CHUNK + i] + ty * work[_VY * CHUNK + i] + tz * work[_VZ * CHUNK + i]
            size = np.float32(math.sqrt(max(np.float32(2) + np.float32(2) * across, np.float32(1e-12))))
            share = ((facing + work[_NV * CHUNK + i]) / size - np.float32(WINDOW_GONE)) * np.float32(
                1 / (WINDOW_FULL - WINDOW_GONE))
            bright = look[8] * min(max(share, zero), one)
            work[_SR * CHUNK + i] += bright
            work[_SG * CHUNK + i] += bright
            work[_SB * CHUNK + i] += bright
    shoulder, room = np.float32(SHOULDER), np.float32(1 - SHOULDER)
    for c in range(3):
        row, shine_row, albedo = (_R + c) * CHUNK, (_SR + c) * CHUNK, look[c]
        for i in range(count):
            value = work[row + i] * albedo + work[shine_row + i]
            above = max(value - shoulder, zero)
            work[row + i] = min(value, shoulder) + above * room / (above + room)


@njit(**_options)
def draw_bands(start, stop, step, items, starts, vertices, faces, proj, snapped, depth, kind, inside, cam, flat, known,
               adjacency, ring, attributes, vertex_ready, planes, ready, material, lamps, sky, view, powers,
               encode, behind, behind_bytes, transparent, picture):
    """Draw the bands start, start + step, ... before stop into picture (h, w, 4)."""
    height, width = picture.shape[0], picture.shape[1]
    row_blocks = (width + 3) >> 2
    buffer = np.empty(BAND_ROWS * row_blocks * _BLOCK, np.int32)
    colour = np.empty(BAND_ROWS * row_blocks * 16, np.float32)             # r, g, b, cover of each pixel
    offsets, offsets64 = np.empty(3 * _LANES, np.int32), np.empty(3 * _LANES, np.int64)
    depths, columns = np.empty(_LANES, np.int32), np.empty(2, np.int64)
    kinds = len(material)
    entry, target = np.empty((kinds, CHUNK), np.int32), np.empty((kinds, CHUNK), np.int32)
    spot, weight = np.empty((kinds, 2 * CHUNK), np.float32), np.empty((kinds, CHUNK), np.float32)
    filled = np.zeros(kinds, np.int64)
    work = np.empty((WORK_ROWS + len(lamps)) * CHUNK, np.float32)
    scratch = np.empty(3, np.float64)
    for band in range(start, stop, step):
        top, bottom = band * BAND_ROWS, min((band + 1) * BAND_ROWS, height)
        for row in range(top, bottom):
            for x in range(width):
                for c in range(4):
                    picture[row, x, c] = behind_bytes[row, c]
        if starts[band] == starts[band + 1]:
            continue
        for block in range((bottom - top) * row_blocks):
            for lane in range(_LANES):
                buffer[_BLOCK * block + lane] = 0
                buffer[_BLOCK * block + _LANES + lane] = -1
        columns[0], columns[1] = row_blocks, -1
        for k in range(starts[band], starts[band + 1]):
            _scan(buffer, offsets, offsets64, depths, faces, snapped, depth, items[k], top, bottom, width, columns)
        left, right = 4 * columns[0], min(4 * columns[1] + 4, width)
        for row in range(bottom - top):
            for k in range(16 * row_blocks * row + 4 * left, 16 * row_blocks * row + 4 * right):
                colour[k] = 0.0

        for row in range(bottom - top):
            for x in range(left, right):
                p = (row * row_blocks + (x >> 2)) * _BLOCK + 4 * (x & 3)
                t0, t1, t2, t3 = buffer[p + 16], buffer[p + 17], buffer[p + 18], buffer[p + 19]
                if t0 < 0 and t1 < 0 and t2 < 0 and t3 < 0:
                    continue
                pixel = row * 4 * row_blocks + x
                if t0 >= 0 and t1 >= 0 and t2 >= 0 and t3 >= 0:
                    k0 = kind[t1]
                    if kind[t0] == k0 and kind[t2] == k0 and kind[t3] == k0:
                        d0, d1, d2, d3 = buffer[p], buffer[p + 1], buffer[p + 2], buffer[p + 3]
                        if max(d0, d1, d2, d3) - min(d0, d1, d2, d3) < _STEP:
                            n = filled[k0]
                            entry[k0, n], target[k0, n], weight[k0, n] = t1, pixel, 1.0
                            spot[k0, 2 * n], spot[k0, 2 * n + 1] = x + 0.5, top + row + 0.5
                            filled[k0] = n + 1
                            if not ready[t1]:
                                _prepare(t1, vertices, faces, proj, cam, flat, adjacency, ring, known, attributes,
                                         vertex_ready, planes, ready, scratch)
                            if n + 1 == CHUNK:
                                _flush(k0, filled, entry, target, spot, weight, work, faces, attributes, planes,
                                       material, flat, inside, powers, lamps, sky, view, colour)
                            continue
                for s in range(4):
                    t = buffer[p + 16 + s]
                    if t < 0:
                        continue
                    k0 = kind[t]
                    n = filled[k0]
                    entry[k0, n], target[k0, n], weight[k0, n] = t, pixel, 0.25
                    spot[k0, 2 * n] = x + np.float32(_SAMPLE_X[s]) / np.float32(256)
                    spot[k0, 2 * n + 1] = top + row + np.float32(_SAMPLE_Y[s]) / np.float32(256)
                    filled[k0] = n + 1
                    if not ready[t]:
                        _prepare(t, vertices, faces, proj, cam, flat, adjacency, ring, known, attributes,
                                 vertex_ready, planes, ready, scratch)
                    if n + 1 == CHUNK:
                        _flush(k0, filled, entry, target, spot, weight, work, faces, attributes, planes,
                               material, flat, inside, powers, lamps, sky, view, colour)
        for k0 in range(kinds):
            if filled[k0]:
                _flush(k0, filled, entry, target, spot, weight, work, faces, attributes, planes, material, flat,
                       inside, powers, lamps, sky, view, colour)
        _finish(colour, row_blocks, top, bottom, left, right, behind, encode, transparent, picture)


@njit(**_options)
def _flush(kind, filled, entry, target, spot, weight, work, faces, attributes, planes, material, flat, inside, powers,
           lamps, sky, view, colour):
    """Shade the chunk of a material and add it to the band's colours."""
    count = filled[kind]
    _gather(count, kind, entry[kind], spot[kind], work, faces, attributes, planes, material, flat, kind == inside, powers)
    _light(count, material[kind], lamps, sky, view, work)
    for i in range(count):
        at, share = 4 * np.int64(target[kind, i]), weight[kind, i]
        colour[at] += share * work[_R * CHUNK + i]
        colour[at + 1] += share * work[_G * CHUNK + i]
        colour[at + 2] += share * work[_B * CHUNK + i]
        colour[at + 3] += share
    filled[kind] = 0


@njit(**_options)
def _finish(colour, row_blocks, top, bottom, left, right, behind, encode, transparent, picture):
    """Put the band's colours over the background and encode them."""
    one, scale = np.float32(1), np.float32(len(encode) - 1)
    for row in range(bottom - top):
        for x in range(left, right):
            at = 4 * (row * 4 * row_blocks + x)
            cover = colour[at + 3]
            if cover == 0.0:
                continue
            if transparent:
                picture[top + row, x, 3] = np.uint8(cover * np.float32(255) + np.float32(0.5))
            for c in range(3):
                value = colour[at + c]
                value = value / cover if transparent else value + behind[top + row, c] * (one - cover)
                value = min(max(value, np.float32(0)), one)
                picture[top + row, x, c] = encode[np.int64(value * scale + np.float32(0.5))]

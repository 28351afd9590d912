"""The rows of a mouth: lips round a slit, the lining behind them; teeth on their gums and a tongue.

Rows of the lips are halves, (2 k + 1) vertices from the middle of the upper lip round the left corner to the middle
of the lower lip.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from clay import Clay, curve, mirrored
from numpy.typing import ArrayLike, NDArray
from sheet import Sheet

# Lips' rows are found by steps of this length over the skin: short beside the roundness of a lip's edge.
_STRIDE = 0.03
_EVENING, _EVENING_ALONG = 2, 12


def slit_at(clay: Clay, line: ArrayLike, count: int, within: ArrayLike) -> NDArray:
    """Return the slit (count, 3), evenly spaced from the middle to the left corner, at the bottom of the mouth's groove.

    line: places in the groove, before the surface. within: where the rays from the line go, inside the head.
    """
    places = curve(line, count)
    inward = np.asarray(within, float) - places
    inward /= np.linalg.norm(inward, axis=1, keepdims=True)
    slit = clay.shoot(places + inward, -inward, 1.0)
    slit[0, 0] = 0.0
    return slit


def lip_rows(
    slit: NDArray,
    clay: Clay,
    offsets: Sequence[float],
    *,
    gap: float,
    out: NDArray,
    rim: Sequence[tuple[float, float]] = (),
    sunk: float = 0.0,
    inner: Sequence[tuple[float, float]] = (),
) -> list[NDArray]:
    """Return rows (2 k + 1, 3) of thick lips round a slit (k + 1, 3), which runs from the middle to the left corner.

    The first rows lie ``offsets`` away from the slit, square to ``out``, and are then moved onto the skin, the largest
    first; then those of the rounded rim, each (away from the slit, behind the skin); then the slit itself, ``sunk``
    behind the skin, its lips ``gap`` apart; then those on the inner side. out: ways out of the mouth (k + 1, 3), unit.
    """
    k = len(slit) - 1
    along = _along(slit)
    normal = np.array(out)
    normal[0, 0] = 0.0
    up = np.cross(normal, along)
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    # Towards the corner the rows fan out round it.
    fan = 0.9 * (np.arange(k) / k)[:, None] ** 5

    def row(d: float, depth: float = 0.0) -> NDArray:
        line = slit - depth * normal
        upper, lower = (line[:k] + d * (sign * np.cos(fan) * up[:k] + np.sin(fan) * along[:k]) for sign in (1, -1))
        return np.concatenate([upper, line[k:] + d * along[k:], lower[::-1]])

    rows = [
        *(clay.onto(row(d)) for d in offsets),
        *(row(*one) for one in rim),
        _seam(slit - sunk * normal, gap),
        *(row(*one) for one in inner),
    ]
    for one in rows:
        one[[0, -1], 0] = 0.0
    return rows


def walked_lip_rows(slit: NDArray, clay: Clay, offsets: Sequence[float], *, gap: float) -> list[NDArray]:
    """Return rows (2 k + 1, 3) of thin lips round a slit (k + 1, 3), which runs from the middle to the left corner.

    The first rows lie ``offsets`` away from the slit, the largest first, measured over the skin: where that bends
    sharply out of the groove, a row set off straight and moved onto it would fall on another. The last is the slit
    itself, its lips ``gap`` apart.
    """
    k = len(slit) - 1
    along = _along(slit, _EVENING_ALONG)
    # Towards the corner the rows fan out round it.
    fan = np.pi / 2 * np.concatenate([share := (np.arange(k + 1) / k) ** 5, 2 - share[-2::-1]])
    along = np.concatenate([along, along[-2::-1]])
    walkers = np.concatenate([slit, slit[-2::-1]])
    rows, walked = [], 0.0
    for d in sorted(offsets):
        steps = int(np.ceil((d - walked) / _STRIDE))
        for _ in range(steps):
            up = np.cross(clay.normals(walkers), along)
            up /= np.linalg.norm(up, axis=1, keepdims=True)
            walkers = walkers + (d - walked) / steps * (np.cos(fan)[:, None] * up + np.sin(fan)[:, None] * along)
            walkers[[0, -1], 0] = 0.0
            walkers = clay.onto(walkers, steps=3)
            walkers[[0, -1], 0] = 0.0
        rows.append(_even(walkers, clay))
        walked = d
    return [*rows[::-1], _seam(slit, gap)]


def _along(slit: NDArray, evening: int = 0) -> NDArray:
    """Return the ways (k + 1, 3), unit, along a slit, smoothed so often: or rows crowd on the inner side of its bends."""
    along = np.gradient(slit, axis=0)
    along[0] = (1.0, 0.0, 0.0)
    for _ in range(evening):
        along[1:-1] = along[1:-1] / 2 + (along[:-2] + along[2:]) / 4
    return along / np.linalg.norm(along, axis=1, keepdims=True)


def _seam(slit: NDArray, gap: float) -> NDArray:
    """Return the row (2 k + 1, 3) where the lips meet along a slit: ``gap`` apart in the middle, one at the corner."""
    k = len(slit) - 1
    taper = np.sqrt(1 - (np.arange(k) / k) ** 2)[:, None]
    half = gap / 2 * np.array([0.0, 1.0, 0.0]) * taper
    return np.concatenate([slit[:k] + half, slit[k:], (slit[:k] - half)[::-1]])


def _even(row: NDArray, clay: Clay) -> NDArray:
    """Return a row smoothed along itself, on the skin."""
    corner = len(row) // 2
    for _ in range(_EVENING):
        even = np.concatenate([row[:1], row[1:-1] / 2 + (row[:-2] + row[2:]) / 4, row[-1:]])
        even[corner] = row[corner]
        row = clay.onto(even, steps=3)
        row[[0, -1], 0] = 0.0
    return row


def arch(*left: tuple[float, float, float]) -> NDArray:
    """Return an arch (2 k - 1, 3) from its left half (k places), the middle last."""
    return np.concatenate([left, mirrored(left[-2::-1])])


def gum_and_teeth(
    part: str,
    arch: NDArray,
    down: ArrayLike,
    gum: float,
    teeth: Sequence[tuple[float, float, float, float]],
    *,
    lean: float = 0.0,
    points: int = 13,
) -> Sheet:
    """Return a row of teeth on a gum that runs along an arch (k, 3), symmetrical: from the left end to the right one.

    down: direction in which the teeth grow. gum: thickness. teeth: (place along the arch 0..1, width, depth, length)
    each; lean: how far tips stand forwards, in lengths. points: rings of the gum.
    """
    sheet = Sheet(part)
    down = np.asarray(down, float) / np.linalg.norm(down)
    path = curve(arch, points)
    along = np.gradient(path, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    out = np.cross(down, along)
    out /= np.linalg.norm(out, axis=1, keepdims=True)
    if (out[:, 2].sum()) < 0:
        out = -out
    t = 2 * np.pi * np.arange(6) / 6
    thick = gum * np.sqrt(np.maximum(1 - np.linspace(-1, 1, len(path)) ** 6, 0.1))
    rings = [
        p + g * (np.cos(t)[:, None] * o + 1.1 * np.sin(t)[:, None] * down)
        for p, o, g in zip(path, out, thick, strict=True)
    ]
    numbers = sheet.tube(rings, "gums")
    sheet.cap(numbers[0], "gums")
    sheet.cap(numbers[-1], "gums")
    for where, width, depth, length in teeth:
        i = where * (len(path) - 1)
        p, a, o = (
            np.array([np.interp(i, range(len(path)), values[:, c]) for c in range(3)]) for values in (path, along, out)
        )
        tooth(sheet, p + 0.5 * gum * down, a, o, down + lean * o, width, depth, length)
    return sheet


def tooth(
    sheet: Sheet, root: NDArray, along: NDArray, out: NDArray, down: NDArray, width: float, depth: float, length: float
) -> None:
    """Add a tooth: its rings of six shrink towards a blunt tip; one much longer than wide curves back like a fang."""
    t = 2 * np.pi * (np.arange(6) + 0.5) / 6
    fang = length > 1.8 * width
    shape = (
        ((0.0, 1.0), (0.35, 0.92), (0.7, 0.55), (0.93, 0.2))
        if fang
        else ((0.0, 0.85), (0.4, 1.0), (0.85, 0.95), (1.0, 0.7))
    )
    rings = []
    for height, size in shape:
        bend = -0.18 * length * height**2 * out if fang else 0.0
        rings.append(
            root
            + height * length * down
            + bend
            + size / 2 * (width * np.cos(t)[:, None] * along + depth * np.sin(t)[:, None] * out)
        )
    numbers = sheet.tube(rings, "teeth")
    sheet.cap(numbers[0], "teeth")
    sheet.cap(numbers[-1], "teeth", rings[-1].mean(axis=0) + 0.05 * length * down)


def tongue(part: str, spine: ArrayLike, widths: ArrayLike, thicknesses: ArrayLike, groove: float = 0.15) -> Sheet:
    """Return a tongue: flat rings of ten along a spine in the plane x = 0, from the root to the tip."""
    sheet = Sheet(part)
    path = curve(spine, len(widths))
    along = np.gradient(path, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    t = 2 * np.pi * np.arange(10) / 10
    rings = []
    for p, a, w, h in zip(path, along, widths, thicknesses, strict=True):
        up = np.cross(a, [1.0, 0.0, 0.0])
        up *= np.sign(up[1])
        dip = 1 - groove * np.clip(np.sin(t), 0, 1) ** 4 * 2
        rings.append(p + w * np.cos(t)[:, None] * np.array([1.0, 0, 0]) + (h * np.sin(t) * dip)[:, None] * up)
    numbers = sheet.tube(rings, "tongue")
    sheet.cap(numbers[0], "tongue")
    sheet.cap(numbers[-1], "tongue", rings[-1].mean(axis=0) + 0.5 * widths[-1] * along[-1])
    return sheet

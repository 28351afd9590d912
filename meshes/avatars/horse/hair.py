"""The horse's forelock and mane: flat tapering locks that start on the poll and on the crest of the neck."""

from __future__ import annotations

import numpy as np
from clay import Clay, curve
from numpy.typing import ArrayLike, NDArray
from sheet import Sheet

from facegen.geometry.mesh import Mesh

# Of a lock, from its root to its tip: half widths as shares of the widest, and heights over the skin.
_WIDTHS = (0.55, 0.85, 1.0, 1.0, 0.9, 0.7, 0.42, 0.12)
_HEIGHTS = (0.0, 0.7, 1.0, 1.0, 1.0, 0.95, 0.9, 0.8)
_SIDES = 6
TWO = ("mane", "mane_dark")


def lock(sheet: Sheet, clay: Clay, spine: ArrayLike, width: float, thick: float, height: float, name: str) -> None:
    """Add a lock along a spine (k, 3), its flat side to the skin, ``height`` over it where it lies highest."""
    path = curve(spine, len(_WIDTHS))
    path = clay.onto(path, height * np.array(_HEIGHTS))
    along = np.gradient(path, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    across = np.cross(clay.normals(path), along)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    up = np.cross(along, across)
    t = 2 * np.pi * np.arange(_SIDES) / _SIDES
    rings = [
        p + share * width * np.cos(t)[:, None] * a + thick * share**0.5 * np.sin(t)[:, None] * n
        for p, a, n, share in zip(path, across, up, _WIDTHS, strict=True)
    ]
    numbers = sheet.tube(rings, name)
    sheet.cap(numbers[0], name)
    sheet.cap(numbers[-1], name, path[-1] + 0.15 * width * along[-1])


def forelock(clay: Clay) -> Mesh:
    """Return the locks that fall from between the ears over the forehead."""
    sheet = Sheet("forelock")
    for number, (root, end, reach, width) in enumerate((
        (-0.45, -1.25, 3.1, 0.34), (0.45, 1.2, 3.0, 0.34), (-0.3, -0.75, 4.0, 0.4), (0.32, 0.62, 3.8, 0.4),
        (0.0, -0.1, 4.5, 0.42),
    )):
        z = np.array([-1.5, -0.2, 0.45 * reach, 0.75 * reach, reach])
        x = root + (end - root) * np.array([0.0, 0.15, 0.65, 1.0, 0.95])
        lock(sheet, clay, np.column_stack([x, np.full(5, 1.8), z]), width, 0.1, 0.12 + 0.06 * number, TWO[number % 2])
    return sheet.mesh()


def mane(clay: Clay, crest: NDArray) -> Mesh:
    """Return the locks along the crest (k, 3), that fall over the neck's left side."""
    sheet = Sheet("mane")
    down = np.array([0.0, -0.72, 0.7])
    for number, root in enumerate(curve(crest, 13)):
        fall = 2.5 + (0.0, 0.55, 0.2, 0.7, 0.35)[number % 5] + 0.05 * number
        sway = (0.25, -0.1, 0.3, 0.05)[number % 4] * np.array([0.0, 0.3, 0.9])
        spine = root + np.array([(-0.35, -0.1, 0.1), (0.1, 0.2, -0.1), (0.75, 0.0, 0.0), (1.3, 0.0, 0.0),
                                 (1.4, 0.0, 0.0)])
        spine[2:] += fall * np.array([0.25, 0.62, 1.0])[:, None] * down
        spine[3] += sway
        lock(sheet, clay, spine, 0.6, 0.12, (0.12, 0.22, 0.16)[number % 3], TWO[number % 2])
    return sheet.mesh()

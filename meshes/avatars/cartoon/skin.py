"""The skin of the cartoon: a grid of quads round the head with rectangular holes, filled by concentric rings.

Columns go round the head and rows from the neck to the crown. The rings are laid out in rings.py; what is left of the grid
is relaxed on the shape.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from head import EYE_RADIUS, LID, LID_GAP, MIRROR, MOUTH_HALF, SLIT, Array, head_shape, onto
from numpy.typing import NDArray
from piece import Piece
from rings import AROUND_LIDS, ear_ring, ear_root, lid_ring, mirrored, mouth_ring, nose_ring, on_lids, orbit_ring
from scipy import sparse
from scipy.sparse.linalg import splu

STIFF = 30.0                               # how far one step of the relaxation goes
COLUMNS, ROWS = 30, 24                     # rows 0 (neck) .. 23; the crown's pole closes the top
# Columns from, to, rows from, to; counted from the middle of the face to the subject's left.
EYE_HOLE, NOSE_HOLE, MOUTH_HOLE, EAR_HOLE = (2, 8, 15, 19), (-2, 2, 10, 14), (-4, 4, 7, 9), (10, 12, 12, 16)


@dataclass
class Skin(Piece):
    """The skin with its rings by name: ``eye_L_0`` is the loop in the grid, higher numbers lie farther inwards."""

    rings: dict[str, list[int]] = field(default_factory=dict)

    def band(self, outer: Sequence[int], inner: Sequence[int], material: str) -> None:
        """Fill between two rings that run counter-clockwise, seen from outside; the inner may have twice as many."""
        n = len(outer)
        for i in range(n):
            j = (i + 1) % n
            if len(inner) == n:
                self.face((outer[i], outer[j], inner[j], inner[i]), material)
            else:
                a, b, c = inner[2 * i], inner[2 * i + 1], inner[2 * j]
                for face in ((outer[i], b, a), (outer[i], outer[j], b), (outer[j], c, b)):
                    self.face(face, material)

    def inwards(self, name: str, rings: Sequence[tuple[str, Array]]) -> list[int]:
        """Fill a hole with rings, from the outside in, a material each; return the innermost."""
        outer = self.rings[f"{name}_0"]
        for number, (material, ring) in enumerate(rings, 1):
            inner = self.add(ring)
            self.band(outer, inner, material)
            self.rings[f"{name}_{number}"] = outer = inner
        return outer

    def cap(self, ring: Sequence[int], wide: int, high: int, material: str, bulge: float = 0.0) -> list[int]:
        """Close a ring of 2 (wide + high) vertices by a grid; ``bulge`` moves its middle forward. Returns what is new."""
        grid = {cell: ring[i] for i, cell in enumerate(_loop((0, wide, 0, high)))}
        start = {cell: self.points[i] for cell, i in grid.items()}
        for a in range(1, wide):
            for b in range(1, high):
                s, t = a / wide, b / high
                across = (1 - s) * start[0, b] + s * start[wide, b]
                along = (1 - t) * start[a, 0] + t * start[a, high]
                lift = 16 * s * (1 - s) * t * (1 - t)
                grid[a, b] = self.add([(across + along) / 2 + (0.0, 0.0, lift * bulge)])[0]
        for a in range(wide):
            for b in range(high):
                self.face((grid[a, b], grid[a + 1, b], grid[a + 1, b + 1], grid[a, b + 1]), material)
        return [grid[a, b] for a in range(1, wide) for b in range(1, high)]


def _loop(hole: tuple[int, int, int, int]) -> list[tuple[int, int]]:
    """Return the cells' corners round a hole, counter-clockwise from the middle of its right side."""
    c0, c1, r0, r1 = hole
    middle = (r0 + r1) // 2
    return ([(c1, r) for r in range(middle, r1)] + [(c, r1) for c in range(c1, c0, -1)]
            + [(c0, r) for r in range(r1, r0, -1)] + [(c, r0) for c in range(c0, c1)]
            + [(c1, r) for r in range(r0, middle)])


def _mirrored_hole(hole: tuple[int, int, int, int]) -> tuple[int, int, int, int]:
    """Return the hole on the other side."""
    return (-hole[1], -hole[0], *hole[2:])


def head_skin() -> Skin:
    """Return the skin."""
    skin = Skin("skin")
    grid = _grid(skin)
    loose = np.flatnonzero(~_set_loops(skin))                # before the rings add their vertices, which are all placed
    loops = np.unique([i for name in ("eye_L", "eye_R", "nose", "mouth") for i in skin.rings[f"{name}_0"]])
    _eyes(skin)
    _mouth(skin)
    _nose(skin)
    _ears(skin)
    _relax(skin, grid, loose, loops)
    skin.faces = [_split_well(face, np.array(skin.points)[list(face)]) for face in skin.faces]
    return skin


def _split_well(face: tuple[int, ...], corners: Array) -> tuple[int, ...]:
    """Return a quad with the first corner from which a reader should split it: along its shorter diagonal, and alike on
    both sides of the face."""
    if len(face) != 4:
        return face
    one, other = np.linalg.norm(corners[2] - corners[0]), np.linalg.norm(corners[3] - corners[1])
    turned = one > other if abs(one - other) > 1e-6 else corners[:, 0].sum() < 0
    return face[1:] + face[:1] if turned else face


def _grid(skin: Skin) -> dict[tuple[int, int], int]:
    """Add the grid, its faces around the holes, and the crown; return cell corner -> vertex."""
    holes = [EYE_HOLE, _mirrored_hole(EYE_HOLE), NOSE_HOLE, MOUTH_HOLE, EAR_HOLE, _mirrored_hole(EAR_HOLE)]
    columns = range(-COLUMNS // 2, COLUMNS // 2)

    def wrapped(c: int) -> int:
        return (c + COLUMNS // 2) % COLUMNS - COLUMNS // 2

    around = np.radians([0, 6, 11, 17, 23, 29, 35, 41, 48, 58, 72, 90, 108, 128, 152, 180])
    heights = np.interp(np.arange(ROWS), [0, 1, 2, 3, 4, 5, 6, 7, 9, 10, 14, 15, 19, 20, 21, 23],
                        [-1.25, -1.07, -1.0, -0.985, -0.96, -0.91, -0.82, -0.7, -0.40, -0.34, -0.02, 0.0, 0.5, 0.6, 0.68, 0.93])
    grid: dict[tuple[int, int], int] = {}
    for r in range(ROWS):
        for c in columns:
            if any(c0 < c < c1 and r0 < r < r1 for c0, c1, r0, r1 in holes):
                continue
            angle = np.sign(c) * around[abs(c)]
            wide = 0.33 if r < 3 else 0.85 * np.sqrt(max(1 - ((heights[r] - 0.05) / 1.02) ** 2, 0.02))
            centre = -0.10 if r < 3 else 0.0
            grid[c, r] = skin.add([[wide * np.sin(angle), heights[r], centre + wide * np.cos(angle)]])[0]
    for r in range(ROWS - 1):
        for c in columns:
            if any(c0 <= c < c1 and r0 <= r < r1 for c0, c1, r0, r1 in holes):
                continue
            d = wrapped(c + 1)
            skin.face((grid[c, r], grid[d, r], grid[d, r + 1], grid[c, r + 1]), "skin")
    crown = skin.add([[0.0, 1.05, -0.1]])[0]
    for c in columns:
        skin.face((grid[c, ROWS - 1], grid[wrapped(c + 1), ROWS - 1], crown), "skin")
    skin.rings["crown"] = [crown]
    skin.rings["neck"] = [grid[c, 0] for c in columns]
    skin.rings["throat"] = [grid[c, 1] for c in columns]
    skin.rings["middle"] = [grid[0, r] for r in range(ROWS) if (0, r) in grid]
    for name, hole in (("eye_L", EYE_HOLE), ("eye_R", _mirrored_hole(EYE_HOLE)), ("nose", NOSE_HOLE),
                       ("mouth", MOUTH_HOLE), ("ear_L", EAR_HOLE), ("ear_R", _mirrored_hole(EAR_HOLE))):
        skin.rings[f"{name}_0"] = [grid[cell] for cell in _loop(hole)]
    return grid


def _set_loops(skin: Skin) -> NDArray[np.bool_]:
    """Place the loops round the holes, the neck and the crown; return what is placed (n,)."""
    fixed = np.zeros(len(skin.points), bool)

    def place(name: str, points: Array) -> None:
        for i, point in zip(skin.rings[name], points, strict=True):
            skin.points[i] = point
            fixed[i] = True

    eye = orbit_ring()
    place("eye_L_0", eye)
    place("eye_R_0", mirrored(eye))
    place("nose_0", onto(nose_ring(112.0) * (1.0, 1.0, 0.98), head_shape))
    place("mouth_0", mouth_ring(MOUTH_HALF + 0.12, 0.14, 0.16, 0.0))
    ear = ear_root(0.30, 0.19, 0.05)
    place("ear_L_0", ear)
    place("ear_R_0", mirrored(ear))
    angle = 2 * np.pi * np.arange(-COLUMNS // 2, COLUMNS // 2) / COLUMNS
    for name, high in (("neck", -1.25), ("throat", -1.09)):
        ring = np.stack([0.31 * np.sin(angle), np.full(COLUMNS, high), -0.09 + 0.31 * np.cos(angle)], axis=1)
        place(name, onto(ring))
    skin.points[skin.rings["crown"][0]] = onto(np.array([[0.0, 1.05, -0.1]]))[0]
    fixed[skin.rings["crown"]] = True
    return fixed


def _relax(skin: Skin, grid: dict[tuple[int, int], int], loose: NDArray[np.intp], loops: NDArray[np.intp]) -> None:
    """Lay the loose vertices on the shape so that rows and columns flow evenly out of the loops they end in.

    Minimises the bending sum_i |p_i - mean of its neighbours|^2 over the loose vertices and the loops, in implicit
    steps with a projection after each. (Plain averaging pulls rows straight, across the loops.)
    """
    n = len(skin.points)
    pairs = np.array([pair for f in skin.faces for pair in zip(f, f[1:] + f[:1], strict=True)])
    beside = sparse.csr_array((np.ones(2 * len(pairs)), (pairs.ravel(), pairs[:, ::-1].ravel())), shape=(n, n))
    beside.data[:] = 1.0
    bend = (sparse.eye_array(n) - sparse.diags_array(1.0 / beside.sum(axis=1)) @ beside).tocsr()
    bend = bend[np.concatenate([loose, loops])]
    energy = (STIFF * (bend.T @ bend)).tocsr()
    held = np.setdiff1d(np.arange(n), loose)
    p = np.array(skin.points)
    p[loose] = onto(p[loose])
    step = splu((sparse.eye_array(len(loose)) + energy[loose][:, loose]).tocsc())
    pull = energy[loose][:, held] @ p[held]
    for _ in range(60):
        p[loose] = onto(step.solve(p[loose] - pull), steps=3)
    p[loose] = onto(p[loose])
    for (c, r), i in grid.items():                                     # mirror images to the last bit
        if 0 < c < COLUMNS // 2:
            p[grid[-c, r]] = p[i] * MIRROR
        else:
            p[i, 0] = p[i, 0] if c % (COLUMNS // 2) else 0.0
    skin.points[:] = list(p)


def _eyes(skin: Skin) -> None:
    """Fill the holes of the eyes: lid skin over the ball, the rim, and a lining behind it."""
    full = EYE_RADIUS + LID
    near = lid_ring(11.0, full)
    between = 0.42 * orbit_ring() + 0.58 * near
    rings = [("skin", on_lids(between, between)), ("skin", on_lids(near, near))]
    rings += [(material, lid_ring(outside, radius, AROUND_LIDS)) for material, outside, radius in (
        ("skin", 6.0, full), ("skin", 2.5, full), ("lid", 0.3, EYE_RADIUS + 0.4 * LID),
        ("lid", 0.0, EYE_RADIUS + LID_GAP), ("lid", 8.0, EYE_RADIUS + LID_GAP))]
    skin.inwards("eye_L", rings)
    skin.inwards("eye_R", [(material, mirrored(ring)) for material, ring in rings])


def _mouth(skin: Skin) -> None:
    """Fill the hole of the mouth: lips, the slit, and the lining of the cavity."""
    w, g = MOUTH_HALF, SLIT / 2
    rings = [("skin", mouth_ring(w + 0.055, 0.095, 0.115, 0.004)),
             ("skin", mouth_ring(w + 0.018, 0.058, 0.090, 0.016)),
             ("lips", mouth_ring(w + 0.004, 0.030, 0.048, 0.036)),
             ("lips", mouth_ring(w, g, g, 0.022)),
             ("lips", mouth_ring(w - 0.004, 0.012, 0.012, -0.040)),
             ("mouth", mouth_ring(w + 0.004, 0.13, 0.14, -0.055)),
             ("mouth", mouth_ring(w + 0.01, 0.17, 0.185, -0.25, flat=True)),
             ("mouth", mouth_ring(w - 0.05, 0.15, 0.175, -0.50, flat=True))]
    skin.cap(skin.inwards("mouth", rings), 8, 2, "mouth", -0.06)


def _nose(skin: Skin) -> None:
    """Fill the hole of the nose: a ball that overhangs the face."""
    inmost = skin.inwards("nose", [("nose", onto(nose_ring(polar))) for polar in (88.0, 62.0, 38.0)])
    new = skin.cap(inmost, 4, 4, "nose", 0.05)
    for i, point in zip(new, onto(np.array([skin.points[i] for i in new])), strict=True):
        skin.points[i] = point
    skin.rings["nose_tip"] = new


def _ears(skin: Skin) -> None:
    """Fill the holes of the ears: the back, the rim, and the hollow."""
    rings = [("skin", ear_root(0.19, 0.055, 0.08)), ("skin", ear_ring(0.215, 0.125, 0.165, -0.010)),
             ("skin", ear_ring(0.26, 0.15, 0.185, 0.03)), ("skin", ear_ring(0.25, 0.145, 0.185, 0.075)),
             ("nose", ear_ring(0.185, 0.095, 0.18, 0.07)), ("nose", ear_ring(0.125, 0.055, 0.155, 0.025))]
    skin.cap(skin.inwards("ear_L", rings), 2, 4, "nose")
    skin.cap(skin.inwards("ear_R", [(material, mirrored(ring)) for material, ring in rings]), 2, 4, "nose")

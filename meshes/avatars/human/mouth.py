"""Lips as edge loops around the mouth's slit, and the nostrils.

Tables run from the middle of the lip (0) to the corner (8); millimetres, before age bends them.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from head_cage import MOUTH_HOLE, NOSTRIL_HOLE, hole_loop, key
from numpy.typing import NDArray
from quads import Cage

RINGS = 8            # hole, around, near, border, belly, contact in front, contact behind, pocket behind the lip
CONTACT = (5, 6)
SLIT = 0.16          # between the lips: they touch for the eye, but are not welded

SEAM = np.array([(0, -70.3, 31.6), (4, -70.1, 31.4), (8, -70.0, 30.6), (12, -70.2, 29.1), (16, -70.5, 27.0),
                 (19.6, -70.9, 24.7), (22.6, -71.2, 22.4), (24.7, -71.5, 20.6), (26.2, -71.8, 19.2)])
# above and in front of the seam
UPPER_BORDER = np.array([(3.7, .7), (4.5, .9), (4.0, .9), (3.3, .8), (2.6, .7), (1.9, .6), (1.3, .5), (.7, .5), (0, .7)])
UPPER_BELLY = np.array([(1.9, 1.5), (2.2, 1.6), (1.9, 1.6), (1.6, 1.5), (1.3, 1.3), (1.1, 1.1), (.8, .8), (.45, .5), (0, .2)])
LOWER_BORDER = np.array([(-5.3, .3), (-5.3, .4), (-5.0, .5), (-4.4, .6), (-3.6, .6), (-2.7, .6), (-1.8, .6), (-1.1, .5),
                         (0, .7)])
LOWER_BELLY = np.array([(-2.5, 2.2), (-2.5, 2.2), (-2.4, 2.1), (-2.2, 1.9), (-2.0, 1.7), (-1.5, 1.3), (-1.0, .9),
                        (-.5, .5), (0, .2)])
INNER_DEPTH = np.array([4.2, 4.2, 4.1, 3.9, 3.6, 3.2, 2.7, 2.2, 1.6])
UPPER_POCKET = np.array([(11, 5.0), (11, 5.0), (10.6, 5.0), (10, 5.0), (9, 5.0), (7.6, 5.0), (5.6, 5.0), (3, 5.0), (0, 5.0)])

# farther back and less deep: the fold below the lip comes near
LOWER_POCKET = np.array([(7.5, 6.8), (7.5, 6.8), (7.3, 6.8), (7.0, 6.8), (6.4, 6.8), (5.6, 6.6), (4.4, 6.2), (2.5, 5.5),
                         (0, 5.0)])


def spokes() -> list[tuple[tuple[int, int], int, int, int]]:
    """Return ((row, column), side, q, lip) around the mouth: q = 0 middle .. 8 corner; lip 1 upper, -1 lower, 0."""
    r0, r1, _, c1 = MOUTH_HOLE
    middle = (r0 + r1) // 2
    out = []
    for r, c in hole_loop(MOUTH_HOLE):
        q = abs(c) if r in (r0, r1) else c1 + 2 - abs(r - middle)
        lip = 0 if q == c1 + 2 else 1 if r > middle else -1
        out.append(((r, c), -1 if c < 0 else 1, q, lip))
    return out


def add_lips(cage: Cage, project) -> list[list]:
    """Add the lips' rings to the cage; return the keys of the rings. ``project`` puts places on the bare skin."""
    rings = [[] for _ in range(RINGS)]
    for rc, side, q, lip in spokes():
        hole = key(*rc)
        rings[0].append(hole)
        for k, place in enumerate(_section(cage[hole], side, q, lip, project), 1):
            name = ("lips", k, *rc)
            cage.vertex(name, place)
            rings[k].append(name)
    for outer, inner in pairwise(rings):
        cage.band(outer, inner)
    return rings


def _section(hole: NDArray, side: int, q: int, lip: int, project) -> list[NDArray]:
    flip = np.array([side, 1, 1])
    seam, up, open_ = SEAM[q], 1 if lip >= 0 else -1, abs(lip)       # at the corner the two lips are one

    def beside(x: float, y: float, z: float) -> NDArray:
        return seam + np.array([x, y, z])

    corner = 1.0 if q == 8 else 0.0
    dy, dz = (UPPER_BORDER if up > 0 else LOWER_BORDER)[q]
    border = beside(1.4 * corner, dy, dz - .9 * corner)
    dy, dz = (UPPER_BELLY if up > 0 else LOWER_BELLY)[q]
    belly = beside(.5 * corner, dy, dz)
    front = beside(0, up * open_ * SLIT / 2, 0)
    back = beside(-.042 * seam[0], up * open_ * SLIT / 2, -INNER_DEPTH[q])
    rise, depth = (UPPER_POCKET if up > 0 else LOWER_POCKET)[q]
    pocket = beside(1.5 * (q / 8) ** 2, up * open_ * rise, -depth - 1.2 * (q / 8))
    border, belly, front, back, pocket = (p * flip for p in (border, belly, front, back, pocket))
    between = 0.66 * hole + 0.34 * border
    around = project([between])[0]
    if lip:                                            # a little fuller than a straight line: teeth push from behind
        around[2] = .4 * around[2] + .6 * between[2]
    near = 0.36 * around + 0.64 * border - np.array([0, 0, .25])
    return [around, near, border, belly, front, back, pocket]


def close_lips(places: NDArray, upper: NDArray, lower: NDArray) -> None:
    """Lay pairs of contact vertices (upper[i] over lower[i]) a slit apart, in place."""
    middle = (places[upper] + places[lower]) / 2
    half = np.array([0, SLIT / 2, 0])
    places[upper], places[lower] = middle + half, middle - half


def add_nostrils(cage: Cage) -> list:
    """Close the two nostrils by blind tunnels; return the keys of the quads' inner vertices."""
    inner = []
    for sign in (1, -1):
        loop = hole_loop(NOSTRIL_HOLE, sign)
        rim = [key(*rc) for rc in loop]
        places = np.array([cage[k] for k in rim])
        middle = places.mean(axis=0)
        rings = [rim]
        for k, (shrink, up, back) in enumerate(((0.86, 1.6, -.4), (0.72, 6.0, -2.0), (0.45, 9.5, -4.0)), 1):
            ring = [("nostril", sign, k, *rc) for rc in loop]
            for name, p in zip(ring, places, strict=True):
                cage.vertex(name, middle + (p - middle) * shrink + [-sign * 0.15 * up, up, back])
            cage.band(rings[-1], ring)
            rings.append(ring)
            if k > 1:
                inner += ring
        a = rings[-1]                                   # six corners: two quads
        cage.quad(a[0], a[1], a[4], a[5])
        cage.quad(a[1], a[2], a[3], a[4])
    return inner


def facing_pairs(loop: NDArray) -> tuple[NDArray, NDArray]:
    """Return (upper, lower) vertices of a fine lip loop that lie over each other, without the corners."""
    m = len(loop)
    right = (m - 2 * 2) % m                             # the loop starts two spokes after the right corner
    k = np.arange(1, m // 2)
    return loop[(right - k) % m], loop[(right + k) % m]

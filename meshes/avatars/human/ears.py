"""The outer ears: loops from the head over the rim to the hollow, then relief by a height function.

Ear axes: u to the back, v up, h away from the head; millimetres; the origin lies over the ear canal.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from head_cage import EAR_HOLE, hole_loop, key
from numpy.typing import NDArray
from quads import Cage
from scipy.interpolate import CubicSpline

# The outline, counter-clockwise seen from outside the left ear, from low in front: one point a spoke.
OUTLINE = np.array([(-9.5, -22), (-8.5, -30), (-4, -37.5), (3, -38.5), (9, -34), (13.5, -26), (17.5, -16.5), (22, -6.5),
                    (26, 3.5), (28, 14), (26.5, 24), (21, 31.5), (12.5, 35), (4, 34), (-3.5, 29.5), (-8.5, 22.5),
                    (-10.5, 13.5), (-11, 4), (-10.8, -5), (-10.3, -14)])
FRONT = np.array([1, .8, .35, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, .25, .6, .9, 1, 1, 1, 1])    # 1 where it grows out of the cheek
INWARD = (0.93, 0.83, 0.68, 0.52, 0.36)                 # the loops inside the rim, as parts of the outline
CENTRE = np.array([2.0, -1.0])


@dataclass(frozen=True)
class Ear:
    """Where an ear sits. ``flare``: degrees that it stands off the head; ``lean``: degrees that its top leans back."""

    sign: int
    origin: tuple[float, float, float]
    flare: float
    lean: float
    size: float

    def axes(self) -> NDArray:
        """Return rows u, v, h."""
        f, a = np.radians(self.flare), np.radians(self.lean)
        u = np.array([np.sin(f), 0, -np.cos(f)])
        h = np.array([np.cos(f), 0, np.sin(f)])
        v = np.array([0, 1, 0])
        u, v = np.cos(a) * u - np.sin(a) * v, np.cos(a) * v + np.sin(a) * u
        return np.stack([u, v, h]) * [self.sign, 1, 1]

    def place(self, u, v, h) -> NDArray:
        local = np.stack(np.broadcast_arrays(u, v, h), axis=-1) * self.size
        return np.array(self.origin) * [self.sign, 1, 1] + local @ self.axes()

    def local(self, places) -> NDArray:
        return (places - np.array(self.origin) * [self.sign, 1, 1]) @ self.axes().T / self.size


EARS = (Ear(1, (72.4, -20, -66.5), 29, 9, 1.0), Ear(-1, (72.8, -21.5, -66.8), 33, 8, 1.02))


def add_ear(cage: Cage, ear: Ear) -> tuple[list, list]:
    """Add an ear; return the keys of its front (relief) vertices, and of all."""
    loop = hole_loop(EAR_HOLE, ear.sign)
    order = [(r, abs(c)) for r, c in loop]
    spoke = {rc: i for i, rc in enumerate(hole_loop(EAR_HOLE))}
    spokes = [spoke[rc] for rc in order]
    rings = [[key(*rc) for rc in loop]]
    root = np.array([cage[k] for k in rings[0]])
    rim = np.array([OUTLINE[i] for i in spokes])
    front = np.array([FRONT[i] for i in spokes])[:, None]
    back_edge = ear.place(rim[:, 0], rim[:, 1], (-3.4 * (1 - front) - .6 * front)[:, 0])
    behind = 0.5 * root + 0.5 * back_edge - 1.6 * (1 - front) * ear.axes()[2]
    levels = [behind, back_edge]
    for k, part in enumerate(INWARD):
        u, v = (CENTRE + part * (rim - CENTRE)).T
        levels.append(ear.place(u, v, 0.2 if k == 0 else -0.5))
    for k, places in enumerate(levels, 1):
        ring = [("ear", ear.sign, k, *rc) for rc in loop]
        for name, p in zip(ring, places, strict=True):
            cage.vertex(name, p)
        cage.band(rings[-1], ring)
        rings.append(ring)
    cap = _fill(cage, ear, rings[-1])
    relief = [k for ring in rings[3:] for k in ring] + cap
    return relief, [k for ring in rings[1:] for k in ring] + cap


def _fill(cage: Cage, ear: Ear, ring: list) -> list:
    """Fill the innermost loop of 20 by a patch of 4 x 6 quads; return the keys of its inner vertices."""
    r0, r1, c0, c1 = EAR_HOLE
    cols = range(c0, c1) if ear.sign > 0 else range(-c1, -c0)
    place = {k[3:]: k for k in ring}
    keys, inner = {}, []
    for r in range(r0, r1 + 1):
        for c in [*cols, cols[-1] + 1]:
            if (r, c) in place:
                keys[r, c] = place[r, c]
                continue
            s, t = (r - r0) / (r1 - r0), (c - cols[0]) / (c1 - c0)
            low, high, near, far = (cage[place[k]] for k in ((r0, c), (r1, c), (r, cols[0]), (r, cols[-1] + 1)))
            keys[r, c] = ("ear", ear.sign, "cap", r, c)
            cage.vertex(keys[r, c], ((1 - s) * low + s * high + (1 - t) * near + t * far) / 2)
            inner.append(keys[r, c])
    for r in range(r0, r1):
        for c in cols:
            cage.quad(keys[r, c], keys[r, c + 1], keys[r + 1, c + 1], keys[r + 1, c])
    return inner


# ---- the relief ----

_OUT = CubicSpline(np.arange(21), np.vstack([OUTLINE, OUTLINE[:1]]), bc_type="periodic")
RIDGES = [  # what, points (u, v), half width, height
    ("helix", CENTRE + .93 * (_OUT(np.linspace(5.5, 15.8, 80)) - CENTRE), 2.4, 2.3),
    ("scapha", CENTRE + .79 * (_OUT(np.linspace(6.5, 13.5, 60)) - CENTRE), 2.1, -1.8),
    ("antihelix", [(5, -15), (10, -11), (14, -4), (16, 4), (16, 11), (14.5, 17)], 3.1, 2.9),
    ("upper crus", [(14.5, 16), (13.5, 21), (11, 25.5)], 2.6, 2.0),
    ("lower crus", [(14.5, 15), (9, 17), (3, 18.5)], 2.3, 1.8),
    ("fossa", [(11, 20), (6, 22.5)], 2.0, -.9),
    ("crus of the helix", [(-9, 14), (-6.5, 8), (-1.5, 3.5)], 2.2, 4.2),
    ("tragus", [(-8.2, -1), (-7.6, -5)], 3.2, 4.4),
    ("antitragus", [(2, -17.5), (6, -15)], 2.8, 2.2),
    ("notch", [(-4.5, -14), (-3, -12)], 2.0, -2.0),
]


def relief(u: NDArray, v: NDArray) -> NDArray:
    """Return the height h of the ear's front at (u, v)."""
    bowl = np.hypot((u - 2.5) / 11.5, (v + 2.5) / 15.5)
    h = -7.0 / (1 + np.exp((bowl - 0.86) / 0.09))
    upper = np.hypot((u - 2.0) / 10.0, (v - 11) / 5.5)
    h -= 0.8 / (1 + np.exp((upper - 0.9) / 0.12))
    h += 1.6 * np.exp(-((u - 2) / 9) ** 2 - ((v + 29) / 8) ** 2)        # the lobe
    h -= 0.0035 * np.maximum(-u, 0) ** 2                                 # runs out into the cheek
    for _, points, width, height in RIDGES:
        h += height * np.exp(-(_distance(u, v, points) / width) ** 2)
    return h


def _distance(u, v, points) -> NDArray:
    p = np.asarray(points, dtype=np.float64)
    best = np.full(np.shape(u), np.inf)
    for a, b in pairwise(p):
        t = np.clip(((u - a[0]) * (b - a)[0] + (v - a[1]) * (b - a)[1]) / ((b - a) @ (b - a)), 0, 1)
        best = np.minimum(best, np.hypot(u - a[0] - t * (b - a)[0], v - a[1] - t * (b - a)[1]))
    return best

"""Eyelids as edge loops between the orbit's rim and the eyeball, and the eyeballs themselves.

Directions at an eye: azimuth from straight ahead toward the temple, elevation upward, degrees. Lengths mm.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from head_cage import EYE_HOLE, hole_loop, key
from numpy.typing import NDArray
from quads import Cage

from facegen.face.eye import eyeball_radius

BALL = 14.0                 # radius of the white
IRIS = 5.5                  # half the width of the iris
GAP = 0.13                  # from the ball to the lid's inner edge: a film of tears, and room for flat facets
THICKNESS = 1.7             # of a lid at its margin
RINGS = 7                   # the orbit's rim, fold, crease, lid, outer edge, inner edge, pocket behind the ball's front


@dataclass(frozen=True)
class Eye:
    """One eye. ``upper``, ``lower``: elevation of the lid margin from the inner to the outer corner."""

    sign: int                                   # +1 the subject's left
    centre: tuple[float, float, float]
    azimuth: tuple[float, ...]
    upper: tuple[float, ...]
    lower: tuple[float, ...]
    hood: float                                 # how far the fold of skin hangs over the upper lid
    bag: float                                  # how far the bag below stands out

    @property
    def origin(self) -> NDArray:
        return np.array(self.centre)

    def direction(self, azimuth: float, elevation: float) -> NDArray:
        a, e = np.radians(azimuth), np.radians(elevation)
        return np.array([self.sign * np.sin(a) * np.cos(e), np.sin(e), np.cos(a) * np.cos(e)])


AZIMUTH = (-54, -46, -37, -26, -15, -2, 11, 24, 37, 49, 59)
EYES = (
    Eye(1, (29.6, -.6, 1.7), AZIMUTH, (-11, -2, 4.5, 9, 12, 13, 12.5, 10, 5.5, -.5, -7),
        (-11, -15, -18, -19.5, -20.5, -21, -21, -20, -17.5, -13.5, -7), hood=2.8, bag=2.4),
    Eye(-1, (-29.6, -1.0, 1.7), AZIMUTH, (-11, -3.5, 1.5, 5.5, 8, 9, 8, 5, .5, -4.5, -10),
        (-11, -15, -17.5, -19, -19.5, -19.5, -19, -18, -16, -13.5, -10), hood=3.4, bag=1.9),
)


def surface_radius(directions) -> NDArray:
    """Return the eyeball's radius in directions (..., 3) of an eye that looks straight ahead."""
    d = np.asarray(directions, dtype=np.float64)
    return eyeball_radius(d[..., 2] / np.linalg.norm(d, axis=-1), radius=BALL, limbus_radius=IRIS)


def turn(a: NDArray, b: NDArray, t: float) -> NDArray:
    """Return the unit vector a fraction t of the way along the great circle from a to b."""
    angle = np.arccos(np.clip(a @ b, -1.0, 1.0))
    return (np.sin((1 - t) * angle) * a + np.sin(t * angle) * b) / np.sin(angle)


def spokes(sign: int) -> list[tuple[tuple[int, int], int, int]]:
    """Return ((row, column), i, lid) around an eye's hole: i = 0 inner .. 10 outer corner, lid 1 upper, -1 lower."""
    r0, r1, c0, c1 = EYE_HOLE
    middle = (r0 + r1) // 2
    out = []
    for r, c in hole_loop(EYE_HOLE, sign):
        a = abs(c)
        if r == middle and a in (c0, c1):
            i, lid = (0, 0) if a == c0 else (10, 0)
        else:
            lid = 1 if r > middle else -1
            i = abs(r - middle) if a == c0 else 10 - abs(r - middle) if a == c1 else 2 + (a - c0)
        out.append(((r, c), i, lid))
    return out


def add_lids(cage: Cage, eye: Eye) -> list[list]:
    """Add an eye's lid rings to the cage; return the keys of its rings, the orbit's rim first."""
    rings = [[] for _ in range(RINGS)]
    for rc, i, lid in spokes(eye.sign):
        orbit = key(*rc)
        rings[0].append(orbit)
        for k, place in enumerate(_section(eye, cage[orbit], i, lid), 1):
            name = ("eye", eye.sign, k, *rc)
            cage.vertex(name, place)
            rings[k].append(name)
    for outer, inner in pairwise(rings):
        cage.band(outer, inner)
    return rings


def _section(eye: Eye, orbit: NDArray, i: int, lid: int) -> list[NDArray]:
    """Return the places of one spoke: fold, crease, lid, outer edge, inner edge, pocket."""
    o = eye.origin
    out_length = np.linalg.norm(orbit - o)
    out = (orbit - o) / out_length
    margin = eye.direction(eye.azimuth[i], (eye.upper if lid > 0 else eye.lower)[i])
    t = i / 10
    middle = np.sin(np.pi * t) ** 0.7                   # 0 at the corners, 1 half way
    ball = surface_radius(margin)

    def at(turned: float, radius: float) -> NDArray:
        return o + turn(margin, out, turned) * radius

    def skin(turned: float) -> float:                   # a straight ramp from the lid to the orbit's rim
        return ball + THICKNESS + (out_length - ball - THICKNESS) * turned

    if lid > 0:
        hang = eye.hood * (0.35 + 0.65 * t)             # an old lid hangs lower outside
        fold = at(0.60 - 0.055 * hang * middle, skin(0.60) + 0.45 * hang * middle)
        crease = at(0.44, ball + 1.9 + 1.0 * (1 - middle))
        pretarsal = at(0.20, ball + 2.25)
    elif lid < 0:
        fold = at(0.70, skin(0.70) + eye.bag * middle)
        crease = at(0.40, skin(0.40) + 0.35 * eye.bag * middle - 0.4)
        pretarsal = at(0.15, skin(0.15) + 0.5)
    else:
        fold, crease, pretarsal = at(0.66, skin(0.66) - 0.6), at(0.36, skin(0.36) - 0.3), at(0.14, skin(0.14))
    edge = o + turn(margin, out, 0.035 if lid else 0.05) * (ball + THICKNESS - 0.25)
    behind = turn(margin, out, -0.01)                   # the pocket follows the ball up behind the lid
    hidden = eye.direction(eye.azimuth[i] * (1.0 if lid else 1.12),
                           (eye.upper[i] + 14 if lid > 0 else eye.lower[i] - 14) if lid else eye.upper[i])
    return [fold, crease, pretarsal, edge, o + behind * (ball + GAP), o + hidden * (surface_radius(hidden) + 0.3)]


def press_on_ball(places: NDArray, eye: Eye, inner_edge: NDArray, pocket: NDArray) -> None:
    """Lay the inner edges on the ball and keep everything else out of it, in place."""
    o = eye.origin
    for rows, gap in ((inner_edge, GAP), (pocket, 0.3)):
        d = places[rows] - o
        d /= np.linalg.norm(d, axis=1, keepdims=True)
        places[rows] = o + d * (surface_radius(d) + gap)[:, None]
    d = places - o
    length = np.linalg.norm(d, axis=1)
    near = length < BALL + 6
    need = surface_radius(d[near] / length[near, None]) + GAP
    push = np.maximum(need / length[near], 1.0)
    places[near] = o + d[near] * push[:, None]


# ---- the eyeball ----

AROUND = 28
RINGS_OF_BALL = (2.0, 3.9, 5.2, IRIS + 0.05, 7.0)       # distance from the axis: pupil | iris | limbus | white
BALL_ANGLES = (42, 56, 72, 90, 112, 138, 163)           # degrees from the axis: the rest of the white
MATERIALS = ("pupil", "iris", "iris", "limbus", "sclera")


def eyeball(eye: Eye) -> tuple[NDArray, list[tuple[int, ...]], list[str]]:
    """Return (vertices, faces, materials) of an eyeball that looks straight ahead."""
    angles = []
    for across in RINGS_OF_BALL:                        # the angle at which the surface is so far from the axis
        a = np.linspace(0.0, 1.0, 4000)
        angles.append(float(np.interp(across, np.sin(a) * _radius(a), a)))
    angles += [np.radians(a) for a in BALL_ANGLES]
    turn_by = 2 * np.pi * np.arange(AROUND) / AROUND
    vertices = [eye.origin + np.array([0, 0, _radius(0.0)])]
    for a in angles:
        r = _radius(a)
        for b in turn_by:
            vertices.append(eye.origin + r * np.array([np.sin(a) * np.cos(b), np.sin(a) * np.sin(b), np.cos(a)]))
    vertices.append(eye.origin - np.array([0, 0, BALL]))
    faces, materials = [], []
    for j in range(AROUND):
        k = (j + 1) % AROUND
        faces.append((0, 1 + j, 1 + k))
        materials.append("pupil")
        for ring in range(len(angles) - 1):
            a, b = 1 + ring * AROUND, 1 + (ring + 1) * AROUND
            faces.append((a + j, b + j, b + k, a + k))
            materials.append(MATERIALS[ring + 1] if ring + 1 < len(MATERIALS) else "sclera")
        last = 1 + (len(angles) - 1) * AROUND
        faces.append((last + j, len(vertices) - 1, last + k))
        materials.append("sclera")
    return np.array(vertices), faces, materials


def _radius(angle):
    return eyeball_radius(np.cos(angle), radius=BALL, limbus_radius=IRIS)

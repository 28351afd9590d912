"""What is not skin: teeth with gums, tongue, the mouth's lining, brows, a fringe of white hair.

Every function returns a Part: vertices (n, 3) in millimetres, faces, a material for each face.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from head_cage import VIEW_CENTRE
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.spatial import cKDTree


@dataclass
class Part:
    """A named object."""

    name: str
    vertices: NDArray = field(default_factory=lambda: np.empty((0, 3)))
    faces: list[tuple[int, ...]] = field(default_factory=list)
    materials: list[str] = field(default_factory=list)

    def add(self, vertices, faces, material) -> None:
        """Append vertices and the faces among them; ``material``: one name, or one a face."""
        first = len(self.vertices)
        self.vertices = np.concatenate([self.vertices, np.asarray(vertices, dtype=np.float64)])
        self.faces += [tuple(first + i for i in f) for f in faces]
        self.materials += [material] * len(faces) if isinstance(material, str) else list(material)


def tube(sections: NDArray, *, caps: tuple[bool, bool]) -> tuple[NDArray, list]:
    """Return (vertices, faces) of closed sections (s, n, 3) joined to a tube; a cap is a fan around its middle.

    Outward if a section runs counter-clockwise seen from the end that the tube starts at.
    """
    count, n, _ = sections.shape
    vertices, faces = list(sections.reshape(-1, 3)), []
    for a in range(count - 1):
        for i in range(n):
            j = (i + 1) % n
            faces.append((a * n + i, (a + 1) * n + i, (a + 1) * n + j, a * n + j))
    for which, wanted in enumerate(caps):
        if wanted:
            row = 0 if which == 0 else count - 1
            vertices.append(sections[row].mean(axis=0))
            for i in range(n):
                j = (i + 1) % n
                a, b = (i, j) if which == 0 else (j, i)
                faces.append((row * n + a, row * n + b, len(vertices) - 1))
    return np.array(vertices), faces


# ---- teeth ----

TEETH = (8.4, 6.8, 7.4, 6.8, 6.8, 9.0)          # widths from the middle to the first molar
ARCH_WIDTH, ARCH_DEPTH, ARCH_BACK = 26.0, 36.0, -16.0
# outward, up; the first and last rows lie in the gum
UPPER = [(.4, -53.6), (1.0, -57), (.8, -61), (1.1, -65.5), (.3, -71), (-1.2, -70.8), (-3.6, -65), (-4.6, -59), (-3.2, -53.6)]
LOWER = [(-3.0, -83), (-4.2, -79), (-3.2, -75), (-1.4, -69.6), (-.2, -69.4), (.6, -73.5), (.3, -78), (.9, -81), (.6, -83.5)]
GUM_ROWS = {"teeth_upper": (0, 1, 7, 8), "teeth_lower": (0, 1, 7, 8)}


def teeth(name: str) -> Part:
    """Return one row of twelve teeth with its gum."""
    upper = name == "teeth_upper"
    profile = np.array(UPPER if upper else LOWER, dtype=np.float64)
    back = 0.0 if upper else 2.4                         # the lower teeth bite behind the upper ones
    width = np.array(TEETH) * (1.0 if upper else 0.94)
    borders = np.concatenate([[0], np.cumsum(width)])
    places = [(b, 1.0) for b in borders]
    places += [(borders[i] + f * width[i], 0.0) for i in range(len(width)) for f in (.22, .78)]
    places = sorted({(s * x, w) for x, w in places for s in (-1, 1)})
    angle = np.linspace(-np.pi / 2, np.pi / 2, 3000)
    arch = np.column_stack([(ARCH_WIDTH - back) * np.sin(angle), ARCH_BACK - back + ARCH_DEPTH * np.cos(angle)])
    length = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(arch, axis=0), axis=1))])
    length -= length[-1] / 2
    sections = []
    for along, border in places:
        x, z = (np.interp(along, length, arch[:, k]) for k in (0, 1))
        a = np.interp(along, length, angle)
        outward = np.array([np.sin(a) / ARCH_WIDTH, 0, np.cos(a) / ARCH_DEPTH])
        outward /= np.linalg.norm(outward)
        o, y = profile.T.copy()
        edge, line = ((4, 5), (2, 6)) if upper else ((3, 4), (2, 6))
        o -= border * np.where(np.isin(np.arange(9), (3, 4, 5, 6) if upper else (2, 3, 4, 5)), .45 * np.sign(o + .8), 0)
        shorter = 0.9 * border + 1.6 * (abs(along) / 45) ** 2
        y[list(edge)] += shorter if upper else -shorter
        y[list(line)] += (-1.1 if upper else 1.1) * border
        sections.append(np.array([x, 0, z]) + o[:, None] * outward + y[:, None] * [0, 1, 0])
    vertices, faces = tube(np.array(sections)[::-1], caps=(True, True))
    gum = set(GUM_ROWS[name])
    part = Part(name)
    part.add(vertices, faces, ["gums" if all(i >= len(sections) * 9 or i % 9 in gum for i in f) else "teeth" for f in faces])
    part.materials = ["gums" if m == "teeth" and _mostly(f, gum) else m for f, m in zip(part.faces, part.materials, strict=True)]
    return part


def _mostly(face, gum) -> bool:
    """Is a face of the quad strip between a gum row and the tooth's neck?"""
    rows = {i % 9 for i in face}
    return len(face) == 4 and rows in ({1, 2}, {6, 7})


# ---- tongue and lining ----

TONGUE = [  # z, y of the middle, half width, half height
    (9.5, -74.2, 5.5, 1.6), (7, -73.6, 10, 3.0), (1, -72.6, 14.5, 4.8), (-8, -71.8, 17, 6.5), (-18, -71.6, 18, 7.5),
    (-28, -72.5, 17.5, 8.0), (-37, -73.5, 15, 7.5), (-43, -74.5, 11.5, 6.0)]


def tongue() -> Part:
    """Return the tongue, tip in front."""
    around = 2 * np.pi * np.arange(12) / 12
    sections = []
    for z, y, w, h in TONGUE:
        groove = -0.16 * h * np.exp(-(np.cos(around) / .35) ** 2) * (np.sin(around) > 0)
        sections.append(np.column_stack([w * np.cos(around), y + h * np.sin(around) + groove, np.full(12, z)]))
    part = Part("tongue")
    part.add(*tube(np.array(sections), caps=(True, True)), "tongue")
    return part


LINING = [  # z, bend back toward the corners, half width, up, down
    (22.6, 14.5, 29.5, 13.6, 13.2), (22.2, 14, 31.0, 18.8, 15), (12, 6, 32.5, 20.5, 16.5), (-9, 2, 33, 20.5, 17),
    (-30, 0, 29, 18, 16), (-46, 0, 19, 13, 12), (-52, 0, 9, 6, 6)]
MOUTH_MIDDLE = -70.0


def lining() -> Part:
    """Return the bag behind the lips, seen from inside; its rim lies behind the pockets of the lips."""
    n = 28
    around = 2 * np.pi * np.arange(n) / n
    c, s = (np.sign(t) * np.abs(t) ** 0.55 for t in (np.cos(around), np.sin(around)))
    sections = []
    for z, bend, w, up, down in LINING:
        sections.append(np.column_stack([w * c, MOUTH_MIDDLE + np.where(s > 0, up, down) * s, z - bend * c**2]))
    vertices, faces = tube(np.array(sections), caps=(False, True))
    part = Part("mouth")
    part.add(vertices, [f[::-1] for f in faces], "mouth")
    return part


# ---- brows ----

BROWS = {  # the middle of the hair, from inside outward: x, y seen from the front
    1: [(8.5, 13.4), (15, 15.8), (24, 18.2), (33, 19.4), (42, 17.4), (50, 11.6)],
    -1: [(-8.0, 12.6), (-15, 14.2), (-24, 15.4), (-33, 15.6), (-42, 12.8), (-50, 6.6)]}
BROW_HALF = (2.0, 3.4, 3.8, 3.5, 2.6, 0.9)
TUFTS = 44


def brows(skin: NDArray, normals: NDArray, rng) -> Part:
    """Return both bushy brows."""
    part = Part("brows")
    for sign in (1, -1):
        _add_brow(part, sign, skin, normals, rng)
    return part


def _add_brow(part: Part, sign: int, skin: NDArray, normals: NDArray, rng) -> None:
    """Add one brow: a thin mat on the skin with tufts of hair growing out of it."""
    front = np.flatnonzero((normals[:, 2] > 0.1) & (skin[:, 2] > -20))
    tree = cKDTree(skin[front, :2])
    points = np.array(BROWS[sign], dtype=np.float64)
    t = np.arange(len(points))
    line, half = CubicSpline(t, points), CubicSpline(t, BROW_HALF)

    def lift(xy):
        d, i = tree.query(xy, k=6)
        w = 1 / (d + .3) ** 2
        w /= w.sum(axis=-1, keepdims=True)
        z = (w * skin[front, 2][i]).sum(axis=-1)
        n = (w[..., None] * normals[front][i]).sum(axis=-2)
        return np.concatenate([xy, z[..., None]], axis=-1), n / np.linalg.norm(n, axis=-1, keepdims=True)

    along, across = np.linspace(0, t[-1], 17), np.linspace(-1, 1, 5)
    tangent = line(along, 1)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    upward = np.column_stack([-tangent[:, 1], tangent[:, 0]]) * sign
    ragged = 1 + .12 * rng.standard_normal((17, 1))
    xy = line(along)[:, None] + (half(along)[:, None] * across * ragged)[..., None] * upward[:, None]
    place, normal = lift(xy)
    end = np.sin(np.pi * np.linspace(0.04, 0.97, 17)) ** .4
    height = 0.25 + 0.9 * (1 - across**2)[None, :] * end[:, None]
    mat = place + height[..., None] * normal
    faces = []
    for a in range(16):
        for b in range(4):
            q = (a * 5 + b, (a + 1) * 5 + b, (a + 1) * 5 + b + 1, a * 5 + b + 1)
            faces.append(q if sign > 0 else q[::-1])
    part.add(mat.reshape(-1, 3), faces, "brows_white")
    for i in range(TUFTS):
        s = t[-1] * (i + .5) / TUFTS
        side = ((i * 0.618) % 1.0 - .55) * 1.7
        tan = line(s, 1) / np.linalg.norm(line(s, 1))
        up = np.array([-tan[1], tan[0]]) * sign
        root, n = lift(line(s) + side * half(s) * up)
        fan = 1 - s / t[-1]                              # inner hairs stand up, outer ones lie along the brow
        out = np.append(tan, 0) * (.55 + .9 * (1 - fan)) + np.append(up, 0) * (.7 * fan + .05 - .5 * side) + .75 * n
        out += .18 * rng.standard_normal(3)
        out /= np.linalg.norm(out)
        part.add(*_tuft(root + .3 * n, out, n, length=4.8 + 2.6 * rng.random(), width=.8), "brows_white")


def _tuft(root, out, normal, *, length: float, width: float) -> tuple[NDArray, list]:
    """Return a three-sided spike that bends back toward the skin."""
    side = np.cross(out, normal)
    side /= np.linalg.norm(side)
    over = np.cross(side, out)
    ring = [np.cos(a) * side + .7 * np.sin(a) * over for a in (np.pi / 2, np.pi * 7 / 6, np.pi * 11 / 6)]
    middle = root + .55 * length * out
    tip = root + length * out - .16 * length * normal
    vertices = [root + width * r for r in ring] + [middle + .75 * width * r for r in ring] + [tip]
    faces = []
    for i in range(3):
        j = (i + 1) % 3
        faces += [(i, j, 3 + j, 3 + i), (3 + i, 3 + j, 6)]
    v = np.array(vertices)
    a, b, c = v[0], v[1], v[4]
    if np.dot(np.cross(b - a, c - a), (a + b) / 2 - root) < 0:
        faces = [f[::-1] for f in faces]
    return v, faces


# ---- the fringe of hair ----

FRINGE = [  # degrees from the face to the back, lowest and highest elevation as seen from VIEW_CENTRE
    (66, 30, 36), (72, 16, 43), (77, 6, 47), (82, 14, 49), (88, 25, 50), (95, 26, 50), (102, 22, 49), (109, 6, 48),
    (118, -16, 46), (132, -30, 43), (150, -35, 40), (180, -37, 37)]
FRINGE_AROUND, FRINGE_UP = 58, 9
HAIR_THICKNESS = 4.2


def fringe(skin: NDArray, rng) -> Part:
    """Return the hair that runs around the bald head from temple to temple; ``skin``: places without the ears."""
    rays = skin - VIEW_CENTRE
    radius = np.linalg.norm(rays, axis=1)
    tree = cKDTree(rays / radius[:, None])
    table = np.array(FRINGE, dtype=np.float64)
    azimuth = np.linspace(table[0, 0], 360 - table[0, 0], FRINGE_AROUND + 1)
    low, high = (np.interp(np.minimum(azimuth, 360 - azimuth), table[:, 0], table[:, k]) for k in (1, 2))
    high = high + 1.2 * rng.standard_normal(len(high))
    low = low + 1.2 * rng.standard_normal(len(low))
    t = np.linspace(0, 1, FRINGE_UP + 1)
    a = np.radians(azimuth)[:, None] + 0 * t
    e = np.radians(low[:, None] * (1 - t) + high[:, None] * t)
    d = np.stack([np.sin(a) * np.cos(e), np.sin(e), np.cos(a) * np.cos(e)], axis=-1)
    gap, i = tree.query(d, k=8)
    w = 1 / (gap + .01) ** 2
    r = (w * radius[i]).sum(axis=-1) / w.sum(axis=-1)
    edge = np.minimum(np.minimum(t, 1 - t)[None, :] * 4, np.minimum(np.arange(len(a)), np.arange(len(a))[::-1])[:, None] / 3)
    body = np.minimum(edge, 1.0) ** .6
    waves = np.sin(a * 37 + 5 * e) + .7 * np.sin(a * 23 - 9 * e + 1) + .5 * rng.standard_normal((len(a), 1))
    r = r - .5 + body * (HAIR_THICKNESS * (1 - .35 * t) + .55 * waves)
    part = Part("hair")
    n = FRINGE_UP + 1
    faces = [(k * n + j, (k + 1) * n + j, (k + 1) * n + j + 1, k * n + j + 1)
             for k in range(FRINGE_AROUND) for j in range(FRINGE_UP)]
    part.add((VIEW_CENTRE + d * r[..., None]).reshape(-1, 3), faces, "hair_white")
    return part

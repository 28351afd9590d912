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
ARCH_WIDTH, ARCH_DEPTH, ARCH_BACK = 29.5, 37.5, -16.0
ARCH_POWER = 2.6     # of the superellipse: fuller than an ellipse, so that the side teeth stand close behind the lips
# outward, up; the first and last rows lie in the gum
UPPER = [(.4, -53.6), (1.0, -57), (.8, -61), (1.1, -65.5), (.3, -71), (-1.2, -70.8), (-3.6, -65), (-4.6, -59), (-3.2, -53.6)]
LOWER = [(-3.4, -82.2), (-4.2, -79), (-3.2, -75), (-1.4, -69.6), (-.2, -69.4), (.6, -73.5), (.3, -77.5), (-1.0, -80), (-2.4, -82.2)]
GUM_ROWS = {"teeth_upper": (0, 1, 7, 8), "teeth_lower": (0, 1, 7, 8)}


def teeth(name: str) -> Part:
    """Return one row of twelve teeth with its gum."""
    upper = name == "teeth_upper"
    profile = np.array(UPPER if upper else LOWER, dtype=np.float64)
    back = 0.0 if upper else 2.1                         # the lower teeth bite behind the upper ones
    width = np.array(TEETH) * (1.0 if upper else 0.94)
    borders = np.concatenate([[0], np.cumsum(width)])
    places = [(b, 1.0) for b in borders]
    places += [(borders[i] + f * width[i], 0.0) for i in range(len(width)) for f in (.22, .78)]
    places = sorted({(s * x, w) for x, w in places for s in (-1, 1)})
    angle = np.linspace(-np.pi / 2, np.pi / 2, 3000)
    sine, cosine = np.sin(angle), np.cos(angle)
    fuller = 2 / ARCH_POWER
    arch = np.column_stack([(ARCH_WIDTH - back) * np.sign(sine) * np.abs(sine) ** fuller,
                            ARCH_BACK - back + ARCH_DEPTH * cosine**fuller])
    length = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(arch, axis=0), axis=1))])
    length -= length[-1] / 2
    sections = []
    for along, border in places:
        x, z = (np.interp(along, length, arch[:, k]) for k in (0, 1))
        si, co = np.sin(a := np.interp(along, length, angle)), np.cos(a)
        outward = np.array([np.sign(si) * abs(si) ** (2 - fuller) / ARCH_WIDTH, 0, co ** (2 - fuller) / ARCH_DEPTH])
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


LINING = [  # z, bend back toward the corners, half width, up, down, and how far its floor lies back and in
    (24.0, 15.0, 29.5, 13.6, 7.0, 2.0), (23.6, 14.5, 29.6, 18.8, 13.4, 4.4), (12, 6, 30.6, 20.5, 16.0, 2.0),
    (-9, 2, 33, 20.5, 17, 0), (-30, 0, 29, 18, 16, 0), (-46, 0, 19, 13, 12, 0), (-52, 0, 9, 6, 6, 0)]
MOUTH_MIDDLE = -70.0


def lining() -> Part:
    """Return the bag behind the lips, seen from inside; its rim lies behind the pockets of the lips."""
    n = 28
    around = 2 * np.pi * np.arange(n) / n
    c, s = (np.sign(t) * np.abs(t) ** 0.55 for t in (np.cos(around), np.sin(around)))
    sections = []
    for z, bend, w, up, down, back in LINING:
        floor = np.maximum(-s, 0.0)                      # clear of the fold below the lip, and of the folds beside it
        sections.append(np.column_stack([(w - 0.5 * back * floor) * c, MOUTH_MIDDLE + np.where(s > 0, up, down) * s,
                                         z - bend * np.abs(c) ** 2.5 - back * floor]))
    vertices, faces = tube(np.array(sections), caps=(False, True))
    part = Part("mouth")
    part.add(vertices, [f[::-1] for f in faces], ["cheeks" if max(f) < 3 * n else "mouth" for f in faces])
    return part


# ---- brows ----

BROWS = {  # the middle of the hair, from inside outward: x, y seen from the front
    1: [(8.5, 13.4), (15, 15.8), (24, 18.2), (33, 19.4), (42, 17.4), (50, 11.6)],
    -1: [(-8.0, 12.6), (-15, 14.2), (-24, 15.4), (-33, 15.6), (-42, 12.8), (-50, 6.6)]}
BROW_HALF = (2.4, 4.0, 4.4, 4.1, 3.1, 1.3)
BROW_BULK = 2.6                  # height of the hair over the skin
TUFTS = 11                       # a brow
TUFT = (                         # columns of a tuft: how high they lie, how far they reach beyond the upper and the lower edge
    (.42, .02, .0, "brows_grey"), (.85, .14, .06, "brows_white"), (1.0, .36, .16, "brows_white"),
    (.72, .18, .08, "brows_white"))
ACROSS = np.array([-1, -.72, -.36, 0, .36, .72, 1])


def brows(skin: NDArray, normals: NDArray, rng) -> Part:
    """Return both bushy brows."""
    part = Part("brows")
    for sign in (1, -1):
        _add_brow(part, sign, skin, normals, rng)
    return part


def _add_brow(part: Part, sign: int, skin: NDArray, normals: NDArray, rng) -> None:
    """Add one brow: a thick mat that is combed into broad tufts, which overlap and end raggedly."""
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

    count = TUFTS * len(TUFT) + 1
    height, above, below, names = zip(*(TUFT[k % len(TUFT)] for k in range(count)), strict=True)
    vigour = np.repeat(rng.uniform(.6, 1.3, TUFTS + 1), len(TUFT))[:count]
    share = np.linspace(0, 1, count)
    lean = .16 + .5 * share                              # inner hairs stand up, outer ones lie along the brow
    lean *= np.minimum(1.0, 4 * (1 - share))
    s = np.clip(t[-1] * share[:, None] + lean[:, None] * ACROSS, 0, t[-1])
    reach = np.where(ACROSS > 0, np.outer(vigour * above, ACROSS**2), np.outer(vigour * below, ACROSS**2))
    tangent = line(s, 1)
    tangent /= np.linalg.norm(tangent, axis=-1, keepdims=True)
    upward = np.stack([-tangent[..., 1], tangent[..., 0]], axis=-1) * sign
    place, normal = lift(line(s) + (half(s) * ACROSS * (1 + reach))[..., None] * upward)
    end = np.sin(np.pi * np.linspace(0.05, 0.97, count)) ** .4
    bulk = BROW_BULK * np.outer(end * np.array(height), (1 - ACROSS**2) ** .6)
    mat = place + (bulk - .3)[..., None] * normal        # its edge is in the skin
    n = len(ACROSS)
    faces, materials = [], []
    for a in range(count - 1):
        for b in range(n - 1):
            q = (a * n + b, (a + 1) * n + b, (a + 1) * n + b + 1, a * n + b + 1)
            faces.append(q if sign > 0 else q[::-1])
            materials.append(names[a])
    part.add(mat.reshape(-1, 3), faces, materials)


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

"""The separate pieces of the cartoon character: eyeballs, brows, moustache, cap, hair, collar, teeth and tongue.

Each is a closed shell but the eyeballs' highlights and the collar; all are built from rings of vertices.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from author_head import EYE, EYE_RADIUS, LID_GAP, MIRROR, MOUTH, face_shape, front, head_shape, onto
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass
class Piece:
    """One object of the file: vertices (n, 3) and polygons with a material each."""

    name: str
    points: list[Array] = field(default_factory=list)
    faces: list[tuple[int, ...]] = field(default_factory=list)
    materials: list[str] = field(default_factory=list)
    front: int = 0                             # the foremost vertex of an eyeball

    def add(self, points) -> list[int]:
        """Append points (k, 3) and return their indices."""
        first = len(self.points)
        self.points.extend(np.asarray(points, float).reshape(-1, 3))
        return list(range(first, len(self.points)))

    def tube(self, rings: Sequence[Array], materials: str | Sequence[str], *, tips: tuple = (None, None)) -> list:
        """Join rings that run clockwise seen along the way from the first to the last; ``tips`` close the ends."""
        rows = [self.add(ring) for ring in rings]
        names = [materials] * (len(rows) - 1) if isinstance(materials, str) else list(materials)
        for a, b, name in zip(rows, rows[1:], names, strict=False):
            n = len(a)
            for i in range(n):
                self._face((a[i], b[i], b[(i + 1) % n], a[(i + 1) % n]), name)
        for row, tip, flip, name in ((rows[0], tips[0], False, names[0]), (rows[-1], tips[1], True, names[-1])):
            if tip is not None:
                top = self.add([tip])[0]
                for i, j in zip(row, row[1:] + row[:1], strict=True):
                    self._face((j, i, top)[::-1] if not flip else (j, i, top), name)
        return rows

    def _face(self, face: tuple[int, ...], material: str) -> None:
        self.faces.append(face)
        self.materials.append(material)

    def outwards(self) -> Piece:
        """Return the piece with its shell turned so that it encloses a positive volume."""
        p = np.array(self.points)
        volume = sum(np.dot(p[f[0]], np.cross(p[f[i]], p[f[i + 1]])) for f in self.faces for i in range(1, len(f) - 1))
        if volume < 0:
            self.faces = [face[::-1] for face in self.faces]
        return self


def _circle(n: int, start: float = 0.0) -> tuple[Array, Array]:
    angle = start + 2 * np.pi * np.arange(n) / n
    return np.cos(angle), np.sin(angle)


def eye(side: str) -> Piece:
    """Return an eyeball that looks straight ahead: pupil, iris, its dark rim, the white, two highlights."""
    piece = Piece(f"eye_{side}")
    n = 24
    c, s = _circle(n)
    angles = np.radians([12.5, 14.0, 25.0, 28.5, 40.0, 55.0, 72.0, 92.0, 115.0, 145.0])
    rings = [np.stack([np.sin(t) * c, np.sin(t) * s, np.full(n, np.cos(t))], axis=1) for t in angles]
    names = ["pupil", "iris", "limbus"] + ["sclera"] * 6
    piece.tube([EYE + EYE_RADIUS * ring for ring in rings], names,
               tips=(EYE + [0.0, 0.0, EYE_RADIUS], EYE - [0.0, 0.0, EYE_RADIUS]))
    piece.front = n * len(rings)
    for side_turn, up_turn, size in ((-11.0, 12.0, 6.2), (11.0, -11.0, 2.8)):          # highlights, from the viewer's left
        yaw, pitch = np.radians(side_turn), np.radians(up_turn)
        forward = np.array([np.sin(yaw) * np.cos(pitch), np.sin(pitch), np.cos(yaw) * np.cos(pitch)])
        right = np.cross([0.0, 1.0, 0.0], forward)
        right /= np.linalg.norm(right)
        up = np.cross(forward, right)
        c8, s8 = _circle(10)
        t = np.radians(size)
        rim = np.cos(t) * forward + np.sin(t) * (c8[:, None] * right + s8[:, None] * up)
        height = EYE_RADIUS + 0.55 * LID_GAP                                          # before the ball, behind the lids
        row = piece.add(EYE + height * rim)
        top = piece.add([EYE + height * forward])[0]
        for i, j in zip(row, row[1:] + row[:1], strict=True):
            piece._face((i, j, top), "highlight")
    if side == "R":                                                # both mirror the same window: only the place changes
        piece.points = [point - [2 * EYE[0], 0.0, 0.0] for point in piece.points]
    return piece


def _swept(path: Array, across: Array, ahead: Array, wide: Array, thick: Array, n: int) -> list[Array]:
    """Return rings round a path (k, 3) with half axes ``wide`` along ``across`` and ``thick`` along ``ahead``."""
    c, s = _circle(n)
    return [p + w * c[:, None] * a + t * s[:, None] * h
            for p, a, h, w, t in zip(path, across, ahead, wide, thick, strict=True)]


def _above(points: Array, lift) -> Array:
    """Return points moved to a height over the head."""
    return onto(points, lambda p: head_shape(p) - lift)


def _on_face(x: Array, y: Array, lift) -> tuple[Array, Array, Array, Array]:
    """Return places before the face at (x, y), and there the unit vectors along the path, across it, off the face."""
    h = 1e-3
    base = np.stack([x, y, front(x, y, face_shape)], axis=1)
    slope = np.stack([(face_shape(base + h * e) - face_shape(base - h * e)) / (2 * h) for e in np.eye(3)], axis=1)
    normal = slope / np.linalg.norm(slope, axis=1, keepdims=True)
    path = base + np.reshape(lift, (-1, 1)) * normal
    along = np.gradient(path, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    across = np.cross(normal, along)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    return path, along, across, np.cross(along, across)


def brow_place(t, side: str):
    """Return (x, y) along a brow, 0 its inner end, on the left; the right one is a little higher."""
    up = 0.0 if side == "L" else 0.022
    return 0.15 + 0.50 * t, 0.50 + up + 0.075 * np.sin(np.pi * (0.10 + 0.80 * t)) - 0.09 * t**1.5


def brow(side: str) -> Piece:
    """Return a thick brow."""
    t = np.linspace(0.0, 1.0, 9)
    x, y = brow_place(t, side)
    path, along, across, ahead = _on_face(x, y, 0.03)
    wide = 0.072 * np.sin(np.pi * (0.16 + 0.76 * t)) ** 0.7 * (1.08 - 0.35 * t)
    piece = Piece(f"brow_{side}")
    piece.tube(_swept(path, across, ahead, wide, 0.62 * wide, 8), "brows",
               tips=(path[0] - 0.03 * along[0], path[-1] + 0.035 * along[-1]))
    if side == "R":
        piece.points = [point * MIRROR for point in piece.points]
    return piece.outwards()


def moustache() -> Piece:
    """Return a handlebar moustache: two lobes that meet under the nose and curl up at their ends."""
    t = np.linspace(-1.0, 1.0, 21)
    a = np.abs(t)
    x = np.sign(t) * (0.46 * a**0.95 - 0.04 * np.maximum(a - 0.72, 0.0) / 0.28)
    y = -0.39 - 0.055 * np.sin(np.pi * np.minimum(a / 0.75, 1.0)) + 0.235 * np.maximum(a - 0.42, 0.0) ** 1.6 / 0.58**1.6
    wide = 0.10 * np.interp(a, [0.0, 0.12, 0.3, 0.5, 0.75, 0.9, 1.0], [0.62, 0.88, 1.0, 0.90, 0.52, 0.30, 0.14])
    path, along, across, ahead = _on_face(x, y, 0.04 + 0.30 * wide + 0.05 * np.maximum(a - 0.7, 0.0))
    piece = Piece("moustache")
    rings = _swept(path, across, ahead, wide, 0.72 * wide, 8)
    piece.tube(rings, "moustache", tips=(path[0] - 0.02 * along[0], path[-1] + 0.02 * along[-1]))
    return piece.outwards()


# ---- what the head wears ----
CAP_TURN = np.radians(np.array([-6.0, -7.0, -9.0]))         # nodded back, turned and tilted to the right ear


def _askew(points: Array, pivot=(0.0, 0.18, -0.08)) -> Array:
    """Return points turned the way the cap sits on the head."""
    (a, b, c) = CAP_TURN
    x = np.array([[1, 0, 0], [0, np.cos(a), -np.sin(a)], [0, np.sin(a), np.cos(a)]])
    y = np.array([[np.cos(b), 0, np.sin(b)], [0, 1, 0], [-np.sin(b), 0, np.cos(b)]])
    z = np.array([[np.cos(c), -np.sin(c), 0], [np.sin(c), np.cos(c), 0], [0, 0, 1]])
    return (np.asarray(points, float) - pivot) @ (z @ y @ x).T + pivot


def cap() -> Piece:
    """Return a flat cap, askew: a band, a soft crown that hangs over it, a visor and a button."""
    piece = Piece("cap")
    n = 32
    c, s = _circle(n)                                         # s > 0 is the front
    # (height, half width, half length, shift forwards): inside of the band, band, crown
    rows = [(0.72, 0.66, 0.66, -0.07), (0.635, 0.725, 0.73, -0.07), (0.625, 0.77, 0.775, -0.07), (0.72, 0.775, 0.78, -0.07),
            (0.755, 0.87, 0.88, -0.06), (0.85, 0.955, 0.99, -0.05), (0.97, 0.91, 0.94, -0.06), (1.07, 0.71, 0.74, -0.08),
            (1.12, 0.42, 0.44, -0.10), (1.14, 0.15, 0.155, -0.10)]
    rings = []
    for number, (high, wide, long, shift) in enumerate(rows):
        soft = 0.016 * np.cos(8 * np.arctan2(s, c)) * (number in (4, 5, 6))            # the seams of its eight panels
        sag = -0.05 * s * (number >= 4)                                                # it leans forward
        rings.append(np.stack([(wide - soft) * c, high + sag, shift + (long - soft) * s], axis=1))
    rings = [_askew(ring) for ring in rings]
    behind = 0.5 - 0.5 * s                                                             # room for the hair
    for number, lift in enumerate((0.03, 0.035, 0.07, 0.075)):
        rings[number] = _above(rings[number], lift + 0.055 * np.minimum(2.0 * behind, 1.0))
    piece.tube(rings, ["cap_band"] * 3 + ["cap"] * 6, tips=(None, _askew([[0, 1.142, -0.10]])[0]))
    piece = piece.outwards()
    return piece


def button() -> Piece:
    """Return the button on the cap."""
    c, s = _circle(10)
    piece = Piece("cap")
    rings = [np.stack([r * c, np.full(10, h), -0.10 + r * s], axis=1) for r, h in ((0.06, 1.12), (0.08, 1.16), (0.05, 1.195))]
    piece.tube([_askew(ring) for ring in rings], "cap_band", tips=(_askew([[0, 1.11, -0.1]])[0], _askew([[0, 1.203, -0.1]])[0]))
    return piece.outwards()


def visor() -> Piece:
    """Return the cap's visor: a thick crescent, bent down a little."""
    piece = Piece("cap")
    angle = np.radians(np.linspace(-60.0, 60.0, 15))
    rings = []
    for t in angle:
        reach = 0.12 + 0.88 * np.cos(t * 90.0 / 64.0) ** 0.75
        out = np.array([np.sin(t), 0.0, np.cos(t)])
        root = np.array([0.77 * out[0], 0.675, -0.055 + 0.775 * out[2]])
        edge = root + reach * (0.13 * out + [0.0, -0.05, 0.24]) - [0.0, 0.06 * np.sin(t) ** 2, 0.0]
        middle = (root + edge) / 2 + [0.0, 0.03 * reach, 0.0]
        thick = np.array([0.0, 0.026, 0.0])
        ring = _askew([root + thick, middle + thick, edge + 0.8 * thick, edge + 0.02 * reach * out, edge - 0.8 * thick,
                       middle - thick, root - thick])
        rings.append(ring + _above(_askew([root]), 0.055) - _askew([root]))        # its root lies on the band
    piece.tube(rings, "cap_band", tips=(rings[0].mean(axis=0), rings[-1].mean(axis=0)))
    return piece.outwards()


def hair() -> Piece:
    """Return the hair below the cap, from ear to ear round the back of the head, its lower edge in tufts."""
    piece = Piece("hair")
    half = np.radians([56, 59, 63, 67, 71, 75, 80, 88, 97, 106, 115, 124, 134, 145, 156, 168, 180])
    around = np.concatenate([half, 2 * np.pi - half[-2::-1]])
    # lower edge by angle: a sideburn before the ear, over the ear, down to the nape; in tufts
    edge = np.interp(half, np.radians([56, 59, 63, 67, 71, 75, 80, 106, 115, 124, 134, 180]),
                     [0.52, 0.40, 0.17, 0.08, 0.04, 0.10, 0.41, 0.42, 0.20, 0.02, -0.14, -0.34])
    edge = edge - 0.05 * (np.arange(len(half)) % 2) * (half > np.radians(110))
    edge = np.concatenate([edge, edge[-2::-1]])
    rows = []
    for u, lift in ((0.0, -0.012), (0.05, 0.035), (0.35, 0.06), (0.70, 0.06), (1.0, 0.045)):
        y = edge + u * (0.68 - edge)
        start = np.stack([0.7 * np.sin(around), y, -0.08 + 0.7 * np.cos(around)], axis=1)
        lift = np.where(around == around.clip(half[1], 2 * np.pi - half[1]), lift, -0.012)   # ends in the skin
        rows.append(piece.add(_above(start, lift)))
    for a, b in zip(rows, rows[1:], strict=False):
        for i in range(len(a) - 1):
            piece._face((a[i], a[i + 1], b[i + 1], b[i]), "hair")
    return piece


def collar() -> Piece:
    """Return the rolled collar of a jersey, ribbed, in which the neck ends."""
    piece = Piece("collar")
    n = 28
    angle = 2 * np.pi * np.arange(n) / n
    # (height, radius): inside top, over the roll, down to the shoulders, and under
    rows = [(-1.16, 0.335), (-1.06, 0.36), (-1.035, 0.415), (-1.07, 0.475), (-1.15, 0.49), (-1.235, 0.46), (-1.25, 0.50), (-1.30, 0.60), (-1.36, 0.66)]
    rings = []
    for number, (high, radius) in enumerate(rows):
        rib = 0.012 * (-1.0) ** np.arange(n) * (1 <= number <= 5)
        r = radius + rib
        rings.append(np.stack([r * np.sin(angle), high - 0.03 * np.cos(angle), -0.085 + r * np.cos(angle) * 0.97], axis=1))
    piece.tube(rings, "collar")
    return piece


# ---- inside the mouth ----
def teeth(row: str) -> Piece:
    """Return a row of big teeth with its gum: four a side, with a gap between the upper two in the middle."""
    upper = row == "upper"
    up = 1.0 if upper else -1.0
    # half width and depth of the arch, how far behind the face, height of the cutting edge
    half, deep, behind, edge = (0.215, 0.20, 0.125, MOUTH - 0.022) if upper else (0.180, 0.165, 0.165, MOUTH - 0.040)
    z0 = float(front(0.0, MOUTH)) - behind
    bounds = 0.45 * np.pi * np.array([0.0, 0.30, 0.55, 0.78, 1.0])
    side = [(0.0, 1.0)]                                              # (angle, how deep the notch there is, 0 on a tooth)
    for a, b in zip(bounds, bounds[1:], strict=False):
        side += [(a + 0.16 * (b - a), 0.0), (b - 0.16 * (b - a), 0.0), (b, 1.0)]
    stations = [(-t, d) for t, d in side[:0:-1]] + side
    rings = []
    for t, notch in stations:
        out = np.array([np.sin(t), 0.0, np.cos(t)])
        spot = np.array([half * np.sin(t), edge, z0 - deep * (1.0 - np.cos(t))])
        bare = 0.055 if upper and t == 0.0 else 0.012                # how much of the edge a notch takes
        thick = 0.032 - 0.010 * notch
        tall = 0.125 if upper else 0.095
        low = 0.030 + 0.7 * notch * bare
        heights = (notch * bare, low, 0.68 * tall + 0.012 * notch, tall, tall, 0.68 * tall, low)
        ahead = (0.25 * thick, thick, 0.85 * thick, 0.1 * thick, -0.035, -0.032, -0.022)
        rings.append(np.array([spot + a * out + (0.0, up * h, 0.0) for h, a in zip(heights, ahead, strict=True)]))
    piece = Piece(f"teeth_{row}")
    rows = piece.tube(rings, "teeth", tips=(rings[0].mean(axis=0), rings[-1].mean(axis=0)))
    gum = {i for ring in rows for i in ring[2:6]}
    piece.materials = ["gums" if gum.issuperset(face) else "teeth" for face in piece.faces]
    return piece.outwards()


def tongue() -> Piece:
    """Return the tongue: flat, with a furrow."""
    z0 = float(front(np.array(0.0), np.array(MOUTH))) - 0.225
    t = np.linspace(0.0, 1.0, 8)
    c, s = _circle(10)
    rings = []
    for u in t:
        wide = 0.125 * np.sqrt(np.sin(np.pi * (0.10 + 0.62 * u)))
        high = 0.045 * np.sqrt(np.sin(np.pi * (0.10 + 0.62 * u)))
        centre = np.array([0.0, MOUTH - 0.088 - 0.02 * u**2 + 0.012 * np.sin(np.pi * u), z0 - 0.22 * u])
        furrow = -0.014 * np.exp(-(c / 0.25) ** 2) * (s > 0)
        rings.append(centre + np.stack([wide * c, high * s + furrow, 0 * c], axis=1))
    piece = Piece("tongue")
    piece.tube(rings, "tongue", tips=(rings[0].mean(axis=0) + [0, 0, 0.03], rings[-1].mean(axis=0) - [0, 0, 0.01]))
    return piece.outwards()


def pieces() -> list[Piece]:
    """Return all pieces but the skin."""
    return [eye("L"), eye("R"), teeth("upper"), teeth("lower"), tongue(), brow("L"), brow("R"), moustache(), cap(), visor(),
            button(), hair(), collar()]

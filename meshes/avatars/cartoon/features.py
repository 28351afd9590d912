"""The cartoon's eyeballs, brows, moustache, teeth and tongue."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from head import EYE, EYE_RADIUS, LID_GAP, MIRROR, MOUTH, Array, front
from piece import Piece, on_face, swept
from rings import turns

CONVERGE = 1.5                                 # degrees: they look at somebody some steps away


def eye(side: str) -> Piece:
    """Return an eyeball: pupil, iris, its dark rim, the white, two highlights."""
    piece = Piece(f"eye_{side}")
    n = 24
    c, s = turns(n)
    angles = np.radians([12.5, 14.0, 25.0, 28.5, 40.0, 55.0, 72.0, 92.0, 115.0, 145.0])
    rings = [np.stack([np.sin(t) * c, np.sin(t) * s, np.full(n, np.cos(t))], axis=1) for t in angles]
    names = ["pupil", "iris", "limbus"] + ["sclera"] * 6
    ahead = np.array([0.0, 0.0, EYE_RADIUS])
    piece.tube([EYE + EYE_RADIUS * ring for ring in rings], names, tips=(EYE + ahead, EYE - ahead))
    piece.front = n * len(rings)
    for side_turn, up_turn, size in ((-11.0, 12.0, 6.2), (11.0, -11.0, 2.8)):          # highlights, from the viewer's left
        yaw, pitch = np.radians(side_turn), np.radians(up_turn)
        forward = np.array([np.sin(yaw) * np.cos(pitch), np.sin(pitch), np.cos(yaw) * np.cos(pitch)])
        right = np.cross([0.0, 1.0, 0.0], forward)
        right /= np.linalg.norm(right)
        up = np.cross(forward, right)
        c, s = turns(10)
        t = np.radians(size)
        rim = np.cos(t) * forward + np.sin(t) * (c[:, None] * right + s[:, None] * up)
        height = EYE_RADIUS + 0.55 * LID_GAP                                          # before the ball, behind the lids
        row = piece.add(EYE + height * rim)
        top = piece.add([EYE + height * forward])[0]
        for i, j in zip(row, row[1:] + row[:1], strict=True):
            piece.face((i, j, top), "highlight")
    # Both mirror the same window, so the right eye is no mirror image.
    turn = np.radians(-CONVERGE if side == "L" else CONVERGE)
    cos, sin = np.cos(turn), np.sin(turn)
    centre = EYE if side == "L" else EYE * MIRROR
    piece.points = [centre + np.array([[cos, 0.0, sin], [0.0, 1.0, 0.0], [-sin, 0.0, cos]]) @ (point - EYE)
                    for point in piece.points]
    return piece


def brow_place(t: Array | float, side: str) -> tuple[Array | float, Array | float]:
    """Return (x, y) along a brow, 0 its inner end, on the left; the right one is a little higher."""
    up = 0.0 if side == "L" else 0.022
    return 0.15 + 0.46 * t, 0.50 + up + 0.075 * np.sin(np.pi * (0.10 + 0.80 * t)) - 0.075 * t**1.5


def brow(side: str) -> Piece:
    """Return a thick brow."""
    t = np.linspace(0.0, 1.0, 9)
    x, y = brow_place(t, side)
    path, along, across, ahead = on_face(x, y, 0.03)
    wide = 0.072 * np.sin(np.pi * (0.16 + 0.76 * t)) ** 0.7 * (1.08 - 0.35 * t)
    piece = Piece(f"brow_{side}")
    piece.tube(swept(path, across, ahead, wide, 0.62 * wide, 8), "brows",
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
    path, along, across, ahead = on_face(x, y, 0.04 + 0.30 * wide + 0.05 * np.maximum(a - 0.7, 0.0))
    piece = Piece("moustache")
    rings = swept(path, across, ahead, wide, 0.72 * wide, 8)
    piece.tube(rings, "moustache", tips=(path[0] - 0.02 * along[0], path[-1] + 0.02 * along[-1]))
    return piece.outwards()


def teeth(row: str) -> Piece:
    """Return a row of big teeth with its gum: four a side, with a gap between the upper two in the middle."""
    upper = row == "upper"
    up = 1.0 if upper else -1.0
    # half width and depth of the arch, how far behind the face, height of the cutting edge
    half, deep, behind, edge = (0.215, 0.20, 0.125, MOUTH - 0.022) if upper else (0.180, 0.165, 0.165, MOUTH - 0.040)
    z0 = float(front(0.0, MOUTH)) - behind
    bounds = 0.45 * np.pi * np.array([0.0, 0.30, 0.55, 0.78, 1.0])
    side = [(0.0, 1.0)]                                              # (angle, how deep the notch there is, 0 on a tooth)
    for a, b in pairwise(bounds):
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
    z0 = float(front(0.0, MOUTH)) - 0.225
    t = np.linspace(0.0, 1.0, 8)
    c, s = turns(10)
    rings = []
    for u in t:
        wide = 0.125 * np.sqrt(np.sin(np.pi * (0.10 + 0.62 * u)))
        high = 0.045 * np.sqrt(np.sin(np.pi * (0.10 + 0.62 * u)))
        centre = np.array([0.0, MOUTH - 0.088 - 0.02 * u**2 + 0.012 * np.sin(np.pi * u), z0 - 0.22 * u])
        furrow = -0.014 * np.exp(-(c / 0.25) ** 2) * (s > 0)
        rings.append(centre + np.stack([wide * c, high * s + furrow, 0 * c], axis=1))
    piece = Piece("tongue")
    tip, root = np.array([0.0, 0.0, 0.03]), np.array([0.0, 0.0, -0.01])
    piece.tube(rings, "tongue", tips=(rings[0].mean(axis=0) + tip, rings[-1].mean(axis=0) + root))
    return piece.outwards()

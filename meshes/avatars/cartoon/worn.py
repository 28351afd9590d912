"""What the cartoon wears: a flat cap, askew, hair under it and the collar of a jersey."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from head import Array
from piece import Piece, above
from rings import turns

CAP_TURN = np.radians(np.array([-6.0, -7.0, -9.0]))         # nodded back, turned and tilted to the right ear


def _askew(points: Array | Sequence[Sequence[float]], pivot: Sequence[float] = (0.0, 0.18, -0.08)) -> Array:
    """Return points turned about the middle of the skull, the way the cap sits on it."""
    (a, b, c) = CAP_TURN
    x = np.array([[1, 0, 0], [0, np.cos(a), -np.sin(a)], [0, np.sin(a), np.cos(a)]])
    y = np.array([[np.cos(b), 0, np.sin(b)], [0, 1, 0], [-np.sin(b), 0, np.cos(b)]])
    z = np.array([[np.cos(c), -np.sin(c), 0], [np.sin(c), np.cos(c), 0], [0, 0, 1]])
    return (np.asarray(points, float) - pivot) @ (z @ y @ x).T + pivot


def cap() -> Piece:
    """Return a flat cap, askew: a band, a soft crown that hangs over it, a visor and a button."""
    piece = Piece("cap")
    n = 32
    c, s = turns(n)                                         # s > 0 is the front
    # (height, half width, half length, shift forwards): inside of the band, band, crown
    rows = [(0.76, 0.63, 0.63, -0.07), (0.635, 0.725, 0.73, -0.07), (0.625, 0.77, 0.775, -0.07), (0.72, 0.775, 0.78, -0.07),
            (0.755, 0.87, 0.88, -0.06), (0.85, 0.955, 0.99, -0.05), (0.97, 0.91, 0.94, -0.06), (1.07, 0.71, 0.74, -0.08),
            (1.12, 0.42, 0.44, -0.10), (1.14, 0.15, 0.155, -0.10)]
    rings = []
    for number, (high, wide, long, shift) in enumerate(rows):
        soft = 0.016 * np.cos(8 * np.arctan2(s, c)) * (number in (4, 5, 6))            # the seams of its eight panels
        sag = -0.05 * s * (number >= 4)                                                # it leans forward
        rings.append(np.stack([(wide - soft) * c, high + sag, shift + (long - soft) * s], axis=1))
    rings = [_askew(ring) for ring in rings]
    behind = 0.5 - 0.5 * s                                                             # room for the hair
    for number, lift in enumerate((0.03, 0.035, 0.058, 0.06)):
        rings[number] = above(rings[number], lift + 0.055 * np.minimum(2.0 * behind, 1.0))
    piece.tube(rings, ["cap_band"] * 3 + ["cap"] * 6, tips=(None, _askew([[0, 1.142, -0.10]])[0]))
    return piece.outwards()


def button() -> Piece:
    """Return the button on the cap."""
    c, s = turns(10)
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
        rings.append(ring + above(_askew([root]), 0.055) - _askew([root]))        # its root lies on the band
    piece.tube(rings, "cap_band", tips=(rings[0].mean(axis=0), rings[-1].mean(axis=0)))
    return piece.outwards()


def hair() -> Piece:
    """Return the hair below the cap, from ear to ear round the back of the head, its lower edge in tufts."""
    piece = Piece("hair")
    half = np.radians([56, 59, 63, 67, 71, 75, 80, 88, 97, 106, 115, 124, 134, 145, 156, 168, 180])
    around = np.concatenate([half, 2 * np.pi - half[-2::-1]])
    # lower edge by angle: a sideburn before the ear, over the ear, down to the nape; in tufts
    edge = np.interp(half, np.radians([56, 59, 63, 67, 71, 75, 80, 97, 106, 115, 124, 134, 180]),
                     [0.52, 0.40, 0.17, 0.08, 0.04, 0.10, 0.40, 0.40, 0.26, 0.08, -0.08, -0.20, -0.36])
    edge = edge - 0.06 * (np.arange(len(half)) % 2) * (half > np.radians(110))
    edge = np.concatenate([edge, edge[-2::-1]])
    rows = []
    for u, lift in ((0.0, -0.012), (0.05, 0.035), (0.35, 0.06), (0.70, 0.06), (1.0, 0.035)):
        y = edge + u * (0.78 - 0.12 * np.sin(around) - edge)               # up under the cap, which is askew
        start = np.stack([0.7 * np.sin(around), y, -0.08 + 0.7 * np.cos(around)], axis=1)
        lift = np.where(np.abs(around - np.pi) <= np.pi - half[1], lift, -0.012)   # ends in the skin
        rows.append(piece.add(above(start, lift)))
    for a, b in pairwise(rows):
        for i in range(len(a) - 1):
            piece.face((a[i], a[i + 1], b[i + 1], b[i]), "hair")
    return piece


def collar() -> Piece:
    """Return the rolled collar of a jersey, ribbed, in which the neck ends."""
    piece = Piece("collar")
    n = 28
    angle = 2 * np.pi * np.arange(n) / n
    # (height, radius): inside from below, over the roll, down to the shoulders, and back under them
    rows = [(-1.36, 0.32), (-1.16, 0.335), (-1.06, 0.36), (-1.035, 0.415), (-1.07, 0.475), (-1.15, 0.49), (-1.235, 0.46),
            (-1.25, 0.50), (-1.30, 0.60), (-1.36, 0.66)]
    rings = []
    for number, (high, radius) in enumerate(rows):
        rib = 0.012 * (-1.0) ** np.arange(n) * (2 <= number <= 6)
        r = radius + rib
        rings.append(np.stack([r * np.sin(angle), high - 0.03 * np.cos(angle), -0.085 + r * np.cos(angle) * 0.97], axis=1))
    piece.tube(rings, "collar", closed=True)
    return piece.outwards()

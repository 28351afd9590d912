"""The horse's mouth and nostrils: fleshy lips, the lining behind them, teeth and tongue, pockets of the nostrils."""

from __future__ import annotations

from itertools import pairwise

import model
import numpy as np
from clay import Clay, curve
from mouth import arch, gum_and_teeth, seam, tongue, ways_along
from numpy.typing import NDArray
from sheet import Sheet

from facegen.geometry.mesh import Mesh

LIP = 15  # quads along half a lip
NOSTRIL = 18  # vertices round a nostril
GAP = 0.012  # between the lips
# Rows of a lip: away from the slit on the skin; then (away, behind the skin) on its round rim, to where the lips touch,
# and on from there to its inner side.
OFFSETS = (0.5, 0.36, 0.23, 0.12)
RIM = ((0.045, 0.035),)
SUNK = 0.1
INNER = ((0.02, 0.19), (0.06, 0.28), (0.13, 0.36), (0.24, 0.42), (0.4, 0.46))
# The mouth behind the lips narrows to the throat: (z, height of its middle, half widths above and below, half height).
LINING = ((7.3, -1.18, 0.72, 0.46, 0.54), (6.0, -1.22, 0.8, 0.52, 0.56), (4.8, -1.3, 0.7, 0.5, 0.5))
THROAT = (0.0, -1.4, 4.3)


def lips(clay: Clay) -> list[NDArray]:
    """Return the rows (2 LIP + 1, 3) of the lips, from the skin to their inner side; in row `EDGE` they touch."""
    slit = clay.onto(curve(model.MOUTH_LINE, LIP + 1))
    along = ways_along(slit)
    out = np.stack([-along[:, 2], 0 * along[:, 1], along[:, 0]], axis=1)
    out /= np.linalg.norm(out, axis=1, keepdims=True)
    up = np.cross(out, along)
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    # Towards the corner the rows fan out round it.
    fan = 0.9 * (np.arange(LIP) / LIP)[:, None] ** 5

    def row(away: float, depth: float = 0.0) -> NDArray:
        line = slit - depth * out
        upper, lower = (line[:LIP] + away * (sign * np.cos(fan) * up[:LIP] + np.sin(fan) * along[:LIP])
                        for sign in (1, -1))
        return np.concatenate([upper, line[LIP:] + away * along[LIP:], lower[::-1]])

    touching = seam(slit - SUNK * out, GAP)
    rows = [*(clay.onto(row(d)) for d in OFFSETS), *(row(*r) for r in RIM), touching, *(row(*r) for r in INNER)]
    for one in rows:
        one[[0, -1], 0] = 0.0
    return rows


EDGE = len(OFFSETS) + len(RIM)


def add_mouth(sheet: Sheet, loop: NDArray, rows: list[NDArray]) -> None:
    """Add lips and lining inside the loop, which is the first of the rows."""
    last = loop
    for number, row in enumerate(rows[1:], start=1):
        row = sheet.row(row)
        name = "muzzle" if number < len(OFFSETS) - 1 else "lips" if number < EDGE + 3 else "mouth"
        sheet.band(last, row, name, closed=False)
        last = row
    ovals = [_oval(*oval) for oval in LINING]
    # Narrower than both at first: beside the corner the lips' own inner sides are in the way.
    between = [(share * rows[-1] + (1 - share) * ovals[0]) * (narrow, 1, 1) for share, narrow in ((0.7, 0.8), (0.3, 0.86))]
    for ring in (*between, *ovals):
        ring = sheet.row(ring)
        sheet.band(last, ring, "mouth", closed=False)
        last = ring
    back = sheet.row(THROAT)[0]
    sheet.triangles([(a, b, back) for a, b in pairwise(last)], "mouth")


def _oval(z: float, y: float, above: float, below: float, high: float) -> NDArray:
    """Return a row (2 LIP + 1, 3) of the lining, square to the face, from the middle of the palate to the floor's."""
    turn = np.pi / 2 * (1 - np.arange(2 * LIP + 1) / LIP)
    wide = np.where(turn < 0, above + (below - above) * np.sin(turn) ** 2, above)
    x = wide * np.cos(turn)
    x[[0, -1]] = 0.0
    return np.stack([x, y + high * np.sin(turn), np.full(len(turn), z)], axis=1)


def nostril_loop(clay: Clay, size: float = 1.0) -> NDArray:
    """Return a loop (NOSTRIL, 3) round the left nostril: a comma, its tail up and inwards."""
    t = 2 * np.pi * np.arange(NOSTRIL) / NOSTRIL
    long, short = model.NOSTRIL_AXES
    reach = 0.4 * (1 + 0.18 * np.cos(t)) * np.cos(t)
    wide = 0.23 * (1 - 0.3 * np.cos(t)) * np.sin(t)
    return clay.onto(model.NOSTRIL + size * (reach[:, None] * long + wide[:, None] * short))


def add_nostril(sheet: Sheet, loop: NDArray) -> None:
    """Add the closed pocket behind a nostril's loop."""
    edge = sheet.at(loop)
    middle = edge.mean(axis=0)
    inward = np.array([-0.45, -0.1, -0.9])
    last = loop
    for size, depth, name in ((0.93, 0.03, "muzzle_dark"), (0.84, 0.1, "muzzle_dark"),
                              (0.74, 0.24, "nostril"), (0.6, 0.45, "nostril"), (0.4, 0.65, "nostril")):
        ring = sheet.row(middle + size * (edge - middle) + depth * inward)
        sheet.band(last, ring, name)
        last = ring
    sheet.cap(last, "nostril")


def _row(path: NDArray, incisors: tuple[float, ...], cheeks: tuple[float, ...], front: tuple[float, float, float],
         back: tuple[float, float, float]) -> list[tuple[float, float, float, float]]:
    """Return a row of teeth: incisors at distances from the middle, cheek teeth at z, with their sizes."""
    fine = curve(path, 401)
    length = np.linalg.norm(np.diff(fine, axis=0), axis=1).sum()
    left = fine[:201, 2]
    places = [(0.5 - d / length, front) for d in incisors]
    places += [(float(np.abs(left - z).argmin()) / 400, back) for z in cheeks]
    return [(side, *size) for where, size in places for side in (where, 1 - where)]


def inner_parts() -> list[Mesh]:
    """Return teeth on their gums, and the tongue."""
    upper = arch((0.54, -0.62, 4.9), (0.58, -0.66, 6.6), (0.5, -0.68, 8.2), (0.46, -0.7, 9.2), (0.58, -0.72, 9.9),
                 (0.42, -0.72, 10.35), (0, -0.72, 10.5))
    lower = arch((0.46, -1.66, 4.9), (0.48, -1.64, 6.6), (0.36, -1.58, 8.2), (0.28, -1.5, 9.0), (0.46, -1.58, 9.65),
                 (0.37, -1.6, 10.1), (0, -1.6, 10.25))
    incisors, cheeks = (0.165, 0.5, 0.83), (7.9, 7.35, 6.8, 6.25, 5.7, 5.2)
    return [
        gum_and_teeth("teeth_upper", upper, (0, -1, 0), 0.17, _row(upper, incisors, cheeks, (0.4, 0.24, 0.5),
                      (0.5, 0.36, 0.44)), lean=0.12, points=25).mesh(),
        gum_and_teeth("teeth_lower", lower, (0, 1, 0), 0.11, _row(lower, incisors, cheeks, (0.37, 0.22, 0.42),
                      (0.5, 0.3, 0.44)), lean=0.2, points=25).mesh(),
        tongue("tongue", [(0, -1.8, 5.0), (0, -1.45, 6.6), (0, -1.42, 8.4), (0, -1.5, 9.8)],
               [0.34, 0.42, 0.42, 0.38, 0.36, 0.38, 0.36, 0.22], [0.28, 0.26, 0.22, 0.2, 0.17, 0.14, 0.11, 0.06]
               ).mesh(),
    ]

"""What eighty years did to the face: clay pushed about in the large, then furrows. Not symmetric.

Places are seen on the left half; each entry says how strongly it holds on the left and on the right. Millimetres.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.spatial import cKDTree

CLAY = [  # what, centre, radii, move, left, right
    ("temple sinks", (60, 22, -12), (16, 20, 20), (-4.2, 0, -1.2), 1, .9),
    ("brow bone stands out", (28, 18, 24), (20, 8, 16), (0, -.6, 3.0), 1, 1.1),
    ("brow hangs outside", (48, 14, 8), (12, 12, 16), (.6, -2.0, .8), .7, 1.2),
    ("one brow is raised", (30, 22, 22), (20, 14, 20), (0, 2.6, .4), 1, 0),
    ("cheek bone shows", (49, -21, 4), (13, 9, 16), (2.2, .6, 1.2), 1, 1),
    ("cheek is hollow", (47, -50, -4), (14, 19, 22), (-6.2, 0, -2.8), 1, .85),
    ("cheek beside the mouth falls in", (40, -66, 4), (9, 14, 14), (-2.2, 0, -1.6), 1, 1),
    ("cheek pad sags", (33, -45, 16), (8, 12, 12), (.6, -1.4, 4.2), 1, 1.15),
    ("jowl", (37, -90, 2), (10, 9, 16), (3.0, -5.2, 3.2), 1.1, .9),
    ("notch before the jowl", (23, -99, 12), (7, 8, 12), (-.8, 2.4, -2.2), 1, 1),
    ("chin", (0, -98, 22), (15, 10, 16), (0, .4, 3.2), 1, 1),
    ("chin tip", (0, -103, 16), (13, 7, 14), (0, -1.6, 1.4), 1, 1),
    ("jaw corner", (54, -74, -44), (12, 14, 20), (1.6, 0, 0), 1, 1),
    ("skin under the chin hangs", (0, -112, -8), (17, 10, 20), (0, -5.0, 3.0), 1, 1),
    ("wattle", (5, -124, -30), (6, 17, 14), (-.4, -1, 5.0), 1.1, .8),
    ("throat between the cords", (0, -138, -38), (4.5, 15, 14), (0, 0, -1.6), 1, 1),
    ("neck cord", (22, -134, -46), (6, 24, 16), (1, 0, 2.6), 1, .8),
    ("neck side thins", (54, -118, -78), (16, 26, 26), (-4, 0, 0), 1, 1),
    ("mouth sinks in", (0, -70, 31), (26, 15, 22), (0, 0, -2.2), 1, 1),
    ("lip above the mouth lengthens", (0, -58, 32), (17, 9, 16), (0, -.3, .7), 1, 1),
    ("forehead slopes", (0, 66, 12), (46, 26, 30), (0, 0, -2.0), 1, 1),
    ("forehead bosses", (25, 50, 14), (15, 14, 18), (.2, 0, 1.7), 1, .8),
    ("crown is high", (0, 96, -66), (50, 34, 52), (0, 3.0, 0), 1, 1),
    ("nose bridge bends to the left", (0, -14, 34), (11, 9, 15), (2.0, 0, .8), 1, 1),
    ("nose tip leans to the right", (0, -40, 45), (16, 12, 20), (-1.7, 0, 0), 1, 1),
    ("wing", (20, -40, 24), (5, 6, 7), (1.1, 0, .8), 1, 1),
    ("one wing is wider", (20, -40, 24), (6, 8, 8), (1, .4, 0), .9, 0),
    ("mouth corner", (27, -72.5, 19), (13, 9, 14), (.2, -2.2, -.2), .1, 1.0),
    ("chin is off the middle", (0, -98, 18), (26, 18, 26), (1.2, 0, 0), 1, 1),
]

FURROWS = [  # what, points (x, y) seen from the front, half width, depth, left, right
    ("frown", [(5.0, 9), (5.6, 15), (4.6, 22)], 1.7, 1.7, 1.1, .8),
    ("nasion", [(0, 4), (5, 4.6), (9, 6)], 1.9, .9, 1, 1),
    ("marionette", [(28.5, -75.5), (30.4, -81), (31, -88), (30, -96)], 2.6, 3.0, .8, 1.2),
    ("chin fold", [(0, -86.5), (8, -86.2), (15, -87.6), (21, -90)], 2.6, 1.5, 1, 1),
    ("tear trough", [(15.5, -12.5), (20, -18.5), (27, -22.5), (35, -23.5), (43, -20.5)], 2.2, 1.3, 1.1, .9),
    ("lower bag", [(19, -10.8), (27, -13.8), (36, -13), (43, -9.8)], 1.5, .6, 1, .9),
    ("crow's foot 1", [(48.5, -1.5), (53, 2), (57.5, 6.5)], 1.6, .9, 1, 1),
    ("crow's foot 2", [(49, -5), (54, -5.6), (59, -5.5)], 1.6, .9, 1, .9),
    ("crow's foot 3", [(47.5, -9.5), (52, -13), (56, -18)], 1.6, .8, .9, 1),
    ("cheek", [(42, -36), (44.5, -46), (44, -57)], 2.5, .9, .6, 1),
    ("upper lip", [(9, -55), (9.6, -62)], 1.2, .35, 1, 1),
    ("philtrum", [(0, -53.5), (0, -63.5)], 2.0, .9, 1, 1),
    ("neck", [(0, -119), (14, -116), (28, -112), (40, -106)], 2.2, 1.2, 1, 1),
]
FOLDS = [  # the same along vertices of the cage, which puts an edge loop into the fold: what, (row, column)s, ...
    ("lower line of the forehead", [(24, c) for c in range(-7, 8)], 2.1, 1.9, 1, 1),
    ("upper line of the forehead", [(27, c) for c in range(-8, 7)], 2.1, 1.7, 1, 1),
    ("nasolabial", [(15, 6), (14, 6), (13, 6), (12, 6), (11, 6), (10, 6), (9, 6), (8, 6)], 2.8, 3.9, 1, 1.2),
    ("wing's groove", [(15, 4), (14, 5), (13, 5), (12, 5), (11, 5)], 1.6, 1.8, 1, 1),
]
FLANK = 0.45         # the skin that a furrow displaces swells beside it, as a part of its depth


def push_clay(places: NDArray) -> NDArray:
    """Return places (n, 3) moved by the clay."""
    out = np.array(places)
    for _, centre, radii, move, left, right in CLAY:
        both = ((1, left), (-1, right)) if centre[0] > 0 else ((1, 1),)
        for sign, strength in both:
            flip = np.array([sign, 1, 1])
            d = (places - np.array(centre) * flip) / radii
            out += strength * np.exp(-(d**2).sum(axis=1))[:, None] * (np.array(move) * flip)
    return out


def furrow(places: NDArray, normals: NDArray, at) -> NDArray:
    """Return how far each place (n, 3) moves along its normal (n,).

    at: gives the index of the vertex at a (row, column) of the cage's grid.
    """
    move = np.zeros(len(places))
    facing = np.flatnonzero((normals[:, 2] > 0.05) & (places[:, 2] > -50))
    seen = cKDTree(places[facing, :2])
    for _, points, width, depth, left, right in FURROWS:
        crosses = points[0][0] == 0                    # its mirror image continues it across the middle
        for sign, strength in ((1, left), (-1, right)):
            line, taper = _line(np.array(points, dtype=np.float64) * [sign, 1], fades_in=not crosses)
            z = places[facing[seen.query(line, k=3)[1]], 2].max(axis=1)
            cut = _groove(places, np.column_stack([line, z]), taper, width) * strength * depth
            if crosses:
                side = sign * places[:, 0]
                cut *= np.where(side > 1e-6, 1.0, np.where(side < -1e-6, 0.0, 0.5))
            move += cut
    for _, cells, width, depth, left, right in FOLDS:
        both = ((1, left), (-1, right)) if min(c for _, c in cells) > 0 else ((1, 1.0),)
        for sign, strength in both:
            path = places[[at(r, sign * c) for r, c in cells]]
            line, taper = _line(path, fades_in=True)
            move += _groove(places, line, taper, width) * strength * depth
    return move


def _groove(places: NDArray, line: NDArray, taper: NDArray, width: float) -> NDArray:
    """Return a furrow's profile at all places: -1 on the line, a swelling beside it, times ``taper`` of the line."""
    away, nearest = cKDTree(line).query(places, distance_upper_bound=4 * width)
    hit = np.flatnonzero(np.isfinite(away))
    x2 = (away[hit] / width) ** 2
    out = np.zeros(len(places))
    out[hit] = (FLANK * x2 * np.exp(-x2 / 1.6) / 1.6 - np.exp(-x2)) * taper[nearest[hit]]
    return out


def _line(points: NDArray, *, fades_in: bool) -> tuple[NDArray, NDArray]:
    """Return 80 points along a smooth curve and how deep it is there, 0..1, fading at its end (and start)."""
    t = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    s = np.linspace(0, 1, 80)
    line = CubicSpline(t, points)(s * t[-1])
    taper = np.sin(np.pi * (s if fades_in else 0.5 + s / 2)) ** 0.6
    return line, np.maximum(taper, 0.0)

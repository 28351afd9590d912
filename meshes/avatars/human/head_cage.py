"""The quad cage of the head: a grid of rows and columns with holes for eyes, mouth, ears and nostrils.

Rows run around the head from the neck's opening (0) to a ring under the crown (30); columns from the middle of the
face (0) over the subject's left (1..19) to the middle of the back (20); negative columns are the right side.
Around each hole lie closed edge loops, laid by the other modules. Millimetres, +x the subject's left, +y up,
+z forward, origin midway between the eyes.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from quads import Cage, edges_of
from scipy.interpolate import CubicSpline, RBFInterpolator
from scipy.sparse import coo_matrix, identity
from scipy.sparse.linalg import spsolve

import facegen

ROWS, COLUMNS = 31, 20
VIEW_CENTRE = np.array([0.0, -20.0, -65.0])       # the head without ears is star-shaped as seen from here

# Holes: first and last row, first and last column (left side; the right side is its mirror).
EYE_HOLE = (17, 21, 3, 9)
EAR_HOLE = (13, 19, 12, 16)
NOSTRIL_HOLE = (12, 13, 1, 3)
MOUTH_HOLE = (7, 11, -6, 6)
CROWN_HALF_FRONT, CROWN_SIDE = 6, 8               # the crown is a patch of 12 x 8 quads in a ring of 40

# ---- where the pinned vertices of the left half lie ----

PROFILE = [  # row, y, z: the middle line of the face
    (0, -152, -41), (1, -141, -38), (2, -128, -34.5), (3, -117, -27), (4, -111, -8), (5, -107, 13), (6, -98, 22.5),
    (7, -88, 23.2), (11, -51.0, 31.3), (12, -49.6, 37), (13, -47, 43), (14, -41, 48), (15, -33, 46.6), (16, -24, 41),
    (17, -14.5, 34.8), (18, -6.5, 27.8), (19, 1, 23.6), (20, 8, 24.6), (21, 14.5, 26.8), (22, 21, 27.2),
    (23, 31.5, 25.2), (24, 35.5, 24.3), (25, 39.5, 23.2), (26, 47, 21), (27, 51, 19.4), (28, 55, 17.6), (29, 71, 7.6),
    (30, 90, -13)]
FOREHEAD_ROWS, FOREHEAD_COLUMNS = range(22, 30), {3: (14, .6), 6: (32, 2.4)}   # column: x, how far its rows rise
NOSE = {  # row: places of columns 1, 2, ...
    11: [(4.5, -51.2, 30.9), (8.5, -51, 29.5), (12.8, -50, 27.6), (17.5, -48.8, 24.6), (22, -47.6, 21.2)],
    12: [(3.4, -49.8, 35.5), (8.6, -48.6, 32.2), (14.2, -46.8, 27.8), (19.6, -44.4, 24.2), (22, -42, 19.6)],
    13: [(4.2, -47.6, 40.8), (9.4, -45.6, 37), (15.2, -43.4, 31), (20.6, -40, 25.2), (21.8, -37, 19.0)],
    14: [(5.0, -42, 46.4), (10.4, -41.4, 41.6), (15.6, -39, 33.4), (19.6, -34.5, 25.8), (20.2, -31, 19.2)],
    15: [(5.0, -34, 44.6), (9.4, -33.5, 39.4), (13.4, -31.5, 31.2), (16.4, -28.5, 23.6), (18.6, -25.5, 18.6)],
    16: [(4.6, -24.5, 39.0), (8.2, -24, 34), (11.0, -23, 27.4), (13.4, -21.4, 21.6), (16.2, -20, 17.4)],
    17: [(4.4, -14.8, 32.8), (7.8, -14.4, 28)],
    18: [(4.2, -6.8, 26), (7.4, -7, 21.8)],
    19: [(4.2, 1, 22), (7.6, .6, 19)],
    20: [(4.6, 8, 23.6), (8.4, 7.8, 21.8)],
}
EYE_RING = {  # (row, column): x, y on the face, seen from the front
    (17, 3): (10.6, -13.2), (17, 4): (15, -16.6), (17, 5): (22, -19), (17, 6): (30, -19.8), (17, 7): (38, -18.5),
    (17, 8): (45, -15), (17, 9): (50, -10.4), (18, 9): (52.2, -5.4), (19, 9): (52.8, 0), (20, 9): (51.6, 5.4),
    (21, 9): (48.4, 10.2), (21, 8): (43.4, 12.6), (21, 7): (37.2, 14), (21, 6): (30, 14.4), (21, 5): (23, 13.5),
    (21, 4): (16.6, 11.6), (21, 3): (11.8, 9.2), (20, 3): (10.4, 4.6), (19, 3): (10.1, -1), (18, 3): (10.1, -7)}
MOUTH_RING = {
    (7, 1): (5.5, -88), (7, 2): (11, -87.6), (7, 3): (16.5, -86.8), (7, 4): (22, -85.4), (7, 5): (27.6, -83.2),
    (7, 6): (32.4, -80), (8, 6): (35.4, -75.4), (9, 6): (36.4, -69.6), (10, 6): (34.4, -62.6), (11, 6): (30.4, -54)}
CHEEK = {  # columns 6 and 7: the fold from nose to mouth and the cheek above it
    (15, 6): (20.6, -24.5), (14, 6): (23.2, -29.5), (13, 6): (26, -36.5), (12, 6): (28.2, -44.5),
    (15, 7): (25, -25), (14, 7): (28, -31), (13, 7): (31, -38.5), (12, 7): (33, -46.5), (11, 7): (35, -55),
    (10, 7): (39.2, -63.5), (9, 7): (41.6, -70.5), (8, 7): (40.4, -77), (6, 6): (34, -88)}
EAR_RING = {  # (row, column): y, z on the side of the head
    (13, 12): (-46, -54), (13, 13): (-49.5, -58.5), (13, 14): (-50.5, -64), (13, 15): (-48, -69.5),
    (13, 16): (-42, -74), (14, 16): (-34, -77), (15, 16): (-25, -78.5), (16, 16): (-16, -79.5), (17, 16): (-7, -80),
    (18, 16): (-.5, -78), (19, 16): (4.5, -76.4), (19, 15): (7.4, -73), (19, 14): (8.4, -68.6), (19, 13): (7.2, -64),
    (19, 12): (3, -59.4), (18, 12): (-4.4, -56.4), (17, 12): (-12.4, -54.2), (16, 12): (-21, -53.8),
    (15, 12): (-29.4, -53.6), (14, 12): (-37.8, -53.6)}
EVEN = [(14, 19, 30), (17, 19, 30), (12, 5, 13), (14, 5, 13), (16, 5, 13), (18, 5, 13)]   # column, rows: evenly between
NECK_RIM = [(0, -152, -41), (33, -150, -51), (56, -147, -84), (42, -143, -120), (0, -140, -137)]
JAW_LINE = {(5, 2): (14, -105, 9), (5, 4): (26.5, -100.5, 0), (5, 6): (36.5, -95, -11), (5, 8): (44, -90, -24),
            (5, 12): (50.5, -84, -60), (5, 14): (50, -87, -82),
            (5, 16): (46, -92, -110), (5, 18): (27, -95, -129), (3, 12): (48, -112, -76), (3, 14): (50, -116, -99),
            (3, 16): (43, -117, -120)}
BACK = [(3, -116, -136.5), (5, -98, -136), (9, -68, -141), (13, -40, -149.5), (19, 4, -162), (25, 38, -164), (30, 66, -152)]
CROWN_RING = [(0, 90, -13), (36, 84, -32), (53, 77, -75), (42, 70, -125), (0, 66, -152)]


def hole_loop(hole: tuple[int, int, int, int], sign: int = 1) -> list[tuple[int, int]]:
    """Return the (row, column) of a hole's rim, counter-clockwise seen from outside."""
    r0, r1, c0, c1 = hole
    if sign < 0:
        c0, c1 = -c1, -c0
    return ([(r0, c) for c in range(c0, c1)] + [(r, c1) for r in range(r0, r1)]
            + [(r1, c) for c in range(c1, c0, -1)] + [(r, c0) for r in range(r1, r0, -1)])


def key(row: int, column: int):
    """Return the key of a grid vertex; column -20 is column 20."""
    return ("grid", row, 20 if column == -20 else column)


def grid() -> Cage:
    """Return the grid's quads with their holes, and the crown's patch; no places yet."""
    holes = [MOUTH_HOLE]
    for h in (EYE_HOLE, EAR_HOLE, NOSTRIL_HOLE):
        holes += [h, (h[0], h[1], -h[3], -h[2])]
    cage = Cage()
    for r in range(ROWS - 1):
        for c in range(-COLUMNS, COLUMNS):
            if not any(h[0] <= r < h[1] and h[2] <= c < h[3] for h in holes):
                cage.quad(key(r, c), key(r, c + 1), key(r + 1, c + 1), key(r + 1, c))
    for i in range(2 * CROWN_HALF_FRONT):
        for j in range(CROWN_SIDE):
            cage.quad(*(_crown(i + a, j + b) for a, b in ((0, 0), (1, 0), (1, 1), (0, 1))))
    return cage


def _crown(i: int, j: int):
    """Return the key of a vertex of the crown's patch: i to the left, j to the back; its rim is the last row."""
    top, x = ROWS - 1, i - CROWN_HALF_FRONT
    if j == 0:
        return key(top, x)
    if j == CROWN_SIDE:
        return key(top, 20 - x if x > 0 else -20 - x)
    if abs(x) == CROWN_HALF_FRONT:
        return key(top, (CROWN_HALF_FRONT + j) * (1 if x > 0 else -1))
    return ("crown", i, j)


class BaseShape:
    """The base face's skin without its ears, as a distance from VIEW_CENTRE in every direction."""

    def __init__(self) -> None:
        mesh = facegen.load_face().mesh(2)
        kept = np.isin(mesh.face_materials, [mesh.materials.index(m) for m in ("skin", "lips")])
        kept &= mesh.face_parts == mesh.parts.index("skin")
        used = np.unique(mesh.faces[kept])
        v = mesh.vertices[used]
        ear = (np.abs(v[:, 0]) > 58) & (v[:, 1] > -56) & (v[:, 1] < 15) & (v[:, 2] < -53) & (v[:, 2] > -96)
        eye = (np.hypot((np.abs(v[:, 0]) - 29) / 15, (v[:, 1] + 1) / 9) < 1) & (v[:, 2] > -10)
        v = v[~ear & ~eye] - VIEW_CENTRE
        radius = np.linalg.norm(v, axis=1)
        self._radius = RBFInterpolator(v / radius[:, None], radius, neighbors=40, smoothing=1e-3)

    def project(self, places):
        """Return the places (n, 3) moved along their rays onto the skin."""
        rays = np.asarray(places, dtype=np.float64) - VIEW_CENTRE
        rays = rays / np.linalg.norm(rays, axis=1, keepdims=True)
        return VIEW_CENTRE + rays * self._radius(rays)[:, None]

    def front(self, x: float, y: float):
        """Return the place on the skin that a viewer in front sees at (x, y)."""
        return self._meet(np.array([x, y, 10.0]), (0, 1))

    def side(self, y: float, z: float):
        """Return the place on the left side of the head that is seen at (y, z)."""
        return self._meet(np.array([64.0, y, z]), (1, 2))

    def _meet(self, place, fixed: tuple[int, int]):
        for _ in range(25):                            # fixed-point: project, put the seen coordinates back
            found = self.project(place[None])[0]
            found[list(fixed)] = place[list(fixed)]
            place = found
        return place


def _curve(points, count: int, crowding: float) -> NDArray:
    """Return ``count`` places, denser in front if ``crowding`` > 1, along a smooth curve that leaves the middle plane squarely at both ends."""
    p = np.asarray(points, dtype=np.float64)
    mirrored = p[1:-1] * [-1, 1, 1]
    loop = np.concatenate([p, mirrored[::-1], p[:1]])
    t = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(loop, axis=0), axis=1))])
    spline = CubicSpline(t, loop, bc_type="periodic")
    dense = spline(np.linspace(0, t[len(p) - 1], 2000))
    s = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(dense, axis=0), axis=1))])
    return spline(np.interp(s[-1] * np.linspace(0, 1, count) ** crowding, s, np.linspace(0, t[len(p) - 1], 2000)))


def pins(base: BaseShape) -> dict:
    """Return (row, column) -> place for the pinned vertices of the left half."""
    out = {(r, 0): (0.0, y, z) for r, y, z in PROFILE}
    back = np.array(BACK, dtype=np.float64)
    rows = np.arange(3, 31)
    on_back = np.column_stack([0 * rows, CubicSpline(back[:, 0], back[:, 1])(rows), CubicSpline(back[:, 0], back[:, 2])(rows)])
    out |= {(int(r), 20): p for r, p in zip(rows, base.project(on_back), strict=True)}
    for c, p in enumerate(_curve(NECK_RIM, COLUMNS + 1, 1.15)):
        out[0, c] = p
    for c, p in enumerate(_curve(CROWN_RING, COLUMNS + 1, 1.4)):
        out.setdefault((30, c), base.project(p[None])[0])
    for k, (x, y) in (EYE_RING | MOUTH_RING | CHEEK).items():
        out[k] = base.front(x, y)
    for r in FOREHEAD_ROWS:
        for c, (x, rise) in FOREHEAD_COLUMNS.items():
            out[r, c] = base.front(x, out[r, 0][1] + rise)
    for k, (y, z) in EAR_RING.items():
        out[k] = base.side(y, z)
    for k, p in JAW_LINE.items():
        out[k] = base.project(np.array([p], dtype=np.float64))[0]
    out[19, 17] = base.side(4, -115)
    out[13, 18] = base.side(-42, -136)
    for column, low, high in EVEN:
        for r in range(low + 1, high):
            t = (r - low) / (high - low)
            out[r, column] = base.project([(1 - t) * out[low, column] + t * out[high, column]])[0]
    for r, places in NOSE.items():
        for c, p in enumerate(places, 1):
            out[r, c] = p
    return out


def head_cage() -> Cage:
    """Return the cage of the head without eyes, mouth, ears and nostrils, all vertices in their places."""
    cage, base = grid(), BaseShape()
    n = len(cage.place)
    fixed = np.zeros(n, dtype=bool)
    places = np.zeros((n, 3))
    for (r, c), p in pins(base).items():
        for sign in (1, -1):
            i = cage.index[key(r, sign * c)]
            places[i], fixed[i] = np.asarray(p) * [sign, 1, 1], True
    edges, _, _ = edges_of(np.array(cage.quads))
    both = np.concatenate([edges, edges[:, ::-1]])
    near = coo_matrix((np.ones(len(both)), (both[:, 0], both[:, 1])), shape=(n, n)).tocsr()
    mean = near.multiply(1.0 / np.asarray(near.sum(axis=1))).tocsr()
    free = np.flatnonzero(~fixed)
    laplace = (identity(n) - mean).tocsr()
    places[free] = spsolve(laplace[free][:, free].tocsc(), -laplace[free][:, fixed] @ places[fixed])
    for _ in range(30):                               # smooth along the skin
        places[free] = base.project(places[free])
        places[free] = 0.4 * places[free] + 0.6 * (mean @ places)[free]
    places[free] = base.project(places[free])
    for c in range(-COLUMNS, COLUMNS):                # the base face ends about here: not its extrapolation
        rim, low, mid, up = (cage.index[key(r, c)] for r in range(4))
        if abs(c) >= 4:
            places[mid] = (places[rim] + 2 * places[up]) / 3
        places[low] = (places[rim] + places[mid]) / 2
    cage.place = list(places)
    return cage

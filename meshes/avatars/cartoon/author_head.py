"""The skin of the cartoon character: a grid of quads round the head with rings for eyes, lips, nose and ears.

The shape is a smooth union of ellipsoids (I. Quilez, "Smooth minimum", 2013); the layout is a grid of columns (round the
head) and rows (from the neck to the crown) with rectangular holes that concentric rings fill. Where the rings lie is
written down below; the rest of the grid is relaxed on the shape. Units: the head is two high; +x subject's left, +y up,
+z forward, origin in the middle of the skull.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import splu

Array = NDArray[np.float64]

# ---- measures shared with the other pieces ----
EYE = np.array([0.395, 0.12, 0.49])       # centre of the left eyeball
EYE_RADIUS = 0.345
LID = 0.034                                # thickness of a lid
LID_GAP = 0.006                            # between lid and eyeball: more than a chord of the margin cuts off the ball
EAR = np.array([0.852, 0.05, -0.02])       # root of the left ear
MOUTH = -0.535                             # height of the slit in the middle
MOUTH_HALF = 0.29                          # half its width
SLIT = 0.0032                              # neutral gap between the lips in the middle
STIFF, TAUT = 30.0, 0.0                    # how far one step of the relaxation goes
MIRROR = np.array([-1.0, 1.0, 1.0])

COLUMNS, ROWS = 30, 24                     # rows 0 (neck) .. 23; the crown's pole closes the top
EYE_HOLE, NOSE_HOLE, MOUTH_HOLE, EAR_HOLE = (2, 8, 15, 19), (-2, 2, 10, 14), (-4, 4, 7, 9), (10, 12, 12, 16)


# ---- the shape: distance functions, all of points (n, 3) ----
def _ellipsoid(p: Array, centre: Sequence[float], radii: Sequence[float]) -> Array:
    """Return about the distance from ellipsoids (first order, exact at the surface)."""
    q = p - np.asarray(centre)
    near = np.linalg.norm(q / radii, axis=1)
    slope = np.linalg.norm(q / np.square(radii), axis=1)
    return near * (near - 1.0) / np.maximum(slope, 1e-9)


def _pair(p: Array, centre: Sequence[float], radii: Sequence[float], blend: float = 0.02) -> Array:
    """Return the distance from an ellipsoid and its mirror image."""
    return _join(_ellipsoid(p, centre, radii), _ellipsoid(p * MIRROR, centre, radii), blend)


def _join(a: Array, b: Array, blend: float) -> Array:
    """Return the union of two shapes, rounded over ``blend``."""
    h = np.maximum(blend - np.abs(a - b), 0.0) / blend
    return np.minimum(a, b) - h * h * blend / 4.0


def _neck(p: Array) -> Array:
    axis = -0.10 + 0.04 * np.clip(-p[:, 1] - 0.8, 0.0, 1.0)
    return np.hypot(p[:, 0], p[:, 2] - axis) - 0.31


def head_shape(p: Array) -> Array:
    """Return the signed distance (about) of the head without eyes and ears."""
    d = _ellipsoid(p, (0.0, 0.18, -0.08), (0.86, 0.85, 0.86))                  # skull
    d = _join(d, _ellipsoid(p, (0.0, -0.38, 0.04), (0.84, 0.58, 0.76)), 0.30)  # lower face
    d = _join(d, np.maximum(_neck(p), p[:, 1] + 0.5), 0.14)
    d = _join(d, _pair(p, (0.50, -0.36, 0.40), (0.31, 0.27, 0.30)), 0.22)      # cheeks
    d = _join(d, _ellipsoid(p, (0.0, -0.50, 0.58), (0.42, 0.24, 0.27)), 0.24)  # muzzle
    d = _join(d, _ellipsoid(p, (0.0, -0.76, 0.60), (0.30, 0.20, 0.22)), 0.14)  # chin
    return _join(d, _pair(p, (0.36, 0.50, 0.53), (0.30, 0.13, 0.16)), 0.16)    # brow ridge


def face_shape(p: Array) -> Array:
    """Return the signed distance (about) of head and lids, without the ball of the nose."""
    d = head_shape(p)
    lids = _pair(p, EYE, (EYE_RADIUS + LID,) * 3)
    d = _join(d, lids, 0.05)
    return _join(d, _ellipsoid(p, (0.0, 0.06, 0.80), (0.09, 0.22, 0.12)), 0.10)    # bridge of the nose


def shape(p: Array) -> Array:
    """Return the signed distance (about) of the whole but the ears."""
    nose = _ellipsoid(p, (0.0, -0.185, 0.95), (0.195, 0.165, 0.185))
    nose = _join(nose, _pair(p, (0.15, -0.225, 0.87), (0.105, 0.095, 0.11)), 0.12)
    return _join(face_shape(p), nose, 0.05)


def onto(p: Array, surface=shape, steps: int = 40) -> Array:
    """Return points moved onto a shape along its gradient."""
    p = np.array(p, float)
    h = 1e-5
    for _ in range(steps):
        d = surface(p)
        slope = np.stack([(surface(p + h * e) - surface(p - h * e)) / (2 * h) for e in np.eye(3)], axis=1)
        p -= 0.9 * d[:, None] * slope / np.maximum((slope**2).sum(axis=1, keepdims=True), 1e-6)
    return p


def front(x: Array, y: Array, surface=head_shape) -> Array:
    """Return z of the foremost surface at places (x, y), by bisection."""
    x, y = np.broadcast_arrays(np.asarray(x, float), np.asarray(y, float))
    low, high = np.zeros(x.shape), np.full(x.shape, 1.6)
    for _ in range(50):
        middle = (low + high) / 2
        inside = surface(np.stack([x, y, middle], axis=-1).reshape(-1, 3)).reshape(x.shape) < 0
        low, high = np.where(inside, middle, low), np.where(inside, high, middle)
    return low


# ---- the eye opening on the ball ----
def _eye_axes() -> Array:
    """Return the rows outwards, up, forwards of the opening: it looks a little to the side."""
    yaw, pitch = np.radians(9.0), np.radians(-1.0)
    forward = np.array([np.sin(yaw) * np.cos(pitch), np.sin(pitch), np.cos(yaw) * np.cos(pitch)])
    out = np.cross([0.0, 1.0, 0.0], forward)
    out /= np.linalg.norm(out)
    return np.stack([out, np.cross(forward, out), forward])


def lid_ring(outside: float, radius: float, count: int = 20) -> Array:
    """Return a ring round the left eye: ``outside`` degrees outside the margin, at a distance from the centre.

    Starts at the outer corner and goes over the upper lid to the inner one.
    """
    angle = 2 * np.pi * np.arange(count) / count
    c, s = np.cos(angle), np.sin(angle)
    side = np.where(c > 0, 50.0, 43.0) + outside * np.where(c > 0, 1.0, 0.8)
    high = np.where(s > 0, 36.0, 38.0) + outside * np.where(s > 0, 1.0, 0.75)
    across, up = side * c, high * s
    up += np.where(s > 0, 3.0 * s * s * -c, 0.0) + 2.0 * np.abs(c) ** 3 * np.sign(c)     # the arch leans inwards
    turn = np.radians(np.hypot(across, up))[:, None]
    flat = np.stack([across, up], axis=1) / np.maximum(np.hypot(across, up), 1e-9)[:, None]
    out, upward, forward = _eye_axes()
    direction = np.cos(turn) * forward + np.sin(turn) * (flat[:, :1] * out + flat[:, 1:] * upward)
    return EYE + radius * direction


def orbit_ring(count: int = 20) -> Array:
    """Return the loop round the left eye where the lids' skin goes over into the face."""
    angle = 2 * np.pi * np.arange(count) / count
    c, s = np.cos(angle), np.sin(angle)
    beside_nose = np.where((c < 0) & (s < 0), 1.0 - 0.45 * np.abs(c * s), 1.0)
    x = EYE[0] + 0.325 * c
    y = EYE[1] + np.where(s > 0, 0.44, 0.335) * s * beside_nose
    return on_lids(np.stack([x, y, 0 * x], axis=1), lid_ring(27.0, EYE_RADIUS))


def on_lids(ahead: Array, around: Array) -> Array:
    """Return rings round the left eye on the face: the inner half of ``ahead`` goes there along z, the outer half of
    ``around`` away from the ball, for there the face turns away."""
    c = np.cos(2 * np.pi * np.arange(len(ahead)) / len(ahead))
    outer = np.clip(1.4 * c - 0.1, 0.0, 1.0)[:, None]
    ahead = np.stack([*ahead[:, :2].T, front(ahead[:, 0], ahead[:, 1], face_shape)], axis=1)
    return onto((1.0 - outer) * ahead + outer * from_ball(around), face_shape)


def from_ball(points: Array) -> Array:
    """Return where rays from the left eyeball's centre through points leave the face first: steps, then bisection."""
    ray = (points - EYE) / np.linalg.norm(points - EYE, axis=1, keepdims=True)
    reach, step = np.full(len(ray), EYE_RADIUS), 0.004
    for _ in range(150):
        reach += np.where(face_shape(EYE + reach[:, None] * ray) < 0, step, 0.0)
    low, high = reach - step, reach
    for _ in range(40):
        middle = (low + high) / 2
        inside = face_shape(EYE + middle[:, None] * ray) < 0
        low, high = np.where(inside, middle, low), np.where(inside, high, middle)
    return EYE + low[:, None] * ray


# ---- the mesh ----
@dataclass
class Skin:
    """Vertices, quads (or triangles) with a material each, and rings by name."""

    points: list[Array] = field(default_factory=list)
    faces: list[tuple[int, ...]] = field(default_factory=list)
    materials: list[str] = field(default_factory=list)
    rings: dict[str, list[int]] = field(default_factory=dict)

    def add(self, points: Array) -> list[int]:
        first = len(self.points)
        self.points.extend(np.asarray(points, float))
        return list(range(first, len(self.points)))

    def band(self, outer: Sequence[int], inner: Sequence[int], material: str = "skin") -> None:
        """Fill between two rings that run counter-clockwise, seen from outside."""
        n = len(outer)
        for i in range(n):
            j = (i + 1) % n
            self.faces.append((outer[i], outer[j], inner[j], inner[i]))
            self.materials.append(material)

    def cap(self, ring: Sequence[int], wide: int, high: int, material: str, bulge: Array) -> list[int]:
        """Close a ring of 2 (wide + high) vertices by a grid; ``bulge`` (3,) lifts its middle. Returns what is new."""
        grid = {cell: ring[i] for i, cell in enumerate(_loop((0, wide, 0, high)))}
        start = {cell: self.points[i] for cell, i in grid.items()}
        for a in range(1, wide):
            for b in range(1, high):
                s, t = a / wide, b / high
                across = (1 - s) * start[0, b] + s * start[wide, b]
                along = (1 - t) * start[a, 0] + t * start[a, high]
                lift = 16 * s * (1 - s) * t * (1 - t)
                grid[a, b] = self.add([(across + along) / 2 + lift * np.asarray(bulge)])[0]
        for a in range(wide):
            for b in range(high):
                self.faces.append((grid[a, b], grid[a + 1, b], grid[a + 1, b + 1], grid[a, b + 1]))
                self.materials.append(material)
        return [grid[a, b] for a in range(1, wide) for b in range(1, high)]


def _loop(hole: tuple[int, int, int, int]) -> list[tuple[int, int]]:
    """Return the cells' corners round a hole, counter-clockwise from the middle of its right side."""
    c0, c1, r0, r1 = hole
    middle = (r0 + r1) // 2
    return ([(c1, r) for r in range(middle, r1)] + [(c, r1) for c in range(c1, c0, -1)]
            + [(c0, r) for r in range(r1, r0, -1)] + [(c, r0) for c in range(c0, c1)]
            + [(c1, r) for r in range(r0, middle)])


def _mirrored(ring: Array) -> Array:
    """Return a ring's mirror image, again counter-clockwise from its right."""
    n = len(ring)
    return ring[(n // 2 - np.arange(n)) % n] * MIRROR


def _mirrored_hole(hole: tuple[int, int, int, int]) -> tuple[int, int, int, int]:
    return (-hole[1], -hole[0], *hole[2:])


def mouth_ring(half: float, above: float, below: float, ahead: float, *, flat: bool = False) -> Array:
    """Return a ring round the slit: its half width, heights over and under the slit, and how far before the face.

    flat: the depth is measured from the height of the slit, for what lies deep inside.
    """
    angle = 2 * np.pi * np.arange(20) / 20
    c, s = np.cos(angle), np.sin(angle)
    x = half * c
    s = np.sign(s) * np.abs(s) ** 0.6 if flat else s
    y = MOUTH + 0.055 * (x / MOUTH_HALF) ** 2 + np.where(s > 0, above, below) * s
    return np.stack([x, y, front(x, MOUTH if flat else y) + ahead], axis=1)


def nose_ring(polar: float) -> Array:
    """Return a ring round the nose, ``polar`` degrees from its axis."""
    angle = 2 * np.pi * np.arange(16) / 16
    t = np.radians(polar)
    direction = np.stack([np.sin(t) * np.cos(angle), np.sin(t) * np.sin(angle), np.full(16, np.cos(t))], axis=1)
    return np.array([0.0, -0.185, 0.93]) + direction * (0.20, 0.17, 0.19)


def ear_root(long: float, wide: float, back: float) -> Array:
    """Return a ring on the head round the root of the left ear: half its length and width, how far it lies behind."""
    angle = 2 * np.pi * np.arange(12) / 12
    across = np.stack([0 * angle, long * np.sin(angle), -back - wide * np.cos(angle)], axis=1)
    return onto(EAR + across, head_shape)


def ear_ring(long: float, wide: float, out: float, ahead: float) -> Array:
    """Return a ring of the left ear in its own plane, which leans back: half its length and width, how far its middle is
    out from the root, and how far it lies before the plane."""
    angle = 2 * np.pi * np.arange(12) / 12
    c, s = np.cos(angle), np.sin(angle)
    lean, tilt = np.radians(50.0), np.radians(10.0)
    outwards = np.array([np.cos(lean), 0.0, -np.sin(lean)])
    facing = np.array([np.sin(lean), 0.0, np.cos(lean)])
    upwards = np.cos(tilt) * np.array([0.0, 1.0, 0.0]) + np.sin(tilt) * outwards
    taper = 1.0 + 0.22 * s                                                          # wider above than at the lobe
    return EAR + long * s[:, None] * upwards + (out + wide * taper * c)[:, None] * outwards + ahead * facing


def head_skin() -> Skin:
    """Return the skin."""
    skin = Skin()
    grid = _grid(skin)
    fixed = _set_loops(skin, grid)
    loops = np.unique([i for name in ("eye_L", "eye_R", "nose", "mouth") for i in skin.rings[f"{name}_0"]])
    _eyes(skin)
    _mouth(skin)
    _nose(skin)
    _ears(skin)
    _relax(skin, grid, np.flatnonzero(~fixed), loops)
    skin.faces = [_split_well(face, np.array(skin.points)[list(face)]) for face in skin.faces]
    return skin


def _split_well(face: tuple[int, ...], corners: Array) -> tuple[int, ...]:
    """Return a quad with the first corner from which a reader should split it: along its shorter diagonal, and alike on
    both sides of the face."""
    if len(face) != 4:
        return face
    one, other = np.linalg.norm(corners[2] - corners[0]), np.linalg.norm(corners[3] - corners[1])
    turned = one > other if abs(one - other) > 1e-6 else corners[:, 0].sum() < 0
    return face[1:] + face[:1] if turned else face


def _grid(skin: Skin) -> dict[tuple[int, int], int]:
    """Add the grid, its faces around the holes, and the crown; return cell corner -> vertex."""
    holes = [EYE_HOLE, _mirrored_hole(EYE_HOLE), NOSE_HOLE, MOUTH_HOLE, EAR_HOLE, _mirrored_hole(EAR_HOLE)]
    columns = range(-COLUMNS // 2, COLUMNS // 2)

    def wrapped(c: int) -> int:
        return (c + COLUMNS // 2) % COLUMNS - COLUMNS // 2

    around = np.radians([0, 6, 11, 17, 23, 29, 35, 41, 48, 58, 72, 90, 108, 128, 152, 180])
    heights = np.interp(np.arange(ROWS), [0, 1, 2, 3, 4, 5, 6, 7, 9, 10, 14, 15, 19, 20, 21, 23],
                        [-1.25, -1.07, -1.0, -0.985, -0.96, -0.91, -0.82, -0.7, -0.40, -0.34, -0.02, 0.0, 0.5, 0.6, 0.68, 0.93])
    grid: dict[tuple[int, int], int] = {}
    for r in range(ROWS):
        for c in columns:
            if any(c0 < c < c1 and r0 < r < r1 for c0, c1, r0, r1 in holes):
                continue
            angle = np.sign(c) * around[abs(c)]
            wide = 0.33 if r < 3 else 0.85 * np.sqrt(max(1 - ((heights[r] - 0.05) / 1.02) ** 2, 0.02))
            centre = -0.10 if r < 3 else 0.0
            grid[c, r] = skin.add([[wide * np.sin(angle), heights[r], centre + wide * np.cos(angle)]])[0]
    for r in range(ROWS - 1):
        for c in columns:
            if any(c0 <= c < c1 and r0 <= r < r1 for c0, c1, r0, r1 in holes):
                continue
            d = wrapped(c + 1)
            skin.faces.append((grid[c, r], grid[d, r], grid[d, r + 1], grid[c, r + 1]))
            skin.materials.append("skin")
    crown = skin.add([[0.0, 1.05, -0.1]])[0]
    for c in columns:
        skin.faces.append((grid[c, ROWS - 1], grid[wrapped(c + 1), ROWS - 1], crown))
        skin.materials.append("skin")
    skin.rings["crown"] = [crown]
    skin.rings["neck"] = [grid[c, 0] for c in columns]
    skin.rings["throat"] = [grid[c, 1] for c in columns]
    skin.rings["middle"] = [grid[0, r] for r in range(ROWS) if (0, r) in grid]
    for name, hole in (("eye_L", EYE_HOLE), ("eye_R", _mirrored_hole(EYE_HOLE)), ("nose", NOSE_HOLE),
                       ("mouth", MOUTH_HOLE), ("ear_L", EAR_HOLE), ("ear_R", _mirrored_hole(EAR_HOLE))):
        skin.rings[f"{name}_0"] = [grid[cell] for cell in _loop(hole)]
    return grid


def _set_loops(skin: Skin, grid: dict[tuple[int, int], int]) -> NDArray[np.bool_]:
    """Place the loops round the holes, the neck and the crown; return what is placed (n,)."""
    fixed = np.zeros(len(skin.points), bool)

    def place(name: str, points: Array) -> None:
        for i, point in zip(skin.rings[name], points, strict=True):
            skin.points[i] = point
            fixed[i] = True

    eye = orbit_ring()
    place("eye_L_0", eye)
    place("eye_R_0", _mirrored(eye))
    place("nose_0", onto(nose_ring(112.0) * (1.0, 1.0, 0.98), head_shape))
    place("mouth_0", mouth_ring(MOUTH_HALF + 0.12, 0.14, 0.16, 0.0))
    ear = ear_root(0.30, 0.19, 0.05)
    place("ear_L_0", ear)
    place("ear_R_0", _mirrored(ear))
    angle = 2 * np.pi * np.arange(-COLUMNS // 2, COLUMNS // 2) / COLUMNS
    for name, high in (("neck", -1.25), ("throat", -1.09)):
        ring = np.stack([0.31 * np.sin(angle), np.full(COLUMNS, high), -0.09 + 0.31 * np.cos(angle)], axis=1)
        place(name, onto(ring))
    skin.points[skin.rings["crown"][0]] = onto(np.array([[0.0, 1.05, -0.1]]))[0]
    fixed[skin.rings["crown"]] = True
    return fixed


def _relax(skin: Skin, grid: dict[tuple[int, int], int], loose: NDArray[np.intp], loops: NDArray[np.intp]) -> None:
    """Lay the loose vertices on the shape so that rows and columns flow evenly out of the loops they end in.

    Minimises the bending sum_i |p_i - mean of its neighbours|^2 over the loose vertices and the loops, in implicit
    steps with a projection after each. (Plain averaging pulls rows straight, across the loops.)
    """
    n = len(skin.points)
    pairs = np.array([pair for f in skin.faces for pair in zip(f, f[1:] + f[:1], strict=True)])
    beside = sparse.csr_array((np.ones(2 * len(pairs)), (pairs.ravel(), pairs[:, ::-1].ravel())), shape=(n, n))
    beside.data[:] = 1.0
    bend = (sparse.eye_array(n) - sparse.diags_array(1.0 / beside.sum(axis=1)) @ beside).tocsr()
    stretch = bend[loose]
    bend = bend[np.concatenate([loose, loops])]
    energy = (STIFF * (bend.T @ bend) + TAUT * (stretch.T @ stretch)).tocsr()
    held = np.setdiff1d(np.arange(n), loose)
    p = np.array(skin.points)
    p[loose] = onto(p[loose])
    step = splu((sparse.eye_array(len(loose)) + energy[loose][:, loose]).tocsc())
    pull = energy[loose][:, held] @ p[held]
    for _ in range(60):
        p[loose] = onto(step.solve(p[loose] - pull), steps=3)
    p[loose] = onto(p[loose])
    for (c, r), i in grid.items():                                     # mirror images to the last bit
        if 0 < c < COLUMNS // 2:
            p[grid[-c, r]] = p[i] * MIRROR
        else:
            p[i, 0] = p[i, 0] if c % (COLUMNS // 2) else 0.0
    skin.points[:] = list(p)


def _eyes(skin: Skin) -> None:
    """Fill the holes of the eyes: lid skin over the ball, the rim, and a lining behind it."""
    full = EYE_RADIUS + LID
    near = lid_ring(11.0, full)
    between = 0.42 * orbit_ring() + 0.58 * near
    rings = [("skin", on_lids(between, between)), ("skin", on_lids(near, near)), ("skin", lid_ring(4.0, full)),
             ("lid", lid_ring(0.3, EYE_RADIUS + 0.6 * LID)), ("lid", lid_ring(0.0, EYE_RADIUS + LID_GAP)),
             ("lid", lid_ring(9.0, EYE_RADIUS + LID_GAP))]
    for side in "LR":
        outer = skin.rings[f"eye_{side}_0"]
        for number, (material, ring) in enumerate(rings, 1):
            inner = skin.add(ring if side == "L" else _mirrored(ring))
            skin.band(outer, inner, material)
            skin.rings[f"eye_{side}_{number}"] = outer = inner


def _mouth(skin: Skin) -> None:
    """Fill the hole of the mouth: lips, the slit, and the lining of the cavity."""
    w, g = MOUTH_HALF, SLIT / 2
    rings = [("skin", mouth_ring(w + 0.055, 0.095, 0.115, 0.004)),
             ("skin", mouth_ring(w + 0.018, 0.058, 0.090, 0.016)),
             ("lips", mouth_ring(w + 0.004, 0.030, 0.048, 0.036)),
             ("lips", mouth_ring(w, g, g, 0.022)),
             ("lips", mouth_ring(w - 0.004, 0.012, 0.012, -0.040)),
             ("mouth", mouth_ring(w + 0.004, 0.13, 0.14, -0.055)),
             ("mouth", mouth_ring(w + 0.01, 0.17, 0.185, -0.25, flat=True)),
             ("mouth", mouth_ring(w - 0.05, 0.15, 0.175, -0.50, flat=True))]
    outer = skin.rings["mouth_0"]
    for number, (material, ring) in enumerate(rings, 1):
        inner = skin.add(ring)
        skin.band(outer, inner, material)
        skin.rings[f"mouth_{number}"] = outer = inner
    skin.rings["gullet"] = skin.cap(outer, 8, 2, "mouth", np.array([0.0, 0.0, -0.06]))


def _nose(skin: Skin) -> None:
    """Fill the hole of the nose: a ball that overhangs the face."""
    outer = skin.rings["nose_0"]
    for number, polar in enumerate((88.0, 62.0, 38.0), 1):
        inner = skin.add(onto(nose_ring(polar)))
        skin.band(outer, inner, "nose")
        skin.rings[f"nose_{number}"] = outer = inner
    new = skin.cap(outer, 4, 4, "nose", np.array([0.0, 0.0, 0.05]))
    for i, point in zip(new, onto(np.array([skin.points[i] for i in new])), strict=True):
        skin.points[i] = point
    skin.rings["nose_tip"] = new


def _ears(skin: Skin) -> None:
    """Fill the holes of the ears: the back, the rim, and the hollow."""
    rings = [("skin", ear_root(0.19, 0.055, 0.08)), ("skin", ear_ring(0.215, 0.125, 0.165, -0.010)),
             ("skin", ear_ring(0.26, 0.15, 0.185, 0.03)), ("skin", ear_ring(0.25, 0.145, 0.185, 0.075)),
             ("nose", ear_ring(0.185, 0.095, 0.18, 0.07)), ("nose", ear_ring(0.125, 0.055, 0.155, 0.025))]
    for side in "LR":
        outer = skin.rings[f"ear_{side}_0"]
        for number, (material, ring) in enumerate(rings, 1):
            inner = skin.add(ring if side == "L" else _mirrored(ring))
            skin.band(outer, inner, material)
            skin.rings[f"ear_{side}_{number}"] = outer = inner
        skin.cap(outer, 2, 4, "nose", np.zeros(3))

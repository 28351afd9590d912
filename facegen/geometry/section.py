"""A head cut at its middle plane: what is left of it, with the cut filled, so that the mouth is seen from inside.

The left half (x > 0) goes. Triangles that cross the plane are cut, and stay cut where they were at rest: every vertex
of the half is a fixed mean of vertices of the whole, so a pose of the whole gives the pose of its half by one product.
Closed curves of the cut, such as the tongue's, are filled with the part's own material; the skin's outline and the
mouth's lining together bound the flesh. The fill is made anew for every pose, for lips and tongue change its shape.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from facegen.geometry.mesh import Mesh

FLESH = "flesh"
"""The material of the cut through skin and what it covers."""

_ON_PLANE = 1e-6        # mm from the plane that are none
_PROUD = 0.3            # mm that the fill of a part stands before the flesh, so that the two do not share one depth
_OUTLINE = ("skin", "mouth")

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Half:
    """The half of a mesh at x <= 0. ``matrix`` (h, n), ``offset`` (h, 3): its vertices from those of the whole.

    ``shell``: what was cut, without fills. ``fills``: curves of vertices, with material and part.
    """

    shell: Mesh
    matrix: sparse.csr_array
    offset: Array
    fills: tuple[tuple[tuple[int, ...], int, int], ...]

    def posed(self, whole: Array) -> Mesh:
        """Return the half of a pose of the whole (n, 3), the cut filled."""
        vertices = self.matrix @ whole + self.offset
        faces, materials, parts = [self.shell.faces], [self.shell.face_materials], [self.shell.face_parts]
        for curve, material, part in self.fills:
            made = np.array(curve)[np.array(_ears(vertices[list(curve)][:, [2, 1]]))]
            faces.append(made)
            materials.append(np.full(len(made), material))
            parts.append(np.full(len(made), part))
        colours = self.shell.colours
        return Mesh(vertices, np.concatenate(faces), self.shell.materials, np.concatenate(materials), self.shell.parts,
                    np.concatenate(parts), colours)


def half_of(mesh: Mesh) -> Half:
    """Return a mesh without what lies at x > 0; a mesh that lies there as a whole loses all its triangles."""
    x = np.where(np.abs(mesh.vertices[:, 0]) < _ON_PLANE, 0.0, mesh.vertices[:, 0])
    rows: list[dict[int, float]] = [{k: 1.0} for k in range(len(x))]
    cut_at: dict[tuple[int, int], int] = {}

    def crossing(a: int, b: int) -> int:
        key = (min(a, b), max(a, b))
        if key not in cut_at:
            share = x[key[0]] / (x[key[0]] - x[key[1]])
            cut_at[key] = len(rows)
            rows.append({key[0]: 1.0 - share, key[1]: share})
        return cut_at[key]

    sides = np.sign(x)[mesh.faces]
    keep = np.flatnonzero((sides <= 0).all(axis=1) & (sides < 0).any(axis=1))
    faces, origin = [tuple(face) for face in mesh.faces[keep].tolist()], keep.tolist()
    for k in np.flatnonzero((sides > 0).any(axis=1) & (sides < 0).any(axis=1)).tolist():
        corners, polygon = mesh.faces[k].tolist(), []
        for a, b in zip(corners, corners[1:] + corners[:1], strict=True):
            if x[a] <= 0:
                polygon.append(a)
            if x[a] * x[b] < 0:
                polygon.append(crossing(a, b))
        for second, third in itertools.pairwise(polygon):
            faces.append((polygon[0], second, third))
            origin.append(k)
    parts, materials = mesh.face_parts[origin], mesh.face_materials[origin]
    names = [*mesh.materials, *([] if FLESH in mesh.materials else [FLESH])]

    places = _matrix(rows, len(x)) @ mesh.vertices
    on_plane = np.abs(places[:, 0]) < 10 * _ON_PLANE
    curves = {name: _curves(np.array(faces, np.int64).reshape(-1, 3)[parts == number], on_plane)
              for number, name in enumerate(mesh.parts)}
    fills: list[tuple[list[int], int, int, float]] = []       # curve, material, part, how far before the plane
    for number, name in enumerate(mesh.parts):
        if name in _OUTLINE:
            continue
        for curve, closed in curves[name]:
            if closed:
                used = materials[parts == number]
                fills.append((curve, int(np.bincount(used).argmax()), number, _PROUD))
    outline = _joined([curve for name in _OUTLINE for curve, _ in curves.get(name, [])], places)
    if outline:
        fills.append((outline, names.index(FLESH), mesh.parts.index(_OUTLINE[0]), 0.0))

    used, flat = np.unique(np.array(faces, np.int64).reshape(-1), return_inverse=True)
    taken, offset, kept = [rows[k] for k in used.tolist()], [0.0] * len(used), []
    for curve, material, part, proud in fills:              # vertices of its own: the cut has a sharp edge
        kept.append((tuple(range(len(taken), len(taken) + len(curve))), material, part))
        taken += [rows[k] for k in curve]
        offset += [proud] * len(curve)
    matrix = _matrix(taken, len(x))
    shift = np.zeros((len(taken), 3))
    shift[:, 0] = offset
    colours = None if mesh.colours is None else np.clip(matrix @ mesh.colours, 0.0, 255.0)
    shell = Mesh(matrix @ mesh.vertices + shift, flat.reshape(-1, 3), tuple(names), materials, mesh.parts, parts,
                 colours)
    return Half(shell, matrix, shift, tuple(kept))


def _matrix(rows: Sequence[dict[int, float]], count: int) -> sparse.csr_array:
    at = [k for k, row in enumerate(rows) for _ in row]
    columns = [column for row in rows for column in row]
    values = np.array([value for row in rows for value in row.values()])
    return sparse.csr_array((values, (np.array(at, np.int64), np.array(columns, np.int64))), shape=(len(rows), count))


def _curves(faces: NDArray[np.int64], on_plane: NDArray[np.bool_]) -> list[tuple[list[int], bool]]:
    """Return the curves of vertices along which faces end at the plane, and whether each is closed."""
    sides = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]) if len(faces) else faces[:, :2]
    sides = sides[on_plane[sides].all(axis=1)]
    known = {(a, b) for a, b in sides.tolist()}
    after: dict[int, int] = {a: b for a, b in known if (b, a) not in known}
    starts = [a for a in after if a not in set(after.values())]
    found = []
    while after:
        start = starts.pop() if starts else next(iter(after))
        curve = [start]
        while curve[-1] in after:
            curve.append(after.pop(curve[-1]))
        closed = curve[0] == curve[-1]
        found.append((curve[:-1] if closed else curve, closed))
    return [(curve, closed) for curve, closed in found if len(curve) > 2]


def _joined(curves: list[list[int]], places: Array) -> list[int]:
    """Return curves as one, each going on where the nearest end is; nothing if there are none."""
    left = sorted(curves, key=len)
    if not left:
        return []
    whole = list(left.pop())
    while left:
        end = places[whole[-1]]
        gaps = [(float(np.linalg.norm(places[curve[tip]] - end)), k, tip)
                for k, curve in enumerate(left) for tip in (0, -1)]
        _, k, tip = min(gaps)
        curve = left.pop(k)
        whole += curve if tip == 0 else curve[::-1]
    return whole


def _ears(points: Array) -> list[tuple[int, int, int]]:
    """Return triangles that fill a simple polygon (k, 2), by clipping ears; turned so that they face +x for (z, y)."""
    left = list(range(len(points)))
    x, y = points[:, 0], points[:, 1]
    if float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)) < 0:
        left.reverse()
    made = []
    while len(left) > 3:
        ring = points[left]
        a, c = np.roll(ring, 1, axis=0), np.roll(ring, -1, axis=0)
        turn = _area(a, ring, c)
        best = None
        for k in np.argsort(-_shape(a, ring, c)):
            if turn[k] <= 0:
                continue
            others = np.delete(ring, [(k - 1) % len(left), k, (k + 1) % len(left)], axis=0)
            inside = (_area(a[k], ring[k], others) >= 0) & (_area(ring[k], c[k], others) >= 0) \
                & (_area(c[k], a[k], others) >= 0)
            if not inside.any():
                best = int(k)
                break
        if best is None:                    # a curve that crosses itself: the flattest corner goes
            best = int(np.argmin(np.abs(turn)))
        made.append((left[best - 1], left[best], left[(best + 1) % len(left)]))
        del left[best]
    made.append(tuple(left))
    return [(a, c, b) for a, b, c in made]


def _area(a: Array, b: Array, c: Array) -> Array:
    """Return twice the signed area of triangles (..., 2)."""
    return (b[..., 0] - a[..., 0]) * (c[..., 1] - a[..., 1]) - (b[..., 1] - a[..., 1]) * (c[..., 0] - a[..., 0])


def _shape(a: Array, b: Array, c: Array) -> Array:
    """Return how near triangles are to equilateral: area over the longest side squared."""
    longest = np.maximum(np.maximum(((a - b) ** 2).sum(-1), ((b - c) ** 2).sum(-1)), ((c - a) ** 2).sum(-1))
    return _area(a, b, c) / np.maximum(longest, 1e-12)

"""A separate piece of the cartoon, built from rings of vertices."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from head import Array, face_shape, front, head_shape, onto
from rings import turns


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

    def tube(self, rings: Sequence[Array], materials: str | Sequence[str], *, tips: tuple = (None, None),
             closed: bool = False) -> list[list[int]]:
        """Join rings in their order; ``tips`` close the ends, ``closed`` joins the last to the first instead."""
        rows = [self.add(ring) for ring in rings]
        rows += rows[:1] * closed
        names = [materials] * (len(rows) - 1) if isinstance(materials, str) else list(materials)
        for a, b, name in zip(rows, rows[1:], names, strict=False):
            n = len(a)
            for i in range(n):
                self.face((a[i], b[i], b[(i + 1) % n], a[(i + 1) % n]), name)
        for row, tip, flip, name in ((rows[0], tips[0], False, names[0]), (rows[-1], tips[1], True, names[-1])):
            if tip is not None:
                top = self.add([tip])[0]
                for i, j in zip(row, row[1:] + row[:1], strict=True):
                    self.face((j, i, top) if flip else (top, i, j), name)
        return rows

    def face(self, face: tuple[int, ...], material: str) -> None:
        """Append a polygon."""
        self.faces.append(face)
        self.materials.append(material)

    def outwards(self) -> Piece:
        """Return the piece with its shell turned so that it encloses a positive volume."""
        p = np.array(self.points)
        volume = sum(np.dot(p[f[0]], np.cross(p[f[i]], p[f[i + 1]])) for f in self.faces for i in range(1, len(f) - 1))
        if volume < 0:
            self.faces = [face[::-1] for face in self.faces]
        return self


def swept(path: Array, across: Array, ahead: Array, wide: Array, thick: Array, n: int) -> list[Array]:
    """Return rings round a path (k, 3) with half axes ``wide`` along ``across`` and ``thick`` along ``ahead``."""
    c, s = turns(n)
    return [p + w * c[:, None] * a + t * s[:, None] * h
            for p, a, h, w, t in zip(path, across, ahead, wide, thick, strict=True)]


def above(points: Array, lift: Array | float) -> Array:
    """Return points moved to a height over the head."""
    return onto(points, lambda p: head_shape(p) - lift)


def on_face(x: Array, y: Array, lift: Array | float) -> tuple[Array, Array, Array, Array]:
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

"""Vertices and triangles while they are being made: rows of vertices, bands between rows, caps, mirror images."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from clay import mirrored
from numpy.typing import ArrayLike, NDArray

from facegen.geometry.mesh import Mesh


class Sheet:
    """One part under construction. Rows are arrays of vertex numbers."""

    def __init__(self, part: str) -> None:
        self.part = part
        self.vertices: list[NDArray] = []
        self.faces: list[tuple[int, int, int]] = []
        self.materials: list[str] = []

    def row(self, points: ArrayLike) -> NDArray[np.int64]:
        """Add vertices (k, 3) and return their numbers."""
        points = np.atleast_2d(np.asarray(points, float))
        start = len(self.vertices)
        self.vertices += list(points)
        return np.arange(start, start + len(points))

    def at(self, rows: ArrayLike) -> NDArray:
        """Return the places of vertices."""
        return np.array(self.vertices)[rows]

    def triangles(self, faces: ArrayLike, material: str | Sequence[str]) -> None:
        """Add triangles (m, 3), of one material or one each."""
        faces = [tuple(int(i) for i in f) for f in np.asarray(faces)]
        self.faces += faces
        self.materials += [material] * len(faces) if isinstance(material, str) else list(material)

    def band(self, first: ArrayLike, second: ArrayLike, material: str | Sequence[str], *, closed: bool = True) -> None:
        """Add the quads between two rows of equal length, each cut along its shorter diagonal.

        material: of all, or of each quad.
        """
        first, second = np.asarray(first), np.asarray(second)
        count = len(first) if closed else len(first) - 1
        for i in range(count):
            j = (i + 1) % len(first)
            a, b, c, d = (int(x) for x in (first[i], first[j], second[j], second[i]))
            short = np.linalg.norm(self.vertices[a] - self.vertices[c]) <= np.linalg.norm(
                self.vertices[b] - self.vertices[d]
            )
            cut = [(a, b, c), (a, c, d)] if short else [(a, b, d), (b, c, d)]
            self.triangles([t for t in cut if len(set(t)) == 3], material if isinstance(material, str) else material[i])

    def tube(self, rows: Sequence[NDArray], material: str, *, closed: bool = True) -> list[NDArray]:
        """Add rows of points (each (k, 3)) and the bands between them; return the rows' numbers."""
        numbers = [self.row(r) for r in rows]
        for a, b in pairwise(numbers):
            self.band(a, b, material, closed=closed)
        return numbers

    def cap(self, ring: ArrayLike, material: str, top: ArrayLike | None = None) -> None:
        """Close a ring with a fan about ``top`` (its middle if not given)."""
        ring = np.asarray(ring)
        middle = self.row(self.at(ring).mean(axis=0) if top is None else top)[0]
        self.triangles([(ring[i], ring[(i + 1) % len(ring)], middle) for i in range(len(ring))], material)

    def mesh(self, *, mirror: bool = False) -> Mesh:
        """Return the mesh, turned outside out; with ``mirror`` joined to its mirror image along x = 0."""
        vertices, faces, names = np.array(self.vertices), np.array(self.faces), list(self.materials)
        faces = orient(faces, vertices)
        if mirror:
            twin = np.arange(len(vertices))
            off = np.flatnonzero(np.abs(vertices[:, 0]) > 1e-9)
            twin[off] = len(vertices) + np.arange(len(off))
            vertices[np.abs(vertices[:, 0]) <= 1e-9, 0] = 0.0
            vertices = np.concatenate([vertices, mirrored(vertices[off])])
            faces = np.concatenate([faces, twin[faces][:, ::-1]])
            names = names + names
            faces = orient(faces, vertices)
        materials = tuple(dict.fromkeys(names))
        order = np.argsort([materials.index(n) for n in names], kind="stable")
        return Mesh(
            vertices,
            faces[order],
            materials,
            np.array([materials.index(names[i]) for i in order]),
            (self.part,),
            np.zeros(len(faces), int),
        )


def mirror_image(mesh: Mesh) -> Mesh:
    """Return the mesh on the other side of the plane x = 0, still outside out."""
    return replace(mesh, vertices=mirrored(mesh.vertices), faces=mesh.faces[:, ::-1])


def orient(faces: NDArray, vertices: NDArray) -> NDArray:
    """Return the faces turned alike in each connected piece, outside out (its signed volume is positive)."""
    beside: dict[frozenset, list[int]] = defaultdict(list)
    for number, f in enumerate(faces):
        for i in range(3):
            beside[frozenset((int(f[i - 1]), int(f[i])))].append(number)
    out = [tuple(int(i) for i in f) for f in faces]
    seen = np.zeros(len(faces), bool)
    for seed in range(len(faces)):
        if seen[seed]:
            continue
        seen[seed], piece, stack = True, [seed], [seed]
        while stack:
            f = out[stack.pop()]
            for i in range(3):
                a, b = f[i - 1], f[i]
                for other in beside[frozenset((a, b))]:
                    if seen[other]:
                        continue
                    g = out[other]
                    if any((g[k - 1], g[k]) == (a, b) for k in range(3)):
                        out[other] = g[::-1]
                    seen[other] = True
                    piece.append(other)
                    stack.append(other)
        corner = vertices[np.array([out[i] for i in piece])]
        middle = corner.mean(axis=(0, 1))
        corner = corner - middle
        if np.einsum("ij,ij->", corner[:, 0], np.cross(corner[:, 1], corner[:, 2])) < 0:
            for i in piece:
                out[i] = out[i][::-1]
    return np.array(out)

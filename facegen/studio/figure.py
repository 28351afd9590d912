"""A face in the browser's scene: one mesh for each colour, since viser's meshes have one each.

The scene is in decimetres of a head of the base face's size, +x the subject's left, +y up, +z forward, so that
viser's own sizes (near plane, points, gizmos) fit.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from facegen.face.colours import CLAY, COLOURS
from facegen.geometry.mesh import Mesh

Array = NDArray[np.float64]

SCALE = 0.01
"""Of the scene, from millimetres."""

# Colours of vertices are gathered into so many meshes: more cost an update each and show no more.
_COLOURS = 10
_ALIKE = 16.0           # sRGB 0..255: colours nearer than this are one


@dataclass(frozen=True, eq=False)
class Hit:
    """A place on a figure: ``face`` (triangle), ``barycentric`` (3,) and ``point`` (3,) in mm."""

    face: int
    barycentric: tuple[float, float, float]
    point: Array


class Figure:
    """One mesh in a scene. ``mesh``; ``vertices`` (n, 3), mm, as last shown; ``offset`` (3,), mm, where it stands."""

    def __init__(self, scene: Any, name: str, mesh: Mesh, *, colours: Any = None, offset: ArrayLike = (0.0, 0.0, 0.0),
                 opacity: float | None = None) -> None:
        self.name, self.mesh = name, mesh
        self.offset = np.asarray(offset, np.float64)
        self.vertices: Array = mesh.vertices
        self._handles = []
        for row, (colour, faces) in enumerate(coloured(mesh, colours)):
            rows, corners = np.unique(mesh.faces[faces], return_inverse=True)
            handle = scene.add_mesh_simple(
                f"/figures/{name}/{row}", self.place(mesh.vertices[rows]), corners.reshape(-1, 3), color=colour,
                side="front" if _lines(mesh, faces) else "double", opacity=opacity, cast_shadow=False,
                receive_shadow=False)
            self._handles.append((handle, rows))

    def place(self, points: ArrayLike) -> NDArray[np.float32]:
        """Return places in the scene of points (..., 3), mm."""
        return ((np.asarray(points) + self.offset) * SCALE).astype(np.float32)

    def unplace(self, points: ArrayLike) -> Array:
        """Return points (..., 3), mm, of places in the scene."""
        return np.asarray(points, np.float64) / SCALE - self.offset

    def show(self, vertices: Array) -> None:
        """Show other vertices (n, 3), mm; meshes in which none moves are not sent."""
        for handle, rows in self._handles:
            if not np.array_equal(vertices[rows], self.vertices[rows]):
                handle.vertices = self.place(vertices[rows])
        self.vertices = vertices

    def visible(self, shown: bool) -> None:
        """Show or hide it."""
        for handle, _ in self._handles:
            handle.visible = shown

    def fade(self, opacity: float | None) -> None:
        """Let what is inside be seen, or with None no more; one that was taken away is left alone."""
        for handle, _ in self._handles:
            handle.opacity = opacity

    def remove(self) -> None:
        """Take it from the scene; what is asked of it afterwards does nothing."""
        for handle, _ in self._handles:
            handle.remove()
        self._handles = []

    def pick(self, origin: ArrayLike, direction: ArrayLike) -> Hit | None:
        """Return the place that a ray of the scene meets first, on the vertices last shown."""
        start, way = self.unplace(origin), np.asarray(direction, np.float64)
        a, b, c = (self.vertices[self.mesh.faces[:, k]] for k in range(3))
        ab, ac = b - a, c - a
        across = np.cross(way, ac)
        det = np.einsum("ij,ij->i", ab, across)
        with np.errstate(divide="ignore", invalid="ignore"):
            to = start - a
            u = np.einsum("ij,ij->i", to, across) / det
            turned = np.cross(to, ab)
            v = turned @ way / det
            t = np.einsum("ij,ij->i", ac, turned) / det
            met = (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0) & (t > 0.0)
        if not met.any():
            return None
        face = int(np.flatnonzero(met)[t[met].argmin()])
        weights = (float(1.0 - u[face] - v[face]), float(u[face]), float(v[face]))
        return Hit(face, weights, np.asarray(weights) @ self.vertices[self.mesh.faces[face]])


def coloured(mesh: Mesh, colours: Any = None) -> list[tuple[tuple[int, int, int], NDArray[np.int64]]]:
    """Return the triangles of each colour, sRGB 0..255.

    colours: material -> colour instead of the usual ones. A mesh with colours of vertices has them gathered.
    """
    if mesh.colours is not None:
        return _gathered(mesh)
    usual = {**COLOURS, **(colours or {})}
    found: dict[tuple[int, int, int], list[NDArray[np.int64]]] = {}
    for row, material in enumerate(mesh.materials):
        faces = np.flatnonzero(mesh.face_materials == row)
        if len(faces):
            found.setdefault(_rgb(usual.get(material, CLAY)), []).append(faces)
    return [(colour, np.sort(np.concatenate(faces))) for colour, faces in found.items()]


def _lines(mesh: Mesh, faces: NDArray[np.int64]) -> bool:
    """Whether triangles line a mouth and are wound to be seen from within: their outer side is then not drawn.

    Nothing sees it, and browsers without a GPU (SwiftShader) miss the depth of triangles seen edge-on by 2 cm and more
    where they smooth edges: the lining's were dark ticks on the cheeks, half of which lie on that side.
    """
    if any(mesh.materials[row] != "mouth" for row in np.unique(mesh.face_materials[faces])):
        return False
    corners = mesh.vertices[mesh.faces[faces]]
    a, b, c = np.moveaxis(corners - corners.mean(axis=(0, 1)), 1, 0)
    return bool(np.einsum("ij,ij->", a, np.cross(b, c)) < 0.0)


def _gathered(mesh: Mesh) -> list[tuple[tuple[int, int, int], NDArray[np.int64]]]:
    """Return the triangles of `_COLOURS` colours that lie far apart, each triangle with the nearest."""
    each = mesh.colours[mesh.faces].mean(axis=1, dtype=np.float64)
    chosen = [np.median(each, axis=0)]
    away = np.linalg.norm(each - chosen[0], axis=1)
    while len(chosen) < _COLOURS and away.max() > _ALIKE:
        chosen.append(each[away.argmax()])
        away = np.minimum(away, np.linalg.norm(each - chosen[-1], axis=1))
    of = np.linalg.norm(each[:, None] - np.array(chosen), axis=2).argmin(axis=1)
    return [(_rgb(each[of == k].mean(axis=0)), np.flatnonzero(of == k)) for k in np.unique(of)]


def _rgb(colour: ArrayLike) -> tuple[int, int, int]:
    red, green, blue = (round(float(each)) for each in np.asarray(colour))
    return red, green, blue

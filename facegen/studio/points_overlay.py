"""What the tab of points draws on the face: feature points, regions, the centre O and the jaw's axis.

All rides on the posed surface: `PointsOverlay.ride` is called after each picture, in the stage's thread.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from facegen.face.face import Face
from facegen.face.region_map import RegionMap, region_map
from facegen.geometry.normals import vertex_normals
from facegen.studio.figure import SCALE, Figure

Array = NDArray[np.float64]

REGIONS = ("hidden", "borders", "tinted")
"""How regions are shown."""

# sRGB.
_MOVABLE, _FIXED, _MOVED, _CHOSEN = (176, 16, 8), (90, 92, 98), (8, 60, 150), (255, 190, 0)
_BORDER, _CENTRE = (52, 58, 72), (40, 120, 90)
_TINTS = ((196, 84, 60), (66, 128, 190), (232, 184, 74), (96, 158, 98), (150, 98, 170), (90, 176, 178))
_SIZE, _FEWER, _CHOSEN_SIZE = 1.15, 1.8, 1.5     # mm: of a point on a face of many, of few; the chosen one is larger
_MANY = 40
_GRIP = 1.8             # times a point's size: so near the mouse takes it
_TINTED = 0.45          # opacity
_THROUGH = 0.6          # opacity of the skin while what lies inside is shown
_PROUD = 0.25           # mm that tints and borders stand before the skin, so that they are not lost in it
_BESIDE = np.array([2.0, 2.0, 3.0])
_AXIS = 85.0            # mm of the jaw's axis to either side
_RIGID = 0.999          # a point that makes so much of the head's turn turns with the skull


@lru_cache(maxsize=8)
def map_of(face: Face) -> RegionMap:
    """Return where a face's regions lie, worked out once."""
    return region_map(face)


class PointsOverlay:
    """``shown``: whether points are. grabbed: called with viser's event of a drag of a point, clicked: of a click."""

    def __init__(self, scene: Any, face: Face, figure: Figure, *, clicked: Callable[[Any], None],
                 grabbed: Callable[[Any], None]) -> None:
        self.face, self.figure = face, figure
        self.names = tuple(face.feature_points)
        self._scene, self._clicked, self._grabbed = scene, clicked, grabbed
        self._lock = threading.RLock()                  # pages change it, the stage's thread moves it
        self._points: Any = None
        self._grips: Any = None                         # round the points, not seen: what the mouse finds
        self._label: Any = None
        self._borders: Any = None
        self._tints: list[tuple[Any, NDArray[np.int64]]] = []
        self._inner: list[tuple[Any, Array]] = []
        self._chosen: str | None = None
        self._moved: frozenset[str] = frozenset()
        self._marked: Any = None
        self._rigid = self._skull()

    def places(self, vertices: Array | None = None) -> dict[str, Array]:
        """Return where the points lie (3,), mm, on vertices, or as last shown."""
        return self.face.feature_point_places(self.figure.vertices if vertices is None else vertices)

    def show_points(self, shown: bool) -> None:
        """Show or hide the points."""
        with self._lock:
            if shown and self._points is None:
                self._add_points()
            elif not shown and self._points is not None:
                self._points.remove()
                self._grips.remove()
                self._points = self._grips = None
            self._dress()

    def show_regions(self, how: str) -> None:
        """Show regions as one of `REGIONS`."""
        with self._lock:
            for handle in (self._borders, *(handle for handle, _ in self._tints)):
                if handle is not None:
                    handle.remove()
            self._borders, self._tints = None, []
            if how == REGIONS[0]:
                return
            places, normals = self.figure.vertices, self._normals(self.figure.vertices)
            self._borders = self._scene.add_line_segments(
                "/points/borders", self.figure.place(map_of(self.face).borders(places + _PROUD * normals)), _BORDER,
                thickness=0.006)
            if how == REGIONS[2]:
                self._add_tints(places, normals)

    def show_inner(self, shown: bool) -> None:
        """Show or hide the centre O and the jaw's axis; the skin is let through while they are."""
        with self._lock:
            if shown == bool(self._inner):
                return
            for handle, _ in self._inner:
                handle.remove()
            self._inner = []
            if shown:
                self._add_inner()
            self.figure.fade(_THROUGH if shown else None)

    def choose(self, name: str | None, moved: frozenset[str], said: str = "") -> None:
        """Mark a point with its name, and those that were moved by hand."""
        with self._lock:
            if (name, moved, said, self._points is None) == self._marked:
                return
            self._marked = name, moved, said, self._points is None
            self._chosen, self._moved = name, moved
            if self._label is not None:
                self._label.remove()
                self._label = None
            if name is not None and self._points is not None:
                self._label = self._scene.add_label("/points/name", said, position=self._beside(self.places()[name]),
                                                    font_screen_scale=0.8)
            self._dress()

    def ride(self, vertices: Array) -> None:
        """Follow the surface."""
        with self._lock:
            if not (self._points or self._borders or self._tints or self._inner or self._label):
                return
            places = self.places(vertices)
            if self._points is not None:
                self._points.batched_positions = self._grips.batched_positions = \
                    self.figure.place(np.array(list(places.values())))
            if self._label is not None:
                self._label.position = self._beside(places[self._chosen])
            if self._borders is not None:
                proud = vertices + _PROUD * self._normals(vertices)
                self._borders.points = self.figure.place(map_of(self.face).borders(proud))
                for handle, rows in self._tints:
                    handle.vertices = self.figure.place(proud[rows])
            turn, shift = self._turn(places)
            for handle, at in self._inner:
                if hasattr(handle, "points"):
                    handle.points = self.figure.place(at @ turn.T + shift)
                else:
                    handle.position = self.figure.place(at @ turn.T + shift)

    def remove(self) -> None:
        """Take all away."""
        self.show_points(False)
        self.show_regions(REGIONS[0])
        self.show_inner(False)
        self.choose(None, frozenset())

    # -- inside -------------------------------------------------------------------------------------------------
    def _add_points(self) -> None:
        size = (_FEWER if len(self.names) < _MANY else _SIZE) * SCALE
        self._points = self._balls("points", size, batched_colors=self._colours())
        self._grips = self._balls("grips", _GRIP * size, opacity=0.0)
        self._grips.on_click(self._clicked)
        self._grips.on_drag(self._grabbed)

    def _balls(self, name: str, size: float, **look: Any) -> Any:
        """Return a ball for each point."""
        vertices, faces = _ball()
        at = self.figure.place(np.array(list(self.places().values())))
        return self._scene.add_batched_meshes_simple(
            f"/points/{name}", vertices * size, faces, batched_wxyzs=np.tile([1.0, 0.0, 0.0, 0.0], (len(at), 1)),
            batched_positions=at, batched_scales=np.ones(len(at)), lod="off", cast_shadow=False, receive_shadow=False,
            **look)

    def _dress(self) -> None:
        if self._points is not None:
            self._points.batched_colors = self._colours()
            self._points.batched_scales = np.array([_CHOSEN_SIZE if name == self._chosen else 1.0
                                                    for name in self.names])

    def _colours(self) -> NDArray[np.uint8]:
        return np.array([_CHOSEN if name == self._chosen else _MOVED if name in self._moved else
                         _MOVABLE if takes else _FIXED
                         for name, takes in zip(self.names, self.face.takes_input, strict=True)], np.uint8)

    def _add_tints(self, places: Array, normals: Array) -> None:
        found, faces = map_of(self.face), self.figure.mesh.faces
        number = np.where(found.regions >= 0, found.tints[found.regions], -1)
        for tint in range(found.tints.max() + 1):
            rows, corners = np.unique(faces[number == tint], return_inverse=True)
            handle = self._scene.add_mesh_simple(
                f"/points/tint-{tint}", self.figure.place((places + _PROUD * normals)[rows]), corners.reshape(-1, 3),
                color=_TINTS[tint % len(_TINTS)], opacity=_TINTED, cast_shadow=False, receive_shadow=False)
            self._tints.append((handle, rows))

    def _normals(self, vertices: Array) -> Array:
        return vertex_normals(vertices, self.figure.mesh.faces)

    def _add_inner(self) -> None:
        hinge = self.face.deformer.jaw.hinge
        turn, shift = self._turn(self.places())
        axis = np.array([[[-_AXIS, hinge[1], hinge[2]], [_AXIS, hinge[1], hinge[2]]]])
        vertices, faces = _ball()
        ball = self._scene.add_mesh_simple("/points/centre", vertices * 0.03, faces, color=_CENTRE, cast_shadow=False,
                                           receive_shadow=False)
        centre = self.face.centre
        name = self._scene.add_label("/points/centre-name", "O, the centre of the projection", font_screen_scale=0.8)
        line = self._scene.add_line_segments("/points/axis", self.figure.place(axis), _CENTRE, thickness=0.012)
        end = self._scene.add_label("/points/axis-name", "the jaw's axis", font_screen_scale=0.8)
        self._inner = [(ball, centre), (name, centre), (line, axis), (end, axis[0, 1])]
        for handle, at in self._inner:
            if hasattr(handle, "points"):
                handle.points = self.figure.place(at @ turn.T + shift)
            else:
                handle.position = self.figure.place(at @ turn.T + shift)

    def _beside(self, place: Array) -> Array:
        return self.figure.place(place + _BESIDE)

    def _skull(self) -> tuple[list[int], Array]:
        """Return the points that nothing moves but the head's turn, and their places at rest."""
        face = self.face
        weights = face.neck_weight()[:, 0] @ np.abs(face.point_weights().T.toarray())
        still = (~face.takes_input) & (face.deformer.jaw_share == 0.0) & (weights > _RIGID)
        rows = np.flatnonzero(still).tolist()
        return rows, np.array(list(self.places(face.mesh().vertices).values()))[rows]

    def _turn(self, places: Mapping[str, Array]) -> tuple[Array, Array]:
        """Return how the skull lies: v -> rotation @ v + shift."""
        rows, rest = self._rigid
        if len(rows) < 3:
            return np.eye(3), np.zeros(3)
        now = np.array(list(places.values()))[rows]
        u, _, v = np.linalg.svd((now - now.mean(axis=0)).T @ (rest - rest.mean(axis=0)))
        turn = u @ np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ v))]) @ v
        return turn, now.mean(axis=0) - turn @ rest.mean(axis=0)


@lru_cache(maxsize=1)
def _ball() -> tuple[NDArray[np.float32], NDArray[np.uint32]]:
    """Return a ball of radius 1: an octahedron, each triangle cut into four, twice."""
    vertices = [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)]
    faces = [(0, 2, 4), (2, 1, 4), (1, 3, 4), (3, 0, 4), (2, 0, 5), (1, 2, 5), (3, 1, 5), (0, 3, 5)]
    points = [np.array(one, float) for one in vertices]
    for _ in range(2):
        middles: dict[tuple[int, int], int] = {}

        def middle(a: int, b: int, middles: dict[tuple[int, int], int] = middles) -> int:
            key = (min(a, b), max(a, b))
            if key not in middles:
                at = points[a] + points[b]
                points.append(at / np.linalg.norm(at))
                middles[key] = len(points) - 1
            return middles[key]

        cut = []
        for a, b, c in faces:
            ab, bc, ca = middle(a, b), middle(b, c), middle(c, a)
            cut += [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        faces = cut
    return np.array(points, np.float32), np.array(faces, np.uint32)

"""A mesh as landmarks are looked for on it: the triangles that may carry them, and what is known once for all calls."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from facegen.errors import InputError
from facegen.geometry.closest import ClosestPoints
from facegen.geometry.mesh import Mesh
from facegen.geometry.operators import Surface
from facegen.landmarking.eyeballs import Ball, balls_of
from facegen.landmarking.proposals import Proposal
from facegen.landmarking.symmetry import Plane, symmetry_planes
from facegen.transfer.enclosure import sample_surface
from facegen.transfer.piece_names import INSIDE, kind_of_name, words_of
from facegen.transfer.weld import weld

Array = NDArray[np.float64]

# Because squares and cubes of smaller and larger numbers run over, and the places of a mesh far off are rounded away.
_SMALLEST, _LARGEST, _FARTHEST = 1e-12, 1e12, 1e6
# Samples by which the planes of symmetry are found: about so many.
_SAMPLES = 20_000
# Landmarks that may lie on an eye or on brows of their own.
_NOT_SKIN = ("eye_center", "brow")
_BROWS = frozenset({"brow", "brows", "eyebrow", "eyebrows"})


class Skin:
    """Some of a mesh's triangles, ``rows``, as a ``surface`` over all its vertices, with a ``search``."""

    def __init__(self, mesh: Mesh, rows: NDArray[np.int64]) -> None:
        self.rows = rows
        self.surface = Surface(mesh.vertices, mesh.faces[rows])

    @cached_property
    def search(self) -> ClosestPoints:
        """The nearest places on it."""
        return ClosestPoints(self.surface)


class Head:
    """A ``mesh`` that is looked at again and again."""

    def __init__(self, mesh: Mesh) -> None:
        """mesh: in any axes and units. Raises InputError for one without triangles or with places that are not
        finite."""
        if not len(mesh.faces) or not np.isfinite(mesh.vertices).all():
            raise InputError("mesh: expected at least one triangle and finite vertices")
        corners = mesh.vertices[mesh.faces]
        size, farthest = float(np.ptp(corners.reshape(-1, 3), axis=0).max()), float(np.abs(corners).max())
        if not _SMALLEST < size < _LARGEST or farthest > _FARTHEST * size:
            raise InputError(f"mesh: spans {size:g} and lies up to {farthest:g} from the origin; expected "
                             f"{_SMALLEST:g} to {_LARGEST:g}, no farther off than {_FARTHEST:g} times that")
        self.mesh = mesh
        areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
        self._area = float(areas.sum())
        self.solid = np.flatnonzero(areas > 0)
        if not len(self.solid):
            raise InputError("mesh: none of its triangles has an area")
        self.surface = Surface(mesh.vertices, mesh.faces[self.solid])
        self._carrying: dict[frozenset[int], Skin] = {}

    @cached_property
    def search(self) -> ClosestPoints:
        """The nearest places on all of it."""
        return ClosestPoints(self.surface)

    @cached_property
    def used(self) -> NDArray[np.bool_]:
        """Which vertices (n,) are those of a solid triangle."""
        found = np.zeros(len(self.mesh.vertices), bool)
        found[self.surface.faces] = True
        return found

    @cached_property
    def planes(self) -> list[Plane]:
        """The planes that it is mirrored in, best first."""
        return symmetry_planes(sample_surface(self.surface.corners, np.sqrt(2 * self._area / _SAMPLES)))

    @cached_property
    def shown(self) -> Skin:
        """All of it but what names say is behind lids and lips."""
        inside = np.array([[kind_of_name(part) in INSIDE or kind_of_name(material) in INSIDE
                            for material in self.mesh.materials] for part in self.mesh.parts])
        hidden = inside[self.mesh.face_parts, self.mesh.face_materials][self.solid]
        return Skin(self.mesh, self.solid[~hidden] if not hidden.all() else self.solid)

    def carrying(self, given: Iterable[Proposal]) -> Skin:
        """Return the pieces that carry known places: without hair, whiskers and eyes that have none."""
        pieces = frozenset(int(self.components[self.mesh.faces[one.face, 0]]) for one in given
                           if not one.name.startswith(_NOT_SKIN))
        if pieces not in self._carrying:
            shown = self.shown.rows
            rows = shown[np.isin(self.components[self.mesh.faces[shown, 0]], list(pieces))]
            self._carrying[pieces] = Skin(self.mesh, rows) if len(rows) else self.shown
        return self._carrying[pieces]

    @cached_property
    def welded(self) -> tuple[Array, NDArray]:
        """The vertices (w, 3) with those on one place as one, and which (n,) each of the mesh is: seams cut nothing."""
        return weld(self.mesh.vertices, self.mesh.faces)

    @cached_property
    def shown_welded(self) -> Surface:
        """What is `shown`, welded."""
        vertices, own = self.welded
        return Surface(vertices, own[self.shown.surface.faces])

    @cached_property
    def components(self) -> NDArray[np.int32]:
        """The number of the connected piece that each vertex (n,) belongs to."""
        vertices, own = self.welded
        return Surface(vertices, own[self.surface.faces]).components()[1][own]

    @cached_property
    def pupils(self) -> NDArray[np.bool_]:
        """Which of the solid triangles are a pupil by their names, or an iris where no name says pupil."""
        words = [[words_of(part) | words_of(material) for material in self.mesh.materials] for part in self.mesh.parts]
        at = self.mesh.face_parts[self.solid], self.mesh.face_materials[self.solid]
        for word in ("pupil", "iris"):
            found = np.array([[word in one for one in row] for row in words])[at]
            if found.any():
                break
        return found

    @cached_property
    def balls(self) -> list[Ball]:
        """Its round pieces."""
        return balls_of(self.surface, self.components)

    @cached_property
    def brows(self) -> Array:
        """Corners (b, 3) of the triangles that are brows, as names say."""
        own = np.array([[bool((words_of(part) | words_of(material)) & _BROWS) for material in self.mesh.materials]
                        for part in self.mesh.parts])[self.mesh.face_parts, self.mesh.face_materials][self.solid]
        return self.surface.corners[own].reshape(-1, 3)

    def given(self, name: str, place: Any) -> Proposal:
        """Return a known place as a proposal: a point (3,), or (triangle, barycentric (3,)); InputError for others."""
        if isinstance(place, (tuple, list)) and len(place) == 2 and np.ndim(place[1]) == 1:
            face, weights = place
            weights = np.asarray(weights, float)
            if not isinstance(face, (int, np.integer)) or not 0 <= face < len(self.mesh.faces):
                raise InputError(f"known: '{name}' is on triangle {face!r}, expected 0 to {len(self.mesh.faces) - 1}")
            if weights.shape != (3,) or not np.isfinite(weights).all() or abs(weights.sum() - 1) > 1e-6:
                raise InputError(f"known: '{name}' has the barycentric weights {list(weights)}, expected three that "
                                 "sum to one")
            return Proposal(name, int(face), weights, weights @ self.mesh.vertices[self.mesh.faces[face]], 1.0, "given")
        try:
            at = np.asarray(place, float)
        except (TypeError, ValueError):
            at = np.empty(0)
        if at.shape != (3,) or not np.isfinite(at).all():
            raise InputError(f"known: '{name}' expected a point of three finite numbers or (triangle, barycentric), "
                             f"got {place!r}")
        feet = self.shown.search(at[None])
        return Proposal(name, int(self.shown.rows[feet.faces[0]]), feet.weights[0], at, 1.0, "given")

    def normal(self, one: Proposal) -> Array:
        """Return the normal (3,) of the triangle that a place is on."""
        a, b, c = self.mesh.vertices[self.mesh.faces[one.face]]
        normal = np.cross(b - a, c - a)
        return normal / max(float(np.linalg.norm(normal)), 1e-300)

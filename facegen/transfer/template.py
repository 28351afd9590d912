"""The source of a transfer: a neutral skin, its landmarks, and how it moves in every shape.

The parametric face knows more of a shape than its vertices: how far the jaw turned and where the eyes look. On a
template from a file (template_file) that is measured.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from facegen.blendshapes.recipes import Recipe
from facegen.face.deformer import Jaw
from facegen.face.face import Face
from facegen.face.motion import joined
from facegen.forked import Aside
from facegen.geometry.closest import ClosestPoints
from facegen.geometry.mesh import Mesh
from facegen.geometry.operators import Surface
from facegen.transfer.face_measures import FaceMeasures
from facegen.transfer.piece_names import KINDS, kind_of_name
from facegen.transfer.same_pieces import TemplatePiece
from facegen.transfer.tongue import Tongue

if TYPE_CHECKING:
    from facegen.transfer.margins import Margins

DETAIL = 2
"""Subdivision level of the template: about 11,000 triangles, 4 mm long."""

_TEST_OPENING = 10.0    # degrees: the jaw's share of a vertex is read off a pose with the jaw this far open


@dataclass(frozen=True, eq=False)
class TemplateShapes:
    """What the k shapes of a template do. ``motion`` (k, n, 3) mm. ``jaw`` (k, 3): opening in degrees, side and forward
    in mm; ``gaze`` (k, 4): yaw and pitch in degrees, left eye then right. ``tongue``: how that moves beside going with
    the jaw, or None. ``pieces``: kind -> all of that kind beside the skin, for avatars that have the same."""

    motion: NDArray[np.float64]
    jaw: NDArray[np.float64]
    gaze: NDArray[np.float64]
    tongue: Tongue | None = None
    pieces: Mapping[str, TemplatePiece] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Template:
    """A neutral skin of n vertices (mm) and its k shapes.

    ``landmarks``: name -> place (3,); ``places``: name -> vertices (3,) of the skin and their weights (3,). ``hinge``:
    how the jaw moves; ``jaw_share`` (n,): how much of it each vertex takes. ``minus`` (k,): the shape to take away from
    the result, or -1. ``make``: makes the `shapes`, which no skin needs before it is laid. ``margins``: slit -> its
    edges, as far as they are known already.
    """

    name: str
    surface: Surface
    landmarks: Mapping[str, NDArray]
    places: Mapping[str, tuple[NDArray, NDArray]]
    names: tuple[str, ...]
    hinge: Jaw | None
    jaw_share: NDArray[np.float64]
    minus: tuple[int, ...]
    make: Callable[[], TemplateShapes]
    margins: Mapping[str, Margins] = field(default_factory=dict)

    @cached_property
    def shapes(self) -> TemplateShapes:
        """What the shapes do: made when it is asked for first."""
        return self.make()

    @contextmanager
    def making(self) -> Iterator[None]:
        """Make the shapes in a fork while this process does other things: ``with template.making(): ...``."""
        with Aside(lambda: (self.shapes, self.without_jaw), useful="shapes" not in vars(self)) as made:
            yield
            if made.forked:
                vars(self)["shapes"], vars(self)["without_jaw"] = made.result()

    @property
    def motion(self) -> NDArray[np.float64]:
        """How the skin moves in each shape, (k, n, 3) mm."""
        return self.shapes.motion

    @cached_property
    def without_jaw(self) -> NDArray[np.float64]:
        """How the skin moves (k, n, 3), without what the jaw alone would do."""
        if self.hinge is None:
            return self.motion
        turned = self.hinge.movement(self.surface.vertices, self.shapes.jaw)
        turned *= self.jaw_share[:, None]
        return np.subtract(self.motion, turned, out=turned)

    @property
    def height(self) -> float:
        """Height of the head, mm."""
        return float(np.ptp(self.surface.vertices[:, 1]))


def places_on(surface: Surface, points: Mapping[str, NDArray]) -> dict[str, tuple[NDArray, NDArray]]:
    """Return for every point the vertices (3,) and weights (3,) of the nearest place on the surface."""
    feet = ClosestPoints(surface)(np.array(list(points.values())).reshape(-1, 3))
    return {name: (surface.faces[face], weights)
            for name, face, weights in zip(points, feet.faces, feet.weights, strict=True)}


def placing(places: Mapping[str, tuple[NDArray, NDArray]], names: Sequence[str], n: int) -> sparse.csr_array:
    """Return the weights (len(names), n) of the vertices that place the landmarks."""
    rows = np.repeat(np.arange(len(names)), 3)
    columns = np.concatenate([places[name][0] for name in names]) if names else np.zeros(0, int)
    values = np.concatenate([places[name][1] for name in names]) if names else np.zeros(0)
    return sparse.csr_array((values, (rows, columns)), shape=(len(names), n))


def template_of(face: Face, shapes: Mapping[str, Recipe], *, detail: int = DETAIL) -> Template:
    """Return the parametric face as a template of the named shapes.

    A shape that is a difference (mouthClose, which corrects jawOpen) is transferred as the pose that it leads to; the
    other is taken away on the avatar. That other must be among the shapes.
    """
    mesh = face.mesh(detail)
    skin = mesh.part_vertices(mesh.parts[0])
    n = int(skin[-1]) + 1                                   # the skin comes first, all of its vertices are used
    surface = Surface(mesh.vertices[:n], mesh.faces[mesh.face_parts == 0])
    places = skin_places(face, surface, detail)
    hinge = face.deformer.jaw
    opened = np.array([_TEST_OPENING, 0.0, 0.0])
    test = face.pose({"units": "millimetre", "jaw": {"open": _TEST_OPENING}}, detail=detail) - mesh.vertices
    turned = hinge.movement(mesh.vertices, opened)
    share = np.clip((test * turned).sum(axis=1) / np.maximum((turned**2).sum(axis=1), 1e-12), 0.0, 1.0)
    landmarks = {name: weights @ surface.vertices[rows] for name, (rows, weights) in places.items()}
    order = {name: row for row, name in enumerate(shapes)}
    minus = tuple(-1 if shape.minus is None else order[shape.minus] for shape in shapes.values())

    def make() -> TemplateShapes:
        together = joined(face, [shape.deformation for shape in shapes.values()])
        posed = face.pose_controls(together, detail=detail)
        pieces = {}
        for kind, parts in _parts_by_kind(mesh).items():
            rows, own = np.unique(mesh.faces[np.isin(mesh.face_parts, parts)], return_inverse=True)
            at = mesh.vertices[rows]
            beside = posed[:, rows] - at - share[rows, None] * hinge.movement(at, together.jaw)
            pieces[kind] = TemplatePiece(Surface(at, own.reshape(-1, 3)), beside, share[rows])
        tongue = Tongue(pieces["tongue"].surface, pieces["tongue"].motion, FaceMeasures(landmarks)) \
            if "tongue" in pieces else None
        return TemplateShapes(posed[:, :n] - surface.vertices, together.jaw, together.eyes, tongue, pieces)

    return Template(face.name, surface, landmarks, places, tuple(shapes), hinge, share[:n], minus, make)


def _parts_by_kind(mesh: Mesh) -> dict[str, list[int]]:
    """Return kind -> the parts of a face that are of it, but for the skin, which is the first."""
    result: dict[str, list[int]] = {}
    for number, name in enumerate(mesh.parts[1:], start=1):
        result.setdefault(name if name in KINDS else kind_of_name(name), []).append(number)
    return result


def skin_places(face: Face, surface: Surface, detail: int) -> dict[str, tuple[NDArray, NDArray]]:
    """Return the landmarks on the skin: as they are defined, which tells lips that touch apart; those of other parts,
    the brows', at the nearest place. The pupils are none of the skin's."""
    mesh = face.mesh(detail)
    result, elsewhere = {}, {}
    weights = face.landmark_weights(detail)
    for row, name in enumerate(face.landmarks):
        if name.startswith("eye_center"):
            continue
        start, stop = weights.indptr[row], weights.indptr[row + 1]
        columns, shares = weights.indices[start:stop], weights.data[start:stop]
        if len(columns) <= 3 and columns.max() < len(surface.vertices):
            fill = 3 - len(columns)
            result[name] = (np.pad(columns, (0, fill), mode="edge"), np.pad(shares, (0, fill)))
        else:
            elsewhere[name] = shares @ mesh.vertices[columns]
    found = result | places_on(surface, elsewhere)
    return {name: found[name] for name in face.landmarks if name in found}

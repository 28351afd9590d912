"""Landmarks proposed for a mesh, from none or from some that are known: `Proposer` for a picker, `propose_landmarks`.

What does not depend on what is known - how the mesh mirrors, where a face is on it, the face laid on it - is computed
once; each call then lays the face anew with the known places as constraints. The result depends on which places are
known, not on the order in which they came.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from facegen.errors import InputError, nearest
from facegen.face.landmarks import NAMES, REQUIRED
from facegen.geometry.closest import ClosestPoints
from facegen.geometry.mesh import Mesh
from facegen.geometry.normals import vertex_normals
from facegen.geometry.operators import Surface
from facegen.landmarking.detect import candidates
from facegen.landmarking.eye_pairs import eye_frames
from facegen.landmarking.features import eye_opening, lip_line
from facegen.landmarking.fit import BENT, WHOLE, Laid, lay, likeness
from facegen.landmarking.model import FaceModel, face_model
from facegen.landmarking.symmetry import Plane, follow, symmetry_planes
from facegen.transfer.alignment import Similarity, align
from facegen.transfer.enclosure import sample_surface
from facegen.transfer.landmark_checks import place_faults
from facegen.transfer.landmarks import Landmarks
from facegen.transfer.piece_names import INSIDE, kind_of_name
from facegen.transfer.pieces import face_names, find_pieces
from facegen.transfer.weld import weld

Array = NDArray[np.float64]

# Samples by which the planes of symmetry are found: about so many.
_SAMPLES = 20_000
# A laid face whose relief is as alike as this is a face; below the second it is none.
_A_FACE, _NO_FACE = 0.65, 0.4
# So many of the places found are followed to their end.
_FOLLOWED = 3
# So many known places say where the face is, whatever was found without them.
_ENOUGH = 4
# A face found where its landmarks are farther from the known ones than this, in millimetres of the base face, is
# another one.
_ELSEWHERE = 20.0
# The head's plane of symmetry is that of what lies within so many millimetres of the face's middle.
_HEAD = 90.0
_MIDDLE = np.array([0.0, -35.0, 0.0])
# A mirrored place is trusted so far.
_MIRRORED = 0.9
# A face is recognised if it is this sure; else so many known places are asked for.
_RECOGNISED, _ENOUGH_TO_START = 0.5, 6
# A known place this far from where a recognised face has it, in distances between the outer corners of the eyes, is
# astray.
_ASTRAY = 0.3
# The order in which places are best asked for: those that fix the face's place and size first.
ASKED = ("eye_outer_L", "eye_outer_R", "nose_tip", "mouth_corner_L", "mouth_corner_R", "chin", "eye_inner_L",
         "eye_inner_R", "eye_upper_L", "eye_upper_R", "eye_lower_L", "eye_lower_R", "mouth_inner_top",
         "mouth_inner_bottom", "mouth_top", "mouth_bottom", "nose_bridge", "nose_wing_L", "nose_wing_R", "brow_inner_L",
         "brow_inner_R", "brow_mid_L", "brow_mid_R", "brow_outer_L", "brow_outer_R")


@dataclass(frozen=True, eq=False)
class Proposal:
    """A place for a landmark: on triangle ``face`` with ``barycentric`` (3,), at ``xyz`` (3,) in the mesh's axes and
    units. ``confidence``: 0 to 1; ``why``: "given", "mirrored", "laid" and so on; ``given``: known before."""

    name: str
    face: int
    barycentric: Array
    xyz: Array
    confidence: float
    why: str

    @property
    def given(self) -> bool:
        """Whether it was known, and is returned as it was."""
        return self.why == "given"


@dataclass(frozen=True, eq=False)
class Proposals(Mapping[str, Proposal]):
    """Name -> `Proposal`, in the order of the list of landmarks. ``face``: how surely there is a face, 0 to 1.
    ``warnings``: a sentence each. ``ask``: the place to ask for next, or None when all required ones are known.
    ``frame``: from the base face's axes and millimetres to the mesh's, or None where no face is."""

    places: Mapping[str, Proposal]
    face: float
    warnings: tuple[str, ...] = ()
    ask: str | None = None
    frame: Similarity | None = None
    mesh: Mesh | None = field(default=None, repr=False)

    def __getitem__(self, name: str) -> Proposal:
        return self.places[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.places)

    def __len__(self) -> int:
        return len(self.places)

    def below(self, confidence: float) -> list[str]:
        """Return the names of required places that are less sure than this."""
        return [name for name in REQUIRED if name in self.places and self.places[name].confidence < confidence]

    def is_worth(self, name: str, confidence: float) -> bool:
        """Return whether a place is required, or as sure as this."""
        return name in REQUIRED or self.places[name].confidence >= confidence

    def landmarks(self) -> Landmarks:
        """Return the places as the landmarks that a rig takes."""
        faces = np.array([one.face for one in self.places.values()], np.int64)
        return Landmarks(tuple(self.places), faces, self.mesh.faces[faces].astype(np.int64),
                         np.array([one.barycentric for one in self.places.values()]).reshape(-1, 3))


def propose_landmarks(mesh: Mesh | str | os.PathLike[str], known: Mapping[str, Any] | None = None) -> Proposals:
    """Return places for the landmarks of a mesh, given or read from a file, each with a confidence.

    known: name -> a point (3,) in the mesh's axes and units, or (triangle, barycentric (3,)). Raises InputError, or
    FileError for the file. ::

        found = facegen.propose_landmarks("avatar.obj")
        found["nose_tip"].xyz, found["nose_tip"].confidence
    """
    if not isinstance(mesh, Mesh):
        from facegen.fileio.avatar import load_avatar

        mesh = load_avatar(mesh).mesh
    return Proposer(mesh).propose(known or {})


class _Skin:
    """Some of a mesh's triangles, ``rows``, as a ``surface`` over all its vertices, with a ``search``."""

    def __init__(self, mesh: Mesh, rows: NDArray[np.int64]) -> None:
        self.rows = rows
        self.surface = Surface(mesh.vertices, mesh.faces[rows])
        self.search = ClosestPoints(self.surface)


@dataclass(frozen=True, eq=False)
class _Found:
    """A face ``laid`` on the mesh, how ``alike`` it is, and what of it is ``seen``, name -> place (3,)."""

    laid: Laid
    alike: float
    seen: Mapping[str, Array]


class Proposer:
    """Proposes landmarks for one mesh, again and again as more become known."""

    def __init__(self, mesh: Mesh) -> None:
        """mesh: in any axes and units. Raises InputError for one without triangles or with places that are not
        finite."""
        if not len(mesh.faces) or not np.isfinite(mesh.vertices).all():
            raise InputError("mesh: expected at least one triangle and finite vertices")
        self.mesh = mesh
        self._model: FaceModel = face_model()
        corners = mesh.vertices[mesh.faces]
        areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
        self._solid = np.flatnonzero(areas > 0)
        if not len(self._solid):
            raise InputError("mesh: none of its triangles has an area")
        self._surface = Surface(mesh.vertices, mesh.faces[self._solid])
        self._area = float(areas.sum())

    # -- what does not depend on what is known -------------------------------------------------------------------------
    @cached_property
    def _planes(self) -> list[Plane]:
        samples = sample_surface(self._surface.corners, np.sqrt(2 * self._area / _SAMPLES))
        return symmetry_planes(samples)

    @cached_property
    def _all(self) -> _Skin:
        """The mesh without what names say is behind lids and lips."""
        inside = np.array([[kind_of_name(part) in INSIDE or kind_of_name(material) in INSIDE
                            for material in self.mesh.materials] for part in self.mesh.parts])
        hidden = inside[self.mesh.face_parts, self.mesh.face_materials][self._solid]
        return _Skin(self.mesh, self._solid[~hidden] if not hidden.all() else self._solid)

    @cached_property
    def _start(self) -> tuple[Laid, float] | None:
        """The face laid where it is most alike, and how alike."""
        search = self._all.search
        frames = [one.frame for one in candidates(self._surface.corners, self._planes)]
        frames += eye_frames(self._surface, self._planes)
        if not frames:
            return None
        whole = self._best_of(frames, _FOLLOWED)
        whole = self._best_of([frame for laid in whole for frame in (laid.frame, *_beside(laid.frame))], _FOLLOWED)
        bent = [lay(self._model, search, laid.frame, {}, BENT, laid.vertices) for laid in whole]
        alike = [likeness(self._model, laid, search) for laid in bent]
        best = int(np.argmax(alike))
        return bent[best], alike[best]

    @cached_property
    def _skin(self) -> _Skin:
        """The skin, as the pieces of a recognised face tell it; else all that names do not exclude."""
        if self._start is None or _sure(self._start[1]) < _RECOGNISED:
            return self._all
        laid = self._start[0]
        frame = laid.frame.inverse()
        vertices, own = weld(frame.apply(self.mesh.vertices), self.mesh.faces)
        points = dict(zip(self._model.names, self._model.placing @ laid.vertices, strict=True))
        try:
            pieces = find_pieces(vertices, own[self.mesh.faces], points, names=face_names(self.mesh))
        except InputError:
            return self._all
        rows = np.concatenate([piece.faces for piece in pieces if piece.kind == "skin"])
        return _Skin(self.mesh, np.intersect1d(rows, self._solid))

    @cached_property
    def _found(self) -> _Found | None:
        """The face found with no place known."""
        if self._start is None:
            return None
        laid, alike = self._start
        return self._finished(laid, alike, {})

    def _finished(self, laid: Laid, alike: float, own: Mapping[str, Array]) -> _Found:
        """Return a laid face with what can be seen of it: laid again with that, in the middle of a recognised face."""
        model, search = self._model, self._skin.search
        if _sure(alike) < _RECOGNISED and len(own) < _ENOUGH_TO_START:
            return _Found(laid, alike, {})
        seen = self._seen(laid)
        hold = {**{name: place for name, place in seen.items() if name in model.names}, **own}
        again = lay(model, search, laid.frame, hold, BENT[-4:], laid.vertices)
        seen = {name: place for name, place in self._seen(again).items() if name not in own}
        return _Found(again, max(alike, likeness(model, again, search)), seen)

    def _seen(self, laid: Laid) -> dict[str, Array]:
        """Return what is seen of lids and lips, name -> place (3,) on the mesh."""
        frame = laid.frame
        back = frame.inverse()
        skin = Surface(back.apply(self.mesh.vertices), self._skin.surface.faces)
        points = dict(zip(self._model.names, self._model.placing @ laid.vertices, strict=True))
        found = {**eye_opening(skin, points, "L"), **eye_opening(skin, points, "R"), **lip_line(skin, points)}
        return {name: frame.apply(place) for name, place in found.items()}

    def _best_of(self, frames: list[Similarity], count: int) -> list[Laid]:
        """Return the faces laid from so many frames, as a whole, that are most alike."""
        search = self._all.search
        laid = [lay(self._model, search, frame, {}, WHOLE) for frame in frames]
        alike = [likeness(self._model, one, search) for one in laid]
        return [laid[i] for i in np.argsort(alike)[::-1][:count]]

    @property
    def face(self) -> float:
        """How surely a face was found without any place known, 0 to 1."""
        return 0.0 if self._start is None else _sure(self._start[1])

    # -- what does -----------------------------------------------------------------------------------------------------
    def propose(self, known: Mapping[str, Any]) -> Proposals:
        """Return a place for every landmark that can be proposed; known ones as they are.

        known: name -> a point (3,) in the mesh's axes and units, or (triangle, barycentric (3,)). Raises InputError.
        """
        given = {name: self._given(name, known[name]) for name in NAMES if name in known}
        for name in known:
            if name not in NAMES:
                raise InputError(f"known: unknown landmark '{name}'{nearest(str(name), NAMES)}")
        at = {name: one.xyz for name, one in given.items()}
        found = self._lay(at)
        laid = None if found is None else found.laid
        sure = 0.0 if found is None else _sure(found.alike)
        plane = self._plane_of(laid)
        places = dict(given)
        if laid is not None:
            places |= {name: one for name, one in self._from(found, sure).items() if name not in given}
        for name, one in given.items():
            partner = f"{name[:-2]}_{'R' if name.endswith('L') else 'L'}"
            if name.endswith(("_L", "_R")) and partner not in given:
                places[partner] = self._mirrored(partner, one, plane)
        ordered = {name: places[name] for name in NAMES if name in places}
        ask = next((name for name in ASKED if name not in given), None)
        warnings = (*self._recognised(sure, given), *self._odd(given, laid, sure))
        return Proposals(ordered, sure, warnings, ask, None if laid is None else laid.frame, self.mesh)

    def _recognised(self, sure: float, given: Mapping[str, Proposal]) -> list[str]:
        """Return a warning if no face was recognised, with how many places to set."""
        more = _ENOUGH_TO_START - len([name for name in given if name in ASKED])
        if sure >= _RECOGNISED or more <= 0:
            return []
        missing = [name for name in ASKED if name not in given][:more]
        return [f"no human face was recognised: the places are guesses; set {more} more, best {', '.join(missing)}, "
                "and the others are proposed from those"]

    def _odd(self, given: Mapping[str, Proposal], laid: Laid | None, sure: float) -> list[str]:
        """Return what is odd about known places, a sentence each: see `place_faults`, and what lies astray where a
        face was recognised without them."""
        if not given:
            return []
        names = tuple(given)
        faces = np.array([one.face for one in given.values()], np.int64)
        weights = np.array([one.barycentric for one in given.values()])
        errors, warnings = place_faults(names, self.mesh.faces[faces].astype(np.int64), weights, self.mesh)
        found = self._found
        if not errors and found is not None and _sure(found.alike) >= _RECOGNISED:
            errors = self._astray(given, found.laid)
        return [*errors, *warnings]

    def _astray(self, given: Mapping[str, Proposal], laid: Laid) -> list[str]:
        """Return which known places lie where a recognised face has another one, or none."""
        where = dict(zip(self._model.names, laid.frame.apply(self._model.placing @ laid.vertices), strict=True))
        unit = float(np.linalg.norm(where["eye_outer_L"] - where["eye_outer_R"]))
        result = []
        for name, one in given.items():
            if name not in where:
                continue
            off = {other: float(np.linalg.norm(one.xyz - place)) / unit for other, place in where.items()}
            if off[name] < _ASTRAY:
                continue
            near = min(off, key=off.get)
            partner = f"{name[:-2]}_{'R' if name.endswith('L') else 'L'}"
            if name.endswith(("_L", "_R")) and off[partner] < 0.5 * off[name]:
                result.append(f"'{name}' lies on the side of '{partner}': _L is the subject's own left, on the right of "
                              "a picture of the face")
            elif off[near] < 0.5 * _ASTRAY:
                result.append(f"'{name}' lies where '{near}' seems to be; is that meant?")
            else:
                result.append(f"'{name}' lies far from where it seems to be; is that meant?")
        return result

    def _given(self, name: str, place: Any) -> Proposal:
        """Return a known place as a proposal."""
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
        feet = self._all.search(at[None])
        return Proposal(name, int(self._all.rows[feet.faces[0]]), feet.weights[0], at, 1.0, "given")

    def _lay(self, at: Mapping[str, Array]) -> _Found | None:
        """Return the face laid with known places (3,) as constraints."""
        model, found, search = self._model, self._found, self._skin.search
        own = {name: at[name] for name in model.names if name in at}
        if not own:
            return found
        tries = []
        if found is not None and self._agree(found.laid, own):
            tries.append(lay(model, search, found.laid.frame, own, BENT[2:], found.laid.vertices))
        if len(own) >= _ENOUGH and not (tries and _sure(found.alike) >= _RECOGNISED):
            try:
                start = align({name: model.points[name] for name in own}, own)
            except InputError:                          # on one line: they fix no place
                start = None
            if start is not None:
                laid = lay(model, search, start, own, WHOLE)
                tries.append(lay(model, search, laid.frame, own, BENT, laid.vertices))
        if not tries:
            return found
        scored = [(likeness(model, laid, search), laid) for laid in tries]
        alike, laid = max(scored, key=lambda one: one[0])
        return self._finished(laid, alike, own)

    def _agree(self, laid: Laid, own: Mapping[str, Array]) -> bool:
        """Return whether known places lie where a laid face has them, by and large."""
        where = dict(zip(self._model.names, laid.frame.apply(self._model.placing @ laid.vertices), strict=True))
        off = [float(np.linalg.norm(where[name] - place)) / laid.frame.scale for name, place in own.items()]
        return float(np.median(off)) < _ELSEWHERE

    def _from(self, found: _Found, sure: float) -> dict[str, Proposal]:
        """Return the places of a laid face's landmarks on the mesh."""
        model, laid, skin = self._model, found.laid, self._skin
        x = laid.vertices
        normals = model.placing @ vertex_normals(x, model.surface.faces) @ laid.frame.rotation.T
        points = laid.frame.apply(model.placing @ x)
        for i, name in enumerate(model.names):
            points[i] = found.seen.get(name, points[i])
        feet = skin.search(points, normals, least_cosine=0.2)
        other = skin.search(points)
        result = {}
        weight = model.placing @ laid.weight
        for i, name in enumerate(model.names):
            saw = name in found.seen
            one = feet if feet.faces[i] >= 0 and not saw else other
            face, weights = int(skin.rows[one.faces[i]]), one.weights[i]
            result[name] = Proposal(name, face, weights, one.points[i], float(sure * (1.0 if saw else weight[i])),
                                    "seen" if saw else "laid")
        return result

    def _plane_of(self, laid: Laid | None) -> Plane:
        """Return the plane of symmetry of the head with the laid face."""
        if laid is None:
            return self._planes[0]
        key = id(laid)
        if getattr(self, "_plane_key", None) == key:
            return self._plane_kept
        frame = laid.frame
        normal = frame.rotation[:, 0]
        middle = frame.apply(_MIDDLE)
        near = ((self.mesh.vertices - middle) ** 2).sum(axis=1) < (_HEAD * frame.scale) ** 2
        samples = self.mesh.vertices[near & np.isin(np.arange(len(near)), self._surface.faces)]
        plane = Plane(normal, float(normal @ frame.offset), np.inf)
        if len(samples) > 20:
            some = samples[np.unique(np.linspace(0, len(samples) - 1, 1500).astype(int))]
            plane = follow(cKDTree(samples), some, plane, frame.scale * _HEAD, 8)
        self._plane_key, self._plane_kept = key, plane
        return plane

    def _mirrored(self, name: str, one: Proposal, plane: Plane) -> Proposal:
        """Return a known place's partner on the other side."""
        at = plane.mirror(one.xyz)
        normal = self._normal(one)
        normal = normal - 2 * (normal @ plane.normal) * plane.normal
        skin = self._skin
        feet = skin.search(at[None], normal[None], least_cosine=0.3)
        if feet.faces[0] < 0:
            feet = skin.search(at[None])
        return Proposal(name, int(skin.rows[feet.faces[0]]), feet.weights[0], feet.points[0], _MIRRORED, "mirrored")

    def _normal(self, one: Proposal) -> Array:
        a, b, c = self.mesh.vertices[self.mesh.faces[one.face]]
        normal = np.cross(b - a, c - a)
        return normal / max(float(np.linalg.norm(normal)), 1e-300)


def _beside(frame: Similarity) -> Iterator[Similarity]:
    """Yield frames beside one: nodding, larger and smaller, higher and lower. A face that is laid a nose too high stays
    there, because a brow is alike to a lip."""
    for nod, size, up in product((-10.0, 0.0, 10.0), (0.9, 1.0, 1.1), (-12.0, 0.0, 12.0)):
        if nod or size != 1.0 or up:
            c, s = np.cos(np.radians(nod)), np.sin(np.radians(nod))
            turn = frame.rotation @ np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
            middle = frame.apply(_MIDDLE + np.array([0.0, up, 0.0]))
            scale = frame.scale * size
            yield Similarity(scale, turn, middle - scale * turn @ _MIDDLE)


def _sure(alike: float) -> float:
    """Return how surely a relief that is so much alike is a face's."""
    return float(np.clip((alike - _NO_FACE) / (_A_FACE - _NO_FACE), 0.0, 1.0))

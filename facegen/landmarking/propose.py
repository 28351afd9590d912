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
from facegen.face.landmarks import NAMES
from facegen.geometry.closest import ClosestPoints
from facegen.geometry.mesh import Mesh
from facegen.geometry.normals import vertex_normals
from facegen.geometry.operators import Surface
from facegen.landmarking.confidence import A_FACE, ENOUGH_TO_START, RECOGNISED, SEEN, belief, laid_share, sure
from facegen.landmarking.detect import candidates
from facegen.landmarking.doubts import not_recognised, odd_places
from facegen.landmarking.eye_pairs import eye_frames
from facegen.landmarking.features import eye_opening, lip_line, nose_tip
from facegen.landmarking.fit import BENT, WHOLE, Laid, lay, likeness
from facegen.landmarking.model import FaceModel, face_model
from facegen.landmarking.proposals import ASKED, Proposal, Proposals
from facegen.landmarking.symmetry import Plane, follow, symmetry_planes
from facegen.transfer.alignment import Similarity, align
from facegen.transfer.enclosure import sample_surface
from facegen.transfer.piece_names import INSIDE, kind_of_name
from facegen.transfer.pieces import face_names, find_pieces
from facegen.transfer.weld import weld

Array = NDArray[np.float64]

# Because squares and cubes of smaller and larger numbers run over, and the places of a mesh far off are rounded away.
_SMALLEST, _LARGEST, _FARTHEST = 1e-12, 1e12, 1e6
# Samples by which the planes of symmetry are found: about so many.
_SAMPLES = 20_000
# So many of the places found are followed to their end.
_FOLLOWED = 2
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
# Lids that lie farther aside from their eyeball than this, mm, are drawn to it: a child's are lower in the face.
_BESIDE_BALL = 4.0
# The middles of the base face's eyeballs, mm.
_BALLS = {"L": np.array([28.9, 0.0, 0.0]), "R": np.array([-28.9, 0.0, 0.0])}


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
    """A face ``laid`` on the mesh, how ``alike`` it is, what of it is ``seen``, name -> place (3,), and by what it is
    ``held`` beside known places: what is seen, and lids that are where their eyeballs are."""

    laid: Laid
    alike: float
    seen: Mapping[str, Array]
    held: Mapping[str, Array]


@dataclass(frozen=True, eq=False)
class Searched:
    """What a `Proposer` found on its mesh with no place known, which takes it seconds: for another of the same mesh, in
    another process. Without anything: that no face was found."""

    planes: list[Plane] | None = None
    start: tuple[Laid, float] | None = None
    found: _Found | None = None
    skin: NDArray[np.int64] | None = None
    balls: Mapping[str, Array] = field(default_factory=dict)


class Proposer:
    """Proposes landmarks for one mesh, again and again as more become known."""

    def __init__(self, mesh: Mesh, searched: Searched | None = None) -> None:
        """mesh: in any axes and units. searched: what another found on it. Raises InputError for a mesh without
        triangles or with places that are not finite."""
        if not len(mesh.faces) or not np.isfinite(mesh.vertices).all():
            raise InputError("mesh: expected at least one triangle and finite vertices")
        size = float(np.ptp(mesh.vertices[mesh.faces].reshape(-1, 3), axis=0).max())
        if not _SMALLEST < size < _LARGEST or np.abs(mesh.vertices[mesh.faces]).max() > _FARTHEST * size:
            raise InputError(f"mesh: spans {size:g} and lies up to {np.abs(mesh.vertices[mesh.faces]).max():g} from "
                             f"the origin; expected {_SMALLEST:g} to {_LARGEST:g}, no farther off than {_FARTHEST:g} "
                             "times that")
        self.mesh = mesh
        self._model: FaceModel = face_model()
        corners = mesh.vertices[mesh.faces]
        areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
        self._solid = np.flatnonzero(areas > 0)
        if not len(self._solid):
            raise InputError("mesh: none of its triangles has an area")
        self._surface = Surface(mesh.vertices, mesh.faces[self._solid])
        self._area = float(areas.sum())
        self._plane_kept: tuple[Laid, Plane] | None = None
        self._balls: dict[str, Array] = {}              # of recognised eyes, known with the skin
        if searched is not None:
            self._balls = dict(searched.balls)
            # As if they had been asked for.
            self.__dict__ |= {"_start": searched.start, "_found": searched.found}
            if searched.planes is not None:
                self.__dict__["_planes"] = searched.planes
            if searched.skin is not None:
                self.__dict__["_skin"] = _Skin(mesh, searched.skin)

    # -- what does not depend on what is known -------------------------------------------------------------------------
    def search(self) -> Searched:
        """Return what is found with no place known."""
        return Searched(self._planes, self._start, self._found, self._skin.rows, self._balls)

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
        found = self._followed([one.frame for one in candidates(self._surface.corners, self._planes)])
        if found is None or found[1] < A_FACE:
            more = self._followed(eye_frames(self._surface, self._planes))
            found = max((one for one in (found, more) if one is not None), key=lambda one: one[1], default=None)
        return found

    def _followed(self, frames: list[Similarity]) -> tuple[Laid, float] | None:
        """Return the face laid from the best of several frames, and how alike it is."""
        if not frames:
            return None
        search = self._all.search
        whole = self._best_of(frames, _FOLLOWED)
        whole = self._best_of([frame for laid in whole for frame in (laid.frame, *_beside(laid.frame))], _FOLLOWED)
        bent = [lay(self._model, search, laid.frame, {}, BENT, laid.vertices) for laid in whole]
        alike = [likeness(self._model, laid, search) for laid in bent]
        best = int(np.argmax(alike))
        return bent[best], alike[best]

    @cached_property
    def _skin(self) -> _Skin:
        """The skin, as the pieces of a recognised face tell it; else all that names do not exclude."""
        if self._start is None or sure(self._start[1]) < RECOGNISED:
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
        for s in "LR":
            eyes = [self.mesh.vertices[np.unique(self.mesh.faces[piece.faces])] for piece in pieces
                    if piece.kind == f"eye_{s}"]
            if eyes:
                ball = max(eyes, key=lambda at: float(np.ptp(at, axis=0).max()))
                self._balls[s] = (ball.min(axis=0) + ball.max(axis=0)) / 2
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
        if sure(alike) < RECOGNISED and len(own) < ENOUGH_TO_START:
            return _Found(laid, alike, {}, {})
        lids = self._at_balls(laid)
        if lids:
            laid = lay(model, search, laid.frame, {**lids, **own}, BENT[2:], laid.vertices)
        seen = self._seen(laid)
        hold = {**lids, **{name: place for name, place in seen.items() if name in model.names}, **own}
        again = lay(model, search, laid.frame, hold, BENT[-4:], laid.vertices)
        seen = {name: place for name, place in self._seen(again).items() if name not in own}
        return _Found(again, max(alike, likeness(model, again, search)), seen, hold)

    def _at_balls(self, laid: Laid) -> dict[str, Array]:
        """Return the lids, name -> place (3,) on the mesh, where eyeballs lie elsewhere than the laid face has them."""
        frame, back = laid.frame, laid.frame.inverse()
        points = dict(zip(self._model.names, self._model.placing @ laid.vertices, strict=True))
        rest = self._model.points
        found = {}
        for s, ball in self._balls.items():
            lids = [f"eye_{name}_{s}" for name in ("inner", "outer", "upper", "lower")]
            before_ball = np.mean([rest[name] for name in lids], axis=0) - _BALLS[s]
            off = back.apply(ball) + before_ball - np.mean([points[name] for name in lids], axis=0)
            if np.linalg.norm(off[:2]) > _BESIDE_BALL:
                found |= {name: points[name] + [off[0], off[1], 0.0] for name in lids}
        if not found:
            return {}
        feet = self._skin.search(frame.apply(np.array(list(found.values()))))
        return dict(zip(found, feet.points, strict=True))

    def _seen(self, laid: Laid) -> dict[str, Array]:
        """Return what is seen of lids and lips, name -> place (3,) on the mesh."""
        frame = laid.frame
        back = frame.inverse()
        skin = Surface(back.apply(self.mesh.vertices), self._skin.surface.faces)
        points = dict(zip(self._model.names, self._model.placing @ laid.vertices, strict=True))
        found = {**lip_line(skin, points), **nose_tip(skin, points)}
        found |= eye_opening(skin, points, "L") | eye_opening(skin, points, "R")
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
        return 0.0 if self._start is None else sure(self._start[1])

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
        face = 0.0 if found is None else sure(found.alike)
        believed = 0.0 if found is None else belief(found.alike, len(at))
        plane = self._plane_of(laid)
        places = dict(given)
        if laid is not None:
            places |= {name: one for name, one in self._from(found, believed).items() if name not in given}
        for name, one in given.items():
            partner = f"{name[:-2]}_{'R' if name.endswith('L') else 'L'}"
            if name.endswith(("_L", "_R")) and partner not in given:
                places[partner] = self._mirrored(partner, one, plane)
        ordered = {name: places[name] for name in NAMES if name in places}
        ask = next((name for name in ASKED if name not in given), None)
        first = self._found
        where = self._where(first.laid) if first is not None and first.alike >= A_FACE else None
        warnings = (*not_recognised(face, given), *odd_places(given, self.mesh, where))
        return Proposals(ordered, face, warnings, ask, None if laid is None else laid.frame, self.mesh)

    def _where(self, laid: Laid) -> dict[str, Array]:
        """Return name -> place (3,) of a laid face's landmarks, in the mesh's axes and units."""
        return dict(zip(self._model.names, laid.frame.apply(self._model.placing @ laid.vertices), strict=True))

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
            if sure(found.alike) >= RECOGNISED:           # what was seen of it stays: an answer at once
                seen = {name: place for name, place in found.seen.items() if name not in own}
                hold = {**found.held, **own}
                laid = lay(model, search, found.laid.frame, hold, BENT[-4:], found.laid.vertices)
                return _Found(laid, max(found.alike, likeness(model, laid, search)), seen, hold)
            tries.append(lay(model, search, found.laid.frame, own, BENT[2:], found.laid.vertices))
        if len(own) >= _ENOUGH:
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
        where = self._where(laid)
        off = [float(np.linalg.norm(where[name] - place)) / laid.frame.scale for name, place in own.items()]
        return float(np.median(off)) < _ELSEWHERE

    def _from(self, found: _Found, believed: float) -> dict[str, Proposal]:
        """Return the places of a laid face's landmarks on the mesh. believed: how far, 0 to 1."""
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
            share = SEEN if saw else laid_share(name) * min(float(weight[i]), 1.0)
            result[name] = Proposal(name, face, weights, one.points[i], believed * share, "seen" if saw else "laid")
        return result

    def _plane_of(self, laid: Laid | None) -> Plane:
        """Return the plane of symmetry of the head with the laid face."""
        if laid is None:
            return self._planes[0]
        if self._plane_kept is not None and self._plane_kept[0] is laid:
            return self._plane_kept[1]
        frame = laid.frame
        normal = frame.rotation[:, 0]
        middle = frame.apply(_MIDDLE)
        near = ((self.mesh.vertices - middle) ** 2).sum(axis=1) < (_HEAD * frame.scale) ** 2
        samples = self.mesh.vertices[near & np.isin(np.arange(len(near)), self._surface.faces)]
        plane = Plane(normal, float(normal @ frame.offset), np.inf)
        if len(samples) > 20:
            some = samples[np.unique(np.linspace(0, len(samples) - 1, 1500).astype(int))]
            plane = follow(cKDTree(samples), some, plane, frame.scale * _HEAD, 8)
        self._plane_kept = laid, plane
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
    """Yield frames beside one: larger and smaller, higher and lower. A face that is laid a nose too high stays there,
    because a brow is alike to a lip."""
    for size, up in product((0.9, 1.0, 1.1), (-12.0, 0.0, 12.0)):
        if size != 1.0 or up:
            middle = frame.apply(_MIDDLE + np.array([0.0, up, 0.0]))
            scale = frame.scale * size
            yield Similarity(scale, frame.rotation, middle - scale * frame.rotation @ _MIDDLE)

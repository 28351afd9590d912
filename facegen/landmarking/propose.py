"""Landmarks proposed for a mesh, from none or from some that are known: `Proposer` for a picker, `propose_landmarks`.

What does not depend on what is known - how the mesh mirrors, where a face is on it, the face laid on it - is computed
once; each call then moves the places beside the known ones, or starts from those where no face was recognised or they
contradict it. The result depends on which places are known, not on the order in which they came.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from facegen.errors import InputError, nearest
from facegen.face.landmarks import NAMES
from facegen.geometry.mesh import Mesh
from facegen.landmarking.confidence import A_FACE, MIRRORED, RECOGNISED, belief, confidence_of, laid_share, sure
from facegen.landmarking.doubts import not_recognised, odd_places
from facegen.landmarking.estimate import Estimate, beside_known, of_face, of_known
from facegen.landmarking.eyeballs import Ball
from facegen.landmarking.fit import Laid
from facegen.landmarking.following import partner
from facegen.landmarking.model import FaceModel, face_model
from facegen.landmarking.proposals import ASKED, Proposal, Proposals
from facegen.landmarking.recognise import recognise
from facegen.landmarking.skin import Head, Skin
from facegen.landmarking.symmetry import Plane
from facegen.transfer.pieces import face_names, find_pieces

Array = NDArray[np.float64]

# So many known places say where the face is, whatever was found without them.
_ENOUGH = 4
# A face found where its landmarks are farther from the known ones than this, in millimetres of the base face, is
# another one, or another kind of face.
_ELSEWHERE = 7.0
# The triangle of a laid place looks the way the face does there: the cosine between the two is at least this.
_SAME_WAY = 0.2


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


@dataclass(frozen=True, eq=False)
class Searched:
    """What a `Proposer` found on its mesh with no place known, which takes it seconds: for another of the same mesh, in
    another process. Without anything: that no face was found."""

    planes: Sequence[Plane] | None = None
    balls: Sequence[Ball] | None = None
    start: tuple[Laid, float] | None = None
    found: Estimate | None = None
    skin: NDArray[np.int64] | None = None


class Proposer:
    """Proposes landmarks for one mesh, again and again as more become known."""

    def __init__(self, mesh: Mesh, searched: Searched | None = None) -> None:
        """mesh: in any axes and units. searched: what another found on it. Raises InputError for a mesh without
        triangles or with places that are not finite."""
        self._head = Head(mesh)
        self._model: FaceModel = face_model()
        if searched is not None:                # as if it had been asked for
            vars(self)["_start"], vars(self)["_found"] = searched.start, searched.found
            if searched.skin is not None:
                vars(self)["_skin"] = Skin(mesh, searched.skin)
            known = {"planes": searched.planes, "balls": searched.balls}
            vars(self._head).update({name: list(one) for name, one in known.items() if one is not None})

    @property
    def mesh(self) -> Mesh:
        """The mesh."""
        return self._head.mesh

    @property
    def face(self) -> float:
        """How surely a face was found without any place known, 0 to 1."""
        return 0.0 if self._start is None else sure(self._start[1])

    # -- what does not depend on what is known -------------------------------------------------------------------------
    def search(self) -> Searched:
        """Return what is found with no place known."""
        return Searched(self._head.planes, self._head.balls, self._start, self._found, self._skin.rows)

    @cached_property
    def _start(self) -> tuple[Laid, float] | None:
        return recognise(self._head, self._model)

    @cached_property
    def _skin(self) -> Skin:
        """The skin, as the pieces of a recognised face tell it; else all that names do not exclude."""
        if self.face < RECOGNISED:
            return self._head.shown
        laid = self._start[0]
        vertices, own = self._head.welded
        points = dict(zip(self._model.names, self._model.placing @ laid.vertices, strict=True))
        try:
            pieces = find_pieces(laid.frame.inverse().apply(vertices), own[self.mesh.faces], points,
                                 names=face_names(self.mesh))
        except InputError:
            return self._head.shown
        rows = np.concatenate([piece.faces for piece in pieces if piece.kind == "skin"])
        return Skin(self.mesh, np.intersect1d(rows, self._head.solid))

    @cached_property
    def _found(self) -> Estimate | None:
        """The landmarks with no place known."""
        if self._start is None:
            return None
        return of_face(self._head, self._skin, self._model, *self._start, sure=self.face >= RECOGNISED)

    # -- what does -----------------------------------------------------------------------------------------------------
    def propose(self, known: Mapping[str, Any]) -> Proposals:
        """Return a place for every landmark that can be proposed; known ones as they are.

        known: name -> a point (3,) in the mesh's axes and units, or (triangle, barycentric (3,)). Raises InputError.
        """
        given = {name: self._head.given(name, known[name]) for name in NAMES if name in known}
        for name in known:
            if name not in NAMES:
                raise InputError(f"known: unknown landmark '{name}'{nearest(str(name), NAMES)}")
        found = self._estimate({name: one.xyz for name, one in given.items()})
        places = dict(given)
        if found is not None:
            places |= {name: one for name, one in self._placed(found, given).items() if name not in given}
        plane = self._head.planes[0] if found is None else found.plane
        for name, one in given.items():
            other = partner(name)
            if other not in given and (found is None or found.laid is not None or other not in found.seen):
                places[other] = self._mirrored(other, one, plane)
        ordered = {name: places[name] for name in NAMES if name in places}
        ask = next((name for name in ASKED if name not in given), None)
        first = self._found
        where = None
        if first is not None and first.alike >= A_FACE:
            where = {name: at for name, at in first.on_mesh.items() if name in first.normals or name in first.seen}
        face = 0.0 if first is None else sure(first.alike)
        errors, odd = odd_places(given, self.mesh, where)
        return Proposals(ordered, face, (*not_recognised(face, given), *errors, *odd), ask,
                         None if found is None else found.frame, self.mesh, errors)

    def _estimate(self, known: Mapping[str, Array]) -> Estimate | None:
        """Return where all landmarks are with known places (3,)."""
        found = self._found
        if found is not None and known and self._agree(found, known):
            return beside_known(found, self._model, known)
        if len(known) >= _ENOUGH:
            return of_known(self._head, self._model, known) or found
        return found

    def _agree(self, found: Estimate, known: Mapping[str, Array]) -> bool:
        """Return whether known places lie where a recognised face has them, by and large."""
        where = found.on_mesh
        off = [float(np.linalg.norm(where[name] - place)) / found.frame.scale for name, place in known.items()]
        return sure(found.alike) >= RECOGNISED and float(np.median(off)) < _ELSEWHERE

    def _placed(self, found: Estimate, given: Mapping[str, Proposal]) -> dict[str, Proposal]:
        """Return the landmarks on the mesh. given: known ones."""
        skin = self._head.carrying(given.values()) if found.laid is None else self._skin
        points = found.on_mesh
        places = np.array(list(points.values()))
        feet = skin.search(places)
        ways = np.array([found.normals.get(name, np.zeros(3)) for name in points]) @ found.frame.rotation.T
        facing = skin.search(places, ways, least_cosine=_SAME_WAY)
        every = self._head.search(places)               # pupils lie on eyes
        result = {}
        for i, name in enumerate(points):
            one = facing if name in found.normals and name not in found.seen and facing.faces[i] >= 0 else feet
            rows = skin.rows
            if name.startswith("eye_center"):
                one, rows = every, self._head.solid
            result[name] = Proposal(name, int(rows[one.faces[i]]), one.weights[i], one.points[i],
                                    self._confidence(found, name, len(given)), "seen" if name in found.seen else
                                    "laid" if name in found.normals else "followed")
        return result

    def _confidence(self, found: Estimate, name: str, known: int) -> float:
        """Return how sure a place is, 0 to 1."""
        if found.laid is None:
            return float(confidence_of(found.off[name], found.places))
        believed = belief(found.alike, known)
        if name not in found.normals:
            return float(believed * confidence_of(found.off[name], found.places))
        weight = 1.0 if name in found.seen else min(float(self._weight[name]), 1.0)
        return believed * laid_share(name, name in found.seen) * weight

    @cached_property
    def _weight(self) -> Mapping[str, float]:
        """Name -> how much the laid face's partners count where a landmark lies, 0 to 1."""
        return dict(zip(self._model.names, self._model.placing @ self._found.laid.weight, strict=True))

    def _mirrored(self, name: str, one: Proposal, plane: Plane) -> Proposal:
        """Return a known place's partner on the other side."""
        at, normal = plane.mirror(one.xyz), self._head.normal(one)
        normal = normal - 2 * (normal @ plane.normal) * plane.normal
        skin = self._skin
        feet = skin.search(at[None], normal[None], least_cosine=0.3)
        if feet.faces[0] < 0:
            feet = skin.search(at[None])
        return Proposal(name, int(skin.rows[feet.faces[0]]), feet.weights[0], feet.points[0], MIRRORED, "mirrored")

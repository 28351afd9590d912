"""Where points probably lie that nobody has placed yet, and what is odd about those that are."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from facegen.errors import InputError
from facegen.geometry.closest import ClosestPoints
from facegen.geometry.mesh import Mesh
from facegen.geometry.operators import Surface
from facegen.studio.landmark_words import ORDER, partner
from facegen.studio.picking import Place, as_landmarks, as_places, missing, place, point
from facegen.studio.placement import axes
from facegen.studio.work import AvatarWork
from facegen.transfer.alignment import align
from facegen.transfer.landmark_checks import average_face
from facegen.transfer.landmarks import check_places, snap

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Proposals:
    """``places`` and ``confidence`` 0..1 by landmark, none that is confirmed; ``advised``: what to place next;
    ``errors`` and ``warnings``: sentences about what was placed."""

    places: Mapping[str, Place] = field(default_factory=dict)
    confidence: Mapping[str, float] = field(default_factory=dict)
    advised: str | None = None
    errors: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()


class Adviser:
    """What is known of one avatar's mesh; made once, asked after each step."""

    def __init__(self, mesh: Mesh) -> None:
        self.mesh = mesh
        used = mesh.vertices[np.unique(mesh.faces)]
        self._middle = (used.min(axis=0) + used.max(axis=0)) / 2
        self._closest = ClosestPoints(Surface(mesh.vertices, mesh.faces))

    def proposals(self, work: AvatarWork) -> Proposals:
        """Return what the points of a work say of the others."""
        errors, warnings = self.faults(work)
        known = {name: point(self.mesh, one) for name, one in work.landmarks.items()}
        found: dict[str, Place] = {}
        if len(known) >= 6:
            try:
                back = align(known, average_face()).inverse()
                found = as_places(snap({name: back.apply(at) for name, at in average_face().items()
                                        if name not in known}, self.mesh))
            except InputError:
                pass
        for name in known:
            pair = partner(name)
            if pair is not None and pair not in known:
                found[pair] = self.mirrored(work, name, work.landmarks[name])
        found = {name: found[name] for name in ORDER if name in found}
        return Proposals(found, dict.fromkeys(found, 0.5), None, errors, warnings)

    def faults(self, work: AvatarWork) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Return (errors, warnings), sentences, about the points of a work."""
        if missing(work):
            return (), ()
        try:
            return (), tuple(check_places(as_landmarks(self.mesh, work.landmarks), self.mesh))
        except InputError as error:
            return tuple(str(error).removeprefix("landmarks: ").split("; ")), ()

    def nearest(self, at: Array) -> Place:
        """Return the place of the mesh that is nearest to a point (3,), in the mesh's units."""
        foot = self._closest(np.asarray(at, float)[None])
        return place(foot.faces[0], foot.weights[0])

    def mirrored(self, work: AvatarWork, name: str, one: Place) -> Place | None:
        """Return where the partner of a point at a place belongs; None if it has none."""
        if partner(name) is None:
            return None
        normal, through = self._plane(work, name)
        at = point(self.mesh, one)
        return self.nearest(at - 2 * ((at - through) @ normal) * normal)

    def _plane(self, work: AvatarWork, moved: str) -> tuple[Array, Array]:
        """Return the normal (3,) and a point of the plane between left and right: by the other pairs, or the file's."""
        known = {name: point(self.mesh, one) for name, one in work.landmarks.items()
                 if moved not in (name, partner(name))}
        pairs = [(at, known[partner(name)]) for name, at in known.items()
                 if name.endswith("_L") and partner(name) in known]
        middles = [(left + right) / 2 for left, right in pairs]
        middles += [at for name, at in known.items() if partner(name) is None]
        if len(pairs) >= 2:
            normal = np.linalg.svd([left - right for left, right in pairs], full_matrices=False)[2][0]
        else:
            normal = axes(work.up, work.front)[0]
        return normal, np.mean(middles, axis=0) if middles else self._middle

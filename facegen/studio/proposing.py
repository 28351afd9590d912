"""Where points probably lie that nobody has placed yet, and what is odd about those that are."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from facegen.errors import FileError
from facegen.geometry.closest import ClosestPoints
from facegen.geometry.mesh import Mesh
from facegen.geometry.operators import Surface
from facegen.landmarking.confidence import RECOGNISED
from facegen.landmarking.propose import Proposer, Searched
from facegen.studio.apart import Waits, patient
from facegen.studio.landmark_words import ORDER, partner
from facegen.studio.picking import Place, place, point
from facegen.studio.placement import axes, nearest_axes
from facegen.studio.reading import search_safely
from facegen.studio.work import AvatarWork

Array = NDArray[np.float64]

FOUND = RECOGNISED
"""From this sureness on, 0..1, a face was found without any point placed."""

# A guess that is less sure than this is not worth a look.
_LEAST = 0.08
# A mirrored place, before anything else is known.
_MIRRORED = 0.9


@dataclass(frozen=True)
class Advice:
    """``places`` and ``confidence`` 0..1 by landmark, none that is confirmed; ``advised``: what to place next;
    ``sure``: how surely there is a face, 0..1; ``stands``: (up, front), axes of the file, if that shows; ``errors``
    and ``warnings``: sentences about what was placed."""

    places: Mapping[str, Place] = field(default_factory=dict)
    confidence: Mapping[str, float] = field(default_factory=dict)
    advised: str | None = None
    sure: float = 0.0
    stands: tuple[str, str] | None = None
    errors: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()


@lru_cache(maxsize=4)       # finding a face takes seconds, and a page that is loaded again has the same mesh
def adviser_of(mesh: Mesh, path: Path) -> Adviser:
    """Return the adviser of a mesh, the same for all who ask."""
    return Adviser(mesh, path)


class Adviser:
    """What is known of one avatar's mesh; made once, asked after each step. ``ready``: whether `advice` is quick.

    path: the avatar's file, read again by the process that looks for a face. Threads take turns.
    """

    def __init__(self, mesh: Mesh, path: Path) -> None:
        self.mesh, self._path = mesh, path
        self._proposer: Proposer | None = None
        self._odd: tuple[str, ...] = ()             # what went wrong when a face was looked for
        self.ready = False
        self._lock = threading.Lock()
        used = mesh.vertices[np.unique(mesh.faces)]
        self._middle = (used.min(axis=0) + used.max(axis=0)) / 2

    @cached_property
    def _closest(self) -> ClosestPoints:
        return ClosestPoints(Surface(self.mesh.vertices, self.mesh.faces))

    def first(self, work: AvatarWork) -> Advice:
        """Return at once what mirroring says: the face is still being looked for."""
        found = {}
        for name, one in work.landmarks.items():
            pair = partner(name)
            if pair is not None and pair not in work.landmarks:
                found[pair] = self.mirrored(work, name, one)
        return Advice(found, dict.fromkeys(found, _MIRRORED))

    def advice(self, work: AvatarWork, waits: Waits = patient) -> Advice:
        """Return what the points of a work say of the others; the first time takes seconds.

        waits: see `facegen.studio.apart.ask`.
        """
        known = {name: (one["face"], tuple(one["barycentric"])) for name, one in work.landmarks.items()}
        with self._lock:
            if self._proposer is None:
                self._proposer = Proposer(self.mesh, self._searched(waits))
            proposed = self._proposer.propose(known)
        self.ready = True
        guesses = {name: proposed[name] for name in ORDER if name in proposed and name not in known
                   and proposed[name].confidence >= _LEAST}
        return Advice({name: place(one.face, one.barycentric) for name, one in guesses.items()},
                      {name: one.confidence for name, one in guesses.items()}, proposed.ask, proposed.face,
                      nearest_axes(proposed.frame.rotation.T) if proposed.face >= FOUND and proposed.frame else None,
                      proposed.errors,
                      (*self._odd, *(each for each in proposed.warnings if each not in proposed.errors)))

    def _searched(self, waits: Waits) -> Searched:
        try:
            return search_safely(self._path, waits=waits)
        except FileError:                           # as the path is nobody's business, it is said here
            self._odd = ("No face could be looked for: it takes too long or too much. Place some points, and the "
                         "others are proposed.",)
            return Searched()

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

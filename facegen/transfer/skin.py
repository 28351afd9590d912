"""An avatar's skin laid on a template: everything of a transfer that does not depend on the shapes.

The steps in their order, each a function of its own: sides of the slits, registration (Onizuka 2018, eq. 10-13), a
finer copy where needed, correspondence, part motion (eq. 16-18), the jaw, and the factored system (eq. 19).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from facegen.fileio.kept import Kept
from facegen.geometry.closest import Feet, means
from facegen.geometry.normals import vertex_normals
from facegen.geometry.operators import Surface
from facegen.progress import Progress, silent
from facegen.transfer.baselines import PAPER, SUMNER, PaperWeights, expression_cloning, gradient_transfer
from facegen.transfer.jaw import JawMotion, avatar_jaw, jaw_share
from facegen.transfer.lining import depths, leaning, too_deep
from facegen.transfer.margins import LIPS, Margins, facing_margins
from facegen.transfer.part_motion import LIP_HEIGHTS, MEMBERS, PartMotion, part_motion, spread
from facegen.transfer.refine import BEND, refine
from facegen.transfer.registration import Correspondence, register
from facegen.transfer.registration_key import registration_key
from facegen.transfer.sides import painted, settled, side_fields
from facegen.transfer.solve import OURS, Followers, Transfer, Weights, landmark_motion
from facegen.transfer.template import Template, placing

METHODS = ("landmarks", "sumner", "cloning")

# Millimetres: partners farther than this are none once the skin is registered.
_REACH = 10.0
# Millimetres: a file's rounding. The skin of a copy lies this near to the template's.
_COPY = 1e-3
# A side's bending is measured on so many shapes at a time, to bound the memory.
_AT_A_TIME = 16
# Above this many triangles the avatar is as fine as the template everywhere that matters: the search is left out.
_FINE_ENOUGH = 60_000


@dataclass(frozen=True, eq=False)
class Solver:
    """``motion`` (k, n_s, 3): the template's, without its jaw. ``n``: of the avatar's vertices, of which the ``system``
    may have more."""

    system: Transfer
    motion: NDArray[np.float64]
    n: int

    def __call__(self, shapes: NDArray[np.int64], *, progress: Progress = silent) -> NDArray[np.float64]:
        """Return the displacements (s, n, 3) of some shapes (s,), without the jaw, mm."""
        return self.system.solve(self.motion[shapes], progress=progress)[:, :self.n]


@dataclass(frozen=True, eq=False)
class Skin:
    """``surface`` of n vertices, ``places`` of its landmarks (vertices (3,), weights (3,)), and ``registered`` (n, 3):
    the same vertices in the template's shape. All in the template's frame, mm."""

    template: Template
    surface: Surface
    places: Mapping[str, tuple[NDArray, NDArray]]
    sides: NDArray[np.float64]
    registered: NDArray[np.float64]
    correspondence: Correspondence

    @cached_property
    def landmarks(self) -> dict[str, NDArray]:
        """Places (3,) of the landmarks."""
        return {name: weights @ self.surface.vertices[rows] for name, (rows, weights) in self.places.items()}

    @cached_property
    def feet(self) -> Feet:
        """The template's partner of each vertex."""
        found = self.correspondence(self.registered, vertex_normals(self.registered, self.surface.faces), self.sides,
                                    reach=_REACH)
        return self._without_deep(found, self.depth)

    @cached_property
    def trust(self) -> NDArray[np.float64]:
        """How much each vertex' partner counts (n,), 0 to 1: see `Correspondence.trust`."""
        return self.correspondence.trust(self.feet, vertex_normals(self.registered, self.surface.faces))

    @cached_property
    def lips(self) -> tuple[Margins, Margins] | None:
        """The edges of the template's lips and of the skin's, where both have some."""
        return facing_margins(self, LIPS)

    @cached_property
    def depth(self) -> NDArray[np.float64]:
        """How far (n,) behind the edges of the lips each vertex lies, mm along the skin; 0 for what does not."""
        return np.zeros(len(self.surface.vertices)) if self.lips is None else \
            depths(self.surface, self.lips[1], self.places)

    @cached_property
    def _template_depth(self) -> NDArray[np.float64]:
        template = self.template
        return np.zeros(len(template.surface.vertices)) if self.lips is None else \
            depths(template.surface, self.lips[0], template.places)

    def _without_deep(self, feet: Feet, depth: NDArray) -> Feet:
        """Return the feet without those of a mouth's lining that lies deeper (n,) than the template's lips reach."""
        partner = np.einsum("nc,nc->n", feet.weights, self._template_depth[self.template.surface.faces[feet.faces]])
        scale = float(self.parts.ratios["mouth"].max())
        return replace(feet, faces=np.where(feet.found & too_deep(depth, partner, scale), -1, feet.faces))

    @cached_property
    def copied(self) -> bool:
        """Whether the skin is the template's own, vertex for vertex within rounding: it then moves as that does."""
        feet = self.feet
        stays = np.abs(self.registered - self.surface.vertices).max() < _COPY
        at_vertices = feet.weights.max(axis=1) > 1 - _COPY
        return bool(stays and feet.found.all() and at_vertices.all() and feet.distances.max() < _COPY)

    @cached_property
    def parts(self) -> PartMotion:
        """How a part's motion goes on this avatar."""
        return part_motion(self.template.landmarks, self.landmarks)

    @cached_property
    def jaw_share(self) -> NDArray[np.float64]:
        """How much of the jaw's motion each vertex takes (n,)."""
        return jaw_share(self.surface, self.feet, self.template.surface.faces, self.template.jaw_share, self.sides,
                         self.places)

    def jaw(self, opening: float = 1.0) -> JawMotion | None:
        """Return the avatar's jaw; None if the template knows of none. opening: a factor on how far it turns."""
        if self.template.hinge is None:
            return None
        return avatar_jaw(self.template.hinge, self.template.landmarks, self.landmarks, self.registered,
                          self.surface.vertices, self.jaw_share, opening=opening)

    def motion(self, method: str = "landmarks", weights: Weights | PaperWeights | None = None, *,
               progress: Progress = silent) -> NDArray[np.float64]:
        """Return the displacements (k, n, 3) of the template's shapes on this skin, mm."""
        if method == "landmarks" and not isinstance(weights, PaperWeights):
            result = self.solver(self.system(weights or OURS))(np.arange(len(self.template.names)), progress=progress)
            self.open_jaw(result, self.template.shapes.jaw)
            return result
        return self.published_motion(method, weights)

    def published_motion(self, method: str, weights: PaperWeights | None = None) -> NDArray[np.float64]:
        """Return the displacements (k, n, 3), mm, as published methods have them."""
        template = self.template
        if method == "cloning":
            return expression_cloning(self.surface, self.registered, template.surface, self.feet, template.motion)
        chosen = SUMNER if method == "sumner" else weights or PAPER
        places, followers = self._landmark_motion()
        return gradient_transfer(self.surface, self.registered, template.surface, template.motion, weights=chosen,
                                 landmarks=places, landmark_motion=followers(template.motion), root=method == "sumner")

    def open_jaw(self, motion: NDArray, jaw: NDArray, opening: float = 1.0) -> None:
        """Add to displacements (k, n, 3) what the template's jaw (k, 3) does, in place."""
        own = self.jaw(opening)
        for some in _blocks(len(motion) if own is not None else 0):
            motion[some] += self.jaw_share[:, None] * own.movement(self.surface.vertices, jaw[some])

    def _landmark_motion(self, *, blended: bool = False) -> tuple[sparse.csr_array, Followers]:
        """Return the weights (l, n) that place the parts' landmarks, and how these move (eq. 16).

        blended: as the skin round them goes, where parts blend; a muzzle's lip, which is turned against its nose, would
        else be drawn into a point. Else each by its own part, as in the paper.
        """
        names = tuple(name for members in MEMBERS.values() for name in members
                      if name in self.places and name in self.template.places)
        part = {name: part for part, members in MEMBERS.items() for name in members}
        if blended:
            matrices, _ = spread(self.parts, self.template.landmarks,
                                 np.array([self.template.landmarks[name] for name in names]))
        else:
            matrices = np.array([self.parts.matrices[part[name]] for name in names])
        followers = landmark_motion(self.template.places, names, matrices)
        return (placing(self.places, names, len(self.surface.vertices)),
                leaning(followers, names, self._thinness()) if blended else followers)

    def _thinness(self) -> dict[str, tuple[str, float]]:
        """Return edge -> its border, and how much lower, 0 to 1, that lip is than the template's."""
        height, result = self.parts.ratios["mouth"][1], {}
        for edge, border in LIP_HEIGHTS:
            own, its = (np.linalg.norm(places[edge] - places[border]) if edge in places and border in places else 0.0
                        for places in (self.landmarks, self.template.landmarks))
            if its > 0:
                result[edge] = border, max(0.0, 1.0 - own / max(height * its, 1e-9))
        return result

    def solver(self, system: Transfer) -> Solver:
        """Return what solves a `system` for the template's shapes."""
        return Solver(system, self.template.without_jaw, len(self.surface.vertices))

    def system(self, weights: Weights = OURS) -> Transfer:
        """Return the system, on a finer copy of the skin where the template bends more than it can."""
        template, surface, registered = self.template, self.surface, self.registered
        sides, depth, feet, trust = self.sides, self.depth, self.feet, self.trust
        places, followers = self._landmark_motion(blended=True)
        if len(surface.faces) < _FINE_ENOUGH:
            fine, fine_registered, made_of = refine(surface, registered, self._bending(self.template.without_jaw))
            if len(fine.vertices) > len(surface.vertices):
                surface, registered, sides, depth = fine, fine_registered, made_of @ sides, made_of @ depth
                normals = vertex_normals(registered, surface.faces)
                feet = self._without_deep(self.correspondence(registered, normals, sides, reach=_REACH), depth)
                trust = self.correspondence.trust(feet, normals)
                places.resize((places.shape[0], len(surface.vertices)))
        shape = Surface(registered, surface.faces)
        middles = self.correspondence(shape.corners.mean(axis=1), shape.normals, sides[surface.faces].mean(axis=1),
                                      reach=_REACH)
        middles = self._without_deep(middles, depth[surface.faces].mean(axis=1))
        matrices, turns = spread(self.parts, template.landmarks, registered)
        return Transfer(surface, template.surface, feet, middles, matrices, turns, places, followers, weights, sides,
                        trust=(trust, self.correspondence.trust(middles, shape.normals)))

    def _bending(self, motion: NDArray) -> Callable[[NDArray, NDArray], NDArray]:
        """Return what gives for sides (e, 2) between places how far the motion of their middles is from the mean of
        their ends', at most, mm."""
        n = len(self.template.surface.vertices)
        farthest = np.sqrt(np.einsum("kni,kni->kn", motion, motion).max(axis=0))     # no side bends more than it allows

        def bend(places: NDArray, sides: NDArray) -> NDArray[np.float64]:
            ends, local = np.unique(sides, return_inverse=True)
            a, b = local.reshape(-1, 2).T
            at_ends, at_middles = (self._weights(at) for at in (places[ends], places[sides].mean(axis=1)))
            difference = sparse.csr_array(at_middles - (at_ends[a] + at_ends[b]) * 0.5)
            most = abs(difference) @ farthest
            mobile = np.flatnonzero(most > BEND)
            squared = np.zeros(len(mobile))
            for some in _blocks(len(motion) if len(mobile) else 0):
                moved = difference[mobile] @ np.moveaxis(motion[some], 0, 1).reshape(n, -1)
                moved = moved.reshape(len(mobile), -1, 3)
                squared = np.maximum(squared, np.einsum("eki,eki->ek", moved, moved).max(axis=1))
            most[mobile] = np.sqrt(squared)
            return most

        return bend

    def _weights(self, places: NDArray) -> sparse.csr_array:
        """Return the weights (p, n_s) of the template's vertices at what is nearest to places (p, 3)."""
        template, feet = self.template.surface, self.correspondence.nearest(places)
        return means(template.faces[feet.faces], feet.weights, len(template.vertices))


def lay_skin(template: Template, surface: Surface, places: Mapping[str, tuple[NDArray, NDArray]], *,
             kept: Kept | None = None, progress: Progress = silent) -> Skin:
    """Return the avatar's skin laid on the template.

    surface: the skin in the template's frame, mm. places: its landmarks. kept: where registrations are found again and
    kept. Raises InputError where the mesh cannot be solved.
    """
    key = None if kept is None else registration_key(template, surface, places)
    registered = None if key is None else kept.find(key, surface.vertices.shape)
    sides = side_fields(surface, places)
    correspondence = Correspondence(template.surface, side_fields(template.surface, template.places),
                                    painted(surface, places, sides))
    places = settled(surface, places, sides)
    if registered is None:
        names = [name for name in places if name in template.places]
        targets = np.array([template.landmarks[name] for name in names])
        registered = register(surface, sides, placing(places, names, len(surface.vertices)), targets,
                              correspondence, progress=progress)
        if key is not None:
            kept.keep(key, registered)
    return Skin(template, surface, places, sides, registered, correspondence)


def _blocks(k: int):
    return [slice(start, start + _AT_A_TIME) for start in range(0, k, _AT_A_TIME)]

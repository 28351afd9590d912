"""Deform the avatar's skin into the template's shape.

Based on: Onizuka et al. (2018), section 4.2, eq. 10-13: minimise ws ES + wi EI + wc EC with the landmarks on the
template's. ES is smoothness, EI keeps the shape, EC draws every vertex to the nearest place of the template. In terms
of the displacement u = x - x0 and its gradient in the triangles' planes, T - I = grad u:

    ES = integral |second derivative of u|^2     (eq. 10, as the jumps of grad u across edges)
    EI = integral |grad u|^2                     (eq. 11)
    EC = integral |x - c(x)|^2                   (eq. 12)

Integrals over the surface, not sums over its triangles: a finer mesh of the same face is registered alike. Where we
differ from the paper: c(x) lies on the surface, not at a vertex; more and gentler steps; no partner across a slit or
beyond the template's border.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.spatial import cKDTree

from facegen.geometry.closest import ClosestPoints, Feet
from facegen.geometry.factor import Factor
from facegen.geometry.fade import smooth_step
from facegen.geometry.normals import vertex_normals
from facegen.geometry.operators import Surface
from facegen.progress import Progress, counted, silent
from facegen.transfer.sides import torn


@dataclass(frozen=True)
class Step:
    """One solve or more with the same weights. smooth (mm^2), stay, close (1 / mm^2): ws, wi, wc; reach (mm): partners
    farther away are no partners."""

    smooth: float
    stay: float
    close: float
    reach: float
    repeat: int = 1


STEPS = (Step(40.0, 0.02, 0.0, 0.0), Step(40.0, 0.01, 0.002, 40.0), Step(20.0, 0.003, 0.01, 25.0),
         Step(10.0, 0.001, 0.05, 15.0, 2), Step(5.0, 0.0, 0.2, 10.0, 2))
"""From stiff to close, in the working frame: a human-sized head in millimetres."""

# How firmly a landmark is held, times the largest diagonal entry: it lands within a hundredth of a millimetre.
_HOLD = 1e2
# Because normals of the registered skin are those of a rough draft at first: this is wider than the final match.
_LEAST_COSINE = 0.1
# Because a partner that comes or goes must change nothing: it counts in full from this cosine on, and less and less
# down to the least one.
_FULL_COSINE = 0.5
# Because a place beyond the template's border has its nearest place on the border: this far in mm, it has no partner.
_PAST = 1.0
# Millimetres: a vertex this near to one of the template's is that one, if they look the same way: a copy's own.
_COPY, _ALIKE = 1e-3, 0.5
# So many of the template's vertices may share a place: two lips that touch, twice where lids meet them.
_LIPS = 4


class Correspondence:
    """The search for partners on the template: normal-aware, no crossing of slits, no partner on the border."""

    def __init__(self, template: Surface, sides: NDArray, painted: tuple[int, ...] = ()) -> None:
        """template, sides: with its `side_fields`. painted: slits that the avatar has not, see `torn`."""
        self.template = template
        self._search = ClosestPoints(template)
        self.sides, self._painted = sides, painted
        self._face_sides = sides[template.faces].mean(axis=1)
        edges, of_side = template.edges
        border = template.border_edges
        self._border_side = border[of_side].reshape(-1, 3)
        self._vertices = cKDTree(template.vertices)
        self._normals = vertex_normals(template.vertices, template.faces)
        self._face_of = np.zeros(len(template.vertices), np.int64)
        self._face_of[template.faces.ravel()] = np.repeat(np.arange(len(template.faces)), 3)
        self._border_corner = np.isin(template.faces, edges[border])

    def nearest(self, points: NDArray) -> Feet:
        """Return the nearest places of all, whatever their normals."""
        return self._search(points)

    def __call__(self, points: NDArray, normals: NDArray, sides: NDArray, *, reach: float,
                 least_cosine: float = _LEAST_COSINE) -> Feet:
        """Return the feet; those beyond reach (mm) or on the template's border count as none."""
        feet = self._itself(points, normals, sides, self._search(
            points, normals, least_cosine=least_cosine, labels=(sides, self._face_sides)))
        beyond = ~(feet.distances <= reach)
        on_side = feet.weights[:, [2, 0, 1]] < 1e-9         # no weight of the corner opposite side k
        on_border = (on_side & self._border_side[feet.faces]) | \
            ((feet.weights > 1 - 1e-9) & self._border_corner[feet.faces])
        beyond |= feet.found & on_border.any(axis=1) & (feet.distances > _PAST)
        if self._painted:
            beyond |= feet.found & torn(sides, self._face_sides[feet.faces], self._painted)
        return Feet(np.where(beyond, -1, feet.faces), feet.weights, feet.points, feet.distances)

    def trust(self, feet: Feet, normals: NDArray) -> NDArray[np.float64]:
        """Return how much partners (p,) count, 0 to 1, of places with normals (p, 3): those that look another way
        count less, and none not at all; a copy's own in full."""
        cosine = np.einsum("pi,pi->p", normals, self.template.normals[feet.faces])
        faces_alike = smooth_step((cosine - _LEAST_COSINE) / (_FULL_COSINE - _LEAST_COSINE))
        return np.where(feet.found, np.where(feet.distances < _COPY, 1.0, faces_alike), 0.0)

    def _itself(self, points: NDArray, normals: NDArray, sides: NDArray, feet: Feet) -> Feet:
        """Return the feet with those of points that coincide with a vertex at that vertex: where the surface folds, a
        vertex' normal may be far from those of all its triangles."""
        apart, near = self._vertices.query(points, k=_LIPS, distance_upper_bound=_COPY)
        here = apart < _COPY
        rows = np.flatnonzero(here.any(axis=1) & (~feet.found | (feet.distances > _COPY)))
        if not len(rows):
            return feet
        near = np.where(here[rows], near[rows], 0)
        alike = np.where(here[rows], np.einsum("pi,pki->pk", normals[rows], self._normals[near]), -1.0)
        alike[((sides[rows][:, None] * self.sides[near]) < 0).any(axis=2)] = -1.0
        best = alike.argmax(axis=1)
        good = alike[np.arange(len(rows)), best] > _ALIKE
        rows, vertices = rows[good], near[np.arange(len(rows)), best][good]
        faces, weights, places, distances = (one.copy() for one in (feet.faces, feet.weights, feet.points,
                                                                    feet.distances))
        faces[rows] = self._face_of[vertices]
        weights[rows] = self.template.faces[faces[rows]] == vertices[:, None]
        places[rows] = self.template.vertices[vertices]
        distances[rows] = np.linalg.norm(points[rows] - places[rows], axis=1)
        return Feet(faces, weights, places, distances)


def register(surface: Surface, sides: NDArray, landmarks: sparse.csr_array, targets: NDArray,
             correspondence: Correspondence, steps: tuple[Step, ...] = STEPS, *, progress: Progress = silent
             ) -> NDArray[np.float64]:
    """Return the vertices (n, 3) of the avatar's skin in the template's shape.

    surface: the skin (n vertices, m triangles), in the template's frame, mm. sides (n, s): `side_fields`. landmarks
    (l, n), targets (l, 3): weights of the vertices that place the landmarks, and the template's. Raises InputError
    where the system is singular.
    """
    n = len(surface.vertices)
    smooth, stay = surface.bending, surface.stretching
    area = np.maximum(surface.vertex_areas, 1e-6 * surface.vertex_areas.mean())
    x, factor = surface.vertices.copy(), None
    all_steps = [step for step in steps for _ in range(step.repeat)]
    for step in counted(progress, "laying the skin on the template", all_steps):
        pull = np.zeros(n)
        goal = x
        if step.close:
            normals = vertex_normals(x, surface.faces)
            feet = correspondence(x, normals, sides, reach=step.reach)
            # Near the reach a partner counts less: one that comes and goes would make steps jump.
            fade = np.where(feet.found, 1 - np.minimum(feet.distances / max(step.reach, 1e-9), 1) ** 2, 0.0)
            fade *= correspondence.trust(feet, normals)
            pull, goal = step.close * area * fade, np.where(feet.found[:, None], feet.points, x)
        energy = step.smooth * smooth + step.stay * stay
        floor = 1e-9 * energy.diagonal().mean()
        hold = _HOLD * energy.diagonal().max()
        matrix = energy + sparse.diags_array(pull + floor) + hold * (landmarks.T @ landmarks)
        right = pull[:, None] * (goal - surface.vertices)
        right += hold * (landmarks.T @ (targets - landmarks @ surface.vertices))
        factor = Factor(matrix, what="the registration of the avatar", spent=factor)
        x = surface.vertices + factor.solve(right)
    return x

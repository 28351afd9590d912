"""The inner side of the lips: skin behind their edges, which the skin before it takes along.

Gradients along the skin know nothing of its thickness. Where an avatar's lips are half as thick as the template's, an
inner side that came as near to the outer one, in millimetres, as the template's does would come through it: what the
inner side moves beside the outer one is scaled by how thick the lips are. And a mouth's lining goes deeper than the
inner side of the template's lips; what is farther inside has no partner there.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.csgraph import connected_components, dijkstra

from facegen.geometry.closest import ClosestPoints, means
from facegen.geometry.fade import smooth_step
from facegen.geometry.normals import vertex_normals
from facegen.geometry.operators import Surface
from facegen.transfer.solve import Followers

if TYPE_CHECKING:
    from facegen.transfer.margins import Margins
    from facegen.transfer.skin import Skin

Array = NDArray[np.float64]
Places = Mapping[str, tuple[NDArray, NDArray]]

# Landmarks that are outside of the mouth, whatever the face.
_OUTSIDE = ("nose_tip", "chin", "forehead")
# A partner is as deep behind the lips as its vertex is, or so many times as deep, and by so many mm at most.
_DEEPER, _DEEPER_MM = 1.6, 4.0
# The skin over an inner side looks the other way: by this cosine at least.
_OPPOSITE = 0.1
# An inner side goes with the skin over it where that is no farther than the first, and not at all from the second on,
# mm: a mouth's floor is no lip.
_THIN, _THICK = 8.0, 20.0
# The template's lips are no thinner than this anywhere, mm: at their very edges thickness is noise.
_LEAST = 0.5
# So many rounds of means make of shares that neighbours have alone one that they have in common.
_ROUNDS = 3


def depths(surface: Surface, edges: Margins, places: Places) -> Array:
    """Return how far (n,) behind the edges of the lips each vertex lies, mm along the skin; 0 for what does not.

    Nothing lies behind edges that do not part the skin in two.
    """
    n = len(surface.vertices)
    on = np.zeros(n, bool)
    on[np.concatenate(edges.ways)] = True
    sides, _ = surface.edges
    rest = sides[~on[sides].any(axis=1)]
    _, part = connected_components(sparse.coo_array((np.ones(len(rest)), rest.T), shape=(n, n)), directed=False)
    outside = [part[vertices[np.argmax(weights)]] for vertices, weights in
               (places[name] for name in _OUTSIDE if name in places)]
    across = sides[on[sides].sum(axis=1) == 1]
    inside = np.isin(part, np.setdiff1d(part[across[~on[across]]], outside)) & ~on
    if not inside.any() or not outside:
        return np.zeros(n)
    within = sides[(inside | on)[sides].all(axis=1)]
    length = np.linalg.norm(surface.vertices[within[:, 0]] - surface.vertices[within[:, 1]], axis=1) + 1e-6
    far = dijkstra(sparse.csr_array((length, within.T), shape=(n, n)), directed=False, indices=np.flatnonzero(on),
                   min_only=True)
    return np.where(inside & np.isfinite(far), far, 0.0)


def too_deep(depth: Array, partner: Array, scale: float) -> NDArray[np.bool_]:
    """Return which vertices (n,) lie farther behind the lips than their partners (n,) do, mm. scale: how many times as
    large as the template's the mouth is."""
    return depth > _DEEPER * scale * partner + _DEEPER_MM


@dataclass(frozen=True, eq=False)
class Leaning(Followers):
    """Places of which some lean on others: ``lean`` (p, p) says how much of each one's movement each takes."""

    lean: Array

    def __call__(self, motion: Array) -> Array:
        """Return the places' displacements (k, p, 3) for the template's (k, n_s, 3)."""
        return np.einsum("pq,kqi->kpi", self.lean, super().__call__(motion))

    def blocks(self, shares: sparse.sparray):
        """As theirs, for shares (n, p)."""
        return super().blocks(sparse.csr_array(shares) @ sparse.csr_array(self.lean))


def leaning(followers: Followers, names: Sequence[str], thinness: Mapping[str, tuple[str, float]]) -> Leaning:
    """Return the landmarks (p,) with the edges of lips leaning on their borders: the lower a lip is beside the
    template's, the less its edge moves beside its border, over which it would else roll.

    thinness: edge -> border, and 0 for a lip as high as the template's, to 1.
    """
    lean = np.eye(len(names))
    for edge, (border, share) in thinness.items():
        if edge in names and border in names:
            i, j = names.index(edge), names.index(border)
            lean[i, i], lean[i, j] = 1.0 - share, share
    return Leaning(followers.corners, followers.weights, followers.matrices, lean)


@dataclass(frozen=True, eq=False)
class InnerSide:
    """``rows`` (r,) of the skin behind the lips' edges, ``over`` (r, n): weights of the skin over them, and ``share``
    (r,): how much they go with it."""

    rows: NDArray[np.int64]
    over: sparse.csr_array
    share: Array

    def carry(self, motion: Array) -> None:
        """Take the inner side along in displacements (k, n, 3) of the skin, in place."""
        for moved in motion:
            moved[self.rows] += self.share[:, None] * (self.over @ moved - moved[self.rows])


def inner_side(skin: Skin) -> InnerSide | None:
    """Return how the inner side of an avatar's lips goes with the outer one; None where it has none."""
    surface, depth = skin.surface, skin.depth
    rows = np.flatnonzero(depth > 0)
    outer = surface.faces[(depth[surface.faces] <= 0).all(axis=1)]
    if not len(rows) or not len(outer):
        return None
    normals, sides = vertex_normals(surface.vertices, surface.faces), skin.sides[:, :1]
    found = ClosestPoints(Surface(surface.vertices, outer))(
        surface.vertices[rows], -normals[rows], least_cosine=_OPPOSITE,
        labels=(sides[rows], sides[outer].mean(axis=1)))
    rows, corners, weights, thick = (one[found.found] for one in
                                     (rows, outer[found.faces], found.weights, found.distances))
    if not len(rows):
        return None
    feet = skin.feet
    opposite = skin.correspondence.nearest(np.einsum("rc,rci->ri", weights, skin.registered[corners])).points
    own = np.where(feet.found[rows, None], feet.points[rows], np.inf)
    less = 1.0 - np.minimum(thick / np.maximum(np.linalg.norm(own - opposite, axis=1), _LEAST), 1.0)
    share = _smooth(surface, rows, np.where(feet.found[rows], less, 1.0))
    over = means(corners, weights, len(surface.vertices))
    return InnerSide(rows, over, share * smooth_step((_THICK - thick) / (_THICK - _THIN)))


def _smooth(surface: Surface, rows: NDArray, values: Array) -> Array:
    """Return values (r,) of some vertices as means with those of their neighbours among them."""
    join = (surface.neighbours + sparse.identity(len(surface.vertices), format="csr")).tocsr()[rows][:, rows]
    count = join.sum(axis=1)
    for _ in range(_ROUNDS):
        values = (join @ values) / count
    return values

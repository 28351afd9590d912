"""Deform a face by its feature points, jaw, eyes and lids.

Based on: T. Akimoto, K. Mase, Y. Suenaga, "Expressive facial image generation by automatic shape modification"
(1986), section 3.1. Every region is bounded by three feature points. A vertex X of it is projected toward the one
centre O onto the triangle of its region's feature points; the areas S1, S2, S3 of the sub-triangles there weigh
the three feature vectors (eq. 1), and the vertex moves by the result (eq. 2):

    V = (S1 V1 + S2 V2 + S3 V3) / (S1 + S2 + S3),    X' = X + V

Neighbouring regions share two feature points and O, so V is continuous. V is linear in the feature vectors: one
sparse matrix W, ``X' = X + W V``. The jaw, the lids and the eyes add their rotations.

Two rules for the jaw. ``points`` is the paper's: feature points that turn with the jaw hand their movement to
eq. 1, and rigid regions turn as a whole. ``vertices`` is ours: each feature point has a share j of the jaw's
movement, V = sum_i w_i (j_i J(X) + V_i) with J evaluated at the vertex: no step at the border of rigid regions.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

Array = NDArray[np.float64]

CLAMP = 1e-9
"""Barycentric weights down to this are inside: a vertex on the border belongs to both regions."""


# A region behind O is infinitely far: in numbers that compare with infinity, no less than this.
_FAR = 1e300


@dataclass(frozen=True)
class Region:
    """Three feature points (indices), whether the region is rigid with the jaw, and its sheet (or None).

    Sheets tell surfaces apart that touch, as the lips do: a vertex of a sheet takes only regions of its own
    sheet or of none.
    """

    points: tuple[int, int, int]
    rigid: bool = False
    sheet: str | None = None


def region_weights(vertices: Array, points: Array, regions: Sequence[Region], centre: Array,
                   sheets: Sequence[str | None], followers: dict[int, dict[int, float]]):
    """Return (W, rigid): the weights (n_vertices, n_points) of eq. 1 and which vertices lie in rigid regions.

    ``vertices`` (n, 3), ``points`` (k, 3), ``centre`` the point O (3,). A vertex that no region covers as seen
    from O takes the nearest one by angle, its weights clamped, never extrapolated. ``followers`` maps a vertex
    to the vertices whose weights it takes (with shares): those that turn inward, which no ray from O orders.
    """
    corners = np.array([r.points for r in regions])
    a, b, c = (points[corners[:, k]] - centre for k in range(3))          # (r, 3) each
    rays = vertices - centre
    # The ray t (X - O) meets the plane of a, b, c where its coordinates in the frame (a, b, c) are the areas.
    frames = np.stack([a, b, c], axis=2)
    shares = np.einsum("rij,nj->nri", np.linalg.pinv(frames, rcond=1e-9), rays)   # (n, r, 3)
    total = shares.sum(axis=2)
    front = total > 1e-9
    shares = shares / np.where(front, total, 1.0)[..., None]
    # A region behind O has no foot on the ray: the nearest of its corners, by angle, stands for it.
    units = rays / np.maximum(np.linalg.norm(rays, axis=1, keepdims=True), 1e-12)
    toward = np.stack([corner / np.linalg.norm(corner, axis=1, keepdims=True) for corner in (a, b, c)], axis=1)
    nearest_corner = np.eye(3)[np.einsum("rkj,nj->nrk", toward, units).argmax(axis=2)]
    clamped = np.where(front[..., None], np.maximum(shares, 0.0), nearest_corner)
    clamped /= clamped.sum(axis=2, keepdims=True)
    at = sum(clamped[..., k, None] * corner for k, corner in enumerate((a, b, c)))
    cosine = np.einsum("nrj,nj->nr", at, rays) / np.maximum(
        np.linalg.norm(at, axis=2) * np.linalg.norm(rays, axis=1, keepdims=True), 1e-12)
    angle = np.arccos(np.clip(cosine, -1.0, 1.0))
    least = np.minimum(np.minimum(shares[..., 0], shares[..., 1]), shares[..., 2])
    angle = np.where(front & (least >= -CLAMP), 0.0, angle)
    of_region = np.array([r.sheet or "" for r in regions])
    of_vertex = np.array([s or "" for s in sheets])
    # A vertex of no sheet may lie in any region; one of a sheet only in its own or in a region of none.
    wrong = (of_vertex[:, None] != "") & (of_region[None, :] != "") & (of_vertex[:, None] != of_region[None, :])
    angle = np.where(wrong, np.inf, angle)
    # Where several regions cover the vertex, the one whose triangle lies nearest to it along the ray.
    depth = np.abs(1.0 - np.where(front, 1.0 / np.where(front, total, 1.0), np.inf))
    angle = np.round(angle, 9)
    nearest = angle <= angle.min(axis=1, keepdims=True)
    best = np.where(nearest, np.minimum(depth, _FAR), np.inf).argmin(axis=1)
    rows = np.arange(len(rays))
    weights = np.zeros((len(vertices), len(points)))
    for k in range(3):
        np.add.at(weights, (rows, corners[best, k]), clamped[rows, best, k])
    rigid = np.array([r.rigid for r in regions])[best] & (angle[rows, best] < 1e-6)
    for vertex, sources in followers.items():
        weights[vertex] = sum(share * weights[source] for source, share in sources.items())
        rigid[vertex] = False
    weights[np.abs(weights) < 1e-7] = 0.0
    return sparse.csr_array(weights), rigid


@dataclass(frozen=True)
class Jaw:
    """A jaw that turns about its joints and glides forward as it opens.

    ``hinge`` (3,): a point on the axis, which runs along x (through F12 and F13). ``glide`` (3,): movement in
    mm per degree of opening. ``rule``: ``vertices`` or ``points``, see above.
    """

    hinge: Array
    glide: Array
    rule: str = "vertices"

    def movement(self, at: Array, jaw: Array) -> Array:
        """Return how places (n, 3) move for jaw (..., 3): opening in degrees, side and forward in mm."""
        angle = np.radians(jaw[..., 0])[..., None]
        y, z = at[:, 1] - self.hinge[1], at[:, 2] - self.hinge[2]
        sin, cos = np.sin(angle), np.cos(angle)
        move = np.empty((*jaw.shape[:-1], len(at), 3))
        move[..., 0] = jaw[..., 1, None] + self.glide[0] * jaw[..., 0, None]
        move[..., 1] = (cos - 1.0) * y - sin * z + self.glide[1] * jaw[..., 0, None]
        move[..., 2] = sin * y + (cos - 1.0) * z + self.glide[2] * jaw[..., 0, None] + jaw[..., 2, None]
        return move


@dataclass(frozen=True)
class Lids:
    """The two lids of one eye.

    ``centre`` (3,) of the eyeball. ``columns`` (c, 2): vertices of the upper and lower margin that face each
    other. ``vertices`` (v,), ``column`` (v,), ``lower`` (v,) bool, ``share`` (v,): every vertex that moves with a
    lid, the column it follows, which lid, and how much of the margin's travel it makes.
    """

    centre: Array
    columns: NDArray[np.int32]
    vertices: NDArray[np.int32]
    column: NDArray[np.int32]
    lower: NDArray[np.bool_]
    share: Array

    def move(self, cage: Array, upper: Array, lower: Array) -> None:
        """Move the lids in ``cage`` (..., n, 3), in place.

        ``upper``, ``lower`` (...,): how much of the way to the other margin each lid travels, in cylinder
        coordinates about the eye's transverse axis: lids rotate about the eye and stretch sideways. The two
        meet where upper + lower = 1 and never pass each other.
        """
        lower = np.minimum(lower, 1.0)
        upper = np.minimum(upper, 1.0 - lower)
        x, angle, radius = self._cylinder(cage[..., self.columns, :])
        span = [q[..., 1] - q[..., 0] for q in (x, angle, radius)]            # upper margin -> lower margin
        vx, vangle, vradius = self._cylinder(cage[..., self.vertices, :])
        travel = np.where(self.lower, -lower[..., None], upper[..., None]) * self.share
        places = zip((vx, vangle, vradius), span, strict=True)
        vx, vangle, vradius = (place + travel * way[..., self.column] for place, way in places)
        cage[..., self.vertices, 0] = vx + self.centre[0]
        cage[..., self.vertices, 1] = self.centre[1] + vradius * np.sin(vangle)
        cage[..., self.vertices, 2] = self.centre[2] + vradius * np.cos(vangle)

    def _cylinder(self, at: Array):
        d = at - self.centre
        return d[..., 0], np.arctan2(d[..., 1], d[..., 2]), np.hypot(d[..., 1], d[..., 2])


@dataclass(frozen=True, eq=False)
class Deformer:
    """Everything that is constant about a face's deformation; ``deform`` only multiplies and turns.

    ``neutral`` (n, 3) mm; ``points`` (k, 3) places of the feature points; ``weights`` (n, k) of eq. 1;
    ``rigid`` (n,) vertices of rigid regions; ``jaw_share`` (k,) each point's share of the jaw's movement.
    """

    neutral: Array
    points: Array
    weights: sparse.csr_array
    rigid: NDArray[np.bool_]
    jaw_share: Array
    jaw: Jaw
    lids: tuple[Lids, ...]

    def __post_init__(self) -> None:
        share = self.weights @ self.jaw_share
        if self.jaw.rule == "points":
            share = self.rigid.astype(float)
        movable = np.flatnonzero(np.abs(share) > 1e-9)
        object.__setattr__(self, "_jaw_vertices", movable)
        object.__setattr__(self, "_jaw_weight", share[movable][:, None])
        object.__setattr__(self, "_turning", np.flatnonzero(self.jaw_share > 0))

    def deform(self, vectors: Array, jaw: Array, lids: Array) -> Array:
        """Return the deformed vertices (..., n, 3), mm.

        ``vectors`` (..., k, 3): feature vectors, mm. ``jaw`` (..., 3): opening in degrees, side (+ toward the
        subject's left) and forward in mm. ``lids`` (..., 2 * number of eyes): upper and lower travel of each.
        """
        vectors = np.asarray(vectors, dtype=np.float64)
        batch = vectors.shape[:-2]
        if self.jaw.rule == "points" and np.any(jaw):        # steps 2 and 3 of section 3.1
            vectors = vectors.copy()
            turning = self._turning
            vectors[..., turning, :] += self.jaw_share[turning, None] * self.jaw.movement(self.points[turning], jaw)
        flat = np.moveaxis(vectors.reshape(-1, *vectors.shape[-2:]), 0, 1).reshape(len(self.points), -1)
        moved = (self.weights @ flat).reshape(len(self.neutral), -1, 3)
        cage = (np.moveaxis(moved, 1, 0) + self.neutral).reshape(*batch, len(self.neutral), 3)
        if np.any(jaw):
            v = self._jaw_vertices
            turn = self.jaw.movement(self.neutral[v], jaw)
            if self.jaw.rule == "points":
                cage[..., v, :] = self.neutral[v] + turn
            else:
                cage[..., v, :] += self._jaw_weight * turn
        for i, lid in enumerate(self.lids):
            upper, lower = lids[..., 2 * i], lids[..., 2 * i + 1]
            if np.any(upper) or np.any(lower):
                lid.move(cage, upper, lower)
        return cage

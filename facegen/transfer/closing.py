"""Lids meet and lips meet where the template's do.

Based on: Onizuka et al. (2018), section 5, which leaves open lids that stay open. A slit's edges are compared at places
that face each other. How far the template closes the slit there is told to the avatar's own gap: what the transfer
missed is added along the avatar's own closing direction, spread over the lid by a smooth field that is 1 on its edge
and 0 on the other edge and at the brow. Round an eye it moves on an arc about the ball. Lips, which may touch at rest,
touch where the template's have not parted.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.spatial import cKDTree

from facegen.geometry.factor import Factor
from facegen.geometry.operators import Surface, dirichlet, hinge_energy
from facegen.transfer.eyeball import Eyeball
from facegen.transfer.margins import LIPS, SAMPLES, Margins, Slit, find_margins
from facegen.transfer.skin import Skin

Array = NDArray[np.float64]

# The field ends at this share of the slit's width from its edges, on the template: below the brow, beside the nose.
_REACH = 0.5
# A field's stretching against its bending, 1/mm^2: enough to keep it from swinging past 0 and 1.
_STRETCH = 0.004
_HOLD = 1e4
# Places whose gap on the template is below this, mm, are corners: they close as their neighbours do.
_CORNER = 0.15
# What the template closes counts in full from this share of the gap on.
_LEAST_CLOSING = 0.1
# Millimetres: lips farther apart than this at some place have parted there.
_PARTED = 1.0
# Millimetres: a miss of this size counts half; on a faithful copy there is none to mend.
_TOLERATED = 0.05
# A slit counts as shut where the template leaves no more than this share of it, and this many mm.
_SHUT, _SHUT_MM = 0.06, 0.3
# Lids keep the distance from the ball that they have at rest, up to so many radii from its centre.
_ON_THE_BALL = 1.25
# What moves over this share of the radius is lifted out of the eye, by this share: a rim may lie in the ball at rest.
_LIFTED, _OUT = 0.15, 0.02
# The middle of a triangle with sides s lies nearer to the eye than its corners: sqrt(1 - s^2 / 3), at most so much.
_MOST_SAG = 0.3
# What stands out of an eye, a cornea or a glint, counts so many radii around: lids of few vertices span it.
_AROUND = 0.3
_TINY = 1e-300


@dataclass(frozen=True, eq=False)
class _Wanted:
    """What k shapes ask of a slit: the ``gap`` (k, SAMPLES, 3), mm; how much it counts, ``active`` (k, SAMPLES); how
    much of the way the upper edge goes (k,); and where the slit is ``shut`` (k, SAMPLES)."""

    gap: Array
    active: Array
    upper_share: Array
    shut: NDArray[np.bool_]


class _Front:
    """How far from its centre an eye reaches in a direction, in radii."""

    def __init__(self, ball: Eyeball, eye: Array) -> None:
        away = (eye - ball.centre) @ np.linalg.inv(ball.shape)
        radius = np.linalg.norm(away, axis=1)
        self._tree = cKDTree(away / np.maximum(radius, _TINY)[:, None])
        around = self._tree.query_ball_point(self._tree.data, _AROUND)
        self._radius = np.array([radius[some].max() for some in around])

    def __call__(self, away: Array) -> Array:
        """Return the radius (n,) in the directions (n, 3)."""
        unit = away / np.maximum(np.linalg.norm(away, axis=1), _TINY)[:, None]
        return self._radius[self._tree.query(unit)[1]]


@dataclass(frozen=True, eq=False)
class Closing:
    """How one slit of an avatar is closed; ``margins`` are the avatar's. Built once; for any shapes."""

    margins: Margins
    rows: NDArray[np.int64]         # the vertices that take part
    field_upper: Array
    field_lower: Array
    edges: NDArray[np.int64]        # (e, 2), among those rows
    along: sparse.csr_array         # (rows, SAMPLES)
    rest: Array                     # (n, 3)
    ball: Eyeball | None
    front: _Front | None            # what the lids lie on
    wanted: _Wanted

    def close(self, motion: Array) -> None:
        """Add to the displacements (k, n, 3) of the skin what they miss, in place."""
        wanted = self.wanted
        for k in np.flatnonzero(wanted.active.max(axis=1) > 0):
            missing = wanted.active[k, :, None] * (wanted.gap[k] - self._gap(motion[k]))
            missing = missing * _beyond(missing)[:, None]
            share = wanted.upper_share[k]
            self._add(motion[k], share * missing, (share - 1.0) * missing)

    def seal(self, motion: Array) -> None:
        """Bring edges that are shut onto one line, no nearer to the eye than either, in place."""
        shut = self.wanted.shut
        for k in np.flatnonzero(shut.any(axis=1)):
            upper = self.margins.upper @ (self.rest + motion[k])
            lower = self.margins.lower @ (self.rest + motion[k])
            line = (upper + lower) / 2
            if self.ball is not None:
                away = line - self.ball.centre
                farther = np.maximum(*(np.linalg.norm(edge - self.ball.centre, axis=1) for edge in (upper, lower)))
                line = self.ball.centre + away * (farther / np.maximum(np.linalg.norm(away, axis=1), _TINY))[:, None]
            on = (shut[k] * _beyond(upper - lower - self.wanted.gap[k]))[:, None]
            self._add(motion[k], on * (line - upper), on * (line - lower), arc=False)

    def _gap(self, moved: Array) -> Array:
        places = self.rest + moved
        return self.margins.upper @ places - self.margins.lower @ places

    def _add(self, moved: Array, upper: Array, lower: Array, *, arc: bool = True) -> None:
        """Move the edges by (SAMPLES, 3) and the skin round them along, in place; on an arc round the ball."""
        step = self.field_upper[:, None] * (self.along @ upper) + self.field_lower[:, None] * (self.along @ lower)
        if self.ball is None or self.front is None or not arc:
            moved[self.rows] += step
            return
        inverse = np.linalg.inv(self.ball.shape)
        rest = self.rest[self.rows]
        now = (rest + moved[self.rows] - self.ball.centre) @ inverse
        radius = np.linalg.norm(now, axis=1)
        at_rest = (rest - self.ball.centre) @ inverse
        home = np.linalg.norm(at_rest, axis=1)
        step = step @ inverse
        then = now + step
        lift = np.clip(np.linalg.norm(then - at_rest, axis=1) / _LIFTED, 0.0, 1.0)
        wanted = np.where(home < _ON_THE_BALL, np.maximum(home, self._over(then)), 0.0)
        radius = radius + lift * np.maximum(wanted - radius, 0.0)
        length = np.linalg.norm(then, axis=1)
        changed = (step != 0).any(axis=1) & (length > _TINY)
        then = then * np.where(changed, radius / np.maximum(length, _TINY), 1.0)[:, None]
        moved[self.rows] = np.where(changed[:, None], then @ self.ball.shape + self.ball.centre - rest,
                                    moved[self.rows])


    def _over(self, places: Array) -> Array:
        """Return the radius (rows,) at which triangles with corners in these directions clear the eye."""
        unit = places / np.maximum(np.linalg.norm(places, axis=1), _TINY)[:, None]
        side = ((unit[self.edges[:, 0]] - unit[self.edges[:, 1]]) ** 2).sum(axis=1)
        longest = np.zeros(len(places))
        np.maximum.at(longest, self.edges.ravel(), np.repeat(side, 2))
        return (self.front(places) + _OUT) / np.sqrt(1 - np.minimum(longest / 3, _MOST_SAG))


def closing(skin: Skin, slit: Slit, ball: Eyeball | None = None, eye: Array | None = None) -> Closing | None:
    """Return how a slit of the avatar closes in the template's shapes; None where it, or the template, has no slit.

    ball, eye (e, 3): how the eye behind lids turns, and its vertices, if there is one.
    """
    template = skin.template
    own = find_margins(template.surface, slit, template.places, skin.correspondence.sides)
    if own is None:
        return None
    margins = find_margins(skin.surface, slit, skin.places, skin.sides, shape=skin.registered, guide=own.line)
    if margins is None:
        return None
    part = skin.parts.matrices[slit.name]
    wanted = _wanted(template.surface.vertices, template.motion, own, skin.surface.vertices, margins, part,
                     lips=slit is LIPS)
    width = float(np.linalg.norm(own.line[0, -1] - own.line[0, 0]))
    front = _Front(ball, eye) if ball is not None and eye is not None else None
    rows, upper, lower, edges, along = _fields(skin, margins, own, _REACH * width)
    return Closing(margins, rows, upper, lower, edges, along, skin.surface.vertices, ball, front, wanted)


def _wanted(rest: Array, motion: Array, own: Margins, avatar: Array, margins: Margins, part: Array, *,
            lips: bool) -> _Wanted:
    """Return what the template's displacements (k, n_s, 3) ask of the avatar. rest, avatar: neutral vertices."""
    k = len(motion)
    upper = np.stack([own.upper @ one for one in motion]) if k else np.zeros((0, SAMPLES, 3))
    lower = np.stack([own.lower @ one for one in motion]) if k else np.zeros((0, SAMPLES, 3))
    gap = own.upper @ rest - own.lower @ rest
    length = np.linalg.norm(gap, axis=1)
    toward = gap / np.maximum(length, _TINY)[:, None]
    moved = gap + upper - lower
    own_gap = margins.upper @ avatar - margins.lower @ avatar
    if lips:
        parted = np.linalg.norm(moved - gap, axis=2) / _PARTED
        return _Wanted(own_gap + (moved - gap) @ part.T, _smooth_step(1.0 - parted), np.full(k, 0.5),
                       np.zeros((k, SAMPLES), bool))
    ratio = np.maximum((moved * toward).sum(axis=2) / np.maximum(length, _TINY), 0.0)
    open_at = np.flatnonzero(length > _CORNER)
    if not len(open_at):
        return _Wanted(np.broadcast_to(own_gap, moved.shape), np.zeros(moved.shape[:2]), np.full(k, 0.5),
                       np.zeros(moved.shape[:2], bool))
    ratio = ratio[:, open_at[np.abs(np.arange(SAMPLES)[:, None] - open_at).argmin(axis=1)]]
    across = moved - ratio[:, :, None] * gap
    target = ratio[:, :, None] * own_gap + across @ part.T
    active = _smooth_step((1.0 - ratio) / _LEAST_CLOSING)
    shut = (ratio <= _SHUT) & (np.linalg.norm(target, axis=2) <= _SHUT_MM) & (active > 0)
    down = np.maximum(-(upper * toward).sum(axis=2), 0.0).sum(axis=1)
    up = np.maximum((lower * toward).sum(axis=2), 0.0).sum(axis=1)
    share = np.where(down + up > _TINY, down / np.maximum(down + up, _TINY), 0.5)
    return _Wanted(target, active, share, shut)


def _beyond(missing: Array) -> Array:
    """Return how much misses (s, 3) count: not at all where a faithful copy misses nothing."""
    square = (missing**2).sum(axis=1)
    return square / (square + _TOLERATED**2)


def _smooth_step(t: Array) -> Array:
    t = np.clip(t, 0.0, 1.0)
    return t * t * (3 - 2 * t)


def _fields(skin: Skin, margins: Margins, own: Margins, reach: float):
    """Return the vertices near the slit, how much they go with its upper and with its lower edge, the mesh's edges
    (e, 2) among them, and the weights (rows, SAMPLES) that tell their place along it."""
    tree = cKDTree(own.line.reshape(-1, 3))
    distance, _ = tree.query(skin.registered)
    near = distance < reach
    near[margins.rows] = True
    faces = skin.surface.faces[near[skin.surface.faces].any(axis=1)]
    rows, local = np.unique(faces, return_inverse=True)
    surface = Surface(skin.surface.vertices[rows], local.reshape(-1, 3).astype(np.int32))
    edges = np.searchsorted(rows, margins.rows)
    held = np.zeros(len(rows))
    held[~near[rows]] = _HOLD
    held[edges] = _HOLD
    held[np.isin(rows, margins.corners)] = _HOLD
    wanted = np.zeros((len(rows), 2))
    wanted[edges, 0], wanted[edges, 1] = margins.is_upper, ~margins.is_upper
    matrix = hinge_energy(surface) + _STRETCH * dirichlet(surface)
    scale = matrix.diagonal().max()
    solved = Factor(matrix + sparse.diags_array(scale * (held + 1e-12)), what="the lids' field").solve(
        scale * held[:, None] * wanted)
    upper, lower = np.clip(solved, 0.0, 1.0).T
    upper[edges], lower[edges] = wanted[edges].T
    at = _where(skin, margins, rows, edges)
    left = np.clip(np.floor(at * (SAMPLES - 1)).astype(int), 0, SAMPLES - 2)
    share = at * (SAMPLES - 1) - left
    index = np.repeat(np.arange(len(rows)), 2)
    along = sparse.csr_array((np.stack([1 - share, share], axis=1).ravel(),
                              (index, np.stack([left, left + 1], axis=1).ravel())), shape=(len(rows), SAMPLES))
    return rows, upper, lower, surface.edges[0], along


def _where(skin: Skin, margins: Margins, rows: NDArray, edges: NDArray) -> Array:
    """Return where along the slit the vertices lie, 0 to 1: at its nearest place, on the registered skin."""
    upper, lower = margins.upper @ skin.registered, margins.lower @ skin.registered
    _, nearest = cKDTree(np.concatenate([upper, lower])).query(skin.registered[rows])
    at = (nearest % SAMPLES) / (SAMPLES - 1)
    at[edges] = margins.at
    return at

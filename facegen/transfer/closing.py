"""Lids meet and lips meet where the template's do.

Based on: Onizuka et al. (2018), section 5, which leaves open lids that stay open. A slit's edges are compared at places
that face each other. How far the template closes the slit there is told to the avatar's own gap: what the transfer
missed is added along the avatar's own closing direction, spread over the lid by a smooth field that is 1 on its edge
and 0 on the other edge and at the brow. Round an eye it moves on an arc about the ball, and a lid's rim, where the
transfer may scatter what the template keeps together, moves as its edge does. Skin that went too far for its eye goes
back (lid_limits), and a lid that closes lies as near to the ball as at rest, whatever ball the template has. Lips,
which may touch at rest, touch where the template's have not parted.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from facegen.geometry.closest import means_of_motion
from facegen.geometry.fade import smooth_step
from facegen.geometry.normals import vertex_normals
from facegen.transfer.closing_field import Field, closing_field
from facegen.transfer.eyeball import EyeFront
from facegen.transfer.lid_limits import LidLimits, lid_limits
from facegen.transfer.margins import LIPS, Margins, Slit, facing_margins
from facegen.transfer.skin import Skin
from facegen.transfer.slit_wanted import Wanted, directions, jaw_alone, told_lids, told_lips

Array = NDArray[np.float64]

# Millimetres: a miss of this size counts half; on a faithful copy there is none to mend.
_TOLERATED = 0.05
# Where a slit stays open, this share of what is left counts as little, up to so many millimetres.
_OF_OPEN, _TOLERATED_OPEN = 0.2, 0.6
# Millimetres by which a rim may move otherwise than its edge: a lid rolls as it closes.
_ROLLS = 0.5
# Lids keep the distance from the ball that they have at rest, up to so many radii from its centre. Skin farther out may
# leave it, up to the second of these less and less.
_ON_THE_BALL, _OFF_THE_BALL = 1.25, 1.8
# What moves over this share of the radius is lifted out of the eye, by this share: a rim may lie in the ball at rest.
_LIFTED, _OUT = 0.15, 0.02
# Millimetres: a step of this size lifts by half; a smaller one mends what the transfer has laid there well.
_MENDS = 0.3
# The middle of a triangle with sides s lies nearer to the eye than its corners: sqrt(1 - s^2 / 3), at most so much.
_MOST_SAG = 0.3
# Sides up to the first of these, in radii, are as long as their mean; from the second on the longest decides.
_FINE, _COARSE = 0.7, 0.9
# What counts less than this is rounding: most shapes leave a slit as it is.
_NOTHING = 1e-9
_TINY = 1e-300


@dataclass(frozen=True, eq=False)
class Closing:
    """How one slit of an avatar is closed: built once, for the template's k shapes. ``margins`` and ``field`` are the
    avatar's, ``rest`` (n, 3) its skin, ``gap`` (SAMPLES, 3) the slit then, mm; ``lid``: its lids, if they lie on an
    eye; ``limits``: how far the skin of lids may go."""

    margins: Margins
    field: Field
    rest: Array
    gap: Array
    lid: _Lid | None
    wanted: Wanted
    limits: LidLimits | None = None

    @property
    def eye(self) -> EyeFront | None:
        """What the lids lie on."""
        return None if self.lid is None else self.lid.eye

    def of(self, shapes: NDArray[np.int64], lid_closure: float = 1.0) -> Closing:
        """Return how the slit closes in some of the shapes, if lids close so many times as far."""
        wanted = self.wanted.of(shapes)
        return replace(self, wanted=wanted if lid_closure == 1.0 else wanted.closed_more(self.gap, lid_closure),
                       limits=None if self.limits is None else self.limits.of(shapes))

    def narrows(self) -> NDArray[np.bool_]:
        """Return in which shapes (k,) lids close."""
        return self.wanted.narrows.any(axis=1)

    def closes(self) -> NDArray[np.bool_]:
        """Return which shapes (k,) shut the slit."""
        return self.wanted.shut.max(axis=1) > 0.5

    def close(self, motion: Array) -> None:
        """Add to the displacements (k, n, 3) of the skin what they miss, in place."""
        wanted, gap = self.wanted, self.gap
        for k in np.flatnonzero(wanted.active.max(axis=1) > 0):
            closing = 0.0
            if self.limits is not None:
                closing = self.limits.closing[k]
                self._move(motion[k], self.limits.back(k, motion[k, self.field.rows]), closing)
            missing = wanted.active[k, :, None] * (wanted.gap[k] - gap - self.margins.gap(motion[k]))
            still_open = np.linalg.norm(wanted.gap[k], axis=1)
            counts = _beyond(missing, np.minimum(_TOLERATED + _OF_OPEN * still_open, _TOLERATED_OPEN))
            missing = missing * counts[:, None]
            if wanted.more is not None:
                missing += wanted.more[k]
                counts = np.maximum(counts, _beyond(wanted.more[k]))
            if counts.max() < _NOTHING:
                continue
            share = wanted.upper_share[k]
            self._move(motion[k], self.field.steps(share * missing, (share - 1.0) * missing), closing)
            if self.lid is not None:
                self._move(motion[k], counts.max() * self._to_edges(motion[k]), closing)
            if self.lid is not None and self.limits is not None:
                rows = self.field.rows
                motion[k, rows] += self.lid.back_on(self.rest[rows] + motion[k, rows], self.limits.opening[k])

    def _to_edges(self, motion: Array) -> Array:
        """Return what brings the rims, which moved as (n, 3), to where they move as their edges do."""
        field = self.field
        edges = (field.along @ edge for edge in self.margins.ends(motion))
        step = np.zeros((len(field.rows), 3))
        for share, edge in zip((field.on_upper, field.on_lower), edges, strict=True):
            away = edge - motion[field.rows]
            step += (share * _beyond(away, _ROLLS))[:, None] * away
        return step

    def seal(self, motion: Array, rows: NDArray[np.int64]) -> None:
        """Bring edges that are shut to one line, as near as the template's come and no nearer to the eye than either,
        in displacements (k, all, 3) of vertices of which ``rows`` (n,) are the skin's, in place."""
        shut, target = self.wanted.shut, self.wanted.target
        for k in np.flatnonzero(shut.max(axis=1) > _NOTHING):
            upper, lower = self.margins.ends(self.rest + motion[k, rows])
            line = (upper + lower) / 2
            if self.lid is not None:
                centre = self.lid.eye.ball.centre
                farther = np.maximum(*(np.linalg.norm(edge - centre, axis=1) for edge in (upper, lower)))
                line = centre + farther[:, None] * directions(line - centre)
            on = (shut[k] * _beyond(upper - lower - target[k]))[:, None]
            half = self.wanted.ajar[k, :, None] * self.gap / 2
            motion[k, rows[self.field.rows]] += self.field.steps(on * (line + half - upper), on * (line - half - lower))

    def _move(self, moved: Array, step: Array, closing: ArrayLike = 0.0) -> None:
        """Move the skin of the field by (r, 3), in place: on an arc round the ball, over what it covers and, as much as
        lids close (r,), no farther from it than at rest."""
        rows = self.field.rows
        if self.lid is None:
            moved[rows] += step
            return
        changed, places = self.lid.moved(self.rest[rows] + moved[rows], step, closing)
        moved[rows[changed]] = places - self.rest[rows[changed]]


class _Lid:
    """The skin of a field round an eye, in the eye's radii; what no shape changes is computed once."""

    def __init__(self, eye: EyeFront, edges: NDArray, rest: Array, outward: Array) -> None:
        """edges (e, 2): of the skin rest (r, 3), mm, whose normals are outward (r, 3)."""
        self.eye, self._rest = eye, eye.ball.in_radii(rest)
        self._home = np.linalg.norm(self._rest, axis=1)
        self._lies = smooth_step((_OFF_THE_BALL - self._home) / (_OFF_THE_BALL - _ON_THE_BALL))
        self._edges, ends = edges, edges.ravel()
        self._by_end = np.argsort(ends, kind="stable")
        self._with_edges, self._starts = np.unique(ends[self._by_end], return_index=True)
        self._count = np.maximum(np.bincount(ends, minlength=len(rest)), 1)
        # How much nearer to the eye than clear of it the skin is at rest: it may stay as near; but within the eye, only
        # a lid's back, where nobody sees it.
        unit, everywhere = directions(self._rest), np.arange(len(rest))
        near = np.maximum(self._over(unit, everywhere) - self._home, 0.0)
        back = (outward * self._rest).sum(axis=1) < 0
        self._sunk = np.where(back | (self._home > eye(unit)), near, 0.0)

    def moved(self, at: Array, step: Array, closing: ArrayLike = 0.0) -> tuple[NDArray[np.int64], Array]:
        """Return which of the skin's places at (r, 3), mm, a step (r, 3) moves, and where to (s, 3). closing (r,): how
        much they are laid on the ball if they stand farther from it than at rest."""
        ball, moving = self.eye.ball, (step != 0).any(axis=1)
        if not moving.any():                        # most shapes leave an eye's skin as it is
            return np.zeros(0, np.int64), np.zeros((0, 3))
        now = ball.in_radii(at)
        then = now + step @ ball.inverse
        changed = np.flatnonzero(moving & (then != 0).any(axis=1))
        unit = directions(then)
        lift = np.clip(np.linalg.norm((then - self._rest)[changed], axis=1) / _LIFTED, 0.0, 1.0)
        wanted = np.zeros(len(changed))
        on = self._home[changed] < _ON_THE_BALL
        rows = changed[on]
        wanted[on] = np.maximum(self._home[rows], self._over(unit, rows) - self._sunk[rows])
        radius = np.linalg.norm(now[changed], axis=1)
        off = np.maximum(radius - np.maximum(wanted, self._home[changed]), 0.0)
        change = np.maximum(wanted - radius, 0.0) - (self._lies * closing)[changed] * off
        radius = radius + _beyond(step[changed], _MENDS) * lift * change
        return changed, (radius[:, None] * unit[changed]) @ ball.shape + ball.centre

    def back_on(self, at: Array, opening: Array) -> Array:
        """Return what lays the skin's places at (r, 3), mm, as near to the ball as at rest, as much as lids open
        (r,)."""
        now = self.eye.ball.in_radii(at)
        radius = np.linalg.norm(now, axis=1)
        off = opening * self._lies * np.maximum(radius - self._home, 0.0)
        step = -((off / np.maximum(radius, _TINY))[:, None] * now) @ self.eye.ball.shape
        return _beyond(step, _TOLERATED_OPEN)[:, None] * step

    def _over(self, unit: Array, rows: NDArray) -> Array:
        """Return the radius (s,) at which triangles with corners in the directions (r, 3) clear the eye, at some of
        the corners (s,)."""
        side = ((unit[self._edges[:, 0]] - unit[self._edges[:, 1]]) ** 2).sum(axis=1)
        both = np.repeat(side, 2)
        longest = np.zeros(len(unit))
        longest[self._with_edges] = np.maximum.reduceat(both[self._by_end], self._starts)
        mean = np.bincount(self._edges.ravel(), both, len(unit)) / self._count
        coarse = smooth_step((np.sqrt(longest) - _FINE) / (_COARSE - _FINE))
        square = mean + coarse * (longest - mean)
        return (self.eye(unit[rows]) + _OUT) / np.sqrt(1 - np.minimum(square[rows] / 3, _MOST_SAG))


def closing(skin: Skin, slit: Slit, eye: EyeFront | None = None) -> Closing | None:
    """Return how a slit of the avatar closes in the template's shapes; None where it, or the template, has no slit.

    eye: what lies behind lids, if anything does.
    """
    found = skin.lips if slit is LIPS else facing_margins(skin, slit)
    if found is None:
        return None
    own, margins = found
    template, rest = skin.template, skin.surface.vertices
    upper, lower = (means_of_motion(edge, template.motion) for edge in (own.upper, own.lower))
    part = skin.parts.matrices[slit.name]
    wanted = told_lips(upper - lower, jaw_alone(template, own), margins.gap(rest), part) if slit is LIPS else \
        told_lids(*own.ends(template.surface.vertices), upper, lower, margins.gap(rest), part)
    field, lid = closing_field(skin, own, margins), None
    if eye is not None:
        normals = vertex_normals(rest, skin.surface.faces)
        lid = _Lid(eye, field.edges, rest[field.rows], normals[field.rows])
    limits = None if slit is LIPS else lid_limits(skin, own, margins, field, wanted.left)
    return Closing(margins, field, rest, margins.gap(rest), lid, wanted, limits)


def _beyond(missing: Array, tolerated: ArrayLike = _TOLERATED) -> Array:
    """Return how much misses (s, 3) count: not at all where a faithful copy misses nothing."""
    square = (missing**2).sum(axis=1)
    return square / (square + tolerated**2)

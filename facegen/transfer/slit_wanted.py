"""What the template's shapes ask of a slit of the avatar: how far its edges stay apart, and where they meet."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from facegen.geometry.fade import smooth_step
from facegen.transfer.margins import SAMPLES, Margins
from facegen.transfer.template import Template

Array = NDArray[np.float64]

# Places whose gap on the template is below this, mm, are corners: they close as their neighbours do.
_CORNER = 0.15
# What the template closes, or opens wider, counts in full from this share of the gap on.
_LEAST_CHANGE = 0.1
# Millimetres: lips farther apart than this at some place have parted there; but where the jaw alone would part them,
# by that much of the way more: a sculptor's lips that close over an open jaw meet no better.
_PARTED, _OF_JAW = 1.0, 0.2
# Lids that close by less than this share of the gap keep still.
_STILL = 0.01
# A slit counts as shut where the template leaves no more than this share of it open; not at all from the second on.
_SHUT, _AJAR = 0.06, 0.15
_TINY = 1e-300


@dataclass(frozen=True, eq=False)
class Wanted:
    """What k shapes ask of a slit: the ``gap`` (k, SAMPLES, 3), mm; how much it counts, ``active`` (k, SAMPLES); how
    much of the way the upper edge goes (k,); ``left`` (k, SAMPLES): the share of the gap at rest that the template
    leaves, ``aside`` (k, SAMPLES): by how much of it the edges pass each other. ``more`` (k, SAMPLES, 3), mm: what the
    user wants to be added to the gap, None if nothing."""

    gap: Array
    active: Array
    upper_share: Array
    left: Array
    aside: Array
    more: Array | None = None

    def of(self, shapes: NDArray) -> Wanted:
        """Return what some of the shapes ask."""
        return Wanted(self.gap[shapes], self.active[shapes], self.upper_share[shapes], self.left[shapes],
                      self.aside[shapes], None if self.more is None else self.more[shapes])

    def closed_more(self, rest: Array, factor: float) -> Wanted:
        """Return what is asked where lids close so many times as far, up to shut. rest (SAMPLES, 3): the gap then."""
        closing = np.where(self.narrows, 1.0 - self.left, 0.0)
        share = np.where(closing * factor < 1.0, factor, 1.0 / np.maximum(closing, _TINY)) - 1.0
        counts = (self.active * share * (closing > 0))[:, :, None]
        return replace(self, left=np.where(closing > 0, 1.0 - closing * (share + 1.0), self.left),
                       more=counts * (self.gap - rest))

    @property
    def narrows(self) -> NDArray[np.bool_]:
        """Where (k, SAMPLES) lids close."""
        return (self.left < 1.0 - _STILL) & (self.active > 0)

    @property
    def target(self) -> Array:
        """The gap (k, SAMPLES, 3) that is wanted after all."""
        return self.gap if self.more is None else self.gap + self.more

    @property
    def shut(self) -> Array:
        """How much (k, SAMPLES) the slit counts as shut."""
        return self.active * smooth_step((_AJAR - np.hypot(self.left, self.aside)) / (_AJAR - _SHUT))

    @property
    def ajar(self) -> Array:
        """The share of the gap (k, SAMPLES) at which edges stay where the slit is shut: nothing, if it is so little."""
        return self.left * smooth_step(self.left / _SHUT)


def jaw_alone(template: Template, own: Margins) -> Array:
    """Return how the template's jaw alone would change the gap between its lips (k, SAMPLES, 3), mm."""
    if template.hinge is None:
        return np.zeros((len(template.shapes.jaw), SAMPLES, 3))
    used = np.unique(np.concatenate([own.upper.indices, own.lower.indices]))
    turned = template.hinge.movement(template.surface.vertices[used], template.shapes.jaw)
    across = (own.upper - own.lower).tocsc()[:, used].toarray()
    return across @ (template.jaw_share[used, None] * turned)


def told_lips(change: Array, by_jaw: Array, own_gap: Array, part: Array) -> Wanted:
    """Return what the template's lips tell the avatar's: see `told_lids`. change, by_jaw (k, SAMPLES, 3): of the gap,
    in all and by the jaw alone."""
    parted = np.linalg.norm(change, axis=2) / (_PARTED + _OF_JAW * np.linalg.norm(by_jaw, axis=2))
    return Wanted(own_gap + change @ part.T, smooth_step(1.0 - parted), np.full(len(change), 0.5),
                   np.ones(parted.shape), np.zeros(parted.shape))


def told_lids(above: Array, below: Array, upper: Array, lower: Array, own_gap: Array, part: Array) -> Wanted:
    """Return what the template's lids tell the avatar's. above, below (SAMPLES, 3): the template's edges at rest;
    upper, lower (k, SAMPLES, 3): how they move; own_gap (SAMPLES, 3): the avatar's gap at rest; part (3, 3): how
    movements go on the avatar."""
    gap = above - below
    length = np.linalg.norm(gap, axis=1)
    toward = directions(gap)
    moved = gap + upper - lower
    ratio = np.maximum((moved * toward).sum(axis=2) / np.maximum(length, _TINY), 0.0)
    open_at = np.flatnonzero(length > _CORNER)
    if not len(open_at):
        none = np.zeros(ratio.shape)
        return Wanted(np.broadcast_to(own_gap, moved.shape), none, np.full(len(moved), 0.5), np.ones(ratio.shape), none)
    ratio = ratio[:, open_at[np.abs(np.arange(SAMPLES)[:, None] - open_at).argmin(axis=1)]]
    across = moved - ratio[:, :, None] * gap
    target = ratio[:, :, None] * own_gap + across @ part.T
    active = smooth_step(np.abs(1.0 - ratio) / _LEAST_CHANGE)
    ways = [np.abs((edge * toward).sum(axis=2)).sum(axis=1) for edge in (upper, lower)]
    share = np.where(sum(ways) > _TINY, ways[0] / np.maximum(sum(ways), _TINY), 0.5)
    # Edges that slip along each other have met all the same.
    along = directions(np.gradient((above + upper + below + lower) / 2, axis=1))
    aside = across - (across * along).sum(axis=2, keepdims=True) * along
    return Wanted(target, active, share, ratio, np.linalg.norm(aside, axis=2) / np.maximum(length, _CORNER))


def directions(ways: Array) -> Array:
    """Return the directions (..., 3) of ways (..., 3); zero of none."""
    return ways / np.maximum(np.linalg.norm(ways, axis=-1, keepdims=True), _TINY)

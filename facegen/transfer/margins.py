"""The two edges of a slit: the margins of the lids, the lines where lips touch.

A margin runs along edges of the mesh from corner to corner through its landmarks. Between landmarks it keeps to the
template's margin, on which the avatar's skin was registered: the shortest way alone would cut across the lid.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from facegen.geometry.closest import ClosestPoints
from facegen.geometry.fade import smooth_step
from facegen.geometry.operators import Surface
from facegen.geometry.spline import smooth_curve
from facegen.transfer.sides import SLITS, painted

if TYPE_CHECKING:
    from facegen.transfer.skin import Skin

Array = NDArray[np.float64]
Places = Mapping[str, tuple[NDArray, NDArray]]

SAMPLES = 33
"""Places along a slit where its edges are compared."""

# Millimetres on the template: this far beside the guide a way is twice as long.
_NARROW = 0.7
# A way on the wrong side of the slit is so many times as long.
_WRONG_SIDE = 20.0
# Lips that touch tell their own edges: the skin of one that lies as near to the other's, mm, where its side is beyond
# doubt by so much. A way along it is so many times as short, and twice as long at most for being beside the guide; the
# row that touches most closely, mm, is the outer one.
_TOUCH, _OF_A_LIP, _APART, _CLOSELY = 0.8, 0.02, 10.0, 0.25
# An edge this many times as long as the line through its landmarks goes round something else: there is no slit.
_LONGEST = 2.5
# Millimetres on the template: no way leads farther round the guide than this.
_BESIDE = 20.0
# An avatar's own lengths decide by so much which places of its edges face each other, the template's by the rest: where
# many vertices lie at one corner of the template's, their own order spreads them.
_OWN = 0.3
# But where edges were found farther than the first of these beside the template's, mm, their own decide more, and
# alone from the second on.
_ASIDE, _ASTRAY = 1.0, 4.0
# A guide is sampled at so many places.
_GUIDE = 200


@dataclass(frozen=True)
class Slit:
    """Landmarks of a slit: its two ``corners``, those along its ``upper`` and ``lower`` edge in the same order, and the
    column of `side_fields` that knows its sides."""

    name: str
    corners: tuple[str, str]
    upper: tuple[str, ...]
    lower: tuple[str, ...]
    side: int


LIDS = tuple(Slit(f"eye_{s}", corners, upper, lower, side)
             for side, (s, (upper, lower, corners)) in enumerate(zip("LR", SLITS[1:], strict=True), start=1))
LIPS = Slit("mouth", ("mouth_corner_R", "mouth_corner_L"), ("mouth_inner_top",), ("mouth_inner_bottom",), 0)


@dataclass(frozen=True, eq=False)
class Margins:
    """``upper``, ``lower``: (SAMPLES, n) weights of the vertices that place facing places of the two edges, corner to
    corner; ``rows``: the vertices on one of them, ``at`` their position along the slit, 0 to 1, and ``is_upper``;
    ``corners``: vertices of both. ``line`` (2, g, 3): the edges as curves, mm; ``paths``: each edge's vertices
    (p, 3), mm, and their positions (p,) along the slit; ``ways``: which vertices (p,) those are."""

    upper: sparse.csr_array
    lower: sparse.csr_array
    rows: NDArray[np.int64]
    at: Array
    is_upper: NDArray[np.bool_]
    corners: NDArray[np.int64]
    line: Array
    paths: tuple[tuple[Array, Array], ...]
    ways: tuple[NDArray[np.int64], ...]

    def on(self, vertices: Array) -> Margins:
        """Return them with curves as they run on the skin's vertices (n, 3) in another shape."""
        return replace(self, line=np.array([_resampled(vertices[way], _GUIDE) for way in self.ways]),
                       paths=tuple((vertices[way], t) for way, (_, t) in zip(self.ways, self.paths, strict=True)))

    def ends(self, places: Array) -> tuple[Array, Array]:
        """Return the facing places (SAMPLES, 3) of the upper and the lower edge, for the skin's vertices (n, 3)."""
        return self.upper @ places, self.lower @ places

    def gap(self, places: Array) -> Array:
        """Return the ways (SAMPLES, 3) from the lower to the upper edge."""
        upper, lower = self.ends(places)
        return upper - lower


def facing_margins(skin: Skin, slit: Slit) -> tuple[Margins, Margins] | None:
    """Return the edges of a slit of the template and of the avatar's skin, or None where either has none."""
    template = skin.template
    if slit.side in painted(skin.surface, skin.places, skin.sides):
        return None
    own = template.margins.get(slit.name) or find_margins(template.surface, slit, template.places,
                                                          skin.correspondence.sides)
    if own is None:
        return None
    avatar = find_margins(skin.surface, slit, skin.places, skin.sides, shape=skin.registered, guide=own)
    return None if avatar is None else (own, avatar)


def find_margins(surface: Surface, slit: Slit, places: Places, sides: Array, *, shape: Array | None = None,
                 guide: Margins | None = None) -> Margins | None:
    """Return the edges of a slit of the skin, or None where it has none: corners, or an edge's landmarks, are missing,
    both edges are one, as on a face with painted lids, or no way along the skin is near the landmarks.

    places: landmark -> vertices (3,) and weights (3,). sides: `side_fields`. guide: the template's edges, to which
    those of the skin laid on it, ``shape`` (n, 3), keep; without, they follow smooth curves through the landmarks.
    """
    at = surface.vertices if shape is None else shape
    sign = sides[:, slit.side]
    apart = None if guide is None or slit is not LIPS else _apart(surface, sign)
    paths, lines = [], []
    for edge, (names, up) in enumerate(((slit.upper, 1.0), (slit.lower, -1.0))):
        stops = _stops(slit, names, places)
        if stops is None:
            return None
        line = _curve(at[stops]) if guide is None else guide.line[edge]
        path = _way(surface, at, stops, line, up * sign, apart)
        if path is None or _lengths(surface.vertices[path])[-1] > _LONGEST * _lengths(surface.vertices[stops])[-1]:
            return None
        paths.append(path)
        lines.append(_resampled(at[path], _GUIDE))
    both = np.intersect1d(*paths)
    if any(len(np.setdiff1d(path, both)) == 0 for path in paths):
        return None
    n = len(surface.vertices)
    along = [_along(surface.vertices[path]) for path in paths]
    if guide is not None:
        off = max(float(cKDTree(line).query(at[path])[0].mean()) for line, path in zip(guide.line, paths, strict=True))
        own = _OWN + (1 - _OWN) * float(smooth_step((off - _ASIDE) / (_ASTRAY - _ASIDE)))
        along = [own * t + (1 - own) * _beside(at[path], *edge)
                 for t, path, edge in zip(along, paths, guide.paths, strict=True)]
    upper, lower = (_sampler(path, t, n) for path, t in zip(paths, along, strict=True))
    own = [~np.isin(path, both) for path in paths]
    rows = np.concatenate([path[keep] for path, keep in zip(paths, own, strict=True)])
    where = np.concatenate([t[keep] for t, keep in zip(along, own, strict=True)])
    is_upper = np.arange(len(rows)) < own[0].sum()
    return Margins(upper, lower, rows, where, is_upper, both, np.array(lines),
                   tuple((at[path], t) for path, t in zip(paths, along, strict=True)), tuple(paths))


def _stops(slit: Slit, names: tuple[str, ...], places: Places) -> NDArray | None:
    """Return the vertices that the landmarks of an edge lie on, corners first and last."""
    wanted = [slit.corners[0], *(name for name in names if name in places), slit.corners[1]]
    if len(wanted) < 3 or any(name not in places for name in wanted):
        return None
    stops = np.array([places[name][0][np.argmax(places[name][1])] for name in wanted])
    return stops if len(np.unique(stops)) == len(stops) else None


def _curve(stops: Array) -> Array:
    """Return a smooth curve (g, 3) through some places (s, 3)."""
    t = _lengths(stops, 1e-9)               # a spline's knots must differ
    return smooth_curve(t, stops, np.linspace(0, t[-1], _GUIDE))


def _apart(surface: Surface, side: Array) -> Array:
    """Return how far (n,) the skin of either lip is from the other one, mm; infinite for what is of none. side (n,): 1
    above to -1 below."""
    result = np.full(len(side), np.inf)
    for own in (side, -side):
        rows, others = np.flatnonzero(own > _OF_A_LIP), (own[surface.faces] < -_OF_A_LIP).all(axis=1)
        if len(rows) and others.any():
            result[rows] = ClosestPoints(Surface(surface.vertices, surface.faces[others]))(
                surface.vertices[rows]).distances
    return result


def _way(surface: Surface, at: Array, stops: NDArray, line: Array, side: Array, apart: Array | None
         ) -> NDArray | None:
    """Return the vertices of the cheapest way along edges from stop to stop, or None where there is none. apart:
    `_apart`."""
    edges, _ = surface.edges
    middle = (at[edges[:, 0]] + at[edges[:, 1]]) / 2
    near = ((middle > line.min(axis=0) - _BESIDE) & (middle < line.max(axis=0) + _BESIDE)).all(axis=1)
    edges, middle = edges[near], middle[near]
    off, _ = cKDTree(line).query(middle)
    where = at if apart is None else surface.vertices
    length = np.linalg.norm(where[edges[:, 0]] - where[edges[:, 1]], axis=1) + 1e-6
    beside = (off / _NARROW) ** 2
    if apart is not None:
        far = apart[edges].max(axis=1)
        close = np.minimum(beside, 1.0) + (np.minimum(far, _TOUCH) / _CLOSELY) ** 2
        beside = np.where(far < _TOUCH, (1 + close) / _APART - 1, beside)
    length = length * (1 + beside) * np.where(side[edges].min(axis=1) < 0, _WRONG_SIDE, 1.0)
    n = len(at)
    graph = sparse.csr_array((length, (edges[:, 0], edges[:, 1])), shape=(n, n))
    _, before = dijkstra(graph, directed=False, indices=stops[:-1], return_predecessors=True)
    path = [int(stops[0])]
    for leg, goal in enumerate(stops[1:]):
        back = [int(goal)]
        while back[-1] != stops[leg]:
            step = int(before[leg, back[-1]])
            if step < 0:
                return None
            back.append(step)
        path += back[-2::-1]
    _, first = np.unique(path, return_index=True)           # a way that comes back to itself goes round nothing
    return np.array(path)[np.sort(first)]


def _along(path: Array) -> Array:
    """Return where the places (p, 3) of an edge lie along the slit, from 0 at its first corner to 1: half by the chord
    between the corners, which faces the other edge, half by the way, which never stands still."""
    chord = path[-1] - path[0]
    by_chord = np.maximum.accumulate(np.clip((path - path[0]) @ chord / max(float(chord @ chord), 1e-300), 0.0, 1.0))
    lengths = _lengths(path)
    by_way = lengths / max(float(lengths[-1]), 1e-300)
    t = 0.5 * by_chord + 0.5 * by_way
    t[0], t[-1] = 0.0, 1.0
    return t


def _beside(path: Array, edge: Array, t: Array) -> Array:
    """Return where the places (p, 3) of an edge lie along a slit, by the nearest place of the template's edge (q, 3),
    whose places lie at t (q,)."""
    start, way = edge[:-1], np.diff(edge, axis=0)
    share = np.einsum("pqi,qi->pq", path[:, None] - start, way) / np.maximum((way**2).sum(axis=1), 1e-300)
    share = np.clip(share, 0.0, 1.0)
    off = ((start + share[:, :, None] * way - path[:, None]) ** 2).sum(axis=2)
    rows, nearest = np.arange(len(path)), off.argmin(axis=1)
    found = np.maximum.accumulate(t[nearest] + share[rows, nearest] * np.diff(t)[nearest])
    found[0], found[-1] = 0.0, 1.0
    return found


def _lengths(path: Array, least: float = 0.0) -> Array:
    """Return how far along a path (p, 3) its places are, from 0 on; each step counts for ``least`` or more."""
    return np.concatenate([[0.0], np.cumsum(np.maximum(np.linalg.norm(np.diff(path, axis=0), axis=1), least))])


def _resampled(path: Array, count: int) -> Array:
    steps = _lengths(path)
    wanted = np.linspace(0, steps[-1], count)
    return np.stack([np.interp(wanted, steps, axis) for axis in path.T], axis=1)


def _sampler(path: NDArray, t: Array, n: int) -> sparse.csr_array:
    """Return the weights (SAMPLES, n) that place evenly spread places of the edge."""
    wanted = np.linspace(0, 1, SAMPLES)
    right = np.clip(np.searchsorted(t, wanted, side="right"), 1, len(t) - 1)
    left = right - 1
    share = np.clip((wanted - t[left]) / np.maximum(t[right] - t[left], 1e-12), 0.0, 1.0)
    rows = np.repeat(np.arange(SAMPLES), 2)
    columns = np.stack([path[left], path[right]], axis=1).ravel()
    return sparse.csr_array((np.stack([1 - share, share], axis=1).ravel(), (rows, columns)), shape=(SAMPLES, n))

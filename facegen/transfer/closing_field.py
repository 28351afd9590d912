"""How far the skin round a slit goes with its edges: 1 on an edge, 0 on the other one, smooth between and beyond."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.spatial import cKDTree

from facegen.geometry.factor import Factor
from facegen.geometry.fade import smooth_step
from facegen.geometry.operators import Surface
from facegen.transfer.margins import SAMPLES, Margins
from facegen.transfer.skin import Skin

Array = NDArray[np.float64]

# The field ends at this share of the slit's width from its edges, on the template: below the brow, beside the nose.
_REACH = 0.5
# A field's stretching against its bending, 1/mm^2: enough to keep it from swinging past 0 and 1.
_STRETCH = 0.004
# How firmly edges, corners and the field's end are held, times the largest diagonal entry.
_HOLD = 1e4
# A rim ends where one edge is so many times as near as the other, and fades until then from the first of these on.
_RIM, _BESIDE = 0.1, 0.3
# An edge is sampled at so many places to tell how far off it is.
_FINE = 8 * SAMPLES
# Because vertices that nothing holds, of a piece beside the slit, must stay: this share of the largest entry.
_TIE = 1e-12


@dataclass(frozen=True, eq=False)
class Field:
    """``rows`` (r,): the skin's vertices near the slit; ``upper``, ``lower`` (r,): how much they go with either edge;
    ``along`` (r, SAMPLES): weights of their place along the slit; ``edges`` (e, 2): the mesh's, among them;
    ``on_upper``, ``on_lower`` (r,): how much they belong to the rim of an open slit, which moves as its edge does."""

    rows: NDArray[np.int64]
    upper: Array
    lower: Array
    along: sparse.csr_array
    edges: NDArray[np.int32]
    on_upper: Array
    on_lower: Array

    def steps(self, upper: Array, lower: Array) -> Array:
        """Return how the vertices move (r, 3) when places along the edges move by (SAMPLES, 3)."""
        return self.upper[:, None] * (self.along @ upper) + self.lower[:, None] * (self.along @ lower)


def closing_field(skin: Skin, template: Margins, avatar: Margins) -> Field:
    """Return the field round a slit of the avatar; template, avatar: `facing_margins`."""
    width = float(np.linalg.norm(template.line[0, -1] - template.line[0, 0]))
    near = cKDTree(template.line.reshape(-1, 3)).query(skin.registered)[0] < _REACH * width
    near[avatar.rows] = True
    faces = skin.surface.faces[near[skin.surface.faces].any(axis=1)]
    rows, local = np.unique(faces, return_inverse=True)
    surface = Surface(skin.surface.vertices[rows], local.reshape(-1, 3).astype(np.int32))
    on_edge = np.searchsorted(rows, avatar.rows)
    held = ~near[rows] | np.isin(rows, avatar.corners)
    held[on_edge] = True
    wanted = np.zeros((len(rows), 2))
    wanted[on_edge, 0], wanted[on_edge, 1] = avatar.is_upper, ~avatar.is_upper
    matrix = surface.bending + _STRETCH * surface.stretching
    scale = matrix.diagonal().max()
    hold = _HOLD * held
    solved = Factor(matrix + sparse.diags_array(scale * (hold + _TIE)), what="the skin round a slit").solve(
        scale * hold[:, None] * wanted)
    upper, lower = np.clip(solved, 0.0, 1.0).T
    upper[on_edge], lower[on_edge] = wanted[on_edge].T
    return Field(rows, upper, lower, _along(skin, avatar, rows, on_edge), surface.edges[0],
                 *_rims(surface.vertices, *avatar.ends(skin.surface.vertices)))


def _rims(places: Array, upper: Array, lower: Array) -> tuple[Array, Array]:
    """Return how much places (r, 3) belong to the rims of edges (SAMPLES, 3): those much nearer to one of them."""
    at, fine = np.arange(SAMPLES), np.linspace(0, SAMPLES - 1, _FINE)
    edges = (np.stack([np.interp(fine, at, axis) for axis in edge.T], axis=1) for edge in (upper, lower))
    to_upper, to_lower = (cKDTree(edge).query(places)[0] for edge in edges)
    farther = np.maximum(np.maximum(to_upper, to_lower), 1e-300)
    on_upper, on_lower = (smooth_step((_BESIDE - to / farther) / (_BESIDE - _RIM)) for to in (to_upper, to_lower))
    return on_upper, on_lower


def _along(skin: Skin, margins: Margins, rows: NDArray, on_edge: NDArray) -> sparse.csr_array:
    """Return the weights (rows, SAMPLES) of each vertex' place along the slit: the nearest one on the registered skin;
    for those on an edge (rows ``on_edge``), their own."""
    nearest = cKDTree(np.concatenate(margins.ends(skin.registered))).query(skin.registered[rows])[1]
    at = (nearest % SAMPLES).astype(float)
    at[on_edge] = margins.at * (SAMPLES - 1)
    left = np.clip(np.floor(at).astype(int), 0, SAMPLES - 2)
    share = at - left
    index = np.repeat(np.arange(len(rows)), 2)
    return sparse.csr_array((np.stack([1 - share, share], axis=1).ravel(),
                             (index, np.stack([left, left + 1], axis=1).ravel())), shape=(len(rows), SAMPLES))

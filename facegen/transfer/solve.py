"""The transfer itself: one linear system for all shapes.

Based on: Onizuka et al. (2018), section 4.3, and Sumner & Popovic (2004). For each shape, over the avatar's
displacement u, minimise

    E = wd sum_t area_t |grad u_t - R_t (grad r)_s(t) Q_t^T|^2     gradients        (eq. 15)
      + wl sum_i |u_i - M_i r_i|^2                                 landmarks        (eq. 16)
      + ws ES + wi sum_t area_t |grad u_t|^2                       smooth, identity (eq. 19)
      + wa sum_v area_v f_v |u_v - M_v r_v|^2                      anchor           (ours)

r: the template's displacement (without its jaw); s(t), and r_v: of the partner on the template. Q_t turns the partner's
plane into the triangle's, so that derivatives are taken along corresponding directions; M and R are the parts'
(part_motion). The anchor draws every vertex to its partner's own movement, scaled to its part (a screened Poisson
equation): gradients alone leave shapes adrift. f fades where the partner is far, f and the triangle's say where it
looks another way.

The left-hand side is the same for all shapes and all three axes: it is factored once. The right-hand side is linear in
r: one sparse matrix of blocks (3, 3) makes those of all shapes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.spatial import cKDTree

from facegen.errors import InputError
from facegen.geometry.closest import Feet, contradict
from facegen.geometry.factor import Factor
from facegen.geometry.fade import smooth_step
from facegen.geometry.operators import Surface, dirichlet
from facegen.progress import Progress, counted, silent
from facegen.transfer.part_motion import nearest_rotations

# Gradients without a partner are zero with this share of the others' weight: they give way, but do not wrinkle.
_ALONE = 0.05
# Because each piece that no partner holds would float: everything is tied to its place this much, times the diagonal.
_TIE = 1e-7
# No vertex is held by less than this share of the largest entry. Where that is more than the energy holds, it decides
# alone how a vertex moves: few may be so, at the corners of needles, but not this share of all.
_LEAST_ENERGY, _MOST_LONE = 1e-12, 0.01
# A vertex without a partner, in a mouth's depth or on a body, stays where it is with this share of the anchor's weight.
_STAY = 0.3
# But a lining, which is without a partner too, moves as the skin over it does, so that it does not come through: wholly
# where that skin is no thicker than the first, not at all from the second on, mm.
_THIN, _THICK = 5.0, 20.0
# The skin over a lining is the mean of so many of its vertices; one so many mm away, or less, is as near as can be, and
# beyond that this power of the square of the distance tells.
_OVER, _CLOSE, _NEAREST = 32, 1.0, 3
# Skin that lies this little on the other side of a slit may be over a lining too: closest.contradict tells.
_ASTRIDE = 0.05
_TINY = 1e-300
# Shapes that are solved together, to bound the memory.
_AT_A_TIME = 16
# Millimetres over which the trust in a partner fades.
_FADE = 6.0


@dataclass(frozen=True)
class Weights:
    """Weights of the energy above. ``anchor`` in 1/mm^2, ``smooth`` in mm^2, ``landmarks`` in mm^2 of skin."""

    gradients: float = 1.0
    landmarks: float = 0.0
    smooth: float = 0.0
    identity: float = 0.0
    anchor: float = 0.0


OURS = Weights(gradients=1.0, landmarks=20.0, anchor=0.032)


@dataclass(frozen=True)
class Followers:
    """How p places are moved by a template: each by the mean of three vertices' movement times a matrix. ``corners``
    (p, 3), ``weights`` (p, 3), ``matrices`` (p, 3, 3)."""

    corners: NDArray[np.int64]
    weights: NDArray[np.float64]
    matrices: NDArray[np.float64]

    def __call__(self, motion: NDArray) -> NDArray[np.float64]:
        """Return the places' displacements (k, p, 3) for the template's (k, n_s, 3)."""
        followed = np.einsum("pc,kpcj->kpj", self.weights, motion[:, self.corners])
        return np.einsum("pij,kpj->kpi", self.matrices, followed)

    def blocks(self, shares: sparse.sparray) -> _Blocks:
        """Return what vertices take of the places' displacements: shares (n, p)."""
        shares = sparse.coo_array(shares)
        v, p = shares.coords
        weights = shares.data[:, None] * self.weights[p]
        return _Blocks(np.repeat(v, 3), self.corners[p].ravel(),
                       (weights[:, :, None, None] * self.matrices[p][:, None]).reshape(-1, 3, 3))


@dataclass(frozen=True)
class _Blocks:
    """Matrices ``values`` (b, 3, 3) from the template's vertices ``columns`` (b,) to the avatar's ``rows`` (b,)."""

    rows: NDArray[np.int64]
    columns: NDArray[np.int64]
    values: NDArray[np.float64]


class Transfer:
    """The system from one template's skin to one avatar's: built once, ``solve`` for any shapes."""

    def __init__(self, surface: Surface, template: Surface, feet: Feet, triangle_feet: Feet, matrices: NDArray,
                 turns: NDArray, landmarks: sparse.csr_array, landmark_motion: Followers,
                 weights: Weights = OURS, sides: NDArray | None = None, *,
                 trust: tuple[NDArray, NDArray]) -> None:
        """surface, template: the skins. feet: of the avatar's vertices (n,), triangle_feet: of its triangles' middles
        (m,). matrices (n, 3, 3): M; turns (n, 3, 3): R. landmarks (l, n); landmark_motion: M r. sides
        (n, s): `side_fields` of the surface, which keep a lip's lining with its own lip. trust (n,), (m,): how much
        the partners of vertices and of middles count, 0 for none to 1."""
        n, n_s = len(surface.vertices), len(template.vertices)
        held, shared = trust
        lining, lined = _lining(surface, held, sides)
        near = 1 / (1 + (np.where(feet.found, feet.distances, 0) / _FADE) ** 2)
        anchor = weights.anchor * surface.vertex_areas
        by_partner, by_lining = anchor * held * near, anchor * (1 - held) * (_STAY + (1 - _STAY) * lined)
        anchor = by_partner + by_lining
        matrix = weights.gradients * dirichlet(surface, _ALONE + (1 - _ALONE) * shared) + sparse.diags_array(anchor)
        if weights.identity:
            matrix = matrix + weights.identity * surface.stretching
        if weights.smooth:
            matrix = matrix + weights.smooth * surface.bending
        if weights.landmarks:
            matrix = matrix + weights.landmarks * (landmarks.T @ landmarks)
        matrix = sparse.csc_array(matrix)
        energy = matrix.diagonal()
        least = _LEAST_ENERGY * energy.max()
        _check_tied(energy > least)
        self._matrix = matrix + sparse.diags_array(_TIE * energy + least)
        parts = [_gradient_blocks(surface, template, triangle_feet, turns, weights.gradients * shared)]
        pulled = sparse.diags_array(by_partner) + sparse.diags_array(by_lining) @ lining
        parts.append(Followers(template.faces[feet.faces], feet.weights, matrices).blocks(pulled))
        if weights.landmarks:
            parts.append(landmark_motion.blocks(weights.landmarks * landmarks.T))
        self._right = _assembled(parts, n, n_s)
        self._shape = (n, n_s)

    @cached_property
    def _factor(self) -> Factor:
        return Factor(self._matrix, what="the transfer to the avatar")

    def solve(self, motion: NDArray, *, progress: Progress = silent) -> NDArray[np.float64]:
        """Return the avatar's displacements (k, n, 3) for the template's (k, n_s, 3)."""
        n, n_s = self._shape
        result = np.empty((len(motion), n, 3))
        for start in counted(progress, "carrying the shapes over", range(0, len(motion), _AT_A_TIME)):
            some = motion[start:start + _AT_A_TIME]
            k = len(some)
            right = self._right @ np.ascontiguousarray(some.reshape(k, 3 * n_s).T)          # (3 n, k)
            solved = self._factor.solve(right.reshape(n, 3 * k))
            result[start:start + k] = np.moveaxis(solved.reshape(n, 3, k), 2, 0)
        return result


def _check_tied(tied: NDArray[np.bool_]) -> None:
    """Raise InputError if the energy holds too few of the vertices: ``tied`` (n,)."""
    lone = np.flatnonzero(~tied)
    if len(lone) > _MOST_LONE * len(tied):
        raise InputError(f"the transfer to the avatar is singular to working precision: {len(lone)} of {len(tied)} "
                         f"vertices of the skin (first: {', '.join(map(str, lone[:5]))}) are tied to nothing; give "
                         "gradients, or anchor, a weight nearer to the others', or leave weights out")


def rotation_between(a: NDArray, b: NDArray) -> NDArray[np.float64]:
    """Return the smallest rotations (n, 3, 3) that turn unit vectors a into b (n, 3).

    Opposite vectors have no smallest rotation; partners are never opposite.
    """
    axis = np.cross(a, b)
    cosine = np.einsum("ni,ni->n", a, b)
    skew = np.zeros((len(a), 3, 3))
    skew[:, 0, 1], skew[:, 0, 2], skew[:, 1, 2] = -axis[:, 2], axis[:, 1], -axis[:, 0]
    skew -= np.swapaxes(skew, 1, 2)
    return np.eye(3) + skew + skew @ skew / np.maximum(1 + cosine, 1e-6)[:, None, None]


def landmark_motion(places: Mapping[str, tuple[NDArray, NDArray]], names: Sequence[str],
                    matrices: NDArray) -> Followers:
    """Return how the template's motion moves landmarks on the avatar (eq. 16).

    places: the template's; matrices (l, 3, 3): R_t A R_s^T of each landmark's part.
    """
    return Followers(np.array([places[name][0] for name in names]).reshape(-1, 3),
                   np.array([places[name][1] for name in names]).reshape(-1, 3), matrices)


def _gradient_blocks(surface: Surface, template: Surface, feet: Feet, turns: NDArray,
                     weight: NDArray) -> _Blocks:
    """Return G^T W R (grad r) Q^T, so many times (m,). feet: of the avatar's triangles."""
    t = np.flatnonzero(feet.found)
    s = feet.faces[t]
    turn = nearest_rotations(turns[surface.faces[t]].mean(axis=1))
    plane = rotation_between(np.einsum("tij,tj->ti", turn, template.normals[s]), surface.normals[t]) @ turn
    # d(hat_i)/d(place) . Q . d(hat_j)/d(place): how corner i of t answers corner j of s
    answer = surface.hat_gradients[t] @ plane @ np.swapaxes(template.hat_gradients[s], 1, 2)
    answer *= (weight * surface.areas)[t, None, None]
    values = (answer[:, :, :, None, None] * turn[:, None, None]).reshape(-1, 3, 3)              # (t, i, j)
    return _Blocks(np.repeat(surface.faces[t], 3, axis=1).ravel(), np.tile(template.faces[s], (1, 3)).ravel(), values)


def _assembled(parts: Sequence[_Blocks], n: int, n_s: int) -> sparse.csr_array:
    """Return the matrix (3 n, 3 n_s) of blocks, of which those at one place add up."""
    place = np.concatenate([part.rows.astype(np.int64) * n_s + part.columns for part in parts])
    values = np.concatenate([part.values for part in parts]).reshape(-1, 9)
    order = np.argsort(place)
    place = place[order]
    first = np.flatnonzero(np.diff(place, prepend=-1))
    rows, columns = np.divmod(place[first], n_s)
    starts = np.concatenate([[0], np.cumsum(np.bincount(rows, minlength=n))])
    blocks = np.add.reduceat(values[order], first).reshape(-1, 3, 3) if len(first) else np.zeros((0, 3, 3))
    # Not by blocks: SciPy's product by columns is slower that way.
    return sparse.csr_array(sparse.bsr_array((blocks, columns, starts), shape=(3 * n, 3 * n_s), blocksize=(3, 3)))


def _lining(surface: Surface, held: NDArray, sides: NDArray | None) -> tuple[sparse.csr_array, NDArray]:
    """Return, for vertices that partners do not hold in full (n,), the weights (n, n) of those of the skin over them,
    and how much they go with it (n,), which is what their weights sum to.

    Not the nearest place alone: which one that is a little change decides.
    """
    n = len(held)
    lone, over = np.flatnonzero(held < 1), np.flatnonzero(held > 0)
    sides = np.zeros((n, 0)) if sides is None else sides
    rows, columns, values = [], [], []
    lined = np.zeros(n)
    where, of_where = np.unique(np.sign(sides[lone]), axis=0, return_inverse=True)
    for k, signs in enumerate(where):
        own = lone[of_where.ravel() == k]
        there = over[(sides[over] * signs >= -_ASTRIDE).all(axis=1)]
        if not len(there):
            continue
        apart, near = cKDTree(surface.vertices[there]).query(surface.vertices[own], k=min(_OVER, len(there)))
        apart, near = apart.reshape(len(own), -1), there[near.reshape(len(own), -1)]
        share = held[near] * surface.vertex_areas[near] / (apart**2 + _CLOSE**2) ** _NEAREST
        if near.shape[1] == _OVER:                  # the last, at whose distance they end, is not to matter
            share *= 1.0 - (apart / np.maximum(apart[:, -1:], _TINY)) ** 2
        share[contradict(sides[own][:, None], sides[near])] = 0.0
        total = share.sum(axis=1)
        share /= np.maximum(total, _TINY)[:, None]
        thick = (share * apart).sum(axis=1)
        lined[own] = np.where(total > 0, smooth_step((_THICK - thick) / (_THICK - _THIN)), 0.0)
        rows.append(np.repeat(own, near.shape[1]))
        columns.append(near.ravel())
        values.append((lined[own, None] * share).ravel())
    if not rows:
        return sparse.csr_array((n, n)), lined
    return sparse.csr_array((np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))),
                            shape=(n, n)), lined

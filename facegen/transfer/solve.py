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
equation): gradients alone leave shapes adrift. f fades where the partner is far.

The left-hand side is the same for all shapes and all three axes: it is factored once. The right-hand side is linear in
r: one sparse matrix makes those of all shapes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from facegen.errors import InputError
from facegen.geometry.closest import ClosestPoints, Feet
from facegen.geometry.factor import Factor
from facegen.geometry.fade import smooth_step
from facegen.geometry.operators import Surface, dirichlet, hinge_energy
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


class Transfer:
    """The system from one template's skin to one avatar's: built once, ``solve`` for any shapes."""

    def __init__(self, surface: Surface, template: Surface, feet: Feet, triangle_feet: Feet, matrices: NDArray,
                 turns: NDArray, landmarks: sparse.csr_array, landmark_motion: sparse.csr_array,
                 weights: Weights = OURS, sides: NDArray | None = None) -> None:
        """surface, template: the skins. feet: of the avatar's vertices (n,), triangle_feet: of its triangles' middles
        (m,). matrices (n, 3, 3): M; turns (n, 3, 3): R. landmarks (l, n); landmark_motion (3 l, 3 n_s): M r. sides
        (n, s): `side_fields` of the surface, which keep a lip's lining with its own lip."""
        n, n_s = len(surface.vertices), len(template.vertices)
        trust = 1 / (1 + (np.where(feet.found, feet.distances, 0) / _FADE) ** 2)
        lining, lined = _lining(surface, feet.found, sides)
        anchor = weights.anchor * surface.vertex_areas * np.where(feet.found, trust, _STAY + (1 - _STAY) * lined)
        share = np.where(triangle_feet.found, 1.0, _ALONE)
        matrix = weights.gradients * dirichlet(surface, share) + sparse.diags_array(anchor)
        if weights.identity:
            matrix = matrix + weights.identity * dirichlet(surface)
        if weights.smooth:
            matrix = matrix + weights.smooth * hinge_energy(surface)
        if weights.landmarks:
            matrix = matrix + weights.landmarks * (landmarks.T @ landmarks)
        matrix = sparse.csc_array(matrix)
        energy = matrix.diagonal()
        least = _LEAST_ENERGY * energy.max()
        _check_tied(energy > least)
        self._matrix = matrix + sparse.diags_array(_TIE * energy + least)
        right = weights.gradients * self._gradient_part(surface, template, triangle_feet, turns)
        pulled = sparse.diags_array(anchor) @ (sparse.diags_array(feet.found.astype(float)) + lining)
        right = right + sparse.kron(pulled, sparse.identity(3), format="csr") @ self._carried(template, feet, matrices)
        if weights.landmarks:
            spread = sparse.kron(landmarks.T, sparse.identity(3, format="csr"), format="csr")
            right = right + weights.landmarks * (spread @ landmark_motion)
        self._right = sparse.csr_array(right)
        self._shape = (n, n_s)

    @cached_property
    def _factor(self) -> Factor:
        return Factor(self._matrix, what="the transfer to the avatar")

    @staticmethod
    def _gradient_part(surface: Surface, template: Surface, feet: Feet, turns: NDArray) -> sparse.csr_array:
        """Return the matrix (3 n, 3 n_s) of G^T W R (grad r) Q^T."""
        n, n_s = len(surface.vertices), len(template.vertices)
        t = np.flatnonzero(feet.found)
        s = feet.faces[t]
        turn = nearest_rotations(turns[surface.faces[t]].mean(axis=1))
        plane = rotation_between(np.einsum("tij,tj->ti", turn, template.normals[s]), surface.normals[t]) @ turn
        # d(hat_i)/d(place) . Q . d(hat_j)/d(place): how corner i of t answers corner j of s
        answer = np.einsum("tia,tab,tjb->tij", surface.hat_gradients[t], plane, template.hat_gradients[s])
        answer *= surface.areas[t, None, None]
        values = answer[:, :, None, :, None] * turn[:, None, :, None, :]                     # (t, i, c, j, d)
        rows = 3 * surface.faces[t][:, :, None] + np.arange(3)
        columns = 3 * template.faces[s][:, :, None] + np.arange(3)
        rows = np.broadcast_to(rows[:, :, :, None, None], values.shape)
        columns = np.broadcast_to(columns[:, None, None], values.shape)
        return sparse.coo_array((values.ravel(), (rows.ravel(), columns.ravel())), shape=(3 * n, 3 * n_s)).tocsr()

    @staticmethod
    def _carried(template: Surface, feet: Feet, matrices: NDArray) -> sparse.csr_array:
        """Return the matrix (3 n, 3 n_s) that gives each vertex M r of its partner, and nothing without one."""
        n, n_s = len(matrices), len(template.vertices)
        v = np.flatnonzero(feet.found)
        values = matrices[v][:, :, None, :] * feet.weights[v][:, None, :, None]
        rows = np.broadcast_to((3 * v[:, None] + np.arange(3))[:, :, None, None], values.shape)
        columns = 3 * template.faces[feet.faces[v]][:, :, None] + np.arange(3)
        columns = np.broadcast_to(columns[:, None], values.shape)
        return sparse.coo_array((values.ravel(), (rows.ravel(), columns.ravel())), shape=(3 * n, 3 * n_s)).tocsr()

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


def landmark_matrix(places: Mapping[str, tuple[NDArray, NDArray]], names: tuple[str, ...],
                    matrices: NDArray, n_s: int) -> sparse.csr_array:
    """Return the matrix (3 l, 3 n_s) that makes of the template's motion the landmarks' motion on the avatar (eq. 16).

    places: the template's; matrices (l, 3, 3): R_t A R_s^T of each landmark's part.
    """
    vertices = np.array([places[name][0] for name in names])
    weights = np.array([places[name][1] for name in names])
    values = matrices[:, :, None, :] * weights[:, None, :, None]                              # (l, c, j, d)
    rows = np.broadcast_to((3 * np.arange(len(names))[:, None] + np.arange(3))[:, :, None, None], values.shape)
    columns = np.broadcast_to((3 * vertices[:, :, None] + np.arange(3))[:, None], values.shape)
    return sparse.coo_array((values.ravel(), (rows.ravel(), columns.ravel())), shape=(3 * len(names), 3 * n_s)).tocsr()


def _lining(surface: Surface, found: NDArray, sides: NDArray | None) -> tuple[sparse.csr_array, NDArray]:
    """Return, for vertices that have no partner (n,), the weights (n, n) of those of the skin over them, and how much
    they go with it (n,), which is what their weights sum to."""
    n = len(found)
    over, lone = surface.faces[found[surface.faces].all(axis=1)], np.flatnonzero(~found)
    if not len(over) or not len(lone):
        return sparse.csr_array((n, n)), np.zeros(n)
    labels = None if sides is None else (sides[lone], sides[over].mean(axis=1))
    feet = ClosestPoints(Surface(surface.vertices, over))(surface.vertices[lone], labels=labels)
    lined = np.zeros(n)
    lined[lone] = smooth_step((_THICK - np.where(feet.found, feet.distances, np.inf)) / (_THICK - _THIN))
    values = lined[lone, None] * feet.weights
    rows = np.repeat(lone, 3)
    return sparse.csr_array((values.ravel(), (rows, over[feet.faces].ravel())), shape=(n, n)), lined

"""Three published methods, to compare with: the paper's own, deformation transfer alone, and expression cloning."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from facegen.geometry.closest import Feet
from facegen.geometry.factor import Factor
from facegen.geometry.normals import vertex_normals
from facegen.geometry.operators import Surface, dirichlet
from facegen.transfer.gradients import deformation_gradients, triangle_pairs

# Because the mesh as a whole may drift where only its gradients are given: the vertex that moves least stays.
_PIN = 1.0
# Shapes whose gradients are in memory at a time.
_AT_A_TIME = 8


@dataclass(frozen=True)
class PaperWeights:
    """wd, wl, ws, wi of eq. 19; (1, 100, 10, 1) are the paper's, (1, 0, 0, 0) is Sumner & Popovic (2004)."""

    gradients: float = 1.0
    landmarks: float = 100.0
    smooth: float = 10.0
    identity: float = 1.0


PAPER = PaperWeights()
SUMNER = PaperWeights(1.0, 0.0, 0.0, 0.0)


def gradient_transfer(surface: Surface, registered: NDArray, template: Surface, motion: NDArray, *,
                      weights: PaperWeights = SUMNER, landmarks: sparse.csr_array | None = None,
                      landmark_motion: NDArray | None = None, root: bool = False) -> NDArray[np.float64]:
    """Return displacements (k, n, 3): the minimum of wd Ed + wl El + ws ES + wi EI (eq. 15-19).

    surface: the avatar's skin; registered (n, 3): in the template's shape; motion (k, n_s, 3). Sums are over triangles
    and pairs of them, each counting one, as in the paper; the free fourth vertex of a triangle of Ed drops out of the
    minimum, that of ES is left out. landmarks (l, n), landmark_motion (k, l, 3): where El wants them.
    """
    pairs = triangle_pairs(template, Surface(registered, surface.faces))
    m, n = len(surface.faces), len(surface.vertices)
    count = np.bincount(pairs[:, 1], minlength=m).astype(float)
    each = 1 / np.maximum(surface.areas, 1e-12)
    matrix = dirichlet(surface, each * (weights.gradients * count + weights.identity))
    if weights.smooth:
        matrix = matrix + weights.smooth * _jumps(surface)
    held = landmarks is not None and landmark_motion is not None and weights.landmarks
    if held:
        matrix = matrix + weights.landmarks * (landmarks.T @ landmarks)
    pins = _pins(surface, registered, template, motion)
    matrix = sparse.csc_array(matrix)
    tie = np.zeros(n)
    typical = np.median(matrix.diagonal())
    tie[pins] = _PIN * typical
    tie += 1e-9 * typical
    factor = Factor(matrix + sparse.diags_array(tie), what="the transfer of gradients")
    gather = sparse.csr_array((np.ones(len(pairs)), (pairs[:, 1], pairs[:, 0])), shape=(m, len(template.faces)))
    result = np.empty((len(motion), n, 3))
    eye = np.eye(3)
    for start in range(0, len(motion), _AT_A_TIME):
        some = slice(start, start + _AT_A_TIME)
        s = deformation_gradients(template.vertices, template.vertices + motion[some], template.faces, root=root) - eye
        k = len(s)
        wanted = (gather @ np.moveaxis(s, 0, 1).reshape(len(template.faces), -1)).reshape(m, k, 3, 3)
        # G^T W (S - I): corner i of t takes hat_i . (S - I)
        corner = weights.gradients * np.einsum("tia,tkca->tikc", surface.hat_gradients, wanted)
        right = np.zeros((n, k, 3))
        np.add.at(right, surface.faces.ravel(), corner.reshape(-1, k, 3))
        if held:
            right += weights.landmarks * (landmarks.T @ np.moveaxis(landmark_motion[some], 0, 1).reshape(-1, 3 * k)
                                          ).reshape(n, k, 3)
        result[some] = np.moveaxis(factor.solve(right.reshape(n, -1)).reshape(n, k, 3), 1, 0)
    return result


def _jumps(surface: Surface) -> sparse.csc_array:
    """Return the matrix of ES with every pair of neighbours counting one (eq. 10)."""
    pairs, _, _ = surface.hinges
    m, h = len(surface.faces), len(pairs)
    rows = np.repeat(np.arange(h), 2)
    step = sparse.csr_array((np.tile([1.0, -1.0], h), (rows, pairs.ravel())), shape=(h, m))
    jump = sparse.kron(step, sparse.identity(3, format="csr"), format="csr") @ surface.gradient
    return sparse.csc_array(jump.T @ jump)


def _pins(surface: Surface, registered: NDArray, template: Surface, motion: NDArray) -> NDArray[np.int64]:
    """Return one vertex of every component: the one whose nearest place on the template moves least."""
    from scipy.spatial import cKDTree

    distance, near = cKDTree(template.vertices).query(registered)
    moves = np.abs(motion).max(axis=(0, 2))[near] + distance
    _count, component = surface.components()
    order = np.argsort(moves, kind="stable")
    _, first = np.unique(component[order], return_index=True)
    return order[first]


def expression_cloning(surface: Surface, registered: NDArray, template: Surface, feet: Feet,
                       motion: NDArray) -> NDArray[np.float64]:
    """Return displacements (k, n, 3) by vertex motion: J. Noh, U. Neumann, "Expression cloning" (2001).

    Each vertex takes the motion of its partner, turned from the partner's local frame (normal and the direction of the
    same edge) into its own, and scaled by the size of the neighbourhoods.
    """
    n, k = len(surface.vertices), len(motion)
    own, theirs = (_local_frames(Surface(v, surface.faces)) for v in (surface.vertices, registered))
    turn = own[0] @ np.swapaxes(theirs[0], 1, 2)
    size = own[1] / np.maximum(theirs[1], 1e-9)
    found = np.flatnonzero(feet.found)
    corners = template.faces[feet.faces[found]]
    result = np.zeros((k, n, 3))
    carried = np.einsum("fc,kfci->kfi", feet.weights[found], motion[:, corners])
    result[:, found] = size[found, None] * np.einsum("fij,kfj->kfi", turn[found], carried)
    return result


def _local_frames(surface: Surface) -> tuple[NDArray, NDArray]:
    """Return for each vertex its frame (n, 3, 3) and the size (n,) of its neighbourhood: the mean of its edges."""
    edges, _ = surface.edges
    n = len(surface.vertices)
    normals = vertex_normals(surface.vertices, surface.faces)
    ends, others = np.concatenate([edges, edges[:, ::-1]]).T
    away = surface.vertices[others] - surface.vertices[ends]
    length = np.sqrt((away**2).sum(axis=1))
    size = np.bincount(ends, length, minlength=n) / np.maximum(np.bincount(ends, minlength=n), 1)
    order = np.argsort(others, kind="stable")                       # the same neighbour in both meshes
    _, first = np.unique(ends[order], return_index=True)
    towards = np.tile([1.0, 0.0, 0.0], (n, 1))
    towards[ends[order][first]] = away[order][first]
    x = towards - np.einsum("ni,ni->n", towards, normals)[:, None] * normals
    x /= np.maximum(np.sqrt((x**2).sum(axis=1)), 1e-12)[:, None]
    return np.stack([x, np.cross(normals, x), normals], axis=2), size

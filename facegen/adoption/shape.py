"""The base face's surface in a head's shape: registered, its cage fitted, and what the cage leaves out.

The registration is the transfer's (Onizuka 2018, eq. 10-13) the other way round: there an avatar's skin takes the
template's shape, here the base face's takes the head's. A cage of few vertices then follows in least squares, as
Loop's surface is linear in it (H. Hoppe et al., "Piecewise smooth surface reconstruction", 1994), and what its smooth
surface leaves out, wrinkles and the like, goes with it as a relief.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.spatial import cKDTree

from facegen.adoption.base import Base
from facegen.geometry.closest import Feet
from facegen.geometry.fade import smooth_step
from facegen.geometry.normals import vertex_normals
from facegen.geometry.operators import Surface
from facegen.transfer.registration import Correspondence, register
from facegen.transfer.sides import painted, settled, side_fields
from facegen.transfer.template import placing

Array = NDArray[np.float64]
Places = Mapping[str, tuple[NDArray, NDArray]]

# Landmarks that people set by eye on wide smooth places: the surface finds its own way there.
_LOOSE = ("temple_", "jaw_", "head_", "neck")
# Millimetres: a place of the surface farther than this from the head has no partner there.
_REACH = 4.0
# How often the cage is fitted to what its smooth surface is nearest to.
_ROUNDS = 4
# How much a vertex without a partner counts, one of an ear, and one of a lid's margin or the lips' line, beside others.
_ALONE, _EAR, _EDGE = 0.02, 0.1, 20.0
# How firmly the cage keeps its own evenness, beside one square millimetre a cage vertex.
_EVEN = 0.02
# How much a landmark counts, beside a cage vertex.
_MARK = 2.0
# Millimetres from lid margins and the lips' line over which the relief comes up: they must meet as the cage's do.
_FADE = 5.0
# Millimetres: lips nearer than this are closed.
_CLOSED = 2.5


@dataclass(frozen=True, eq=False)
class Shape:
    """``cage`` (c, 3) and ``surface`` (n, 3), in the working frame, mm; ``partners``: the surface's on the head.
    ``scale``: of the face's middle, beside the base face's."""

    cage: Array
    surface: Array
    partners: Feet
    scale: float


def shape_of(base: Base, head: Surface, places: Places) -> Shape:
    """Return the base face in the shape of a head's skin with its landmarks, both in the base face's frame, mm.

    Raises InputError where the system is singular.
    """
    of_head = side_fields(head, places)
    shut = painted(head, places, of_head)
    places = settled(head, places, of_head)
    search = Correspondence(head, of_head, shut)
    names = [name for name in base.coarse_places if name in places and not name.startswith(_LOOSE)]
    marks = placing(base.coarse_places, names, len(base.coarse.vertices))
    targets = np.array([weights @ head.vertices[rows] for rows, weights in (places[name] for name in names)])
    sides = base.sides
    registered = register(base.coarse, sides[:marks.shape[1]], marks, targets, search)
    held_marks = sparse.csr_array(marks @ base.matrix[:marks.shape[1]]), targets
    scale = _scale(base, registered)
    edges, ears = _edges(base), _ears(base)
    # From the registration the cage takes where things are, and from the head, more and more closely, how it is formed.
    coarse, n = len(registered), len(base.surface.vertices)
    goal, weight = np.zeros((n, 3)), np.zeros(n)
    goal[:coarse] = registered
    weight[:coarse] = base.coarse.vertex_areas
    held = edges[edges < coarse]
    weight[held] *= _EDGE
    cage = _fit_cage(base, goal, weight, held_marks, scale)
    closed = _closed(places, head)
    area = base.surface.vertex_areas
    for _ in range(_ROUNDS):
        cage = _close_lips(base, cage) if closed else cage
        smooth = base.matrix @ cage
        feet = search(smooth, vertex_normals(smooth, base.surface.faces), sides, reach=_REACH)
        goal = np.where(feet.found[:, None], feet.points, smooth)
        weight = area * np.where(feet.found, 1.0, _ALONE) * np.where(ears, _EAR, 1.0)
        weight[edges] = 0.0
        goal[held] = registered[held]
        weight[held] = _EDGE * base.coarse.vertex_areas[held]
        cage = _fit_cage(base, goal, weight, held_marks, scale)
    cage = _tuck(base, _close_lips(base, cage) if closed else cage, scale)
    smooth = base.matrix @ cage
    feet = search(smooth, vertex_normals(smooth, base.surface.faces), sides, reach=_REACH)
    relief = np.where(feet.found[:, None], feet.points - smooth, 0.0)
    return Shape(cage, smooth + _relief_share(base, feet.found & ~ears)[:, None] * relief, feet, scale)


def _closed(places: Places, head: Surface) -> bool:
    """Return whether the lips are closed, or all but."""
    top, bottom = (weights @ head.vertices[rows] for rows, weights in
                   (places[name] for name in ("mouth_inner_top", "mouth_inner_bottom")))
    return bool(np.linalg.norm(top - bottom) < _CLOSED)


def _ears(base: Base) -> NDArray[np.bool_]:
    """Return which vertices (n,) of the surface are ear: their folds are finer than the cage and are not followed."""
    names = (base.folder / "cage_names.txt").read_text(encoding="utf-8").split()
    return base.matrix @ np.array([name.startswith("ear_") for name in names], float) > 0.5


def _scale(base: Base, registered: Array) -> float:
    """Return how large the face is beside the base face's: its landmarks' spread."""
    spreads = []
    for vertices in (registered, base.coarse.vertices):
        at = np.array([w @ vertices[rows] for rows, w in base.coarse_places.values()])
        spreads.append(np.sqrt(((at - at.mean(axis=0)) ** 2).sum()))
    return float(spreads[0] / spreads[1])


def _follower_matrix(base: Base) -> tuple[sparse.csr_array, NDArray]:
    """Return the matrix (c, c) that gives each vertex itself and each follower its sources' mean, and the followers."""
    c = len(base.cage.vertices)
    matrix = sparse.lil_array(sparse.identity(c, format="lil"))
    followers = base.data["followers"]
    for row, sources in followers.items():
        matrix[[int(row)], :] = 0.0
        for source, share in sources.items():
            matrix[int(row), int(source)] = share
    return sparse.csr_array(matrix), np.array(sorted(int(row) for row in followers))


def _tuck(base: Base, cage: Array, scale: float) -> Array:
    """Return the cage with the rims that turn inward as far behind what they follow as the base face's are."""
    matrix, rows = _follower_matrix(base)
    own = base.cage.vertices
    tucked = cage.copy()
    tucked[rows] = (matrix @ cage + scale * (own - matrix @ own))[rows]
    return tucked


def _fit_cage(base: Base, goal: Array, weight: Array, marks: tuple[sparse.csr_array, Array], scale: float) -> Array:
    """Return the cage (c, 3) whose smooth surface comes nearest to goal (n, 3) with weights (n,), and its landmarks,
    weights (l, c), to their places (l, 3)."""
    matrix, followers = _follower_matrix(base)
    own = base.cage.vertices
    free = np.setdiff1d(np.arange(len(own)), followers)
    spread = sparse.csc_array(matrix)[:, free]
    fixed = np.zeros_like(own)
    fixed[followers] = scale * (own - matrix @ own)[followers]
    weight = weight / weight.sum() * len(own)
    left = base.matrix @ spread
    right = goal - base.matrix @ fixed
    laplace = _evenness(base)
    even = (laplace @ spread)
    start = scale * (laplace @ own) - laplace @ fixed
    at = marks[0] @ spread
    normal = left.T @ sparse.diags_array(weight) @ left + _EVEN * (even.T @ even) + _MARK * (at.T @ at)
    solved = np.linalg.solve(normal.toarray(), left.T @ (weight[:, None] * right) + _EVEN * (even.T @ start)
                             + _MARK * (at.T @ (marks[1] - marks[0] @ fixed)))
    return spread @ solved + fixed


def _evenness(base: Base) -> sparse.csr_array:
    """Return the umbrella operator (c, c) of the cage: each vertex less the mean of its neighbours."""
    c = len(base.cage.vertices)
    a, b = base.cage.faces[:, [0, 1, 2]].ravel(), base.cage.faces[:, [1, 2, 0]].ravel()
    links = sparse.csr_array((np.ones(2 * len(a)), (np.r_[a, b], np.r_[b, a])), shape=(c, c))
    links.data[:] = 1.0
    degree = np.asarray(links.sum(axis=1)).ravel()
    return sparse.csr_array(sparse.identity(c) - sparse.diags_array(1 / np.maximum(degree, 1)) @ links)


def _close_lips(base: Base, cage: Array) -> Array:
    """Return the cage with closed lips: both edges on one line, as the base face's are."""
    upper, lower = base.seam.T
    cage = cage.copy()
    cage[upper] = cage[lower] = (cage[upper] + cage[lower]) / 2
    return cage


def _edges(base: Base) -> NDArray[np.int64]:
    """Return the surface's vertices that lie on the lid margins and on the lips' line: those of creases alone."""
    on_crease = np.zeros(len(base.cage.vertices))
    on_crease[np.unique(base.data["creases"])] = 1.0
    return np.flatnonzero(base.matrix @ on_crease > 1 - 1e-9)


def _relief_share(base: Base, found: NDArray) -> Array:
    """Return how much of the relief each vertex (n,) of the surface takes: none where lids and lips meet, on what turns
    inward, and where the head has no partner."""
    vertices = base.surface.vertices
    inward = np.zeros(len(base.cage.vertices))
    inward[[int(row) for row in base.data["followers"]]] = 1.0
    inside = base.matrix @ inward > 1e-9
    away, _ = cKDTree(vertices[_edges(base)]).query(vertices)
    share = smooth_step(away / _FADE) * found * ~inside
    # Where a patch without partners begins the relief goes out within a few vertices.
    links = sparse.csr_array((np.ones(3 * len(base.surface.faces)), (
        base.surface.faces.ravel(), base.surface.faces[:, [1, 2, 0]].ravel())), shape=(len(vertices),) * 2)
    links = links + links.T + sparse.identity(len(vertices))
    mean = sparse.diags_array(1 / np.asarray(links.sum(axis=1)).ravel()) @ links
    for _ in range(3):
        share = np.minimum(share, mean @ share)
    return share

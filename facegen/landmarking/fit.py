"""Lay the base face's front on an avatar: iterated closest points, first as a whole, then bending more and more.

The least squares are those of a registration (Onizuka et al. 2018, eq. 10-13: bending, partners, landmarks) in the few
ways that `model` lets the face bend; a partner holds across its surface more than along it (Y. Chen, G. Medioni, 1991),
so that the face can slide to where it fits.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from facegen.geometry.closest import ClosestPoints, Feet
from facegen.geometry.normals import vertex_normals
from facegen.landmarking.model import FaceModel
from facegen.transfer.alignment import Similarity

Array = NDArray[np.float64]

# What a partner holds along the surface, beside across it.
_ALONG = 0.1
# A landmark that is known counts as this many square millimetres of partners, times the stiffness' share.
_HOLD = 4000.0
# As a whole the face is laid by every third of its vertices, in so few ways; bent, by every second.
_EVERY, _FEW = 3, 24
# Normals of a place and its partner agree at least so well.
_LEAST_COSINE = 0.3


@dataclass(frozen=True)
class Round:
    """``stiff``: of the bending, mm^4; ``near``: a partner this far away, mm, counts a quarter."""

    stiff: float
    near: float


WHOLE = (Round(1e8, 30.0), Round(1e8, 25.0), Round(2e7, 20.0), Round(2e7, 20.0), Round(5e6, 15.0), Round(5e6, 15.0))
"""The face as a whole, hardly bent."""
BENT = (Round(1e6, 12.0), Round(1e6, 12.0), Round(2e5, 10.0), Round(2e5, 10.0), Round(5e4, 8.0), Round(5e4, 8.0),
        Round(2e4, 6.0), Round(2e4, 6.0))
"""Then bent to what is there."""


@dataclass(frozen=True, eq=False)
class Laid:
    """``frame``: from the base face's frame to the mesh's; ``vertices`` (n, 3): the face's front, bent, in the first,
    mm. ``feet``: their partners on the mesh, in its axes and units; ``weight`` (n,): how much each counts, 0 to 1."""

    frame: Similarity
    vertices: Array
    feet: Feet
    weight: Array


def lay(model: FaceModel, search: ClosestPoints, start: Similarity, known: Mapping[str, Array],
        rounds: tuple[Round, ...], bent: Array | None = None) -> Laid:
    """Return the face laid on a mesh. start: from its frame to the mesh's. known: name -> place (3,) on the mesh.
    bent (n, 3): where it starts, in its own frame, mm. In `WHOLE`'s rounds it needs few of its vertices and ways."""
    whole = rounds[0].stiff > BENT[0].stiff
    some, few = slice(None, None, _EVERY if whole else _EVERY - 1), _FEW if whole else model.ways.shape[1]
    ways, stiffness, areas = model.ways[:, :few], model.stiffness[:few], model.areas[some]
    own_ways, at_start = ways[some], model.surface.vertices[some]
    frame = start
    x = model.surface.vertices if bent is None else bent
    names = [name for name in model.names if name in known]
    rows = [model.names.index(name) for name in names]
    marks = model.placing[rows]
    at_ways = marks @ ways
    at_rest = marks @ model.surface.vertices
    targets = np.array([known[name] for name in names]).reshape(-1, 3)
    for step in rounds:
        feet, weight = _partners(model, search, frame, x, step.near, some)
        back = frame.inverse()
        goal = np.where(feet.found[:, None], back.apply(feet.points), 0.0)
        normals = np.where(feet.found[:, None], search.surface.normals[feet.faces], 0.0) @ frame.rotation
        w = areas * weight * (model.areas.sum() / areas.sum())
        root = np.sqrt(w)[:, None]
        across = ((root * normals)[:, :, None] * own_ways[:, None, :]).reshape(len(w), -1)      # (n, 3 k)
        rest = goal - at_start
        left = across.T @ across
        right = across.T @ (root[:, 0] * np.einsum("ni,ni->n", normals, rest))
        along = _ALONG * (own_ways.T * w) @ own_ways + np.diag(step.stiff * stiffness + 1e-6 * w.sum())
        pull = _ALONG * (own_ways.T * w) @ rest
        if names:
            along += _HOLD * at_ways.T @ at_ways
            pull += _HOLD * at_ways.T @ (back.apply(targets) - at_rest)
        left += np.kron(np.eye(3), along)
        amounts = np.linalg.solve(left, right + pull.T.ravel()).reshape(3, few).T
        x = model.surface.vertices + ways @ amounts
        frame, x = _reframed(model, frame, x)
    feet, weight = _partners(model, search, frame, x, rounds[-1].near)
    return Laid(frame, x, feet, weight)


def _partners(model: FaceModel, search: ClosestPoints, frame: Similarity, x: Array, near: float,
              some: slice = slice(None)) -> tuple[Feet, Array]:
    """Return the partners of some of the face's vertices and how much each counts."""
    normals = vertex_normals(x, model.surface.faces)[some] @ frame.rotation.T
    feet = search(frame.apply(x[some]), normals, least_cosine=_LEAST_COSINE)
    apart = np.where(feet.found, feet.distances, np.inf) / frame.scale
    return feet, 1.0 / (1.0 + (apart / near) ** 2) ** 2


def _reframed(model: FaceModel, frame: Similarity, x: Array) -> tuple[Similarity, Array]:
    """Return the frame that takes the face at rest nearest to where it is now, and the bent face in it."""
    v, a = model.surface.vertices, model.areas / model.areas.sum()
    p, q = v - a @ v, x - a @ x
    u, _s, vt = np.linalg.svd((q * a[:, None]).T @ p)
    turn = (u * [1.0, 1.0, np.sign(np.linalg.det(u) * np.linalg.det(vt))]) @ vt
    scale = float(np.sqrt((a @ (q**2).sum(axis=1)) / (a @ (p**2).sum(axis=1))))
    moved = Similarity(scale, turn, a @ x - scale * turn @ (a @ v))
    new = Similarity(frame.scale * scale, frame.rotation @ turn, frame.apply(moved.offset))
    return new, moved.inverse().apply(x)


def likeness(model: FaceModel, laid: Laid, search: ClosestPoints) -> float:
    """Return how alike the reliefs of a laid face and the mesh are, -1 to 1: the correlation of what their normals have
    beside those of the face without its relief, where partners count."""
    ways = model.ways[:, :_SMOOTH]
    smooth = ways @ (ways.T @ (model.areas[:, None] * laid.vertices))
    base = vertex_normals(smooth, model.surface.faces)
    own = vertex_normals(laid.vertices, model.surface.faces) - base
    found = laid.feet.found
    there = np.where(found[:, None], search.surface.normals[laid.feet.faces] @ laid.frame.rotation - base, -own)
    w = model.areas
    there = there * np.sqrt(laid.weight)[:, None]
    return float((w * (own * there).sum(axis=1)).sum()
                 / np.sqrt((w * (own**2).sum(axis=1)).sum() * (w * (there**2).sum(axis=1)).sum()))


# So few ways make a face without nose, sockets and lips.
_SMOOTH = 14

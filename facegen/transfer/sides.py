"""Which side of a slit a place of the skin lies on: above or below the mouth, above or below each eye's opening.

Closed lips touch, so that the nearest place of a lower lip may lie on the upper one. A field that is one at the
landmarks above the slit and minus one at those below, and smooth along the skin, tells them apart (the paper trusts
normals alone: section 4.2).
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from facegen.geometry.factor import Factor
from facegen.geometry.operators import Surface
from facegen.transfer.template import placing

SLITS = (
    (("mouth_top", "mouth_upper_L", "mouth_upper_R"), ("mouth_bottom", "mouth_lower_L", "mouth_lower_R"),
     ("mouth_corner_L", "mouth_corner_R")),
    *((tuple(f"{name}_{side}" for name in ("eye_upper_inner", "eye_upper", "eye_upper_outer")),
       tuple(f"{name}_{side}" for name in ("eye_lower_inner", "eye_lower", "eye_lower_outer")),
       (f"eye_inner_{side}", f"eye_outer_{side}")) for side in "LR"),
)
"""For each slit the landmarks above, below and at its corners; those of lids from corner to corner. The inner edges of
the lips are not among them: where lips touch, a person who sets points cannot see on which lip a point lands (see
`settled`)."""

_EDGES = (("mouth_inner_top", "mouth_inner_bottom"), ("eye_upper_L", "eye_lower_L"), ("eye_upper_R", "eye_lower_R"))
"""For each slit the landmarks in the middle of its two edges."""

_INNER = {"mouth_inner_top": 1.0, "mouth_inner_bottom": -1.0}
# Because a point on the wrong lip belongs to a vertex about as near on the other: not farther than this, in mm.
_ASTRAY = 8.0
# Because the field is near zero in the depth of a mouth too: a lip's edge has a side of more than this.
_ON_A_LIP = 0.15

# Because rounding gives the middle of a lip no side at all, and a vertex of lips that are one has neighbours with more.
_BOTH = 0.05
# A place with less of a side than this may lie on the line itself.
_ON_THE_LINE = 0.15

# Millimetres along the skin over which a side fades: about the height of a lip, so that a cheek has no side.
_REACH = 12.0
# How firmly a landmark holds the field: far above the stiffness of a vertex, about one.
_HOLD = 1e3


def side_fields(surface: Surface, places: Mapping[str, tuple[NDArray, NDArray]]) -> NDArray[np.float64]:
    """Return, for every vertex (n, slits), a number from -1 (below) to 1 (above); 0 far from the slit.

    places: landmark -> vertices (3,) and their weights (3,).
    """
    n = len(surface.vertices)
    matrix = surface.stretching + sparse.diags_array(np.maximum(surface.vertex_areas, 1e-9) / _REACH**2)
    rows = [(name, slit, value) for slit, slits in enumerate(SLITS)
            for names, value in zip(slits, (1.0, -1.0, 0.0), strict=True) for name in names if name in places]
    at = placing(places, [name for name, _, _ in rows], n)
    wanted = np.zeros((len(rows), len(SLITS)))
    for row, (_, slit, value) in enumerate(rows):
        wanted[row, slit] = value
    # A hold of one slit also holds the others' fields at zero there: they are far from each other.
    held = Factor(matrix + _HOLD * (at.T @ at), what="which side of a slit the skin lies on")
    return held.solve(_HOLD * (at.T @ wanted))


def painted(surface: Surface, places: Mapping[str, tuple[NDArray, NDArray]], sides: NDArray) -> tuple[int, ...]:
    """Return the slits without an opening: the skin goes on from one side to the other where both edges rest.

    On lips that touch, points for both edges may rest on one vertex too; but round it the skin is of one lip."""
    result = []
    for slit, names in enumerate(_EDGES):
        if all(name in places for name in names):
            high, low = (vertices[weights > 1e-6] for vertices, weights in (places[name] for name in names))
            round_it = surface.faces[np.isin(surface.faces, high).any(axis=1)]
            both = sides[round_it, slit].min(initial=0.0) < -_BOTH < _BOTH < sides[round_it, slit].max(initial=0.0)
            if set(high.tolist()) == set(low.tolist()) and (both or slit > 0):
                result.append(slit)
    return tuple(result)


def torn(sides: NDArray, partners: NDArray, slits: tuple[int, ...]) -> NDArray[np.bool_]:
    """Return which places (p,) lie on the line of a painted slit while their partner is on one side of the template's:
    the line belongs to both lips and would tear if some of it went with one and some with the other.

    sides (p, slits) of the places and of their partners."""
    at = list(slits)
    return ((np.abs(sides[:, at]) < _ON_THE_LINE) & (np.abs(partners[:, at]) > _ON_THE_LINE)).any(axis=1)


def settled(surface: Surface, places: Mapping[str, tuple[NDArray, NDArray]], sides: NDArray
            ) -> dict[str, tuple[NDArray, NDArray]]:
    """Return the places with the inner edges of the lips on their own lip: each that lies on the other goes to the
    nearest vertex of its own; on a painted mouth they stay. sides: `side_fields` of the same places."""
    result = dict(places)
    for name, sign in _INNER.items():
        if name not in places or 0 in painted(surface, places, sides):
            continue
        vertices, weights = places[name]
        if sign * (weights @ sides[vertices, 0]) > 0:
            continue
        at = weights @ surface.vertices[vertices]
        distance = np.where(sign * sides[:, 0] > _ON_A_LIP, np.linalg.norm(surface.vertices - at, axis=1), np.inf)
        near = int(distance.argmin())
        if distance[near] <= _ASTRAY:
            result[name] = (np.full(3, near), np.array([1.0, 0.0, 0.0]))
    return result

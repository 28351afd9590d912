"""The space round a face, carried from the base face's to a person's: what lies in it goes along.

Biharmonic splines in three dimensions (kernel r, with an affine part), through the cage's vertices: exact there,
smooth between, and nearly affine far away (J. Carr et al., "Reconstruction and representation of 3D objects with
radial basis functions", 2001).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from facegen.geometry.closest import ClosestPoints
from facegen.geometry.operators import Surface
from facegen.transfer.alignment import Similarity

Array = NDArray[np.float64]
Space = Callable[[ArrayLike], Array]

# Millimetres: cage vertices nearer than this are one centre, as on closed lips.
_SAME = 1e-3


def space_between(before: Array, after: Array) -> Space:
    """Return the function that takes places (..., 3) of the space round ``before`` (c, 3) to that round ``after``."""
    from scipy.interpolate import RBFInterpolator

    _, first, group = np.unique(np.round(before / _SAME).astype(np.int64), axis=0, return_index=True,
                                return_inverse=True)
    moved = np.zeros((len(first), 3))
    np.add.at(moved, group.ravel(), after - before)
    moved /= np.bincount(group.ravel())[:, None]
    field = RBFInterpolator(before[first], moved, kernel="linear", degree=1)

    def carry(places: ArrayLike) -> Array:
        at = np.asarray(places, float)
        flat = at.reshape(-1, 3)
        return (flat + field(flat)).reshape(at.shape)

    return carry


def similarity_between(before: Array, after: Array) -> Similarity:
    """Return the similarity, upright, that takes places (k, 3) to others best: turned about x alone."""
    p, q = before - before.mean(axis=0), after - after.mean(axis=0)
    turn = np.arctan2((p[:, 1] * q[:, 2] - p[:, 2] * q[:, 1]).sum(), (p[:, 1] * q[:, 1] + p[:, 2] * q[:, 2]).sum())
    c, s = np.cos(turn), np.sin(turn)
    rotation = np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
    scale = float(np.sqrt((q**2).sum() / (p**2).sum()))
    return Similarity(scale, rotation, after.mean(axis=0) - scale * rotation @ before.mean(axis=0))


def heights(places: Array, surface: Surface) -> tuple[Array, Array]:
    """Return how far places (k, 3) lie above a surface, mm, below counted negative, and the normals (k, 3) there."""
    feet = ClosestPoints(surface)(places)
    normals = surface.normals[feet.faces]
    away = places - feet.points
    above = np.where((away * normals).sum(axis=1) < 0, -feet.distances, feet.distances)
    return above, normals

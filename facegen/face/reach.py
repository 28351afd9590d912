"""A feature point taken by hand: the vector that brings it to a place, whatever else the face does.

The vector of eq. 1 (Akimoto 1986) moves the cage; the surface follows it more or less, lids turn about the eye and the
head about its neck. So the vector that lets a point of the surface lie at a place is sought by Newton's method on the
face itself, with the three vertices at most that make the point.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from facegen.errors import InputError, nearest
from facegen.face.face import Controls, Face
from facegen.facs.deformation import mirror_name

Array = NDArray[np.float64]

# Of the vector, mm, by which the slope is measured: lids bend little over so much.
_STEP = 0.25
_ROUNDS = 20
# Millimetres that no eye sees.
_NEAR = 1e-4
# A vector that long, mm, leaves the face: half the width of a head.
LONGEST = 80.0
# Because a point whose surface hardly follows would need vectors that tear the skin round it.
_LEAST_SLOPE = 0.05


@dataclass(frozen=True)
class Reached:
    """``vector`` (3,), mm: the feature vector found; ``place`` (3,): where the point then lies; ``missed``: mm from
    where it was wanted."""

    vector: Array
    place: Array
    missed: float


def movable_points(face: Face) -> tuple[str, ...]:
    """Return the feature points that take a vector; the rest are fixed or turn with the jaw."""
    return tuple(name for name, takes in zip(face.feature_points, face.takes_input, strict=True) if takes)


class Grip:
    """One feature point of a face, held; ``row``: its place among them.

    mirrored: the point on the other side goes along as its mirror image.

    A point in the middle then stays there. Raises InputError for a point that is none or takes no vector.
    """

    def __init__(self, face: Face, point: str, *, mirrored: bool = False, detail: int = 2) -> None:
        names, movable = list(face.feature_points), movable_points(face)
        if point not in names:
            raise InputError(f"point: {point!r} is no feature point of {face.name!r}{nearest(point, names)}")
        if point not in movable:
            raise InputError(f"point: {point!r} of {face.name!r} takes no vector: it is fixed or turns with the jaw")
        other = mirror_name(point)
        self.point = point
        self.other = other if mirrored and other in movable else None
        self.row = names.index(point)
        self._other = names.index(self.other) if self.other else None
        self._middle = self.other == point
        weights = face.point_weights(detail)[[self.row]]
        order = np.argsort(weights.indices)
        self._weights = weights.data[order]
        self._posed = face.some_posed(weights.indices[order].astype(np.int64), detail=detail)

    def places(self, controls: Controls, vectors: ArrayLike) -> Array:
        """Return where the point lies (k, 3), mm, with vectors (k, 3) of its own beside what ``controls`` have."""
        vectors = np.atleast_2d(np.asarray(vectors, np.float64))
        many = np.repeat(controls.vectors[None], len(vectors), axis=0)
        many[:, self.row] += vectors
        if self._other is not None and not self._middle:
            many[:, self._other] += vectors * [-1.0, 1.0, 1.0]
        rest = {name: np.repeat(getattr(controls, name)[None], len(vectors), axis=0)
                for name in ("jaw", "lids", "eyes", "head", "folds")}
        return np.einsum("v,kvi->ki", self._weights, self._posed(replace(controls, vectors=many, **rest)))

    def reach(self, controls: Controls, target: ArrayLike, start: ArrayLike = (0.0, 0.0, 0.0)) -> Reached:
        """Return the vector that brings the point to ``target`` (3,), mm, or as near as it goes.

        controls: all that the face shows beside this vector. start: a vector near the one sought.
        """
        target = np.asarray(target, np.float64)
        free = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]) if self._middle else np.eye(3)
        vector = np.asarray(start, np.float64) * free.any(axis=0)
        best = step = None
        for _ in range(_ROUNDS):
            here, *beside = self.places(controls, np.concatenate([vector[None], vector + _STEP * free]))
            miss = target - here
            away = float(np.linalg.norm(miss))
            if best is not None and away >= best.missed:        # too far: skin came to rest on something
                step = step / 2.0
            else:
                best = Reached(vector, here, away)
                slope = (np.array(beside) - here).T / _STEP     # (3, free)
                u, sizes, v = np.linalg.svd(slope, full_matrices=False)
                held = sizes > _LEAST_SLOPE
                step = ((u.T @ miss)[held] / sizes[held]) @ v[held] @ free
            if best.missed <= _NEAR or np.linalg.norm(step) <= _NEAR:
                break
            vector = best.vector + step
            size = np.linalg.norm(vector)
            if size > LONGEST:
                vector = vector * (LONGEST / size)
        return best

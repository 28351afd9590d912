"""How near an adopted face comes to the head that it was made of."""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray

from facegen.adoption.base import Base
from facegen.geometry.closest import ClosestPoints, Feet
from facegen.geometry.operators import Surface

# Behind this share of the way from the tip of the nose to the back of the head lie ears, hair and neck: no face.
_FACE = 0.45


@dataclass(frozen=True)
class Residual:
    """Distances in mm of the face's own vertices, from brows' height over the forehead to the chin and from ear to ear,
    to the head: ``median``, ``p95`` (95 in 100 are nearer) and ``largest``; ``reached``: the share of them that have
    any place of the head near."""

    median: float
    p95: float
    largest: float
    reached: float

    def as_dict(self) -> dict[str, float]:
        """Return it as plain data."""
        return {key: round(value, 4) for key, value in asdict(self).items()}


def residual_of(made: Surface, base: Base, head: Surface, partners: Feet) -> Residual:
    """Return the distances of a made face's surface to the head. partners: the registration's on the head."""
    face = _face_rows(base)
    rows = face[partners.found[face]]
    distances = ClosestPoints(head)(made.vertices[rows]).distances
    if not len(rows):
        return Residual(np.inf, np.inf, np.inf, 0.0)
    median, p95 = np.quantile(distances, [0.5, 0.95])
    return Residual(float(median), float(p95), float(distances.max()), len(rows) / len(face))


def _face_rows(base: Base) -> NDArray[np.int64]:
    """Return the rows of the surface that are face: in front of the ears, above the chin's underside, no rim inside."""
    vertices = base.surface.vertices
    front, back = vertices[:, 2].max(), vertices[:, 2].min()
    inward = np.zeros(len(base.cage.vertices))
    inward[[int(row) for row in base.data["followers"]]] = 1.0
    chin = base.landmarks["chin"][1]
    keep = (vertices[:, 2] > front - _FACE * (front - back)) & (vertices[:, 1] > chin) & (base.matrix @ inward < 1e-9)
    return np.flatnonzero(keep)

"""What lies in and on a face, carried to a person: eyeballs, teeth, tongue, the mouth's lining, brows and hair."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from facegen.adoption.base import Base
from facegen.adoption.shape import Shape
from facegen.adoption.space import Space, heights, similarity_between
from facegen.geometry.ahead import ahead
from facegen.geometry.mesh import Mesh
from facegen.geometry.operators import Surface
from facegen.transfer.alignment import Similarity

Array = NDArray[np.float64]

TEETH = ("teeth_upper", "teeth_lower", "tongue")
"""What lies between the lips and keeps its own shape: one similarity takes all, so that the teeth still meet."""

# An eyeball much larger or smaller than the base face's beside the same opening is a slip of a landmark.
_LEAST_EYE, _MOST_EYE = 0.6, 1.6
# How firmly an eye's centre keeps to where the space takes it, beside ten vertices of the lids' margins.
_KEEP = 0.3
_ROUNDS = 20
# Millimetres: teeth are not drawn back farther than this; those this far behind the foremost are in front.
_DRAWN_BACK, _FRONT = 8.0, 15.0
# Of the way from the base face's teeth to the outside of its lips, what a person with thinner lips still needs.
_CLEAR = 0.6


@dataclass(frozen=True, eq=False)
class Eyes:
    """``centres`` (2, 3), left then right, mm; ``size``: of the balls, times the base face's."""

    centres: Array
    size: float


def eyes_of(base: Base, shape: Shape, space: Space) -> Eyes:
    """Return the eyeballs on which the person's lids rest as the base face's rest on its own: as large as the openings
    are wide, their centres where all margins have their distances."""
    own = np.array([base.data["eyes"][side] for side in "LR"])
    before, after = base.matrix @ base.cage.vertices, base.matrix @ shape.cage
    widths = [np.mean([np.linalg.norm(vertices[m[0]] - vertices[m[5]]) for m in base.margins])
              for vertices in (before, after)]
    size = float(np.clip(widths[1] / widths[0], _LEAST_EYE, _MOST_EYE))
    centres = []
    for home, margin in zip(own, base.margins, strict=True):
        far = size * np.linalg.norm(before[margin] - home, axis=1)
        kept = centre = after[margin].mean(axis=0) + size * (home - before[margin].mean(axis=0))
        for _ in range(_ROUNDS):                        # Gauss-Newton: |margin - centre| = far
            away = centre - after[margin]
            length = np.linalg.norm(away, axis=1)
            slope = away / length[:, None]
            left = slope.T @ slope + _KEEP * np.eye(3)
            centre = centre + np.linalg.solve(left, slope.T @ (far - length) + _KEEP * (kept - centre))
        centres.append(centre)
    return Eyes(np.array(centres), size)


def parts_of(base: Base, shape: Shape, space: Space, eyes: Eyes) -> tuple[dict[str, Mesh], Similarity]:
    """Return name -> mesh of every part of the base face in the person's place, and what takes teeth there."""
    meshes = {a.mesh.parts[0]: a.mesh for a in base.face.attachments}
    bite = _bite(base, shape, space, meshes)
    skins = base.surface, Surface(shape.surface, base.surface.faces)
    result = {}
    for entry in base.data["parts"]:
        name, mesh = entry["part"], meshes[entry["part"]]
        at = mesh.vertices
        if entry["carried_by"] == "eye":
            k = "LR".index(entry["eye"])
            moved = eyes.centres[k] + eyes.size * (at - base.data["eyes"][entry["eye"]])
        elif name in TEETH:
            moved = bite.apply(at)
        elif entry["carried_by"] == "skin":             # as far above the skin as before
            above = heights(at, skins[0])[0]
            moved = space(at)
            for _ in range(2):
                now, normals = heights(moved, skins[1])
                moved = moved + (above * shape.scale - now)[:, None] * normals
        else:
            moved = space(at)
        result[name] = mesh.with_vertices(moved)
    return result, bite


def _bite(base: Base, shape: Shape, space: Space, meshes: Mapping[str, Mesh]) -> Similarity:
    """Return what takes teeth and tongue to their place: as the space does, but stiff, and drawn back where they would
    come nearer to the lips than the base face's are to its own."""
    at = np.concatenate([meshes[name].vertices for name in TEETH if name in meshes])
    found = similarity_between(at, space(at))
    teeth = np.concatenate([meshes[name].vertices for name in TEETH[:2] if name in meshes])
    front = teeth[teeth[:, 2] > teeth[:, 2].max() - _FRONT]
    before, _ = ahead(front, base.surface.corners)
    after, _ = ahead(found.apply(front), shape.surface[base.surface.faces])
    over = np.isfinite(before) & np.isfinite(after)         # places that lips cover
    short = float((_CLEAR * before - after)[over].max(initial=0.0))
    back = np.array([0.0, 0.0, -min(short, _DRAWN_BACK)])
    return Similarity(found.scale, found.rotation, found.offset + back)

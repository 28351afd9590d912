"""How the parametric face moves in named shapes: what a rig made of it, or a conversion of weights, is built on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields

import numpy as np
from numpy.typing import NDArray

from facegen.blendshapes.recipes import Recipe
from facegen.errors import InputError
from facegen.face.face import Controls, Face
from facegen.facs.deformation import Deformation


def shape_motion(face: Face, recipes: Mapping[str, Recipe], *, detail: int = 2) -> NDArray[np.float64]:
    """Return the displacements (k, n, 3), mm, of the vertices of ``mesh(detail)`` in each of k shapes.

    What a recipe names that the face lacks is passed over. Raises InputError if a corrective's shape is not among the
    recipes. ::

        shapes = shape_set("arkit")
        moved = shape_motion(face, shapes)[list(shapes).index("jawOpen")]
    """
    places = {name: row for row, name in enumerate(recipes)}
    motion = posed(face, [recipe.deformation for recipe in recipes.values()], detail=detail)
    motion -= face.mesh(detail).vertices
    motion[[not any(recipe.deformation) for recipe in recipes.values()]] = 0.0      # not even by rounding
    whole = {name: motion[places[name]].copy() for name in {r.minus for r in recipes.values()} & set(places)}
    for name, recipe in recipes.items():
        if recipe.minus is None:
            continue
        if recipe.minus not in places:
            raise InputError(f"recipes: '{name}' corrects '{recipe.minus}', which is not among them")
        motion[places[name]] -= whole[recipe.minus]
    return motion


def posed(face: Face, several: Sequence[Sequence[Deformation]], *, detail: int) -> NDArray[np.float64]:
    """Return the vertices (k, n, 3), mm, under k sums of deformations."""
    if not several:
        return np.empty((0, *face.mesh(detail).vertices.shape))
    return face.pose_controls(joined(face, several), detail=detail)


def joined(face: Face, several: Sequence[Sequence[Deformation]]) -> Controls:
    """Return the deformer's input for k sums of deformations, with a leading axis of k; at least one."""
    found = [face.controls(*one, strict=False) for one in several]
    return Controls(*(np.stack([getattr(one, field.name) for one in found]) for field in fields(Controls)))

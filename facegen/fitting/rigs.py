"""Which weights of a rig a fit looks for, and the places that they move."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import sparse

from facegen.blendshapes.names import member_of
from facegen.blendshapes.recipes import CLASH, SETS
from facegen.errors import InputError, nearest
from facegen.face.avatar import AvatarFace
from facegen.face.face import Face
from facegen.fitting.points import BlendPoints, Points, Shapes
from facegen.fitting.units import FacePoints, UnitMix, unit_atoms

Rig = Face | AvatarFace

# A rig with so many of ARKit's 52 is fitted by them: what most recorders and engines speak.
_MOST_OF_ARKIT = 40
# A rig with so many units is fitted by those.
_MOST_OF_UNITS = 20


@dataclass(frozen=True)
class Wanted:
    """The weights to be found. ``vocabulary``: of a performance; ``names``: of the weights, in it; ``columns``: the
    rig's own names of them (blendshapes) or atoms (units)."""

    vocabulary: str
    names: tuple[str, ...]
    columns: tuple[str, ...]


def wanted(face: Rig, shapes: str | Sequence[str] | None = None, *, dense: bool = True) -> Wanted:
    """Return which weights of a rig to fit.

    shapes: a set ("units", "arkit", "visemes", "vrm", "expressions"), "shapes" for all of the file's own, or names; by
    default units for a parametric face, and for an avatar ARKit's shapes if it has most of them, else units, else all.
    Raises InputError.
    """
    if isinstance(face, Face):
        if isinstance(shapes, str) and shapes in (*SETS, "shapes") and shapes != "units":
            raise InputError(f"shapes: the parametric face '{face.name}' has no blendshapes, only units, got {shapes!r}"
                             "; make an avatar of it or leave this out")
        given = [shapes] if isinstance(shapes, str) else shapes
        return _units(unit_atoms(None if shapes in (None, "units") else given, dense=dense))
    by_set: dict[str, dict[str, str]] = {}                  # set -> shape -> the file's name of it
    for name, (shape, recipe) in face.known.items():
        by_set.setdefault(recipe.set, {})[shape.removeprefix(CLASH)] = name
    if shapes is None:
        shapes = next((kind for kind, least in (("arkit", _MOST_OF_ARKIT), ("units", _MOST_OF_UNITS))
                       if len(by_set.get(kind, ())) >= least), "shapes")
    if not isinstance(shapes, str) or shapes not in (*SETS, "shapes"):
        return _named(face, [shapes] if isinstance(shapes, str) else list(shapes))
    if shapes == "shapes":
        halves = set(face.notes.halves.values())
        names = tuple(name for name in face.shapes if name not in halves)
        return Wanted("shapes", names, names)
    found = by_set.get(shapes, {})
    if not found:
        raise InputError(f"shapes: {face.path.name} has none of the set '{shapes}'; it has "
                         f"{', '.join(sorted(by_set)) or 'none that is known by name: take shapes'}")
    if shapes == "units":
        members = {member_of(shape) for shape in found}
        return _units(tuple(atom for atom in unit_atoms(dense=dense) if atom in members))
    return Wanted(shapes, tuple(found), tuple(found.values()))


def rig_points(face: Rig, place: sparse.csr_array, want: Wanted, *, detail: int = 2, gaze: bool = True) -> Points:
    """Return the places (p) on a rig as a function of its weights; place (p, n): weights of its mesh's vertices."""
    if isinstance(face, Face):
        return FacePoints(face, place, want.columns, detail=detail, gaze=gaze)
    rest = place @ face.mesh().vertices
    if want.vocabulary == "units":
        shapes = {recipe: name for name, (recipe, one) in face.known.items() if one.set == "units"}
        members = {member_of(shape): name for shape, name in shapes.items()}
    else:
        members = {column: column for column in want.columns}
    names = list(members.values())
    halves = {row: half for row, name in enumerate(names) if (half := face.notes.halves.get(name)) in face.shapes}
    basis = np.array([place @ face.motion(name) for name in [*names, *halves.values()]]).reshape(-1, *rest.shape)
    if want.vocabulary == "units":
        rows = {member: row for row, member in enumerate(members)}
        return BlendPoints(want.names, rest, basis, UnitMix(want.columns, rows, {
            row: len(names) + k for k, row in enumerate(halves)}, len(basis)))
    known = {face.known[name][0]: row for row, name in enumerate(names) if name in face.known}
    pairs = {row: known[minus] for row, name in enumerate(names) if name in face.known
             and (minus := face.known[name][1].minus) in known}
    # A corrective without what it corrects means nothing: it stays at zero.
    points = BlendPoints(want.names, rest, basis, Shapes(len(names), {row: len(names) + k for k, row in
                                                                     enumerate(halves)}, pairs))
    for row, name in enumerate(names):
        if name in face.known and face.known[name][1].minus is not None and row not in pairs:
            points.high[row] = 0.0
    return points


def _units(atoms: tuple[str, ...]) -> Wanted:
    if not atoms:
        raise InputError("shapes: expected one unit or more, got none")
    return Wanted("units", atoms, atoms)


def _named(face: AvatarFace, names: list[str]) -> Wanted:
    """Return the weights of these shapes, by the file's names or by what they are."""
    mine = {shape: name for name, (shape, _) in face.known.items()}
    for name in names:
        if name not in face.shapes and name not in mine:
            raise InputError(f"shapes: {face.path.name} has no shape '{name}', and there is no set of that name"
                             f"{nearest(str(name), (*face.shapes, *mine, *SETS))}")
    columns = tuple(dict.fromkeys(name if name in face.shapes else mine[name] for name in names))
    if not columns:
        raise InputError("shapes: expected one name or more, got none")
    kinds = {face.known[name][1].set if name in face.known else "shapes" for name in columns}
    if kinds == {"arkit"} or kinds == {"visemes"} or kinds == {"vrm"}:
        return Wanted(kinds.pop(), tuple(face.known[name][0] for name in columns), columns)
    return Wanted("shapes", columns, columns)

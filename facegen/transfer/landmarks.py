"""Landmarks of an avatar: named places on a mesh of any make, read from a file and checked.

A landmark is a vertex, a place on a triangle, or a point, which is snapped to the nearest surface. `docs/landmarks.md`
lists the names; the base face's own file is read by facegen.face.landmarks.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from facegen.errors import InputError, TableError
from facegen.face.landmarks import REQUIRED, Landmark, landmark_entries, read_landmark
from facegen.facs.validate import Entry
from facegen.geometry.closest import ClosestPoints
from facegen.geometry.mesh import Mesh
from facegen.geometry.operators import Surface
from facegen.transfer.landmark_checks import place_faults
from facegen.transfer.landmark_surface import check_faces
from facegen.transfer.piece_names import INSIDE, kind_of_name

# A point farther from the surface than this share of the landmarks' extent was set on another mesh, or slipped.
_FARTHEST = 0.05
# A point is snapped to the skin if that is nearer than this share of the extent, though an eyeball be nearer still:
# lids and lips touch what they cover.
_SKIN_FIRST = 0.02
# An extent this many times the mesh's, or this share of it, is one of other units. Because a face may be a thirtieth
# of a body, less is no sign.
_OTHER_UNITS = (3.0, 0.01)
# Surfaces nearer to each other than this share of the extent touch; the middles of a place's own triangles lie within
# the second share of it.
_TOUCHING, _BESIDE = 1e-6, 0.15
_UPPER_LOWER = re.compile(r"(?:mouth_inner_|eye_)(top|bottom|upper|lower)(?:_inner|_outer)?(?:_[LR])?$")
_DIGEST = re.compile(r"(?:sha256:)?([0-9a-f]{8,64})")


@dataclass(frozen=True, eq=False)
class Landmarks:
    """Places on the triangles of a mesh: ``names`` (k); ``faces`` (k,) rows of its triangles, ``corners`` (k, 3) their
    vertices, ``barycentric`` (k, 3) the corners' weights."""

    names: tuple[str, ...]
    faces: NDArray[np.int64]
    corners: NDArray[np.int64]
    barycentric: NDArray[np.float64]

    def points(self, vertices: NDArray) -> dict[str, NDArray[np.float64]]:
        """Return name -> place (3,) on the mesh's vertices (n, 3), posed or not."""
        places = np.einsum("kc,kci->ki", self.barycentric, np.asarray(vertices, float)[self.corners])
        return dict(zip(self.names, places, strict=True))


def snap(points: Mapping[str, NDArray], mesh: Mesh) -> Landmarks:
    """Return the places of a mesh that are nearest to points (3,).

    Raises InputError naming those that are farther from any surface than a twentieth of the points' extent.
    """
    wrong = [name for name, at in points.items()
             if np.shape(at) != (3,) or not np.isfinite(np.asarray(at, float)).all()]
    if wrong or not points:
        raise InputError(f"points: expected three finite numbers for each landmark, got others for {_listed(wrong)}"
                         if wrong else "points: expected at least one landmark")
    return _snap({name: Landmark(at=tuple(np.asarray(at, float))) for name, at in points.items()}, mesh)


def load_landmarks(path: Path | str, mesh: Mesh, *, mesh_name: str = "", digest: str = "", partial: bool = False
                   ) -> Landmarks:
    """Return the landmarks in a file, on a mesh, after every check.

    mesh_name, digest: the mesh's file name and content hash (SHA-256, hexadecimal), compared if the file names one.
    partial: required ones may be missing.
    What is merely suspicious is told by `check_places`. Raises FileError (not to be read) or TableError: unknown,
    missing or doubled names, places the mesh does not have, left and right swapped, a place on the wrong part, or a
    file for another mesh.
    """
    return load_checked(path, mesh, mesh_name=mesh_name, digest=digest, partial=partial)[0]


def load_checked(path: Path | str, mesh: Mesh, *, mesh_name: str = "", digest: str = "", partial: bool = False
                 ) -> tuple[Landmarks, list[str]]:
    """Return what `load_landmarks` does, and what `check_places` has to warn of."""
    about, entries = landmark_entries(path, partial=partial)
    if about is not None:
        _check_mesh(about, mesh, mesh_name, digest)
    found = {name: read_landmark(entry, len(mesh.vertices), mesh.faces, mesh.parts) for name, entry in entries.items()}
    try:
        landmarks = _snap(found, mesh)
        return landmarks, check_places(landmarks, mesh, partial=partial)
    except InputError as error:
        raise TableError(f"{path}: {error}") from None


def check_places(landmarks: Landmarks, mesh: Mesh, *, partial: bool = False) -> list[str]:
    """Return warnings, a sentence each, about landmarks that may be wrong; InputError for those that must be,
    and, unless ``partial``, for required ones that are missing."""
    missing = [f"'{name}'" for name in REQUIRED if name not in landmarks.names]
    if missing and not partial:
        raise InputError(f"landmarks: {_listed(missing)} missing")
    check_faces(landmarks.names, landmarks.corners, landmarks.barycentric, mesh)
    errors, warnings = place_faults(landmarks.names, landmarks.corners, landmarks.barycentric, mesh)
    if errors:
        raise InputError("landmarks: " + "; ".join(errors))
    return warnings


def _check_mesh(entry: Entry, mesh: Mesh, mesh_name: str, digest: str) -> None:
    """Raise TableError if what a file says of its mesh (its name, number of vertices or hash) is not so."""
    advice = "take the landmarks made for this mesh, or remove the key 'mesh' if it only changed its name"
    if isinstance(entry.value, (int, float)) and not isinstance(entry.value, bool):
        count = entry.number(0)
        if count != len(mesh.vertices):
            raise entry.fail(f"the landmarks are of a mesh of {count:g} vertices, this one has {len(mesh.vertices)}; "
                             f"{advice}")
        return
    said = entry.text()
    hashed = _DIGEST.fullmatch(said.lower())
    if hashed:
        if digest and not digest.lower().removeprefix("sha256:").startswith(hashed[1]):
            raise entry.fail(f"the landmarks are of a mesh with the hash {said[:20]}..., this one has "
                             f"{digest[:12]}...; {advice}")
    elif mesh_name and Path(said.replace("\\", "/")).name != Path(mesh_name).name:
        raise entry.fail(f"the landmarks are of the mesh '{said}', this one is '{Path(mesh_name).name}'; {advice}")


def _snap(found: Mapping[str, Landmark], mesh: Mesh) -> Landmarks:
    """Return the landmarks on the mesh; InputError if points miss its surface."""
    names = tuple(found)
    if not len(mesh.faces) or not np.isfinite(mesh.vertices).all():
        raise InputError("mesh: expected at least one triangle and finite vertices")
    faces = np.array([one.face for one in found.values()], np.int64)
    weights = np.array([one.weights for one in found.values()], float)
    points = np.array([one.at or (0.0, 0.0, 0.0) for one in found.values()], float)
    loose = np.array([one.at is not None for one in found.values()], bool)
    points[~loose] = np.einsum("kc,kci->ki", weights[~loose], mesh.vertices[mesh.faces[faces[~loose]]])
    extent = _extent(points)
    if loose.any():
        rows = np.flatnonzero(loose)
        parts = [found[names[row]].part for row in rows]
        loose_names = [names[row] for row in rows]
        faces[rows], weights[rows], distances = _nearest(loose_names, points[rows], parts, mesh, extent)
        _part_lips(names, points, loose, mesh, extent, faces, weights)
        missed = [f"'{names[row]}' ({d:.3g} away)" for row, d in zip(rows, distances, strict=True)
                  if d > _FARTHEST * extent]
        if missed:
            raise InputError(f"landmarks: {_listed(missed)} miss{'es' if len(missed) == 1 else ''} the surface: "
                             f"farther than {_FARTHEST * extent:.3g}, a twentieth of the landmarks' extent; "
                             + _units(extent, mesh))
    return Landmarks(names, faces, mesh.faces[faces].astype(np.int64), weights)


def _nearest(names: list[str], points: NDArray, parts: list[str | None], mesh: Mesh, extent: float):
    """Return (faces (p,), weights (p, 3), distances (p,)) of the nearest places; skin goes before what it covers."""
    inside = np.array([kind_of_name(name) in INSIDE for name in mesh.parts])[mesh.face_parts]
    faces, weights, distances = _feet(points, mesh, np.ones(len(mesh.faces), bool))
    if inside.any() and not inside.all():
        skin = _feet(points, mesh, ~inside)
        near = (skin[2] < _SKIN_FIRST * extent) & [not name.startswith("eye_center") for name in names]
        faces, weights = np.where(near, skin[0], faces), np.where(near[:, None], skin[1], weights)
    for i, part in enumerate(parts):
        if part is not None:
            of_part = _feet(points[i:i + 1], mesh, mesh.face_parts == mesh.parts.index(part))
            faces[i], weights[i], distances[i] = (one[0] for one in of_part)
    return faces, weights, distances


def _part_lips(names: tuple[str, ...], points: NDArray, loose: NDArray, mesh: Mesh, extent: float,
               faces: NDArray, weights: NDArray) -> None:
    """Where closed lips or lids touch, a point lies on both: put the upper one's on the upper, in place."""
    at = dict(zip(names, points, strict=True))
    middles = None
    for i, name in enumerate(names):
        part = _UPPER_LOWER.match(name)
        if not part or not loose[i]:
            continue
        side = name[-1]
        high, low = ("mouth_top", "mouth_bottom") if name[0] == "m" else (f"brow_mid_{side}", f"eye_lower_{side}")
        if high not in at or low not in at:
            continue
        middles = mesh.vertices[mesh.faces].mean(axis=1) if middles is None else middles
        away = middles - points[i]
        own = (away @ (at[high] - at[low]) > 0) == (part[1] in ("top", "upper"))
        own &= np.einsum("ij,ij->i", away, away) < (_BESIDE * extent) ** 2
        if own.any():
            foot = _feet(points[i:i + 1], mesh, own)
            here = weights[i] @ mesh.vertices[mesh.faces[faces[i]]]
            if foot[2][0] <= np.linalg.norm(here - points[i]) + _TOUCHING * extent:
                faces[i], weights[i] = foot[0][0], foot[1][0]


def _feet(points: NDArray, mesh: Mesh, which: NDArray[np.bool_]):
    rows = np.flatnonzero(which)
    feet = ClosestPoints(Surface(mesh.vertices, mesh.faces[rows]))(points)
    return rows[feet.faces], feet.weights, feet.distances


def _extent(points: NDArray) -> float:
    """Return the diagonal of the places' box, the unit for distances."""
    return float(np.linalg.norm(np.ptp(points, axis=0)))


def _units(extent: float, mesh: Mesh) -> str:
    whole = _extent(mesh.vertices[np.unique(mesh.faces)])
    if extent > _OTHER_UNITS[0] * whole or extent < _OTHER_UNITS[1] * whole:
        return (f"the landmarks span {extent:.3g} and the mesh {whole:.3g}: give points in the mesh's own units and "
                "axes, as they stand in its file")
    return "set them on this mesh, in its own units and axes"


def _listed(names: list[str]) -> str:
    return ", ".join(names[:8]) + (f" and {len(names) - 8} more" if len(names) > 8 else "")

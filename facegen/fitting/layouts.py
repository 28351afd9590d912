"""Landmark layouts: numbered points that detectors give, and where they lie on a rig.

On the base face a file says so (meshes/akimoto/layouts.yaml). On any other rig a point that is a landmark lies at the
rig's own; the rest are carried over: the base face with its jaw open is bent so that its landmarks come to lie on the
rig's (thin-plate spline: F. Bookstein, "Principal warps", 1989), and the nearest skin is taken. The jaw is open
because closed lips lie on each other.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from facegen.data import meshes_dir
from facegen.errors import InputError, nearest
from facegen.face.face import Face, load_face
from facegen.face.landmarks import REQUIRED, Landmark, read_landmark
from facegen.facs.validate import Entry
from facegen.facs.yamlfile import read_data
from facegen.fitting.places import cage_rows, landmark_rows, skin_faces
from facegen.fitting.rigs import Rig
from facegen.geometry.closest import ClosestPoints
from facegen.geometry.normals import vertex_normals
from facegen.geometry.operators import Surface

_WIDEST = "27"              # opens the jaw
# Skin that faces away from the base face's by more than this cosine is the inside of a lip or a lid.
_FACING = -0.2
# Because with fewer landmarks in common nothing can be bent.
_LEAST = 6


@dataclass(frozen=True, eq=False)
class Layout:
    """``count``: points that a detector gives; ``indices`` (p,): those used; ``shares`` (p,): how much each counts;
    ``groups``: what each belongs to; ``places``: a landmark's name or a place on the base face's cage."""

    name: str
    about: str
    count: int
    indices: NDArray[np.int64]
    shares: NDArray[np.float64]
    groups: tuple[str, ...]
    why: dict[str, str]
    places: tuple[str | Landmark, ...]


def layout_names() -> tuple[str, ...]:
    """Return the names of the layouts."""
    return tuple(_layouts())


def load_layout(name: str) -> Layout:
    """Return a layout: "ibug68" or "mediapipe478". InputError for another name."""
    if name not in _layouts():
        raise InputError(f"layout: expected {', '.join(_layouts())}, got {name!r}{nearest(str(name), _layouts())}")
    return _layouts()[name]


@cache
def _layouts() -> dict[str, Layout]:
    path, face = meshes_dir() / "akimoto" / "layouts.yaml", load_face()
    faces = face.mesh(0).faces[face.mesh(0).face_parts == 0]
    n = int(faces.max()) + 1
    top = Entry(read_data(path), str(path)).fields(required=("source", "layouts"))
    found = {}
    for name, entry in top["layouts"].items():
        fields = entry.fields(required=("about", "count", "groups"))
        rows = []
        why = {}
        for group, one in fields["groups"].items():
            part = one.fields(required=("weight", "why", "points"))
            why[group] = part["why"].text()
            for index, place in part["points"].items():
                where = place.choice(face.landmarks, "landmark") if isinstance(place.value, str) else \
                    read_landmark(place, n, faces, face.mesh(0).parts)
                rows.append((int(index), part["weight"].number(0.0, 10.0), group, where))
        rows.sort(key=lambda row: row[0])
        indices, shares, groups, places = zip(*rows, strict=True)
        found[name] = Layout(name, fields["about"].text(), int(fields["count"].number(1, 1e6)), np.array(indices),
                             np.array(shares), groups, why, places)
    return found


@lru_cache(maxsize=16)
def layout_rows(face: Rig, layout: Layout) -> sparse.csr_array:
    """Return the weights (p, n) of the vertices of ``face.mesh()`` that place the points of a layout; a row of zeros
    for one that the rig has not (a pupil); kept. InputError for a rig whose landmarks are not known."""
    if face is load_face():
        return _base_rows(layout)
    known, rows = landmark_rows(face)
    if missing := [name for name in REQUIRED if name not in known]:
        raise InputError(f"layout: where {layout.name} lies on '{face.name}' follows from its landmarks, and it has no "
                         f"{', '.join(missing[:4])}{' ...' if len(missing) > 4 else ''}; facegen rig notes them")
    found = sparse.lil_array((len(layout.indices), rows.shape[1]))
    carried = []
    for row, place in enumerate(layout.places):
        if isinstance(place, str) and place in known:
            found[[row]] = rows[[known.index(place)]]
        elif not (isinstance(place, str) and place.startswith("eye_center")):
            carried.append(row)
    if carried:
        faces, corners = _carried(face, known, rows, _base_rows(layout)[carried])
        for row, at, weights in zip(carried, faces, corners, strict=True):
            found[row, at] = weights
    return sparse.csr_array(found)


def _base_rows(layout: Layout) -> sparse.csr_array:
    """Return the weights (p, n) on the base face."""
    face = load_face()
    known, rows = landmark_rows(face)
    cage = {str(k): place for k, place in enumerate(layout.places) if isinstance(place, Landmark)}
    found = sparse.lil_array((len(layout.places), rows.shape[1]))
    if cage:
        found[[int(k) for k in cage]] = cage_rows(face, cage)
    for k, place in enumerate(layout.places):
        if isinstance(place, str):
            found[[k]] = rows[[known.index(place)]]
    return sparse.csr_array(found)


def _carried(face: Rig, known: tuple[str, ...], rows: sparse.csr_array, wanted: sparse.csr_array
             ) -> tuple[NDArray, NDArray]:
    """Return the corners (q, 3) and their weights of the places on a rig that places of the base face mean."""
    from scipy.interpolate import RBFInterpolator

    base, mesh = load_face(), face.mesh()
    names = [name for name in base.landmarks if name in known and not name.startswith("eye_center")]
    open_base, open_rig = base.pose({_WIDEST: 1.0}), _open(face)
    if open_rig is None:
        open_base, open_rig = base.mesh().vertices, mesh.vertices
    base_known, base_rows = landmark_rows(base)
    source = base_rows[[base_known.index(name) for name in names]] @ open_base
    target = rows[[known.index(name) for name in names]] @ open_rig
    _, first = np.unique(source.round(6), axis=0, return_index=True)        # relief faces: lips in one place
    if len(first) < _LEAST:
        raise InputError(f"layout: the landmarks of '{face.name}' lie on each other")
    bend = RBFInterpolator(source[first], target[first], kernel="thin_plate_spline")
    skin = base.mesh().faces[base.mesh().face_parts == 0]
    normals = np.nan_to_num(vertex_normals(open_base, skin))
    faces = skin_faces(face, mesh)
    feet = ClosestPoints(Surface(open_rig, faces))(bend(wanted @ open_base), wanted @ normals, least_cosine=_FACING)
    lost = ~feet.found
    if lost.any():
        again = ClosestPoints(Surface(open_rig, faces))(bend(wanted @ open_base)[lost])
        feet.faces[lost], feet.weights[lost] = again.faces, again.weights
    return faces[feet.faces], feet.weights


def _open(face: Rig) -> NDArray[np.float64] | None:
    """Return the vertices (n, 3) with the jaw open, or None if nothing opens it."""
    if isinstance(face, Face):
        return face.pose({_WIDEST: 1.0})
    moves = face.opened()
    return None if moves is None else face.mesh().vertices + moves

"""The doors: a rig and what was measured in, a performance out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import sparse

from facegen.errors import InputError
from facegen.face.face import Face
from facegen.fitting.layouts import layout_rows, load_layout
from facegen.fitting.observed import observed
from facegen.fitting.places import marker_rows
from facegen.fitting.results import Fitted, told
from facegen.fitting.rigs import Rig, Wanted, rig_points, wanted
from facegen.fitting.sequence import Tracker, track
from facegen.fitting.solve import Rules
from facegen.fitting.views import Camera, Pinhole, Space, View, WeakCamera

Array = NDArray[np.float64]

MESH_NOISE, MARKER_NOISE, PICTURE_NOISE = 0.1, 0.5, 1.0
"""Noise that is assumed if none is given: millimetres of meshes and of markers, pixels of landmarks."""

# Of an avatar's vertices that a mesh is fitted by, this many are enough for any noise.
_MOST_VERTICES = 20_000
# Vertices that make less than this of the head's turn are of the neck.
_OF_HEAD = 0.999


def fit_meshes(face: Rig, vertices: ArrayLike, *, times: ArrayLike | None = None, fps: float = 25.0,
               shapes: str | Sequence[str] | None = None, neutral: Sequence[int] = (), scale: float | None = None,
               noise: float = MESH_NOISE, sparsity: float = Rules.sparsity, change: float = Rules.change,
               robust: bool = False) -> Fitted:
    """Return the weights and the pose that deform a rig into meshes of the same vertices.

    vertices: (n, v, 3), or (v, 3) for one, in the order of ``face.mesh().vertices``, any unit and frame. times: (n,)
        seconds, else by ``fps``. shapes: which weights, see `wanted`. neutral: frames in which a person other than the
        rig rests: movements are then counted from there. scale: units in a millimetre of the rig's, fitted if not
        given. noise: of a vertex in each direction, mm of the rig's. sparsity: one over the mean of a weight; change:
        how far a weight wanders in a second, a smaller number is steadier. robust: outliers count less.

    Raises InputError for vertices of another mesh. ::

        fit_meshes(face, [face.pose("happiness")]).performance.frame(0)      # {"L6": 0.8, "R6": 0.8, ...}
    """
    mesh, goals = face.mesh(), _frames("vertices", vertices, 3)
    if goals.shape[1] != len(mesh.vertices):
        raise InputError(f"vertices: expected {len(mesh.vertices)}, as '{face.name}' has, got {goals.shape[1]}: "
                         "another mesh, or a tool that merged or split vertices; place markers on it instead")
    rows = _mesh_rows(face)
    place = sparse.csr_array((np.ones(len(rows)), (np.arange(len(rows)), rows)), shape=(len(rows), len(mesh.vertices)))
    rules = _rules(noise, sparsity, change, robust)
    return _fitted(face, place, np.ones(len(rows)), goals[:, rows], Space(), wanted(face, shapes), rules, times, fps,
                   neutral, scale, "meshes")


def fit_markers(face: Rig, positions: ArrayLike, markers: Sequence[str] | Mapping[str, Any], *,
                times: ArrayLike | None = None, fps: float = 25.0, shapes: str | Sequence[str] | None = None,
                neutral: Sequence[int] = (), scale: float | None = None, noise: float = MARKER_NOISE,
                sparsity: float = Rules.sparsity, change: float = Rules.change, robust: bool = False) -> Fitted:
    """Return the weights and the pose that bring markers on a rig to where they were measured.

    positions: (n, p, 3) or (p, 3), any unit and frame; NaN where a marker was lost. markers: p names of landmarks, or
        name -> where it sits, see `marker_rows`. All else as in `fit_meshes`.

    Raises InputError. ::

        fit_markers(face, positions, {"chin": None, "m1": 812, "m2": [12.0, -60.0, 33.0]})
    """
    places = dict(markers) if isinstance(markers, Mapping) else _once(markers)
    goals = _frames("positions", positions, 3)
    if goals.shape[1] != len(places):
        raise InputError(f"positions: expected {len(places)} points a frame, one for each marker, got {goals.shape[1]}")
    rules = _rules(noise, sparsity, change, robust)
    want = wanted(face, shapes, dense=False)
    return _fitted(face, marker_rows(face, places), np.ones(len(places)), goals, Space(), want, rules, times, fps,
                   neutral, scale, "markers")


def fit_landmarks(face: Rig, landmarks: ArrayLike, layout: str | Mapping[str, Any], *, camera: Camera | None = None,
                  times: ArrayLike | None = None, fps: float = 25.0, shapes: str | Sequence[str] | None = None,
                  neutral: Sequence[int] = (), scale: float | None = None, noise: float | None = None,
                  sparsity: float = Rules.sparsity, change: float = Rules.change, robust: bool = False) -> Fitted:
    """Return the weights and the pose that show a rig's landmarks where they are in pictures.

    landmarks: (n, p, 2) or (p, 2) pixels, x to the right and y down, NaN where missing; of a layout all its points, in
        its order. With three numbers they are places in space (y up), of any unit and frame, and take no camera.
    layout: "ibug68", "mediapipe478", or markers as in `fit_markers`. camera: a `Pinhole`, or None for weak perspective,
        which leaves the distance open. noise: pixels, or mm. All else as in `fit_meshes`.

    Raises InputError. ::

        fit_landmarks(face, found, "ibug68", camera=Pinhole.of_view(60, (1280, 720)))
    """
    solid = np.ndim(landmarks) in (2, 3) and np.shape(landmarks)[-1] == 3
    if solid and camera is not None:
        raise InputError("camera: landmarks of three numbers are places in space and take none; give x and y alone")
    if scale is not None and not solid:
        raise InputError("scale: only places in space have one; a picture's follows from the camera")
    goals = _frames("landmarks", landmarks, 3 if solid else 2)
    place, share, indices = layout_points(face, layout, goals.shape[1])
    rules = _rules((MARKER_NOISE if solid else PICTURE_NOISE) if noise is None else noise, sparsity, change, robust)
    want, view = wanted(face, shapes, dense=False), Space() if solid else _camera(camera)
    return _fitted(face, place, share, goals[:, indices], view, want, rules, times, fps, neutral, scale,
                   layout if isinstance(layout, str) else "landmarks")


def landmark_tracker(face: Rig, layout: str | Mapping[str, Any], *, camera: Camera | None = None,
                     shapes: str | Sequence[str] | None = None, noise: float = PICTURE_NOISE,
                     sparsity: float = Rules.sparsity, change: float = Rules.change, robust: bool = False
                     ) -> tuple[Tracker, NDArray[np.int64]]:
    """Return what fits landmarks as they come, and which points (p,) of the layout it takes: ``step(found[used], s)``.

    ``tracker.points.weights(state.x)`` are the weights of a step, by ``tracker.points.names``.
    """
    place, share, indices = layout_points(face, layout, None)
    points = rig_points(face, place, wanted(face, shapes, dense=False))
    return Tracker(points, _camera(camera), share, _rules(noise, sparsity, change, robust)), indices


def layout_points(face: Rig, layout: str | Mapping[str, Any], count: int | None
                  ) -> tuple[sparse.csr_array, Array, NDArray[np.int64]]:
    """Return the weights (p, n) that place the points of a layout on a rig, how much each counts and its index.

    count: how many points there are, checked.
    """
    if isinstance(layout, Mapping):
        place, share, indices, expected = marker_rows(face, layout), np.ones(len(layout)), np.arange(len(layout)), \
            len(layout)
    else:
        table = load_layout(layout)
        place, expected = layout_rows(face, table), table.count
        has = np.diff(place.indptr) > 0
        place, share, indices = place[np.flatnonzero(has)], table.shares[has], table.indices[has]
    if count is not None and count != expected:
        name = layout if isinstance(layout, str) else "these markers"
        raise InputError(f"landmarks: expected {expected} points a frame, as {name} has, got {count}")
    return place, share, indices


def _mesh_rows(face: Rig) -> NDArray[np.int64]:
    """Return the vertices that a mesh is fitted by: of the head, for a neck and a body go another way."""
    mesh = face.mesh()
    if isinstance(face, Face):
        cage = face.mesh(0)                     # the surface at the cage's vertices, which keep their numbers
        offset = len(mesh.part_vertices("skin")) - len(cage.part_vertices("skin"))
        rows = np.concatenate([cage.part_vertices("skin"), *(cage.part_vertices(part) + offset for part in mesh.parts
                                                             if part.startswith(("eye", "teeth_lower", "tongue")))])
        return rows[face.neck_weight(2)[rows, 0] > _OF_HEAD]
    rows = face.focus if face.focus is not None else np.unique(mesh.faces)
    if face.notes.framed:
        rows = rows[face.neck_weight[rows, 0] > _OF_HEAD]
    return rows[::-(-len(rows) // _MOST_VERTICES)]


def _fitted(face: Rig, place: sparse.csr_array, share: Array, goals: Array, view: View, want: Wanted, rules: Rules,
            times: ArrayLike | None, fps: float, neutral: Sequence[int], scale: float | None, source: str) -> Fitted:
    """Return the fit of measurements (n, p, 2 or 3)."""
    n = len(goals)
    stamps = _times(times, fps, n)
    for k in neutral:
        if isinstance(k, bool) or not isinstance(k, (int, np.integer)) or not 0 <= k < n:
            raise InputError(f"neutral: expected frames 0..{n - 1}, got {k!r}")
    if scale is not None and not (np.isfinite(scale) and scale > 0.0):
        raise InputError(f"scale: expected a number above 0, got {scale!r}")
    valid = np.isfinite(goals).all(axis=2)
    if not valid.any():
        raise InputError(f"{source}: expected places, got NaN everywhere")
    points = rig_points(face, place, want)
    found = track(points, view, goals, share, stamps, rules, scale=scale, neutral=neutral)
    first = next((state for state in found.states if state is not None), None)
    if first is None:
        raise InputError(f"{source}: no frame has points enough for a pose: {4 if view.size == 2 else 3} or more that "
                         "are not on a line")
    seen = observed(found.points, found.view, first.pose, np.where(valid.any(axis=0), share, 0.0), rules.noise)
    return told(face, found, goals, share, want, seen, stamps, rules, source)


def _camera(camera: Camera | None) -> View:
    if camera is None:
        return WeakCamera()
    if not isinstance(camera, (WeakCamera, Pinhole)):
        raise InputError(f"camera: expected a Pinhole, a WeakCamera or None, got {type(camera).__name__}")
    return camera


def _rules(noise: float, sparsity: float, change: float, robust: bool) -> Rules:
    for name, value, low in (("noise", noise, 0.0), ("sparsity", sparsity, None), ("change", change, 0.0)):
        if isinstance(value, bool) or not isinstance(value, (int, float, np.number)) or not np.isfinite(value) or \
                value < 0.0 or (low is not None and value <= low):
            raise InputError(f"{name}: expected a number {'of 0 or more' if low is None else 'above 0'}, got {value!r}")
    return Rules(float(noise), float(sparsity), float(change), robust=bool(robust))


def _frames(name: str, values: ArrayLike, size: int) -> Array:
    """Return places as frames (n, p, size)."""
    try:
        array = np.asarray(values, np.float64)
    except (TypeError, ValueError):
        raise InputError(f"{name}: expected numbers of shape (frames, points, {size})") from None
    if array.ndim == 2:
        array = array[None]
    if array.ndim != 3 or array.shape[2] != size or not array.size:
        raise InputError(f"{name}: expected shape (frames, points, {size}), got {np.shape(values)}")
    return np.where(np.isinf(array), np.nan, array)


def _times(times: ArrayLike | None, fps: float, n: int) -> Array:
    if times is None:
        if not (np.isfinite(fps) and fps > 0.0):
            raise InputError(f"fps: expected a number above 0, got {fps!r}")
        return np.arange(n) / fps
    stamps = np.asarray(times, np.float64)
    if stamps.shape != (n,):
        raise InputError(f"times: expected {n}, one for each frame, got shape {stamps.shape}")
    return stamps


def _once(markers: Sequence[str]) -> dict[str, None]:
    names = list(map(str, markers))
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise InputError(f"markers: expected each once, got {', '.join(twice)} more often")
    return dict.fromkeys(names)

"""What lies at each pixel, as numbers: depth, normal, part, material and triangle, and where named points are.

One sample a pixel, at its centre: labels must not be mixed as colours are. The Z-buffer says which triangle is
in front; everything else is computed from that triangle in float64.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from facegen.errors import InputError
from facegen.geometry.camera import Camera, check_view, frame
from facegen.geometry.mesh import Mesh
from facegen.geometry.normals import face_normals, vertex_normals
from facegen.render.dress import portrait
from facegen.render.request import (
    SHADINGS,
    Rig,
    check_choice,
    check_in_front,
    check_size,
    neutral_mesh,
    posed_vertices,
)
from facegen.render.zbuffer import scan, seen_by, twice_area

# Name -> type and value of a pixel that shows nothing.
_EMPTY: dict[str, tuple[type, float]] = {
    "depth": (np.float32, math.inf), "normal": (np.float32, 0.0), "part": (np.uint8, 0), "material": (np.uint8, 0),
    "triangle": (np.int32, -1),
}
# Name -> the rig's method that places the points on posed vertices.
_POINTS = {"landmarks": "landmark_points", "feature_points": "feature_point_places"}
ARRAY_PASSES, POINT_PASSES = tuple(_EMPTY), tuple(_POINTS)
PASSES = (*ARRAY_PASSES, *POINT_PASSES)
# Pixels looked at together: bounds the memory, whatever the picture's size.
_BAND_PIXELS = 2**18
# The Z-buffer's corners are rounded to 1/256 pixel, so a centre may lie outside its triangle by that: weights of
# corners may leave 0..1 by this much, which keeps planes exact; more, in slivers, would shoot past the corners.
_SLACK = 0.01
# A point is hidden where a surface lies before it by more than this share of the mesh's diagonal: a millimetre or
# so on a head. Less is the surface that carries the point.
_HIDDEN = 0.003
# Names that 8 bits can tell apart, 0 being nothing.
_MOST_NAMES = 255


@dataclass(frozen=True, eq=False)
class Points:
    """Named points in a picture.

    names: (k,). places: (k, 3) in the mesh's axes and units. xy: (k, 2) pixels, (0.5, 0.5) is the centre of the first
    one. depth: (k,) in front of the camera, mesh units. visible: (k,) bool: inside the picture and not behind a
    surface.
    """

    names: tuple[str, ...]
    places: NDArray[np.float64]
    xy: NDArray[np.float64]
    depth: NDArray[np.float64]
    visible: NDArray[np.bool_]


class Passes(dict[str, Any]):
    """The passes by name, and what they refer to: ``camera``, and the names ``parts`` and ``materials``."""

    def __init__(self, camera: Camera, mesh: Mesh) -> None:
        super().__init__()
        self.camera, self.parts, self.materials = camera, mesh.parts, mesh.materials


def render_passes(thing: Mesh | Rig, pose: Any = None, *, passes: Sequence[str] = ("depth", "normal", "part"),
                  size: int | tuple[int, int] = 512, view: tuple[float, float] = (0.0, 0.0),
                  detail: int | None = None, person: Any = None, intensity: float = 1.0, shading: str = "smooth",
                  orthographic: bool = False, camera: Camera | None = None) -> Passes:
    """Return what each pixel's centre shows, as a dict of arrays (h, w), pixel for pixel beside `render`'s picture.

    passes: any of
        "depth"           float32, distance in front of the camera along its axis, mesh units; inf is nothing.
        "normal"          (h, w, 3) float32 unit vectors in camera axes (right, up, to the viewer), of the side that is
                          seen; 0 is nothing.
        "part"            uint8, index into the mesh's parts + 1; 0 is nothing. The names are in ``.parts``.
        "material"        uint8, the same for ``.materials``.
        "triangle"        int32, row of the mesh's faces; -1 is nothing.
        "landmarks"       `Points` with their places, pixels, depth and whether they are seen; of a face.
        "feature_points"  the same for the points that drive the deformation, where they lie on the surface.
    shading: "smooth" normals are interpolated and have length one, "flat" ones are the triangles' own.
    Everything else: see `Renderer`. The result also holds ``camera``.

    Raises InputError. ::

        found = facegen.render_passes(face, "happiness", passes=("depth", "landmarks"), size=256)
        found["depth"].min(), found["landmarks"].xy
    """
    size, view = check_size(size), check_view(view)
    wanted = check_passes(passes)
    check_choice("shading", shading, SHADINGS)
    mesh, level = neutral_mesh(thing, detail=detail, size=size, view=view, orthographic=orthographic,
                               flat=shading == "flat", camera=camera)
    for name in wanted:
        _check_possible(name, thing, mesh)
    vertices = posed_vertices(thing, pose, mesh, level, person=person, intensity=intensity)
    camera = camera or frame(portrait(thing, mesh.vertices), portrait(thing, vertices), size=size, view=view,
                             orthographic=orthographic)
    check_in_front("pose", vertices, mesh.faces, camera)
    posed = mesh.with_vertices(vertices)
    found = Passes(camera, posed)
    arrays = _arrays(posed, camera, [name for name in wanted if name in _EMPTY], flat=shading == "flat")
    for name in wanted:
        if name in arrays:
            found[name] = arrays[name]
        else:
            places = getattr(thing, _POINTS[name])(vertices, detail=level)
            found[name] = locate(places, posed, camera)
    return found


def check_passes(passes: Any) -> tuple[str, ...]:
    """Return the names of passes, each once, or raise InputError."""
    if isinstance(passes, str) or not isinstance(passes, Sequence) or not passes:
        raise InputError(f"passes: expected a list of names out of {', '.join(PASSES)}, got {passes!r}")
    for name in passes:
        check_choice("passes", name, PASSES)
    return tuple(dict.fromkeys(passes))


def locate(places: dict[str, NDArray], mesh: Mesh, camera: Camera) -> Points:
    """Return where points (name -> place (3,)) of a posed mesh are in a camera's picture, and whether they are seen.

    A point is looked up along its own ray, not in the depth pass, so that the answer does not depend on the pixels.
    """
    at = np.array(list(places.values()), dtype=np.float64).reshape(-1, 3)
    x, y, depth = camera.project(at).T
    inside = (x >= 0) & (x < camera.width) & (y >= 0) & (y < camera.height) & (depth > camera.near)
    corners = camera.project(mesh.vertices)[mesh.faces]
    corners = corners[(corners[..., 2] > camera.near).all(axis=1)]
    low, high = corners.min(axis=1), corners.max(axis=1)
    allowance = _HIDDEN * math.sqrt(((mesh.vertices.max(axis=0) - mesh.vertices.min(axis=0)) ** 2).sum())
    visible = inside.copy()
    for k in np.flatnonzero(inside):
        over = np.flatnonzero((low[:, 0] <= x[k]) & (high[:, 0] >= x[k]) & (low[:, 1] <= y[k]) & (high[:, 1] >= y[k])
                              & (low[:, 2] < depth[k] - allowance))
        weights = _weights(camera, corners[over], x[k], y[k])
        hit = (weights >= 0).all(axis=1) & np.isfinite(weights).all(axis=1)
        front = (weights * corners[over, :, 2]).sum(axis=1)
        visible[k] = not (hit & (front < depth[k] - allowance)).any()
    return Points(tuple(places), at, np.stack([x, y], axis=1), depth, visible)


def _check_possible(name: str, thing: Mesh | Rig, mesh: Mesh) -> None:
    """Raise InputError for a pass that this thing cannot have."""
    if name in _POINTS and not (hasattr(thing, _POINTS[name]) and len(getattr(thing, name, [name]))):
        raise InputError(f"passes: {name!r} needs a face that has them, e.g. facegen.load_face(), "
                         f"got {getattr(thing, 'name', None) or 'a ' + type(thing).__name__}")
    names = {"part": mesh.parts, "material": mesh.materials}.get(name, ())
    if len(names) > _MOST_NAMES:
        raise InputError(f"passes: {name!r} can tell {_MOST_NAMES} names apart, the mesh has {len(names)}; "
                         "take 'triangle' and look the names up")


def _arrays(mesh: Mesh, camera: Camera, wanted: list[str], *, flat: bool) -> dict[str, NDArray]:
    """Return the passes that have one value (or vector) a pixel."""
    if not wanted:
        return {}
    shape = (camera.height, camera.width)
    out = {name: np.full((*shape, 3) if name == "normal" else shape, _EMPTY[name][1], _EMPTY[name][0])
           for name in wanted}
    projected = camera.project(mesh.vertices)[mesh.faces]
    # The triangles of the side that is seen: clockwise in pixels, whose y runs down.
    back = twice_area(projected) > 0
    normals = (face_normals if flat else vertex_normals)(mesh.vertices, mesh.faces) @ camera.rotation.T
    for rows, columns, ids in _seen(mesh, camera):
        if "triangle" in out:
            out["triangle"][rows, columns] = ids
        for name, labels in (("part", mesh.face_parts), ("material", mesh.face_materials)):
            if name in out:
                out[name][rows, columns] = labels[ids] + 1
        if "depth" not in out and ("normal" not in out or flat):
            weights = None
        else:
            weights = _held(_weights(camera, projected[ids], columns + 0.5, rows + 0.5))
        if "depth" in out:
            out["depth"][rows, columns] = (weights * projected[ids, :, 2]).sum(axis=1)
        if "normal" in out:
            normal = normals[ids] if flat else np.einsum("kc,kci->ki", weights, normals[mesh.faces[ids]])
            normal /= np.maximum(np.sqrt((normal * normal).sum(axis=1)), 1e-12)[:, None]
            out["normal"][rows, columns] = np.where(back[ids, None], -normal, normal)
    return out


def _seen(mesh: Mesh, camera: Camera) -> Iterator[tuple[NDArray, NDArray, NDArray]]:
    """Yield rows, columns and the triangles in front of the covered pixels, band by band."""
    triangles = seen_by(camera, mesh, samples=1)
    band = max(1, _BAND_PIXELS // camera.width)
    for top in range(0, camera.height, band):
        ids = scan(triangles, top, min(top + band, camera.height))[0][:, 0]
        rows, columns = np.nonzero(ids >= 0)
        yield rows + top, columns, ids[rows, columns]


def _weights(camera: Camera, corners: NDArray, x: NDArray | float, y: NDArray | float) -> NDArray[np.float64]:
    """Return the corners' weights (k, 3) at pixel coordinates x, y in projected triangles (k, 3 corners, 3).

    In the picture the weights are the areas opposite the corners; on the surface each area counts by its corner's
    nearness (J. Blinn, "Hyperbolic interpolation", 1992). A triangle without area gets NaN or infinity.
    """
    right, down = corners[..., 0] - np.asarray(x)[..., None], corners[..., 1] - np.asarray(y)[..., None]
    after, before = [1, 2, 0], [2, 0, 1]
    areas = right[:, after] * down[:, before] - right[:, before] * down[:, after]
    if not camera.orthographic:
        areas = areas / corners[..., 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        return areas / areas.sum(axis=1, keepdims=True)


def _held(weights: NDArray) -> NDArray[np.float64]:
    """Return weights that leave their triangle by no more than the Z-buffer's rounding."""
    weights = np.clip(np.where(np.isnan(weights), 1 / 3, weights), -_SLACK, 1 + _SLACK)
    return weights / weights.sum(axis=1, keepdims=True)

"""From files to a fit: what kind of measurement they hold decides which door it goes through."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from facegen.errors import InputError
from facegen.face.face import load_face
from facegen.fitting.camera import parse_camera
from facegen.fitting.fit import MARKER_NOISE, MESH_NOISE, Fitted, fit_landmarks, fit_markers, fit_meshes
from facegen.fitting.layouts import layout_names, load_layout
from facegen.fitting.read import Measured, read_markers, read_measured

# Shares of a picture: MediaPipe's landmarks may lie a little outside it.
_LOW, _HIGH = -0.5, 1.5

Paths = str | os.PathLike[str] | Sequence[str | os.PathLike[str]]


def fit_files(paths: Paths, rig: str | Path = "akimoto", *, layout: str | None = None,
              markers: str | os.PathLike[str] | Mapping[str, Any] | None = None, camera: str | None = None,
              picture: tuple[int, int] | None = None, fps: float | None = None, person: str | None = None,
              noise: float | None = None, **how: Any) -> Fitted:
    """Return the fit of a rig to what files hold (docs/fit.md): meshes of its vertices, markers, or landmarks.

    paths: a file, a folder of meshes, or several meshes. rig: a face's name or path. layout: of numbered points, by
    default the one that has so many. markers: where named ones sit, or a file that says so; by default they are
    landmarks. camera: see `facegen.fitting.camera.parse_camera`; by default weak perspective. picture: its width and
    height, for shares of a picture as MediaPipe gives them. fps: before a file's own times. person: which face of a
    table. noise and how: as in `facegen.fit_landmarks`. Raises FileError or InputError. ::

        fit_files("openface.csv", "hero.glb", camera="fov=60", picture=(1280, 720)).performance
    """
    several = [paths] if isinstance(paths, (str, os.PathLike)) else list(paths)
    face = load_face(rig)
    found = read_measured([Path(path) for path in several], face, fps=fps, person=person)
    for name, value in (("layout", layout), ("camera", camera), ("picture", picture), ("markers", markers)):
        if found.kind == "meshes" and value is not None:
            raise InputError(f"{name}: meshes have none")
    how = {**how, "times": found.times, "fps": 25.0 if fps is None else fps}
    if found.times is not None and fps is not None:
        how["times"] = found.times
    if found.kind == "meshes":
        fitted = fit_meshes(face, found.values, noise=MESH_NOISE if noise is None else noise, **how)
    elif found.kind == "markers":
        fitted = _markers(face, found, markers, camera, picture, noise, layout, how)
    else:
        if markers is not None:
            raise InputError("markers: the points are numbered, not named; give their layout")
        values, lens = _pictured(found, layout := layout or _guessed(found), camera, picture)
        fitted = fit_landmarks(face, values, layout, camera=lens, noise=noise, **how)
    said = (*found.warnings, *fitted.performance.warnings)
    return replace(fitted, performance=replace(fitted.performance, warnings=said))


def _markers(face: Any, found: Measured, markers: Any, camera: str | None, picture: tuple[int, int] | None,
             noise: float | None, layout: str | None, how: dict[str, Any]) -> Fitted:
    """Return the fit of named markers, in space or in pictures."""
    if layout is not None:
        raise InputError("layout: the points are named, not numbered; a layout says nothing of them")
    given = {} if markers is None else dict(markers) if isinstance(markers, Mapping) else read_markers(Path(markers))
    given = {**found.places, **given}
    names = [name for name in found.names if name in given or not given or name in face.landmarks]
    if not names:
        raise InputError(f"markers: none of the points ({', '.join(found.names[:6])} ...) is placed")
    unplaced = [name for name in found.names if name not in names]
    values = found.values[:, [found.names.index(name) for name in names]]
    places = {name: given.get(name) for name in names}
    if values.shape[2] == 3:
        if camera is not None:
            raise InputError("camera: places in space take none; leave out the columns of z for landmarks in pictures")
        fitted = fit_markers(face, values, places, noise=MARKER_NOISE if noise is None else noise, **how)
    else:
        lens = parse_camera(camera or "weak", picture)
        fitted = fit_landmarks(face, values, places, camera=lens, noise=noise, **how)
    if not unplaced:
        return fitted
    said = f"no place on the rig is given for {', '.join(unplaced[:8])}{' ...' if len(unplaced) > 8 else ''}: left out"
    return replace(fitted, performance=replace(fitted.performance, warnings=(said, *fitted.performance.warnings)))


def _guessed(found: Measured) -> str:
    """Return the layout that has so many points."""
    count = found.values.shape[1]
    fits = [name for name in layout_names() if load_layout(name).count == count]
    if len(fits) != 1:
        raise InputError(f"layout: {count} points a frame are of none that is known ({', '.join(layout_names())}): "
                         "name the points and say where they sit")
    return fits[0]


def _pictured(found: Measured, layout: str, camera: str | None, picture: tuple[int, int] | None) -> tuple[Any, Any]:
    """Return landmarks in pixels with their camera, or in space with none."""
    values = found.values
    flat = values[..., :2][np.isfinite(values[..., :2]).all(axis=-1)]
    shares = bool(len(flat)) and flat.min() >= _LOW and flat.max() <= _HIGH
    solid = values.shape[2] == 3 and camera is None and picture is None and not shares and layout != "mediapipe478"
    if solid:
        return values, None
    values = values[..., :2]
    if shares:
        if picture is None:
            raise InputError("picture: the points are shares of a picture, 0..1: give its size, such as 1280x720")
        values = values * picture
    return values, parse_camera(camera or "weak", picture)

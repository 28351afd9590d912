"""Passes as files that any program reads: PNG for pictures, JSON for points and meanings, NPZ for exact numbers."""

from __future__ import annotations

import colorsys
import json
import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from facegen.errors import FileError, InputError
from facegen.fileio.images import write_whole
from facegen.fileio.textfile import save_text, whole_file
from facegen.geometry.camera import Camera
from facegen.render.passes import POINT_PASSES, Passes, Points, check_passes

# Steps of depth in 16 bits; 0 is nothing.
_DEPTH_STEPS = 65534
# Hue moves on by the golden angle, so that neighbouring labels never look alike.
_HUE_STEP = 0.6180339887498949


def pass_paths(passes: Iterable[str], prefix: str | os.PathLike[str], *, exact: bool = False) -> dict[str, Path]:
    """Return what `save_passes` writes, by name, or raise before any work if it could not be written.

    Raises InputError for the names, FileError for the place.
    """
    names = check_passes(list(passes))
    into = os.fspath(prefix).endswith(("/", os.sep))
    prefix = Path(prefix)
    folder, stem = (prefix, "") if into or not prefix.name else (prefix.parent, f"{prefix.name}.")
    if not folder.is_dir():
        raise FileError(f"{prefix}: the folder {folder} does not exist; make it first")
    paths = {name: folder / f"{stem}{name}.{'json' if name in POINT_PASSES else 'png'}" for name in names}
    paths["passes"] = folder / f"{stem}passes.json"
    if exact:
        paths["arrays"] = folder / f"{stem}passes.npz"
    for path in paths.values():
        if path.is_dir():
            raise FileError(f"{path}: is a folder, expected a file")
    return paths


def save_passes(passes: Passes, prefix: str | os.PathLike[str], *, exact: bool = False) -> dict[str, Path]:
    """Write passes as ``prefix.depth.png``, ``prefix.part.png`` ... and return the paths by name.

    prefix: the files' common beginning, such as "out/smile". One that ends in a slash is a folder, whose files are
        called depth.png ...
    exact: also write ``prefix.passes.npz`` with every array as it is.

    depth: 16-bit grey, distance = offset + step * value, 0 is nothing. normal: 8-bit RGB, n = value / 127.5 - 1, black
    is nothing. part, material: a palette picture whose indices are the labels. triangle: RGB, row =
    R + 256 G + 65536 B - 1. Points: JSON. ``prefix.passes.json`` says offset and step, the labels' names and colours,
    and the camera. Each file appears whole or not at all.

    Raises InputError, and FileError if a place cannot be written.
    """
    if not isinstance(passes, Passes):
        raise InputError(f"passes: expected what render_passes returned, got a {type(passes).__name__}")
    paths = pass_paths(passes, prefix, exact=exact)
    about: dict[str, Any] = {"size": [passes.camera.width, passes.camera.height], "camera": camera_data(passes.camera)}
    for name, value in passes.items():
        if isinstance(value, Points):
            save_text(json.dumps(points_data(value), indent=1) + "\n", paths[name])
        else:
            about[name] = _save_png(name, value, passes, paths[name])
    save_text(json.dumps(about, indent=1) + "\n", paths["passes"])
    if exact:
        _save_npz(passes, paths["arrays"])
    return paths


def points_data(points: Points) -> dict[str, dict[str, Any]]:
    """Return points as plain data: name -> xy, depth, visible and place, rounded to what a float32 knows."""
    return {name: {"xy": [round(float(c), 4) for c in xy], "depth": round(float(depth), 5), "visible": bool(visible),
                   "place": [round(float(c), 5) for c in place]}
            for name, xy, depth, visible, place in zip(points.names, points.xy, points.depth, points.visible,
                                                       points.places, strict=True)}


def camera_data(camera: Camera) -> dict[str, Any]:
    """Return a camera as plain data, whole: with these numbers any place can be projected again.

    ``extrinsics`` (3, 4) and ``intrinsics`` (3, 3): see `Camera`. Their axes are those of computer vision (y down, z
    away from the viewer), so z is the depth.
    """
    return {"projection": "orthographic" if camera.orthographic else "perspective",
            "extrinsics": camera.extrinsics.tolist(), "intrinsics": camera.intrinsics.tolist()}


def _save_png(name: str, array: NDArray, passes: Passes, path: Path) -> dict[str, Any]:
    """Write one pass as PNG and return what its values mean."""
    from PIL import Image  # lazy: most of facegen works without it

    about: dict[str, Any]
    if name == "depth":
        seen = np.isfinite(array)
        low, high = (float(array[seen].min()), float(array[seen].max())) if seen.any() else (0.0, 1.0)
        step = (high - low) / _DEPTH_STEPS or 1.0
        level = np.where(seen, np.where(seen, array, low).astype(np.float64) - low, 0.0) / step
        picture = Image.fromarray(np.where(seen, np.rint(level) + 1, 0).astype(np.uint16))
        about = {"offset": low - step, "step": step, "unit": "the mesh's", "nothing": 0}
    elif name == "normal":
        levels = np.rint((array + 1) * 127.5).astype(np.uint8)
        picture = Image.fromarray(np.where((array == 0).all(axis=2, keepdims=True), 0, levels).astype(np.uint8))
        about = {"axes": ["right", "up", "to the viewer"], "nothing": [0, 0, 0]}
    elif name == "triangle":
        code = (array + 1).astype(np.uint32)
        picture = Image.fromarray(np.stack([code & 255, code >> 8 & 255, code >> 16], axis=2).astype(np.uint8))
        about = {"row": "R + 256 G + 65536 B - 1", "nothing": [0, 0, 0]}
    else:
        names = ("nothing", *(passes.parts if name == "part" else passes.materials))
        colours = label_colours(len(names))
        picture = Image.fromarray(array)
        picture.putpalette([c for colour in colours for c in colour])
        about = {"labels": {label: {"value": k, "colour": list(colours[k])} for k, label in enumerate(names)}}
    write_whole(picture, path, f"{name} pass")
    return {"file": path.name, **about}


def label_colours(count: int) -> list[tuple[int, ...]]:
    """Return sRGB colours that are easily told apart, one for each label; label 0, nothing, is black."""
    colours: list[tuple[int, ...]] = [(0, 0, 0)]
    for k in range(1, count):
        colour = colorsys.hsv_to_rgb(0.07 + _HUE_STEP * (k - 1) % 1, (0.45, 0.75, 0.6)[k % 3], (0.95, 0.8)[k // 2 % 2])
        colours.append(tuple(round(255 * c) for c in colour))
    return colours[:count]


def _save_npz(passes: Passes, path: Path) -> None:
    """Write every array, and of points each field; read it with `numpy.load`."""
    arrays: dict[str, Any] = {}
    for name, value in passes.items():
        if isinstance(value, Points):
            arrays.update({f"{name}_{key}": np.asarray(field) for key, field in vars(value).items()})
        else:
            arrays[name] = value
    with whole_file(path, "the arrays ") as draft, open(draft, "wb") as file:
        np.savez_compressed(file, **arrays)

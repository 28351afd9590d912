"""What a caller may ask of a renderer, checked once, before any work."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from facegen.errors import InputError, nearest
from facegen.geometry.camera import Camera, frame
from facegen.geometry.mesh import Mesh
from facegen.render.dress import portrait
from facegen.render.zbuffer import twice_area

SMALLEST, LARGEST = 32, 4096
SHADINGS = ("smooth", "flat")
OCCLUSIONS = ("posed", "neutral", "off")
BACKGROUNDS = ("plain", "transparent")
MAX_DETAIL = 3
# Pixels that a typical triangle may cover before the next subdivision level is taken.
_TRIANGLE_PIXELS = 26.0


@runtime_checkable
class Rig(Protocol):
    """Anything that can be posed: a mesh at a detail (subdivision level), and vertices for a pose.

    It may also bring ``colours`` (material -> sRGB 0..255) and ``focus`` (the vertices that a portrait frames).
    """

    def mesh(self, detail: int) -> Mesh:
        """Return the neutral mesh."""

    def pose(self, what: Any, *, person: Any, intensity: float, detail: int) -> NDArray[np.float64]:
        """Return the posed vertices (n, 3)."""


@dataclass(frozen=True)
class Look:
    """How a mesh is drawn, whoever draws it. ``background``: "plain", "transparent" or sRGB (r, g, b).

    ``threads``: how many may work on one picture; None is as many as there are cores. ``shadows``: whether the key
    light casts shadows.
    """

    background: str | tuple[float, float, float] = "plain"
    flat: bool = False
    occlusion: str = "posed"
    threads: int | None = None
    shadows: bool = False


def check_look(*, background: str | Sequence[float] = "plain", shading: str = "smooth",
               occlusion: str = "posed", threads: int | None = None, shadows: bool = False) -> Look:
    """Return the look that was asked for or raise InputError."""
    check_choice("shading", shading, SHADINGS)
    check_choice("occlusion", occlusion, OCCLUSIONS)
    if threads is not None and (isinstance(threads, bool) or not isinstance(threads, (int, np.integer)) or threads < 1):
        raise InputError(f"threads: expected a whole number of 1 or more, or None for all cores, got {threads!r}")
    if not isinstance(shadows, (bool, np.bool_)):
        raise InputError(f"shadows: expected True or False, got {shadows!r}")
    return Look(_checked_background(background), shading == "flat", occlusion, threads, bool(shadows))


def check_size(size: object, *, argument: str = "size") -> tuple[int, int]:
    """Return a picture's size as (width, height) or raise InputError."""
    pair = tuple(size) if isinstance(size, (tuple, list)) else (size, size)
    whole = all(isinstance(s, (int, np.integer)) and not isinstance(s, bool) for s in pair)
    if len(pair) != 2 or not whole or not all(SMALLEST <= s <= LARGEST for s in pair):
        raise InputError(f"{argument}: expected pixels as a whole number or (width, height), "
                         f"each {SMALLEST}..{LARGEST}, got {size!r}")
    return int(pair[0]), int(pair[1])


def check_choice(argument: str, value: Any, valid: tuple[str, ...], *, also: str = "") -> None:
    """Raise InputError unless the value is one of the valid names."""
    if value not in valid:
        raise InputError(f"{argument}: expected {', '.join(valid)}{also}, "
                         f"got {value!r}{nearest(value, valid)}")


def neutral_mesh(thing: Mesh | Rig, *, detail: int | None, size: tuple[int, int], view: tuple[float, float],
                 orthographic: bool, flat: bool, camera: Camera | None) -> tuple[Mesh, int | None]:
    """Return the neutral mesh to draw and its subdivision level (None for a Mesh, which has but one)."""
    check_camera(camera)
    if isinstance(thing, Mesh):
        if detail is not None:
            raise InputError(f"detail: a Mesh has one level only; leave detail out or pass a face, got {detail!r}")
        level, mesh = None, thing
    elif isinstance(thing, Rig):
        if detail is None:
            level = 0 if flat else _fitting_detail(thing, size, view, orthographic, camera)
        else:
            level = _checked_detail(detail)
        mesh = thing.mesh(level)
    else:
        raise InputError(f"thing: expected a Mesh or a face, got {type(thing).__name__}")
    if not len(mesh.faces):
        raise InputError("thing: the mesh has no triangles, there is nothing to draw")
    check_finite("thing", mesh.vertices)
    check_extent("thing", mesh.vertices, mesh.faces)
    if camera is not None:
        check_in_front("camera", mesh.vertices, mesh.faces, camera)
    return mesh, level


def posed_vertices(thing: Mesh | Rig, pose: Any, neutral: Mesh, detail: int | None, *, person: Any,
                   intensity: float) -> NDArray[np.float64]:
    """Return the vertices (n, 3) of a pose; None is the neutral."""
    if isinstance(thing, Mesh):
        if person is not None:
            raise InputError(f"person: a Mesh has no expressions; leave person out or pass a face, got {person!r}")
        if pose is not None and not isinstance(pose, np.ndarray):
            raise InputError("pose: a Mesh can only be posed by an array of vertices; pass a face for "
                             f"{pose!r}, e.g. facegen.load_face()")
    if pose is None:
        return neutral.vertices
    posed = pose if isinstance(pose, np.ndarray) else thing.pose(pose, person=person, intensity=intensity,
                                                                 detail=detail)
    try:
        posed = np.asarray(posed, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError("pose: expected vertices as numbers, got an array of "
                         f"{np.asarray(posed).dtype}") from None
    if posed.shape != neutral.vertices.shape:
        raise InputError(f"pose: expected vertices of shape {neutral.vertices.shape}, got {posed.shape}")
    check_finite("pose", posed)
    check_extent("pose", posed, neutral.faces)
    return posed


def check_camera(camera: Camera | None) -> None:
    """Raise InputError for a camera that cannot draw; None, to be framed, can."""
    if camera is None:
        return
    if not isinstance(camera, Camera):
        raise InputError(f"camera: expected a facegen.geometry.camera.Camera or None, got {type(camera).__name__}")
    check_size((camera.width, camera.height), argument="camera")
    if not (0 < camera.distance < math.inf and 0 < camera.scale < math.inf):
        raise InputError("camera: expected a distance and a scale above 0, "
                         f"got {camera.distance!r} and {camera.scale!r}")


def check_in_front(argument: str, vertices: NDArray, faces: NDArray, camera: Camera) -> None:
    """Raise InputError for a mesh that a camera stands in: part of it before the near plane, part behind.

    A mesh wholly behind the camera is merely out of the picture.
    """
    towards = camera.rotation[2]
    depth = camera.distance + camera.target @ towards - vertices @ towards
    if depth.min() > camera.near:
        return
    depth = depth[np.unique(faces)]                     # a vertex that no triangle uses may lie anywhere
    behind = int((depth <= camera.near).sum())
    if 0 < behind < len(depth):
        raise InputError(f"{argument}: the camera stands inside the mesh or too near to it: {behind} of {len(depth)} "
                         "vertices lie behind its near plane; move the camera away (a larger distance), or leave "
                         "camera out to have the head framed")


def available_cores() -> int:
    """Return how many cores this process may use: fewer than the machine has, in a container for example."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def check_finite(argument: str, vertices: NDArray) -> None:
    """Raise InputError that names the first vertex that is not finite."""
    if not math.isfinite(float(vertices.sum())) and not np.isfinite(vertices).all():
        bad = int(np.flatnonzero(~np.isfinite(vertices).all(axis=1))[0])
        raise InputError(f"{argument}: expected finite vertices, vertex {bad} is {vertices[bad].tolist()}")


def check_extent(argument: str, vertices: NDArray, faces: NDArray) -> None:
    """Raise InputError for triangles that lie in one point."""
    first = vertices[faces[0, 0]]
    if not ((vertices[faces[:64]] != first).any() or (vertices[faces] != first).any()):
        raise InputError(f"{argument}: all triangles lie in one point, there is nothing to draw")


def _checked_detail(detail: object) -> int:
    if isinstance(detail, bool) or not isinstance(detail, (int, np.integer)) or not 0 <= detail <= MAX_DETAIL:
        raise InputError(f"detail: expected a subdivision level 0..{MAX_DETAIL}, got {detail!r}")
    return int(detail)


def _fitting_detail(rig: Rig, size: tuple[int, int], view: tuple[float, float], orthographic: bool,
                    camera: Camera | None) -> int:
    """Return the level at which the triangle under a typical pixel covers a few pixels."""
    mesh = rig.mesh(0)
    if not len(mesh.faces):
        return 0
    camera = camera or frame(portrait(rig, mesh.vertices), size=size, view=view, orthographic=orthographic)
    corners = camera.project(mesh.vertices)[mesh.faces]
    area, (x, y, _) = -twice_area(corners) / 2, np.moveaxis(corners, -1, 0)     # y runs down: the seen side is negative
    area = np.sort(area[(area > 0) & (x.max(axis=1) > 0) & (x.min(axis=1) < camera.width)
                        & (y.max(axis=1) > 0) & (y.min(axis=1) < camera.height)])
    if not len(area):
        return 0
    below = np.cumsum(area)
    typical = area[np.searchsorted(below, below[-1] / 2)]
    return int(np.clip(math.ceil(math.log(typical / _TRIANGLE_PIXELS, 4)), 0, MAX_DETAIL))


def _checked_background(background: Any) -> Any:
    if isinstance(background, str):
        check_choice("background", background, BACKGROUNDS, also=" or an sRGB colour (r, g, b)")
        return background
    return check_colour("background", background, also=f"{', '.join(BACKGROUNDS)} or ")


def check_colour(argument: str, value: Any, *, also: str = "") -> tuple[float, ...]:
    """Return an sRGB colour as three numbers 0..255 or raise InputError."""
    try:
        colour = tuple(float(c) for c in value)
    except (TypeError, ValueError):
        colour = ()
    if len(colour) != 3 or not all(0 <= c <= 255 for c in colour):
        raise InputError(f"{argument}: expected {also}an sRGB colour (r, g, b) of 0..255, got {value!r}")
    return colour

"""The one door from a mesh or a face to a picture."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from facegen.errors import InputError, nearest
from facegen.geometry.camera import Camera, check_view, frame
from facegen.geometry.mesh import Mesh
from facegen.geometry.normals import vertex_normals
from facegen.render.occlusion import visibility
from facegen.render.scene import Scene
from facegen.render.shading import from_srgb, shade, surface, to_srgb
from facegen.render.zbuffer import prepare, scan

SMALLEST, LARGEST = 32, 4096
SHADINGS = ("smooth", "flat")
OCCLUSIONS = ("posed", "neutral", "off")
BACKGROUNDS = ("plain", "transparent")
# Samples held at once: the picture is drawn in bands, so that its size does not decide the memory.
_BAND_SAMPLES = 2**18
# Share of the scene's depth within a pixel above which its four samples are shaded one by one.
_DEPTH_STEP = 0.01


@runtime_checkable
class Rig(Protocol):
    """Anything that can be posed: a mesh at a detail (subdivision level), and vertices for a pose."""

    def mesh(self, detail: int) -> Mesh:
        """Return the neutral mesh."""

    def pose(self, what: Any, *, person: Any, intensity: float, detail: int) -> NDArray[np.float64]:
        """Return the posed vertices (n, 3)."""


def render(thing: Mesh | Rig, pose: Any = None, *, size: int | tuple[int, int] = 512,
           view: tuple[float, float] = (0.0, 0.0), detail: int | None = None,
           background: str | Sequence[int] = "plain", person: Any = None, intensity: float = 1.0,
           shading: str = "smooth", occlusion: str = "posed", orthographic: bool = False,
           camera: Camera | None = None, scene: Scene | None = None) -> NDArray[np.uint8]:
    """Return a picture as (height, width, 4) uint8, sRGB with straight alpha.

    thing: a Mesh, or a face or other rig.
    pose: for a rig anything its ``pose`` takes ("happiness", "6C+12D", ...) or vertices (n, 3); for a mesh
        vertices (n, 3). None is the neutral.
    size: pixels, one number for a square or (width, height), 32..4096.
    view: (yaw, pitch) of the camera round the head in degrees; positive yaw goes to the subject's left,
    positive
        pitch up.
    detail: subdivision level of a rig, 0..3; None follows the size (and is 0 for flat shading).
    background: "plain" (light grey), "transparent" or an sRGB colour (r, g, b).
    person, intensity: passed to the rig's ``pose``.
    shading: "smooth" interpolates normals, "flat" shows the triangles as pictures of 1986 often did.
    occlusion: bake ambient occlusion on the "posed" mesh (right for open mouths), on the "neutral" (free
    after
        the first picture of an animation), or "off".
    orthographic: parallel projection instead of the portrait lens.
    camera: a ready camera instead of size, view and orthographic. scene: other lights and materials.

    Raises InputError. ::

        pixels = facegen.render(facegen.load_face(), "happiness", size=512, view=(30, 0))
    """
    width, height = check_size(size)
    view = check_view(view)
    ground = _checked_background(background)
    _choice("shading", shading, SHADINGS)
    _choice("occlusion", occlusion, OCCLUSIONS)
    scene = scene or Scene()
    neutral, mesh = _meshes(thing, pose, detail=detail, pixels=max(width, height), flat=shading == "flat",
                            person=person, intensity=intensity)
    if camera is None:
        camera = frame(neutral.vertices, None if mesh is neutral else mesh.vertices, size=(width, height),
                       view=view, orthographic=orthographic)
    baked = None if occlusion == "off" else mesh if occlusion == "posed" else neutral
    return draw(mesh, camera, scene, background=ground, flat=shading == "flat", baked=baked)


def draw(mesh: Mesh, camera: Camera, scene: Scene, *, background: Any = "plain", flat: bool = False,
         baked: Mesh | None = None) -> NDArray[np.uint8]:
    """Return the picture (h, w, 4) of checked arguments; ``baked``: the pose whose occlusion is used."""
    seen = None if baked is None else visibility(baked)
    normals = None if baked is None or baked is mesh else vertex_normals(baked.vertices, baked.faces)
    prepared = surface(mesh, camera, scene, flat=flat, seen=seen, seen_normals=normals)
    projected = camera.project(mesh.vertices)
    in_front = projected[:, 2] > camera.near
    near = camera.nearness(projected[:, 2])
    low, high = (near[in_front].min(), near[in_front].max()) if in_front.any() else (0.0, 1.0)
    # Kept off 0, which means "nothing" in the buffer.
    projected[:, 2] = np.where(in_front, 0.01 + 0.98 * (near - low) / max(high - low, 1e-12), np.nan)
    width, height = camera.width, camera.height
    triangles = prepare(projected, mesh.faces, width=width, height=height, samples=4)

    picture = np.empty((height, width, 4), np.uint8)
    rows = max(1, _BAND_SAMPLES // (4 * width))
    for top in range(0, height, rows):
        bottom = min(top + rows, height)
        light, cover = _band(triangles, prepared, camera, scene, top, bottom)
        picture[top:bottom] = _finished(light, cover, background, scene, top, height)
    return picture


def check_size(size: object) -> tuple[int, int]:
    """Return a picture's size as (width, height) or raise InputError."""
    pair = tuple(size) if isinstance(size, (tuple, list)) else (size, size)
    whole = all(isinstance(s, (int, np.integer)) and not isinstance(s, bool) for s in pair)
    if len(pair) != 2 or not whole or not all(SMALLEST <= s <= LARGEST for s in pair):
        raise InputError("size: expected pixels as a whole number or (width, height), "
                         f"each {SMALLEST}..{LARGEST}, got {size!r}")
    return int(pair[0]), int(pair[1])


def _band(triangles, prepared, camera, scene, top, bottom) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return premultiplied linear light (3, rows, width) and coverage (rows, width) of some pixel rows.

    A pixel whose four samples see one continuous piece of one material is shaded once, at its centre; any
    other pixel four times, at its samples.
    """
    ids, nearness = scan(triangles, top, bottom)
    rows, samples, width = ids.shape
    light = np.zeros((3, rows, width), np.float32)
    hit = ids >= 0
    cover = hit.mean(axis=1, dtype=np.float32)
    kind = np.where(hit, (2 * prepared.material + prepared.back)[ids], -1)
    one = ((kind == kind[:, :1]).all(axis=1) & hit[:, 0]
           & (nearness.max(axis=1) - nearness.min(axis=1) < np.float32(_DEPTH_STEP)))
    y, x = np.nonzero(one)
    light[:, y, x] = shade(prepared, camera, scene, ids[y, 1, x], x + 0.5, y + (top + 0.5))

    y, x = np.nonzero(hit.any(axis=1) & ~one)
    mixed = ids[y, :, x]                                                        # (k, samples)
    k, s = np.nonzero(mixed >= 0)
    total = np.zeros((3, len(y), samples), np.float32)
    across, down = np.array(triangles.sample_x)[s], top + (s + 0.5) / samples
    total[:, k, s] = shade(prepared, camera, scene, mixed[k, s], x[k] + across, y[k] + down)
    light[:, y, x] = total.mean(axis=2)
    return light, cover


def _finished(light, cover, background, scene, top, height) -> NDArray[np.uint8]:
    """Return the band (rows, width, 4) over its background: resolved in linear light, then sRGB."""
    rows, width = cover.shape
    out = np.empty((rows, width, 4), np.uint8)
    if isinstance(background, str) and background == "transparent":
        light = light / np.maximum(cover, np.float32(1e-6))
        out[..., 3] = np.rint(cover * 255)
    else:
        if isinstance(background, str):
            share = ((top + np.arange(rows) + 0.5) / height)[:, None]
            high, low = (np.array(c, np.float64) for c in scene.background)
            behind = np.array([from_srgb(tuple(c)) for c in high + (low - high) * share]).T[:, :, None]
        else:
            behind = from_srgb(background)[:, None, None]
        light = light + behind * (1 - cover)
        out[..., 3] = 255
    out[..., :3] = np.moveaxis(to_srgb(light), 0, -1)
    return out


def _meshes(thing, pose, *, detail, pixels, flat, person, intensity) -> tuple[Mesh, Mesh]:
    """Return the neutral and the posed mesh."""
    if isinstance(thing, Mesh):
        if detail is not None:
            raise InputError("detail: a Mesh has one level only; leave detail out or pass a face, "
                             f"got {detail!r}")
        if person is not None:
            raise InputError("person: a Mesh has no expressions; leave person out or pass a face, "
                             f"got {person!r}")
        if pose is not None and not isinstance(pose, np.ndarray):
            raise InputError("pose: a Mesh can only be posed by an array of vertices; pass a face for "
                             f"{pose!r}, e.g. facegen.load_face()")
        neutral = thing
    elif isinstance(thing, Rig):
        detail = _checked_detail(detail, pixels, flat)
        neutral = thing.mesh(detail)
    else:
        raise InputError(f"thing: expected a Mesh or a face, got {type(thing).__name__}")
    if not len(neutral.faces):
        raise InputError("thing: the mesh has no triangles, there is nothing to draw")
    _finite("thing", neutral.vertices)
    if pose is None:
        return neutral, neutral
    if isinstance(pose, np.ndarray):
        posed = pose
    else:
        posed = thing.pose(pose, person=person, intensity=intensity, detail=detail)
    try:
        posed = np.asarray(posed, dtype=np.float64)
    except (TypeError, ValueError):
        kind = np.asarray(posed).dtype
        raise InputError(f"pose: expected vertices as numbers, got an array of {kind}") from None
    if posed.shape != neutral.vertices.shape:
        raise InputError(f"pose: expected vertices of shape {neutral.vertices.shape}, got {posed.shape}")
    _finite("pose", posed)
    return neutral, neutral.with_vertices(posed)


def _checked_detail(detail: int | None, pixels: int, flat: bool) -> int:
    if detail is None:
        return 0 if flat else 1 if pixels < 96 else 2 if pixels <= 1024 else 3
    if isinstance(detail, bool) or not isinstance(detail, (int, np.integer)) or not 0 <= detail <= 3:
        raise InputError(f"detail: expected a subdivision level 0..3, got {detail!r}")
    return int(detail)


def _checked_background(background: Any) -> Any:
    if isinstance(background, str):
        _choice("background", background, BACKGROUNDS, also=" or an sRGB colour (r, g, b)")
        return background
    try:
        colour = tuple(float(c) for c in background)
    except (TypeError, ValueError):
        colour = ()
    if len(colour) != 3 or not all(0 <= c <= 255 for c in colour):
        raise InputError(f"background: expected {', '.join(BACKGROUNDS)} or an sRGB colour (r, g, b) of "
                         f"0..255, got {background!r}")
    return colour


def _choice(argument: str, value: Any, valid: tuple[str, ...], *, also: str = "") -> None:
    if value not in valid:
        raise InputError(f"{argument}: expected {', '.join(valid)}{also}, "
                         f"got {value!r}{nearest(value, valid)}")


def _finite(argument: str, vertices: NDArray) -> None:
    if not math.isfinite(float(vertices.sum())) and not np.isfinite(vertices).all():
        bad = int(np.flatnonzero(~np.isfinite(vertices).all(axis=1))[0])
        raise InputError(f"{argument}: expected finite vertices, vertex {bad} is {vertices[bad].tolist()}")

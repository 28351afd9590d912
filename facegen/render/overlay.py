"""The mesh's edges drawn over a picture, as the figures of 1986 show their triangles.

Based on: J. Bærentzen, S. Nielsen, M. Gjøl, B. Larsen, "Single-pass wireframe rendering", 2006: each sample knows
the triangle in front and measures its distance to that triangle's sides. What is hidden has no sample, so no depth
is compared, no line is broken and none shows through.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from facegen.errors import InputError
from facegen.geometry.camera import Camera
from facegen.geometry.mesh import Mesh
from facegen.render.request import Rig, check_choice, check_colour
from facegen.render.zbuffer import scan, seen_by, twice_area

LINES = ("mesh", "cage")
_THINNEST, _THICKEST = 0.2, 50.0
# Triangles smaller than this many line widths get thinner ink, so that dense parts do not turn black.
_DENSE = 9.0
# Samples held at once, whatever the picture's size.
_BAND_SAMPLES = 2**19


@dataclass(frozen=True)
class Wireframe:
    """How edges are drawn. ``colour``: sRGB 0..255. ``width``: pixels. ``opacity``: 0..1.

    ``lines``: "mesh" draws every edge of the triangles, "cage" only the edges of a face's cage, along the smooth skin.
    ``parts``: names of the parts to draw on; None is all.
    """

    colour: tuple[float, float, float] = (34, 38, 46)
    width: float = 1.0
    opacity: float = 0.8
    lines: str = "mesh"
    parts: Sequence[str] | None = None


def check_wireframe(wireframe: Any, thing: Mesh | Rig, mesh: Mesh, detail: int | None
                    ) -> tuple[Wireframe, NDArray[np.bool_]] | None:
    """Return the wireframe asked for and which sides (m, 3) of the triangles it draws; None for none. InputError."""
    if wireframe is None or wireframe is False:
        return None
    look = Wireframe() if wireframe is True else wireframe
    if not isinstance(look, Wireframe):
        raise InputError(f"wireframe: expected True, False or a Wireframe, got {wireframe!r}")
    check_colour("wireframe.colour", look.colour)
    _check_number("wireframe.width", look.width, _THINNEST, _THICKEST)
    _check_number("wireframe.opacity", look.opacity, 0.0, 1.0)
    check_choice("wireframe.lines", look.lines, LINES)
    if look.lines == "cage" and not hasattr(thing, "cage_sides"):
        raise InputError("wireframe.lines: 'cage' needs a face that has one, such as the base face; take 'mesh' for "
                         f"{getattr(thing, 'name', None) or 'a ' + type(thing).__name__}")
    sides = thing.cage_sides(detail) if look.lines == "cage" else np.ones(mesh.faces.shape, bool)
    if look.parts is not None:
        if isinstance(look.parts, str):
            raise InputError(f"wireframe.parts: expected a list of names, got {look.parts!r}")
        for part in look.parts:
            check_choice("wireframe.parts", part, mesh.parts)
        chosen = np.array([part in look.parts for part in mesh.parts])
        sides = sides & chosen[mesh.face_parts][:, None]
    return look, sides


def draw_wireframe(picture: NDArray[np.uint8], mesh: Mesh, camera: Camera, look: Wireframe,
                   sides: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """Return a picture (h, w, 4) of a posed mesh with its edges over it.

    Blended in sRGB: thin dark lines keep the weight they have on paper, where linear light would thin them.
    """
    projected = camera.project(mesh.vertices)
    corners = projected[mesh.faces][..., :2]
    lines = _side_lines(corners)
    area = twice_area(projected[mesh.faces])
    alone = _alone(mesh.faces, area < 0)
    reach = np.where(sides, look.width / 2 * (1 + alone), -np.inf).astype(np.float32)
    size = np.sqrt(np.abs(area)) / (_DENSE * look.width)
    thinned = np.ones_like(size) if look.lines == "cage" else np.minimum(size, 1.0)
    strength = np.where(alone, 1.0, thinned[:, None]).astype(np.float32)
    # Lines are round where they meet: a triangle that only touches one there would leave a notch in it.
    met = np.zeros(len(projected), bool)
    met[mesh.faces[sides]] = met[mesh.faces[:, [1, 2, 0]][sides]] = True
    joint = np.where(met[mesh.faces], look.width / 2, -np.inf).astype(np.float32)
    triangles = seen_by(camera, mesh, samples=4)
    across = np.array(triangles.sample_x)
    out = picture.copy()
    clear = picture[..., 3] < 255
    rows = max(1, _BAND_SAMPLES // (4 * camera.width))
    for top in range(0, camera.height, rows):
        ids = scan(triangles, top, min(top + rows, camera.height))[0]
        y, s, x = np.nonzero(ids >= 0)
        triangle = ids[y, s, x]
        place = np.stack([x + across[s], top + y + (s + 0.5) / 4], axis=1)
        line = lines[triangle]
        distance = np.abs(line[..., 0] * place[:, :1] + line[..., 1] * place[:, 1:] + line[..., 2])
        apart = corners[triangle] - place[:, None]
        from_corner = np.sqrt((apart * apart).sum(axis=2))
        within = np.maximum(reach[triangle] - distance, joint[triangle] - from_corner)
        inked = (strength[triangle] * np.clip(within + np.float32(0.5), 0, 1)).max(axis=1)
        pixel = y * camera.width + x
        ink = np.bincount(pixel, inked, minlength=len(ids) * camera.width).reshape(len(ids), camera.width)
        # Where nothing is behind the picture, a pixel's colour is that of its covered samples alone.
        covered = np.where(clear[top:top + rows], (ids >= 0).sum(axis=1), 4)
        share = look.opacity * ink / np.maximum(covered, 1)
        band = out[top:top + rows, :, :3]
        band[:] = np.rint(band + share[..., None] * (np.array(look.colour, float) - band))
    return out


def _side_lines(corners: NDArray) -> NDArray[np.float64]:
    """Return (m, 3 sides, 3): a, b, c of each side's line, a x + b y + c its signed distance in pixels."""
    start, end = corners, corners[:, [1, 2, 0]]
    along = end - start
    length = np.sqrt((along * along).sum(axis=2))
    with np.errstate(divide="ignore", invalid="ignore"):
        a, b = -along[..., 1] / length, along[..., 0] / length
    a, b = np.nan_to_num(a), np.nan_to_num(b)
    far = np.where(length > 0, 0.0, np.inf)                    # a side without length has no line
    return np.stack([a, b, far - (a * start[..., 0] + b * start[..., 1])], axis=2)


def _alone(faces: NDArray, front: NDArray) -> NDArray[np.bool_]:
    """Return which sides (m, 3) have no triangle beyond them that is seen from the same side: borders, the outline.

    Only one triangle draws their line, so it draws both halves. front: (m,) seen from outside.
    """
    start, end = faces.astype(np.int64), faces[:, [1, 2, 0]].astype(np.int64)
    edge = (np.minimum(start, end) * (int(faces.max()) + 1) + np.maximum(start, end)).ravel()
    _, which = np.unique(edge, return_inverse=True)
    fronts = np.bincount(which, np.repeat(front, 3))[which].reshape(-1, 3)
    backs = np.bincount(which, np.repeat(~front, 3))[which].reshape(-1, 3)
    return np.where(front[:, None], fronts, backs) < 2


def _check_number(argument: str, value: Any, low: float, high: float) -> None:
    number = isinstance(value, (int, float, np.integer, np.floating)) and not isinstance(value, bool)
    if not number or not low <= value <= high:
        raise InputError(f"{argument}: expected a number {low:g}..{high:g}, got {value!r}")

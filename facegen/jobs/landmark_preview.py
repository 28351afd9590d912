"""A sheet that shows where landmarks lie: the head from the front, from beside the front and from the side."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from facegen.fileio.avatar import AvatarFile
from facegen.fileio.images import check_image_path, contact_sheet, save_image
from facegen.geometry.mesh import Mesh
from facegen.landmarking.proposals import Proposal, Proposals
from facegen.render.render import Renderer
from facegen.transfer.alignment import Similarity

VIEWS = {"front": (0.0, 0.0), "three-quarter": (35.0, 0.0), "side": (80.0, 0.0)}
# sRGB of a place that was given, and of proposed ones from unsure to sure.
_GIVEN, _UNSURE, _HALF, _SURE = (40, 90, 230), (215, 40, 40), (235, 165, 20), (25, 150, 70)
# Millimetres of the base face round the face's middle that are shown, and in how much more detail than a point.
_AROUND = 105.0
_MIDDLE = np.array([0.0, -32.0, 0.0])
# A place whose surface looks away from the viewer by more than this is not drawn: it is on the other side.
_AWAY = -0.15


def save_landmark_preview(avatar: AvatarFile, found: Proposals, path: str | os.PathLike[str], *, size: int = 640
                          ) -> Path:
    """Draw a mesh from three sides with its landmarks: blue where given, else from red (unsure) to green (sure).

    size: pixels of each picture. The sheet appears whole or not at all. Raises InputError or FileError.
    """
    path = check_image_path(path)
    frame = found.frame or Similarity(1.0, np.eye(3), np.zeros(3))
    mesh = avatar.mesh.with_vertices(frame.inverse().apply(avatar.mesh.vertices))
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * _AROUND + _MIDDLE
    if found.frame is None:
        corners = mesh.vertices
    pictures = []
    for view in VIEWS.values():
        camera = _camera(corners, size, view)
        renderer = Renderer(Mesh.of(mesh.vertices, mesh.faces), size=size, view=view, camera=camera)
        pictures.append(_marked(renderer, mesh, found, frame))
    return save_image(contact_sheet(pictures, list(VIEWS), len(VIEWS)), path)


def _camera(corners: NDArray, size: int, view: tuple[float, float]):
    from facegen.geometry.camera import frame

    return frame(corners, size=(size, size), view=view)


def _marked(renderer: Renderer, mesh: Mesh, found: Proposals, frame: Similarity) -> NDArray[np.uint8]:
    """Return the picture of one view with its points and names."""
    from PIL import Image, ImageDraw

    picture = Image.fromarray(renderer.draw())
    draw = ImageDraw.Draw(picture)
    camera = renderer.camera
    radius = max(2.0, camera.width / 200)
    taken: list[tuple[float, float]] = []
    for name, one in sorted(found.items(), key=lambda item: item[1].confidence):
        normal = _normal(one, mesh)
        if normal @ camera.rotation[2] < _AWAY:
            continue
        at = frame.inverse().apply(one.xyz)
        x, y, _ = camera.project(at[None])[0]
        colour = colour_of(one)
        draw.ellipse([x - radius, y - radius, x + radius, y + radius], fill=colour, outline=(255, 255, 255))
        side = 1 if normal @ camera.rotation[0] >= 0 else -1
        label = (x + side * 2 * radius, y)
        while any(abs(label[1] - v) < 10 and abs(label[0] - u) < 60 for u, v in taken):
            label = (label[0], label[1] + 5)
        taken.append(label)
        draw.text(label, name, fill=colour, anchor="lm" if side > 0 else "rm", stroke_width=1,
                  stroke_fill=(255, 255, 255))
    return np.asarray(picture)


def colour_of(one: Proposal) -> tuple[int, int, int]:
    """Return the colour (sRGB) of a landmark by how sure it is."""
    if one.given:
        return _GIVEN
    low, high, share = (_UNSURE, _HALF, 2 * one.confidence) if one.confidence < 0.5 else \
        (_HALF, _SURE, 2 * one.confidence - 1)
    return tuple(round(a + (b - a) * min(max(share, 0.0), 1.0)) for a, b in zip(low, high, strict=True))


def _normal(one: Proposal, mesh: Mesh) -> NDArray[np.float64]:
    a, b, c = mesh.vertices[mesh.faces[one.face]]
    normal = np.cross(b - a, c - a)
    return normal / max(float(np.linalg.norm(normal)), 1e-300)

"""A picture of the base face with one landmark marked: what to look for on the avatar."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from facegen.face.face import load_face
from facegen.geometry.camera import Camera, frame
from facegen.render.render import render
from facegen.studio.landmark_words import WORDS

SIZE = 260
"""Pixels of a side."""

DETAIL = 2
# Half of what is seen round the middle of a part, mm; and the angles, degrees, from which it is seen best.
_REACH = {"eye_L": 26.0, "eye_R": 26.0, "nose": 36.0, "mouth": 36.0, "jaw": 62.0, "brow_L": 36.0, "brow_R": 36.0,
          "side": 88.0, "neck": 88.0, "whole": 125.0}
_MIDDLE = {"eye_L": (30.0, 5.0, 12.0), "eye_R": (-30.0, 5.0, 12.0), "nose": (0.0, -28.0, 25.0),
           "mouth": (0.0, -68.0, 25.0), "jaw": (0.0, -62.0, 0.0), "brow_L": (31.0, 8.0, 15.0),
           "brow_R": (-31.0, 8.0, 15.0), "side": (0.0, -45.0, -40.0), "neck": (0.0, -80.0, -40.0),
           "whole": (0.0, -14.0, -55.0)}
# What is seen where that is not the part that is looked at on the avatar.
_SEEN = {"brow_inner": "brow", "brow_mid": "brow", "brow_outer": "brow", "jaw": "side", "jaw_angle": "side",
         "neck": "neck"}
_VIEW = {"nose_base": (0.0, -28.0), "nose_tip": (25.0, 0.0), "nose_bridge": (20.0, 0.0), "chin": (25.0, 0.0),
         "jaw_L": (65.0, 0.0), "jaw_R": (-65.0, 0.0), "jaw_angle_L": (65.0, 0.0), "jaw_angle_R": (-65.0, 0.0),
         "temple_L": (50.0, 0.0), "temple_R": (-50.0, 0.0), "head_top": (25.0, 45.0), "head_back": (150.0, 15.0),
         "brow_outer_L": (25.0, 0.0), "brow_outer_R": (-25.0, 0.0), "neck": (30.0, 0.0)}
# Lips are shown a little apart where it matters which of them is meant.
_PARTED = "25C+26B"
_MARK, _RIM = (224, 74, 32), (255, 255, 255)


@lru_cache(maxsize=64)
def guide(name: str) -> NDArray[np.uint8]:
    """Return the picture (SIZE, SIZE, 3) uint8 for a landmark."""
    vertices = _posed(name.startswith("mouth_inner"))
    base, side = (name[:-2], name[-2:]) if name[-2:] in ("_L", "_R") else (name, "")
    seen = _SEEN.get(base, WORDS[name].part)
    camera = _camera(seen + side if seen == "brow" else seen, view_of(name))
    at = load_face().landmark_points(vertices, detail=DETAIL)[name]
    return _marked(render(load_face(), vertices, detail=DETAIL, camera=camera, threads=1)[..., :3],
                   camera.project(at[None])[0, :2])


def view_of(name: str) -> tuple[float, float]:
    """Return the angles (yaw, pitch), degrees, from which a landmark is seen best."""
    return _VIEW.get(name, (0.0, 0.0))


def room_of(part: str) -> tuple[NDArray[np.float64], float]:
    """Return the middle (3,) of a part of the base face and how far it reaches round that, mm. part: of `VIEWS`."""
    return np.asarray(_MIDDLE[part]), _REACH[part]


@lru_cache(maxsize=2)
def _posed(parted: bool) -> NDArray[np.float64]:
    return load_face().pose(_PARTED if parted else "neutral", detail=DETAIL)


def _camera(part: str, view: tuple[float, float]) -> Camera:
    """Return a camera that sees a part of the base face."""
    corners = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1).T / np.sqrt(3.0)
    return frame(np.asarray(_MIDDLE[part]) + _REACH[part] * corners, None, size=(SIZE, SIZE), view=view)


def _marked(picture: NDArray[np.uint8], at: NDArray) -> NDArray[np.uint8]:
    """Return the picture with a dot in a ring at a place, pixels."""
    from PIL import Image, ImageDraw  # lazy: facegen works without it

    finer = 3                                       # Pillow does not smooth what it draws
    image = Image.fromarray(picture).resize((SIZE * finer, SIZE * finer), Image.Resampling.BICUBIC)
    draw = ImageDraw.Draw(image)
    x, y = at * finer
    for radius, width, colour in ((13, 5, _RIM), (12, 3, _MARK)):
        draw.ellipse([x - radius * finer, y - radius * finer, x + radius * finer, y + radius * finer], outline=colour,
                     width=width * finer // 2)
    for radius, colour in ((4.2, _RIM), (3, _MARK)):
        draw.ellipse([x - radius * finer, y - radius * finer, x + radius * finer, y + radius * finer], fill=colour)
    return np.asarray(image.resize((SIZE, SIZE), Image.Resampling.LANCZOS))

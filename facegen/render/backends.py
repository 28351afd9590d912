"""The renderers behind the door: which there are, which one is taken, and what is missing where one cannot be."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace
from importlib import import_module
from importlib.util import find_spec
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from facegen.errors import InputError
from facegen.geometry.camera import Camera, frame
from facegen.geometry.mesh import Mesh
from facegen.render.request import Look, check_choice
from facegen.render.scene import Scene


class Backend(Protocol):
    """Draws poses of one mesh for one camera."""

    def draw(self, vertices: NDArray[np.float64]) -> NDArray[np.uint8]:
        """Return the picture (h, w, 4) of checked vertices (n, 3)."""


# Name -> where it lives. Imported when asked for: all but the first need packages that not everybody has.
_HOMES = {
    "soft": ("facegen.render.soft", "SoftBackend"),
    "fast": ("facegen.render.fast", "FastBackend"),
    "gl": ("facegen.render.gl", "GlBackend"),
}
# Name -> the package without which it cannot be; the extra of facegen that brings it has the renderer's name.
_NEEDS = {"fast": "numba"}

RENDERERS = ("auto", *_HOMES)
# Fewer pixels than these, in all pictures together, are drawn by NumPy before the compiled renderer has been compiled.
_WORTH_COMPILING = 6e6


def choose(renderer: str, *, pictures: int | None = None, pixels: int = 0, now: bool = False) -> str:
    """Return the name of the renderer to use; InputError for one that is unknown or whose package is missing.

    "auto" is the compiled renderer where numba is installed and ``pictures`` of so many ``pixels`` are worth its
    start; None is an unknown, large number. That it is in memory counts only for what is drawn ``now``: a film that
    goes on after a stop must choose again as it did.
    """
    check_choice("renderer", renderer, RENDERERS)
    if renderer == "auto":
        worth = pictures is None or pictures * pixels >= _WORTH_COMPILING
        loaded = now and _HOMES["fast"][0] in sys.modules
        return "fast" if (worth or loaded) and find_spec("numba") else "soft"
    if renderer in _NEEDS and find_spec(_NEEDS[renderer]) is None:
        raise InputError(f"renderer: {renderer!r} needs the package {_NEEDS[renderer]}, which is not installed: "
                         f'pip install "facegen[{renderer}]", or leave renderer out')
    return renderer


def warm(name: str, *, coloured: bool = False) -> None:
    """Have a renderer compiled, which happens once on a machine: before several processes do it at the same time.

    coloured: for vertices with colours of their own, which are drawn by code of their own.
    """
    if name == "fast":
        triangle = Mesh.of(np.eye(3), [[0, 1, 2]])
        triangle = replace(triangle, colours=np.zeros((3, 3))) if coloured else triangle
        load(name)(triangle, frame(triangle.vertices, size=(32, 32)), Scene(), Look()).draw(triangle.vertices)


def load(name: str) -> Callable[[Mesh, Camera, Scene, Look], Backend]:
    """Return the class of a renderer."""
    module, kind = _HOMES[name]
    return getattr(import_module(module), kind)

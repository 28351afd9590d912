"""The renderers behind the door: which there are, which one is taken, and what is missing where one cannot be."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from facegen.geometry.camera import Camera
from facegen.geometry.mesh import Mesh
from facegen.render.request import Look, check_choice
from facegen.render.scene import Scene


class Backend(Protocol):
    """Draws poses of one mesh for one camera."""

    def draw(self, vertices: NDArray[np.float64]) -> NDArray[np.uint8]:
        """Return the picture (h, w, 4) of checked vertices (n, 3)."""


# Name -> where it lives. Imported when asked for: two of them need packages that not everybody has.
_HOMES = {
    "soft": ("facegen.render.soft", "SoftBackend"),
    "fast": ("facegen.render.fast", "FastBackend"),
}

RENDERERS = ("auto", *_HOMES)


def choose(renderer: str, *, once: bool = False, pixels: int = 0) -> str:
    """Return the name of the renderer to use; InputError for an unknown one."""
    check_choice("renderer", renderer, RENDERERS)
    return "soft" if renderer == "auto" else renderer


def load(name: str) -> Callable[[Mesh, Camera, Scene, Look], Backend]:
    """Return the class of a renderer."""
    module, kind = _HOMES[name]
    return getattr(import_module(module), kind)

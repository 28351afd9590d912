"""From places in the recorder's frame to what is measured of them: in space, or in a picture.

The recorder's frame is facegen's: +x is to the subject's left when they face the recorder, +y up, +z from the face
towards the recorder; millimetres; a camera stands at the origin and looks along -z. Pictures have x to the right and
y down, in pixels.
"""

from __future__ import annotations

import math
import numbers
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from facegen.errors import InputError

Array = NDArray[np.float64]

# Because a place nearer than this many millimetres to the camera has no picture.
_NEAR = 1.0
# Degrees of a field of view that a lens which is no fisheye has.
_WIDEST = 160.0


class View(Protocol):
    """A projection with a zoom factor; ``zooms`` says whether a fit may change it, ``size``: of a measurement."""

    zooms: bool
    size: int
    unit: str

    def project(self, places: Array, zoom: float) -> Array:
        """Return measurements (p, size) of places (p, 3)."""

    def slopes(self, places: Array, zoom: float) -> tuple[Array, Array]:
        """Return how they change with the places, (p, size, 3), and with the zoom's logarithm, (p, size)."""


@dataclass(frozen=True)
class Space:
    """Places are measured as they are, in a unit of which a millimetre of the rig's has ``zoom``."""

    zooms: bool = False
    size: int = 3
    unit: str = "mm"

    def project(self, places: Array, zoom: float) -> Array:
        """Return (p, 3)."""
        return zoom * places

    def slopes(self, places: Array, zoom: float) -> tuple[Array, Array]:
        """Return (p, 3, 3) and (p, 3)."""
        return np.broadcast_to(zoom * np.eye(3), (len(places), 3, 3)), zoom * places


@dataclass(frozen=True)
class WeakCamera:
    """Weak perspective: a picture without depth, whose scale is fitted. For a camera that nothing is known of.

    centre: the picture's middle in pixels, from which the head's place is counted.
    """

    centre: tuple[float, float] = (0.0, 0.0)
    zooms: bool = field(default=True, init=False)
    size: int = field(default=2, init=False)
    unit: str = field(default="px", init=False)

    def project(self, places: Array, zoom: float) -> Array:
        """Return (p, 2), pixels."""
        return np.asarray(self.centre) + zoom * places[:, :2] * (1.0, -1.0)

    def slopes(self, places: Array, zoom: float) -> tuple[Array, Array]:
        """Return (p, 2, 3) and (p, 2)."""
        one = np.array([[zoom, 0.0, 0.0], [0.0, -zoom, 0.0]])
        return np.broadcast_to(one, (len(places), 2, 3)), zoom * places[:, :2] * (1.0, -1.0)


@dataclass(frozen=True)
class Pinhole:
    """A camera with perspective. ``focal``: pixels in x and y; ``centre``: where it looks, pixels. No lens distortion:
    take it out of the landmarks before.

    Raises InputError for a focal length that no camera has. ::

        Pinhole.of_view(60.0, (1280, 720))          # 60 degrees across 1280 pixels
    """

    focal: tuple[float, float]
    centre: tuple[float, float]
    zooms: bool = field(default=False, init=False)
    size: int = field(default=2, init=False)
    unit: str = field(default="px", init=False)

    def __post_init__(self) -> None:
        focal, centre = _two("focal", self.focal), _two("centre", self.centre)
        if min(focal) <= 0.0:
            raise InputError(f"camera: focal: expected pixels above 0, got {min(focal):g}")
        object.__setattr__(self, "focal", focal)
        object.__setattr__(self, "centre", centre)

    @classmethod
    def of_view(cls, degrees: float, picture: tuple[float, float]) -> Pinhole:
        """Return the camera whose view is so many degrees across a picture (width, height), looking at its middle."""
        width, height = _two("picture", picture)
        if not isinstance(degrees, numbers.Real) or not 0.0 < degrees < _WIDEST:
            raise InputError(f"camera: fov: expected degrees above 0 and below {_WIDEST:g}, got {degrees!r}")
        if min(width, height) <= 0.0:
            raise InputError(f"camera: picture: expected a size above 0, got {width:g} x {height:g}")
        focal = width / 2.0 / math.tan(math.radians(degrees) / 2.0)
        return cls((focal, focal), (width / 2.0, height / 2.0))

    def project(self, places: Array, zoom: float = 1.0) -> Array:
        """Return (p, 2), pixels; what is behind the camera is drawn as if just before it."""
        away = np.maximum(-places[:, 2], _NEAR)
        return np.asarray(self.centre) + places[:, :2] * np.array([self.focal[0], -self.focal[1]]) / away[:, None]

    def slopes(self, places: Array, zoom: float = 1.0) -> tuple[Array, Array]:
        """Return (p, 2, 3) and zeros (p, 2)."""
        away = np.maximum(-places[:, 2], _NEAR)
        slopes = np.zeros((len(places), 2, 3))
        slopes[:, 0, 0], slopes[:, 1, 1] = self.focal[0] / away, -self.focal[1] / away
        slopes[:, 0, 2] = self.focal[0] * places[:, 0] / away**2
        slopes[:, 1, 2] = -self.focal[1] * places[:, 1] / away**2
        return slopes, np.zeros((len(places), 2))


Camera = WeakCamera | Pinhole


def fixed(view: View, zooms: bool) -> View:
    """Return a view in space whose scale may change or not; cameras say so themselves."""
    return replace(view, zooms=zooms) if isinstance(view, Space) else view


def _two(name: str, value: Sequence[float]) -> tuple[float, float]:
    try:
        first, second = (float(one) for one in value)
    except (TypeError, ValueError):
        raise InputError(f"camera: {name}: expected two numbers, got {value!r}") from None
    if not (math.isfinite(first) and math.isfinite(second)):
        raise InputError(f"camera: {name}: expected two finite numbers, got {value!r}")
    return first, second

"""The camera: looks at the head from a direction and frames it like a portrait lens."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from facegen.errors import InputError

# Angle that a sphere round the head fills. Because a portrait is taken from about a metre and a half: a wider
# lens comes closer and makes the nose large.
FIELD_OF_VIEW = 16.0
# Share of the picture kept free on each side of the neutral head.
MARGIN = 0.08
# Share kept free when a pose leaves the neutral's frame and the frame must grow.
POSED_MARGIN = 0.03
# Nearest depth that is drawn, as a share of the camera's distance.
NEAR = 0.02


@dataclass(frozen=True, eq=False)
class Camera:
    """A pinhole (or orthographic) camera.

    ``rotation`` (3, 3): rows are the picture's right, its up and the direction towards the viewer, in the
    world's axes. ``target`` (3,): the point looked at, ``distance`` in front of the camera (the mesh's
    units). ``scale``: pixels a unit at the target's depth. ``offset``: the target's place in the picture,
    pixels. Pixel coordinates run right and down; the centre of the first pixel is (0.5, 0.5).
    """

    rotation: NDArray[np.float64]
    target: NDArray[np.float64]
    distance: float
    scale: float
    offset: tuple[float, float]
    width: int
    height: int
    orthographic: bool = False

    @property
    def near(self) -> float:
        """Depth in front of which nothing is drawn."""
        return NEAR * self.distance

    @property
    def extrinsics(self) -> NDArray[np.float64]:
        """World to camera, (3, 4): ``[R | t] @ (x, y, z, 1)`` is a place in the axes that computer vision is used to.

        These are: x to the picture's right, y DOWN, z forward, away from the viewer; the camera is the origin. Mesh
        units.
        """
        axes = self.rotation * np.array([[1.0], [-1.0], [-1.0]])
        return np.column_stack([axes, np.array([0.0, 0.0, self.distance]) - axes @ self.target])

    @property
    def intrinsics(self) -> NDArray[np.float64]:
        """Camera to pixels, (3, 3): ``K @ (X / Z, Y / Z, 1)`` for a place (X, Y, Z) in the axes of ``extrinsics``.

        For an orthographic camera ``K @ (X, Y, 1)``. The centre of the first pixel is (0.5, 0.5).
        """
        focal = self.scale * (1.0 if self.orthographic else self.distance)
        return np.array([[focal, 0.0, self.offset[0]], [0.0, focal, self.offset[1]], [0.0, 0.0, 1.0]])

    def project(self, vertices: ArrayLike) -> NDArray[np.float64]:
        """Return (..., n, 3): x and y in pixels, and depth in front of the camera in the mesh's units.

        Vertices at or behind the camera keep their depth and get the x and y of the near plane.
        """
        local = (np.asarray(vertices, dtype=np.float64) - self.target) @ self.rotation.T
        depth = self.distance - local[..., 2]
        zoom = self.scale if self.orthographic else self.scale * self.distance / np.maximum(depth, self.near)
        x, y = self.offset[0] + zoom * local[..., 0], self.offset[1] - zoom * local[..., 1]
        return np.stack([x, y, depth], axis=-1)

    def nearness(self, depth: ArrayLike) -> NDArray[np.float64]:
        """Return a quantity that grows towards the viewer and is linear over a triangle in the picture.

        That is 1 / depth for a pinhole, -depth for an orthographic camera.
        """
        depth = np.asarray(depth, dtype=np.float64)
        return -depth if self.orthographic else 1.0 / np.maximum(depth, self.near)

    def rays(self, x: NDArray, y: NDArray) -> tuple[NDArray, NDArray, NDArray]:
        """Return the unit vector from the surface towards the viewer at pixel coordinates, in camera axes."""
        if self.orthographic:
            return np.zeros_like(x), np.zeros_like(x), np.ones_like(x)
        focal = x.dtype.type(self.scale * self.distance)
        right, down = (x - x.dtype.type(self.offset[0])) / focal, (y - y.dtype.type(self.offset[1])) / focal
        length = 1 / np.sqrt(right * right + down * down + 1)
        return -right * length, down * length, length


def view_rotation(view: tuple[float, float]) -> NDArray[np.float64]:
    """Return the camera's axes as rows (right, up, towards the viewer) for a view (yaw, pitch) in degrees.

    Yaw turns the camera round the head towards the subject's left, pitch raises it: (0, 0) looks at the face,
    (90, 0) at the left ear, (0, 30) from above.
    """
    yaw, pitch = (math.radians(angle) for angle in check_view(view))
    back = np.array([math.sin(yaw) * math.cos(pitch), math.sin(pitch), math.cos(yaw) * math.cos(pitch)])
    right = np.array([math.cos(yaw), 0.0, -math.sin(yaw)])
    return np.stack([right, np.cross(back, right), back])


def check_view(view: object) -> tuple[float, float]:
    """Return a view as (yaw, pitch) or raise InputError; yaw within +-360, pitch within +-90 degrees."""
    try:
        yaw, pitch = (float(angle) for angle in view)  # type: ignore[attr-defined]
    except (TypeError, ValueError):
        raise InputError(f"view: expected two angles in degrees, (yaw, pitch), got {view!r}") from None
    if not (abs(yaw) <= 360 and abs(pitch) <= 90):
        raise InputError("view: expected yaw within +-360 and pitch within +-90 degrees, "
                         f"got ({yaw:g}, {pitch:g})")
    return yaw, pitch


def frame(vertices: ArrayLike, posed: ArrayLike | None = None, *, size: tuple[int, int],
          view: tuple[float, float] = (0.0, 0.0), orthographic: bool = False) -> Camera:
    """Return a camera that shows all of a head, with a margin, at a size (width, height) in pixels.

    vertices: (n, 3), the neutral head: it alone decides the frame, so that poses of one face stay comparable.
    posed: (k, 3) a pose: where it would leave the frame, the frame grows to hold both.
    """
    vertices = np.asarray(vertices, dtype=np.float64)
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    target = (low + high) / 2
    radius = math.sqrt(((vertices - target) ** 2).sum(axis=1).max()) or 1.0
    distance = radius / math.sin(math.radians(FIELD_OF_VIEW / 2))
    width, height = size
    unit = Camera(view_rotation(view), target, distance, 1.0, (0.0, 0.0), width, height, orthographic)
    camera = _fitted(unit, vertices, MARGIN)
    if posed is not None:
        x, y, _ = np.moveaxis(camera.project(posed), -1, 0)
        inset = POSED_MARGIN * min(width, height)
        if min(x.min(), y.min()) < inset or x.max() > width - inset or y.max() > height - inset:
            camera = _fitted(unit, np.concatenate([vertices, np.asarray(posed)]), POSED_MARGIN, camera.scale)
    return camera


def _fitted(unit: Camera, vertices: NDArray, margin: float, largest: float = math.inf) -> Camera:
    """Return the camera whose scale (at most ``largest``) and offset fit the projection in: no search."""
    points = unit.project(vertices)[..., :2]
    low, high = points.min(axis=0), points.max(axis=0)
    free = np.array([unit.width, unit.height]) - 2 * margin * min(unit.width, unit.height)
    scale = min(largest, float((free / np.maximum(high - low, 1e-9 * unit.distance)).min()))
    x, y = np.array([unit.width, unit.height]) / 2 - scale * (low + high) / 2
    return replace(unit, scale=scale, offset=(float(x), float(y)))

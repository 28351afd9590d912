"""The shape of the cartoon's head: a smooth union of ellipsoids, and the measures all pieces share.

After I. Quilez, "Smooth minimum" (2013) and "Ellipsoid - SDF" (2008). Units: the head is two high; +x subject's left, +y up,
+z forward, origin in the middle of the skull.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Distance = Callable[[Array], Array]          # of points (n, 3): negative inside

EYE = np.array([0.395, 0.12, 0.49])        # centre of the left eyeball
EYE_RADIUS = 0.345
LID = 0.034                                # thickness of a lid
LID_GAP = 0.006                            # between lid and eyeball: more than a chord of the margin cuts off the ball
EAR = np.array([0.852, 0.05, -0.02])       # root of the left ear
MOUTH = -0.535                             # height of the slit in the middle
MOUTH_HALF = 0.29                          # half its width
SLIT = 0.0032                              # neutral gap between the lips in the middle
MIRROR = np.array([-1.0, 1.0, 1.0])



def _ellipsoid(p: Array, centre: Sequence[float], radii: Sequence[float]) -> Array:
    """Return the signed distance from an ellipsoid, to first order: exact at the surface."""
    q = p - np.asarray(centre)
    near = np.linalg.norm(q / radii, axis=1)
    slope = np.linalg.norm(q / np.square(radii), axis=1)
    return near * (near - 1.0) / np.maximum(slope, 1e-9)


def _pair(p: Array, centre: Sequence[float], radii: Sequence[float], blend: float = 0.02) -> Array:
    """Return the distance from an ellipsoid and its mirror image."""
    return _join(_ellipsoid(p, centre, radii), _ellipsoid(p * MIRROR, centre, radii), blend)


def _join(a: Array, b: Array, blend: float) -> Array:
    """Return the union of two shapes, rounded over ``blend``."""
    h = np.maximum(blend - np.abs(a - b), 0.0) / blend
    return np.minimum(a, b) - h * h * blend / 4.0


def _neck(p: Array) -> Array:
    """Return the distance from an endless column that leans back a little."""
    axis = -0.10 + 0.04 * np.clip(-p[:, 1] - 0.8, 0.0, 1.0)
    return np.hypot(p[:, 0], p[:, 2] - axis) - 0.31


def head_shape(p: Array) -> Array:
    """Return the signed distance (about) of the head without eyes and ears."""
    d = _ellipsoid(p, (0.0, 0.18, -0.08), (0.86, 0.85, 0.86))                  # skull
    d = _join(d, _ellipsoid(p, (0.0, -0.38, 0.04), (0.84, 0.58, 0.76)), 0.30)  # lower face
    d = _join(d, np.maximum(_neck(p), p[:, 1] + 0.5), 0.14)
    d = _join(d, _pair(p, (0.50, -0.36, 0.40), (0.31, 0.27, 0.30)), 0.22)      # cheeks
    d = _join(d, _ellipsoid(p, (0.0, -0.50, 0.58), (0.42, 0.24, 0.27)), 0.24)  # muzzle
    d = _join(d, _ellipsoid(p, (0.0, -0.76, 0.60), (0.30, 0.20, 0.22)), 0.14)  # chin
    return _join(d, _pair(p, (0.36, 0.50, 0.53), (0.30, 0.13, 0.16)), 0.16)    # brow ridge


def face_shape(p: Array) -> Array:
    """Return the signed distance (about) of head and lids, without the ball of the nose."""
    d = head_shape(p)
    d = _join(d, _pair(p, EYE, (EYE_RADIUS + LID,) * 3), 0.05)
    return _join(d, _ellipsoid(p, (0.0, 0.06, 0.80), (0.09, 0.22, 0.12)), 0.10)    # bridge of the nose


def shape(p: Array) -> Array:
    """Return the signed distance (about) of the whole but the ears."""
    nose = _ellipsoid(p, (0.0, -0.185, 0.95), (0.195, 0.165, 0.185))
    nose = _join(nose, _pair(p, (0.15, -0.225, 0.87), (0.105, 0.095, 0.11)), 0.12)
    return _join(face_shape(p), nose, 0.05)


def onto(p: Array, surface: Distance = shape, steps: int = 40) -> Array:
    """Return points moved onto a shape along its gradient."""
    p = np.array(p, float)
    h = 1e-5
    for _ in range(steps):
        d = surface(p)
        slope = np.stack([(surface(p + h * e) - surface(p - h * e)) / (2 * h) for e in np.eye(3)], axis=1)
        p -= 0.9 * d[:, None] * slope / np.maximum((slope**2).sum(axis=1, keepdims=True), 1e-6)
    return p


def front(x: Array | float, y: Array | float, surface: Distance = head_shape) -> Array:
    """Return z of the foremost surface at places (x, y), by bisection."""
    x, y = np.broadcast_arrays(np.asarray(x, float), np.asarray(y, float))
    low, high = np.zeros(x.shape), np.full(x.shape, 1.6)
    for _ in range(50):
        middle = (low + high) / 2
        inside = surface(np.stack([x, y, middle], axis=-1).reshape(-1, 3)).reshape(x.shape) < 0
        low, high = np.where(inside, middle, low), np.where(inside, high, middle)
    return low

"""Where the rings of the skin lie round eyes, mouth, nose and ears: each counter-clockwise, seen from outside.

Those of the left side are written down; those of the right are their mirror images.
"""

from __future__ import annotations

import numpy as np
from head import EAR, EYE, EYE_RADIUS, MIRROR, MOUTH, MOUTH_HALF, Array, face_shape, front, head_shape, onto

AROUND_EYE, AROUND_MOUTH, AROUND_NOSE, AROUND_EAR = 20, 20, 16, 12        # vertices of a ring
AROUND_LIDS = 2 * AROUND_EYE               # of the rings at the lids' edge: it closes on itself over the whole eyeball
# How pointed the corners of the opening are, and until so many degrees outside it: round ones crumple as lids close.
POINTED, POINTED_UNTIL = 0.6, 15.0


def turns(count: int) -> tuple[Array, Array]:
    """Return cosine and sine of the angles of a ring's vertices."""
    angle = 2 * np.pi * np.arange(count) / count
    return np.cos(angle), np.sin(angle)


def mirrored(ring: Array) -> Array:
    """Return a ring's mirror image, again counter-clockwise from its right."""
    n = len(ring)
    return ring[(n // 2 - np.arange(n)) % n] * MIRROR


def _eye_axes() -> Array:
    """Return the rows outwards, up, forwards of the opening: it looks a little to the side."""
    yaw, pitch = np.radians(9.0), np.radians(-1.0)
    forward = np.array([np.sin(yaw) * np.cos(pitch), np.sin(pitch), np.cos(yaw) * np.cos(pitch)])
    out = np.cross([0.0, 1.0, 0.0], forward)
    out /= np.linalg.norm(out)
    return np.stack([out, np.cross(forward, out), forward])


def lid_ring(outside: float, radius: float, count: int = AROUND_EYE) -> Array:
    """Return a ring round the left eye: ``outside`` degrees outside the margin, at a distance from the centre.

    Starts at the outer corner and goes over the upper lid to the inner one.
    """
    c, s = turns(count)
    side = np.where(c > 0, 50.0, 43.0) + outside * np.where(c > 0, 1.0, 0.8)
    high = np.where(s > 0, 36.0, 38.0) + outside * np.where(s > 0, 1.0, 0.75)
    pointed = POINTED * max(1.0 - outside / POINTED_UNTIL, 0.0)
    across, up = side * c, high * s * np.abs(s) ** pointed
    up += np.where(s > 0, 3.0 * s * s * -c, 0.0) + 2.0 * np.abs(c) ** 3 * np.sign(c)     # the arch leans inwards
    turn = np.radians(np.hypot(across, up))[:, None]
    flat = np.stack([across, up], axis=1) / np.maximum(np.hypot(across, up), 1e-9)[:, None]
    out, upward, forward = _eye_axes()
    direction = np.cos(turn) * forward + np.sin(turn) * (flat[:, :1] * out + flat[:, 1:] * upward)
    return EYE + radius * direction


def orbit_ring() -> Array:
    """Return the loop round the left eye where the lids' skin goes over into the face."""
    c, s = turns(AROUND_EYE)
    beside_nose = np.where((c < 0) & (s < 0), 1.0 - 0.45 * np.abs(c * s), 1.0)
    x = EYE[0] + 0.325 * c
    y = EYE[1] + np.where(s > 0, 0.44, 0.335) * s * beside_nose
    return on_lids(np.stack([x, y, 0 * x], axis=1), lid_ring(27.0, EYE_RADIUS))


def on_lids(ahead: Array, around: Array) -> Array:
    """Return rings round the left eye on the face: the inner half of ``ahead`` goes there along z, the outer half of
    ``around`` away from the ball, for there the face turns away."""
    outer = np.clip(1.4 * turns(AROUND_EYE)[0] - 0.1, 0.0, 1.0)[:, None]
    ahead = np.stack([*ahead[:, :2].T, front(ahead[:, 0], ahead[:, 1], face_shape)], axis=1)
    return onto((1.0 - outer) * ahead + outer * from_ball(around), face_shape)


def from_ball(points: Array) -> Array:
    """Return where rays from the left eyeball's centre through points leave the face first: steps, then bisection."""
    ray = (points - EYE) / np.linalg.norm(points - EYE, axis=1, keepdims=True)
    reach, step = np.full(len(ray), EYE_RADIUS), 0.004
    for _ in range(150):
        reach += np.where(face_shape(EYE + reach[:, None] * ray) < 0, step, 0.0)
    low, high = reach - step, reach
    for _ in range(40):
        middle = (low + high) / 2
        inside = face_shape(EYE + middle[:, None] * ray) < 0
        low, high = np.where(inside, middle, low), np.where(inside, high, middle)
    return EYE + low[:, None] * ray


def mouth_ring(half: float, above: float, below: float, ahead: float, *, flat: bool = False) -> Array:
    """Return a ring round the slit: its half width, heights over and under the slit, and how far before the face.

    flat: the depth is measured from the height of the slit, for what lies deep inside.
    """
    c, s = turns(AROUND_MOUTH)
    x = half * c
    s = np.sign(s) * np.abs(s) ** 0.6 if flat else s
    y = MOUTH + 0.055 * (x / MOUTH_HALF) ** 2 + np.where(s > 0, above, below) * s
    return np.stack([x, y, front(x, MOUTH if flat else y) + ahead], axis=1)


def nose_ring(polar: float) -> Array:
    """Return a ring round the nose, ``polar`` degrees from its axis."""
    c, s = turns(AROUND_NOSE)
    t = np.radians(polar)
    direction = np.stack([np.sin(t) * c, np.sin(t) * s, np.cos(t) + 0 * c], axis=1)
    return np.array([0.0, -0.185, 0.93]) + direction * (0.20, 0.17, 0.19)


def ear_root(long: float, wide: float, back: float) -> Array:
    """Return a ring on the head round the root of the left ear: half its length and width, how far it lies behind."""
    c, s = turns(AROUND_EAR)
    across = np.stack([0 * c, long * s, -back - wide * c], axis=1)
    return onto(EAR + across, head_shape)


def ear_ring(long: float, wide: float, out: float, ahead: float) -> Array:
    """Return a ring of the left ear in its own plane, which leans back: half its length and width, how far its middle is
    out from the root, and how far it lies before the plane."""
    c, s = turns(AROUND_EAR)
    lean, tilt = np.radians(50.0), np.radians(10.0)
    outwards = np.array([np.cos(lean), 0.0, -np.sin(lean)])
    facing = np.array([np.sin(lean), 0.0, np.cos(lean)])
    upwards = np.cos(tilt) * np.array([0.0, 1.0, 0.0]) + np.sin(tilt) * outwards
    taper = 1.0 + 0.22 * s                                                          # wider above than at the lobe
    return EAR + long * s[:, None] * upwards + (out + wide * taper * c)[:, None] * outwards + ahead * facing

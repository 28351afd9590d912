"""The shape of the eyeball: a sphere with the cornea's smaller sphere in front, blended at the limbus.

Sizes: cornea radius 7.8 mm and iris diameter 11.8 mm are those of adults; the ball itself follows the face's
lids, which rest on it, and is therefore larger than the anatomical 12 mm.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

EYE_RADIUS = 14.8
"""Radius of the ball, mm: a little under the lid margins, which lie 15.4 mm or more from the eye's centre."""

CORNEA_RADIUS = 7.8
"""Radius of curvature of the cornea, mm."""

LIMBUS_RADIUS = 5.9
"""Half the diameter of the visible iris, mm, across the optical axis."""

LIMBUS_BLEND = 0.6
"""Where ball and cornea differ by less than this, mm, they are blended: the limbus has no sharp crease."""


def eyeball_radius(cos_angle: ArrayLike, *, radius: float = EYE_RADIUS, cornea_radius: float = CORNEA_RADIUS,
                   limbus_radius: float = LIMBUS_RADIUS, blend: float = LIMBUS_BLEND) -> NDArray[np.float64]:
    r"""Return the distance, mm, from the eye's centre to its surface in given directions.

    ``cos_angle`` (...): cosine of the angle theta between the direction and the optical axis. The cornea's
    centre lies d in front of the eye's, such that both spheres meet at ``limbus_radius`` l from the axis:

        b = R                                           ball
        c = d cos(theta) + sqrt(k^2 - d^2 sin(theta)^2)   cornea,   d = sqrt(R^2 - l^2) - sqrt(k^2 - l^2)
        r = max(b, c) + max(h - |b - c|, 0)^2 / 4h      rounded maximum, h = ``blend``

    r is continuous with a continuous slope and falls steadily from the cornea's apex to the ball.

    >>> eyeball_radius([1.0, 0.0]).round(2).tolist()
    [16.27, 14.8]
    """
    cos_angle = np.asarray(cos_angle, dtype=np.float64)
    centre = np.sqrt(radius**2 - limbus_radius**2) - np.sqrt(cornea_radius**2 - limbus_radius**2)
    across2 = centre**2 * (1.0 - np.minimum(cos_angle**2, 1.0))
    hit = cos_angle * centre + np.sqrt(np.maximum(cornea_radius**2 - across2, 0.0))
    rounding = np.maximum(blend - np.abs(hit - radius), 0.0) ** 2 / (4.0 * blend) if blend > 0.0 else 0.0
    return np.maximum(hit, radius) + rounding

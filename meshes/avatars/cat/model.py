"""The cat's head in clay, and where its features lie. Centimetres; +x the cat's left, +y up, +z forward."""

from __future__ import annotations

import numpy as np
from clay import Clay, ball, curve, rotation, stroke
from ear import Ear, ear_axes
from eyes import Eye

# Midway between the eyes is (0, 0.55, 3.0): the origin lies inside the head, which is nine centimetres wide.
EYE = Eye.looking((1.88, 0.55, 2.02), 1.22, yaw=11.0, pitch=0.0, roll=16.0)
BALL = Eye.looking(EYE.centre, EYE.radius, yaw=11.0, pitch=0.0)  # the pupil stands upright
# The line where the lips meet, from the middle to the left corner.
MOUTH_LINE = (
    (0.0, -1.97, 4.5),
    (0.36, -2.2, 4.5),
    (0.8, -2.4, 4.34),
    (1.25, -2.36, 3.97),
    (1.62, -2.17, 3.48),
    (1.95, -1.88, 2.88),
)
MOUTH_INSIDE = (0.0, -1.5, 1.5)
NOSE_TIP = (0.0, -0.95, 4.95)
CENTRE = np.array([0.0, -0.6, 0.6])
NECK_PLANE = (np.array([0.0, -4.6, -2.6]), np.array([0.0, -0.85, -0.53]))


def clay() -> Clay:
    """Return the head without ears."""
    c = Clay()
    c.add(ball((0, 0.8, -0.9), (4.2, 3.55, 4.3)))  # skull
    c.add(ball((2.6, -1.3, 0.0), (1.95, 1.95, 2.4), rotation((0, 0, 1), 30)), 1.6, pair=True)  # cheeks
    c.add(stroke([(0, -1.5, -1.5), (0, -6.5, -4.6)], [3.3, 3.4]), 2.2)  # neck
    c.add(ball((0, 2.1, 1.3), (2.7, 1.9, 1.9)), 1.2)  # forehead
    c.add(stroke([(0, 1.7, 2.4), (0, 0.45, 3.5), (0, -0.7, 4.45)], [1.0, 0.82, 0.55], (1.0, 1, 1)), 0.9)  # nose bridge
    c.add(ball((0, -1.55, 2.9), (1.9, 1.35, 1.5)), 0.9)  # muzzle
    c.add(ball((0.82, -1.65, 3.95), (1.0, 0.84, 1.05), rotation((0, 0, 1), -12)), 0.45, pair=True)  # whisker pads
    c.add(ball((0, -2.72, 3.3), (0.85, 0.62, 0.85)), 0.6)  # chin
    c.add(stroke([(0, -2.7, 3.0), (0, -2.9, 1.2)], [0.75, 1.6]), 1.0)  # lower jaw
    c.add(ball(EYE.centre, EYE.radius * 1.1), 0.45, pair=True)  # lids
    c.add(stroke([(0.75, 1.75, 3.0), (1.7, 2.0, 2.7), (2.9, 1.5, 1.7)], [0.35, 0.42, 0.3]), 0.7, pair=True)  # brow
    c.add(ball((0, -0.82, 4.62), (0.62, 0.36, 0.42)), 0.25)  # nose leather
    c.carve(stroke([(0, -1.15, 5.15), (0, -1.6, 5.05), (0, -2.05, 5.1)], 0.1), 0.3)  # philtrum
    c.carve(stroke(curve(MOUTH_LINE, 12), [0.05] * 12), 0.22, pair=True)  # the groove of the mouth
    c.carve(ball((0.34, -0.95, 5.05), (0.2, 0.13, 0.3), rotation((0, 0, 1), 25)), 0.12, pair=True)  # nostrils
    return c


NOSTRIL = (0.34, -0.93, 4.95)
EAR = Ear(
    base=np.array([2.45, 3.05, -0.7]),
    axes=ear_axes((0.40, 1.0, -0.06), (1.0, -0.3, -0.75)),
    height=3.7,
    width=1.8,
    hollow=0.85,
    thickness=0.2,
    profile=lambda h: (1 - h) ** 0.75 * (1 + 0.2 * h),
    lean=lambda h: 0.35 * h**2 - 0.25 * np.sin(np.pi * h),
    foot=(1.85, 0.55, 1.0),
)

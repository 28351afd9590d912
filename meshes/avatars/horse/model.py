"""The horse's head in clay, and where its features lie.

Units of five centimetres; x to the horse's left, y square to its face, z along its face from the poll to the lips: the
head hangs only when it is written.
"""

from __future__ import annotations

import numpy as np
from chart import Long
from clay import Clay, ball, rotation, stroke
from ear import Ear, ear_axes
from eyes import Eye

EYE = Eye.looking((1.52, 0.55, 3.75), 0.84, yaw=64.0, pitch=14.0, roll=10.0)
HANGING = 45.0  # degrees from the horizontal to the line of the face


def _level(eye: Eye) -> Eye:
    """Return the eye with its frame level when the head hangs, as a horse keeps its pupils."""
    out = np.cross(rotation((1, 0, 0), -HANGING) @ [0.0, 1.0, 0.0], eye.frame[2])
    out /= np.linalg.norm(out)
    return Eye(eye.centre, eye.radius, np.stack([out, np.cross(eye.frame[2], out), eye.frame[2]]))


BALL = _level(Eye.looking(EYE.centre, EYE.radius, yaw=60.0, pitch=12.0))
# The line where the lips meet, from the middle to the left corner.
MOUTH_LINE = (
    (0.0, -1.22, 11.1),
    (0.45, -1.21, 11.0),
    (0.85, -1.21, 10.65),
    (1.08, -1.22, 10.15),
    (1.17, -1.17, 9.7),
    (1.20, -1.07, 9.3),
)
CHART = Long(np.array([0.0, -0.8, 0.4]), np.array([0.0, -0.85, 9.7]), 1.3)
REACH = 8.0
NECK_PLANE = (np.array([0.0, -6.0, -2.1]), np.array([0.0, -1.0, 0.05]))
NOSTRIL = np.array([1.0, 0.0, 10.75])
# Along the nostril, from its tail to its wide end, and across it.
NOSTRIL_AXES = np.array([[0.45, -0.85, 0.1], [0.62, 0.3, -0.72]])
EAR = Ear(
    base=np.array([0.95, 1.15, 0.5]),
    axes=ear_axes((0.24, 0.76, -0.60), (1.0, -0.1, -0.55)),
    height=3.1,
    width=0.86,
    hollow=0.75,
    thickness=0.16,
    profile=lambda h: (0.6 + 1.7 * h) * (1 - h) ** 0.85,
    lean=lambda h: 0.1 * h - 0.35 * h**2,
    foot=(0.52, 0.42, 0.45),
)
# The crest of the neck, from the poll down, about.
CREST = ((0.0, 0.9, -1.2), (0.0, 0.2, -2.1), (0.0, -1.2, -3.0), (0.0, -3.2, -3.7), (0.0, -5.8, -4.4))


def clay() -> Clay:
    """Return the head without ears."""
    c = Clay()
    c.add(ball((0, -0.2, 1.6), (1.8, 1.75, 2.0)))  # skull
    c.add(stroke([(0, -1.0, -0.5), (0, -3.2, -1.6), (0, -9.0, -2.4)], [1.75, 2.0, 2.7], (0.68, 1, 1)), 1.2)  # neck
    c.add(stroke([(0, -1.2, 1.8), (0, -3.4, -0.3)], 1.5, (0.85, 1, 1)), 0.8)  # throat
    c.add(ball((0, 0.55, 3.0), (2.0, 1.2, 2.0)), 0.8)  # forehead
    c.add(stroke([(0, 0.35, 3.2), (0, -0.05, 9.6)], [1.4, 0.96]), 0.8)  # nose
    c.add(stroke([(0, -0.7, 3.8), (0, -0.75, 8.4)], [1.5, 0.82]), 0.9)  # teeth's roots
    c.add(stroke([(0, 1.0, 4.0), (0, 0.45, 9.6)], [0.62, 0.5], (1.3, 1, 1)), 0.6)  # its flat ridge
    c.add(ball((1.0, -1.75, 2.4), (1.0, 2.1, 2.2)), 0.6, pair=True)  # cheeks
    c.add(stroke([(0.75, -2.3, 3.2), (0.45, -1.5, 9.0)], [0.9, 0.52]), 0.9, pair=True)  # lower jaw
    c.add(stroke([(1.62, -0.5, 5.2), (1.4, -0.3, 7.0)], [0.2, 0.1]), 0.7, pair=True)  # ridge of the cheekbone
    c.add(ball((0, -0.45, 10.0), (1.27, 1.05, 1.14)), 0.7)  # muzzle
    c.add(ball((0, -0.75, 10.45), (1.05, 0.6, 0.8)), 0.4)  # upper lip
    c.add(ball((0, -1.55, 10.05), (1.0, 0.5, 0.9)), 0.4)  # lower lip
    c.add(ball((0, -1.95, 9.6), (0.64, 0.45, 0.62)), 0.5)  # chin
    c.add(stroke([(1.45, 0.3, 4.3), (1.2, 0.1, 6.2)], [0.3, 0.2]), 0.5, pair=True)  # before the eye
    c.add(ball(EYE.centre, EYE.radius * 1.08), 0.35, pair=True)  # lids
    c.add(stroke([(1.15, 1.25, 4.4), (1.62, 1.45, 3.5), (1.75, 1.05, 2.6)], [0.22, 0.3, 0.2]), 0.6, pair=True)  # brow
    c.add(stroke([(0.7, 0.55, 10.35), (1.18, 0.25, 10.25), (1.3, -0.25, 10.35), (0.98, -0.55, 10.75)],
                 [0.2, 0.28, 0.32, 0.2]), 0.5, pair=True)  # wings of the nostrils
    c.carve(stroke([NOSTRIL - 0.2 * NOSTRIL_AXES[0], NOSTRIL + 0.2 * NOSTRIL_AXES[0]], [0.12, 0.2]), 0.3, pair=True)
    return c

"""Rigs to be fitted, and pictures of them."""

from __future__ import annotations

import numpy as np
import pytest

from facegen.face.avatar import AvatarFace
from facegen.face.face import load_face
from facegen.fitting.fit import layout_points
from facegen.fitting.head_pose import rotation
from facegen.fitting.rigs import wanted
from facegen.fitting.views import Pinhole

CAMERA = Pinhole.of_view(40.0, (1280, 720))
# What 68 points see well; the rest they hardly do, which tests of observability say.
SEEN = ("eyeBlinkLeft", "eyeBlinkRight", "jawOpen", "jawLeft", "mouthSmileLeft", "mouthSmileRight", "mouthPucker",
        "mouthFrownLeft", "mouthFrownRight", "browInnerUp", "browOuterUpLeft", "browOuterUpRight", "browDownLeft",
        "browDownRight", "mouthUpperUpLeft", "mouthLowerDownRight", "mouthClose", "noseSneerLeft")


@pytest.fixture(scope="session")
def base():
    return load_face()


@pytest.fixture(scope="session")
def avatar(rig_of):
    """The base face as an avatar with ARKit's shapes."""
    return AvatarFace(rig_of("arkit", name="hero"))


@pytest.fixture(scope="session")
def drawn():
    """Return a function: rig, weights (n, k), layout -> all its landmarks (n, count, 2) in a camera's pictures."""
    def draw(rig, vertices, layout="ibug68", *, camera=CAMERA, turn=(15.0, 5.0, -5.0), place=(20.0, 10.0, -700.0)):
        rows, _, indices = layout_points(rig, layout, None)
        count = {"ibug68": 68, "mediapipe478": 478}[layout]
        found = np.full((len(vertices), count, 2), np.nan)
        for k, one in enumerate(vertices):
            found[k, indices] = camera.project((rows @ one) @ rotation(*turn).T + place, 1.0)
        return found

    return draw


@pytest.fixture(scope="session")
def performed(avatar):
    """Return a function: frames -> weights (n, 52) of a smooth performance, and its vertices."""
    names = wanted(avatar).names

    def make(n, seed=3, active=7, rate=30.0):
        rng = np.random.default_rng(seed)
        chosen = rng.choice(SEEN, active, replace=False)
        time = np.arange(n)[:, None] / rate
        waves = np.clip(0.5 * np.sin(time * rng.uniform(2, 6, active) + rng.uniform(0, 6, active)) + 0.4, 0.0, 1.0)
        weights = np.zeros((n, len(names)))
        for name, wave in zip(chosen, waves.T, strict=True):
            weights[:, names.index(name)] = wave
        jaw, close = names.index("jawOpen"), names.index("mouthClose")
        weights[:, close] = np.minimum(weights[:, close], weights[:, jaw])
        posed = np.array([avatar.pose_shapes(dict(zip(names, row, strict=True))) for row in weights])
        return weights, posed

    return make

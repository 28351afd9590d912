"""Animations that facegen writes are valid, and other people's players show what facegen shows."""

from __future__ import annotations

import numpy as np
import pytest
from browser import chromium, seen_by_threejs
from rigged import missing, picture
from scipy.spatial import cKDTree
from test_threejs import keep
from test_validator import complaints

import facegen
from facegen.animation.playback import Playback
from facegen.animation.streams.gltf import read_gltf_performance
from facegen.jobs.animated import save_animation

NAMES = ("eyeBlinkLeft", "jawOpen", "mouthSmileLeft", "browInnerUp", "cheekPuff")
TIMES = (0.0, 0.21, 0.5, 0.9)
FARTHEST = 2e-4         # of the avatar's size: between keys a quaternion goes round where degrees go straight


def recorded():
    t = np.arange(11) / 10
    weights = np.stack([np.sin(t * k) ** 2 for k in range(1, len(NAMES) + 1)], axis=1)
    head = np.stack([28 * np.sin(3 * t), 9 * np.cos(2 * t), -12 * t], axis=1)
    return Playback(facegen.Performance(t + 5, NAMES, weights, "arkit", head=head))


@pytest.fixture(scope="session")
def takes(cartoon, tmp_path_factory):
    """A recording on the parametric face and on a shipped avatar, and a clip: name -> file."""
    folder = tmp_path_factory.mktemp("takes")
    clip = facegen.load_clip({"keyframes": [{"t": 0, "pose": "0"}, {"t": 1, "pose": "happiness", "head": {"yaw": 20}}]})
    save_animation(recorded(), folder / "face.glb", detail=1)
    save_animation(recorded(), folder / "cartoon.glb", face=cartoon[0])
    save_animation(clip, folder / "clip.glb", detail=1)
    save_animation(recorded(), folder / "twice.glb", face=folder / "cartoon.glb")
    return {path.stem: path for path in folder.glob("*.glb")}


@pytest.mark.parametrize("name", ["face", "cartoon", "clip", "twice"])
def test_the_validator_finds_nothing(takes, validate, name):
    report = validate(takes[name])
    assert complaints(report) == []
    assert report["info"]["animationCount"] == (2 if name == "twice" else 1)
    assert report["info"]["hasMorphTargets"]
    assert report["info"]["hasSkins"]


@pytest.mark.parametrize("name", ["face", "cartoon", "twice"])
def test_threejs_plays_it(takes, judges, tmp_path, name):
    if chromium() is None:
        missing("Chromium is not installed")
    seen = seen_by_threejs(judges, takes[name], [], tmp_path / "profile", TIMES)
    assert seen["animations"][-1] == name
    play, avatar = Playback(read_gltf_performance(takes[name], name)), facegen.load_face(takes[name])
    pose, meant = play.shown.on(avatar), recorded()
    size = np.ptp(avatar.mesh().vertices, axis=0).max()
    for t, moment in zip(TIMES, seen["moments"], strict=True):
        vertices, far, moved = pose(play.cue(t)), 0.0, set()
        for mesh in moment:
            weights = dict(zip(mesh["names"], mesh["weights"], strict=True))
            for k, shape in enumerate(NAMES):
                if shape in weights:
                    assert weights[shape] == pytest.approx(meant.cue(t).weights[k], abs=2e-3), (t, shape)
                    moved.add(shape)
            places = avatar.notes.apply(np.array(mesh["places"]).reshape(-1, 3))
            far = max(far, cKDTree(vertices).query(places)[0].max())
        assert moved == set(NAMES)
        assert far < FARTHEST * size, t
    pictures = [picture(seen["pictures"][f"at {t:g}"]) for t in TIMES[1:]]
    assert all(np.abs(one - picture(seen["pictures"][""])).max() > 30 for one in pictures)
    keep(seen, f"animation-{name}")

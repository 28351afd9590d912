"""Blender imports the shapes by name and value. Optional: ``FACEGEN_BPY`` names a Python that has bpy 4.5."""

from __future__ import annotations

import importlib.util
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from rigged import rows_of, written
from scipy.spatial import cKDTree

import facegen
from facegen.animation.playback import Playback
from facegen.jobs.animated import save_animation

PYTHON = os.environ.get("FACEGEN_BPY") or (sys.executable if importlib.util.find_spec("bpy") else None)


pytestmark = pytest.mark.skipif(PYTHON is None,
                                reason="bpy is not installed; FACEGEN_BPY may name a Python that has it")
# Blender's axes: x as in glTF, y into the picture, z up.
TURN = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])


def seen_by_blender(path, *times):
    """Return what blender_look.py finds in a file, or in its animation at some times in seconds."""
    done = subprocess.run([PYTHON, str(Path(__file__).with_name("blender_look.py")), str(path), *map(str, times)],
                          capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return json.loads(next(line for line in done.stdout.splitlines() if line.startswith("FOUND"))[6:])


@pytest.mark.parametrize(("kind", "quantise"), [
    ("obj", False), ("obj", True), ("instanced", False), ("morphing", False), ("quantised", False),
    ("transformed", False), ("seams", False), ("skin", False)])
def test_shape_keys(tmp_path, kind, quantise):
    path, avatar, shapes = written(kind, tmp_path, quantise=quantise)
    found = seen_by_blender(path)
    expected = {**avatar.shapes, **shapes}
    assert {name for one in found.values() for name in one["keys"]} == set(expected)
    points, size = avatar.mesh.vertices @ TURN.T, np.ptp(avatar.mesh.vertices, axis=0).max()
    assert set(avatar.mesh.parts) <= set(found)
    for part, one in found.items():
        # Blender shows nodes that stand in no scene, too, and puts a skinned mesh into its bind pose.
        if part not in avatar.mesh.parts or kind == "skin":
            continue
        away = np.linalg.norm(np.array(one["rest"])[:, None] - points[None], axis=2)
        assert away.min(axis=1).max() < 1e-5 * size
        rows = away.argmin(axis=1)
        for name, delta in one["keys"].items():
            if kind != "seams":     # there, places are shared by vertices that move on their own
                np.testing.assert_allclose(delta, expected[name][rows] @ TURN.T, atol=2e-5 * size)


def test_a_shipped_avatar_that_facegen_rigged(cartoon):
    path, avatar, shapes = cartoon
    found = seen_by_blender(path)
    size = np.ptp(avatar.mesh.vertices, axis=0).max()
    assert {name for one in found.values() for name in one["keys"]} == set(shapes)
    met = dict.fromkeys(shapes, 0.0)
    for part, one in found.items():
        rows, away = rows_of(avatar, part, np.array(one["rest"]) @ TURN)
        assert away < 1e-6 * size
        for name, delta in one["keys"].items():
            np.testing.assert_allclose(np.array(delta) @ TURN, shapes[name][rows], atol=2e-6 * size)
            met[name] = max(met[name], np.abs(delta).max())
    for name, shape in shapes.items():
        assert met[name] == pytest.approx(np.abs(shape).max(), abs=2e-6 * size)


def test_an_animation(tmp_path, cartoon):
    times = (0.25, 0.5, 0.75)
    take = Playback(facegen.Performance(np.arange(5) / 4, ("jawOpen", "eyeBlinkLeft"), np.array(
        [[0, 0], [0.5, 1], [1, 0.25], [0.3, 0], [0, 0]]), "arkit", head=np.outer(np.arange(5), [6.0, 3.0, -2.0])))
    path = save_animation(take, tmp_path / "take.glb", face=cartoon[0]).path
    found, avatar = seen_by_blender(path, *times), facegen.load_face(path)
    pose = take.shown.on(facegen.load_face(cartoon[0]))
    size = np.ptp(avatar.mesh().vertices, axis=0).max()
    for t, moment in zip(times, found, strict=True):
        vertices = pose(take.cue(t))
        met = set()
        for one in moment.values():
            for k, name in enumerate(take.performance.names):
                if name in one["values"]:
                    assert one["values"][name] == pytest.approx(take.cue(t).weights[k], abs=1e-5)
                    met.add(name)
            places = avatar.notes.apply(np.array(one["places"]) @ TURN)
            assert cKDTree(vertices).query(places)[0].max() < 2e-5 * size
        assert met == {"jawOpen", "eyeBlinkLeft"}

"""three.js in a browser sees the names, the numbers and the pictures that facegen meant."""

from __future__ import annotations

import os

import gltfs
import numpy as np
import pytest
from browser import chromium, seen_by_threejs
from PIL import Image
from rigged import missing, picture, rows_of, written


@pytest.fixture
def see(judges, tmp_path):
    """A function that returns what three.js sees in a file."""
    if chromium() is None:
        missing("Chromium is not installed")
    return lambda path, poses: seen_by_threejs(judges, path, poses, tmp_path / "profile")


def nearest_rows(points, of):
    return np.linalg.norm(points[:, None] - of[None], axis=2).argmin(axis=1)


@pytest.mark.parametrize(("kind", "options"), [
    ("obj", {}), ("obj", {"quantise": True}), ("instanced", {}), ("morphing", {}), ("quantised", {}),
    ("transformed", {}), ("seams", {})], ids=lambda value: value if isinstance(value, str) else "-".join(value))
def test_names_deltas_and_pictures(tmp_path, see, kind, options):
    path, avatar, shapes = written(kind, tmp_path, **options)
    poses = [f"bump {i}" for i in range(6)] + ["all"]
    seen = see(path, [*poses, "nothing"])
    expected = {**avatar.shapes, **shapes}
    assert {name for mesh in seen["meshes"] for name in mesh["names"]} == set(expected)
    size = np.ptp(avatar.mesh.vertices, axis=0).max()
    met = dict.fromkeys(expected, 0.0)
    for mesh in seen["meshes"]:
        assert mesh["relative"]
        assert list(mesh["dictionary"].values()) == list(range(len(mesh["names"])))
        matrix = np.array(mesh["matrix"]).reshape(4, 4).T
        world = np.array(mesh["position"]).reshape(-1, 3) @ matrix[:3, :3].T + matrix[:3, 3]
        rows = nearest_rows(world, avatar.mesh.vertices)
        np.testing.assert_allclose(world, avatar.mesh.vertices[rows], atol=1e-5 * size)
        for name in mesh["names"]:
            delta = np.array(mesh["deltas"][name]).reshape(-1, 3) @ matrix[:3, :3].T
            together = np.linalg.norm(expected[name][rows] - delta, axis=1)
            if kind != "seams":     # there, places are shared by vertices that move on their own
                assert together.max() < 2e-5 * size, name
            met[name] = max(met[name], np.abs(delta).max())
    for name, shape in expected.items():
        assert met[name] == pytest.approx(np.abs(shape).max(), abs=2e-5 * size), name
    neutral = picture(seen["pictures"][""])
    assert neutral.std() > 10
    assert (neutral.min(axis=2) < 250).mean() > 0.02        # something is there, and it is not the background
    changes = [np.abs(picture(seen["pictures"][pose]) - neutral).max() for pose in poses]
    assert max(changes) > 30
    assert np.count_nonzero(np.array(changes) > 2) >= 3         # some bumps are on the far side
    assert not np.any(picture(seen["pictures"]["nothing"]) - neutral)
    keep(seen, f"{kind}-{'-'.join(options)}")


def test_a_shipped_avatar_that_facegen_rigged(see, cartoon):
    path, avatar, shapes = cartoon
    seen = see(path, list(shapes))
    assert {name for mesh in seen["meshes"] for name in mesh["names"]} == set(shapes)
    size = np.ptp(avatar.mesh.vertices, axis=0).max()
    met = dict.fromkeys(shapes, 0.0)
    for mesh in seen["meshes"]:
        rows, away = rows_of(avatar, mesh["name"], np.array(mesh["position"]).reshape(-1, 3))
        assert away < 1e-6 * size
        for name in mesh["names"]:
            delta = np.array(mesh["deltas"][name]).reshape(-1, 3)
            np.testing.assert_allclose(delta, shapes[name][rows], atol=1e-6 * size)
            met[name] = max(met[name], np.abs(delta).max())
    for name, shape in shapes.items():
        assert met[name] == pytest.approx(np.abs(shape).max(), abs=1e-6 * size)
    neutral = picture(seen["pictures"][""])
    for name in shapes:
        changed = np.abs(picture(seen["pictures"][name]) - neutral).max(axis=2) > 10
        assert changed.mean() > 2e-4, name                      # a glance moves a hundred pixels
    keep(seen, "cartoon")


def keep(seen, name):
    """Write what was seen where the environment says, to be looked at."""
    if folder := os.environ.get("FACEGEN_KEEP_PICTURES"):
        for pose, uri in seen["pictures"].items():
            Image.fromarray(picture(uri).astype(np.uint8)).save(f"{folder}/{name}-{pose.replace(':', '-')}.png")


def test_normals_turn_with_the_surface(tmp_path, see):
    path, _, _ = written("plain", tmp_path)
    mesh, = see(path, [])["meshes"]
    vertices, _ = gltfs.ball()
    normals = vertices / np.linalg.norm(vertices, axis=1, keepdims=True)
    for name in ("bump 0", "all"):
        change = np.array(mesh["normals"][name]).reshape(-1, 3)
        assert np.abs(change).max() > 0.01
        np.testing.assert_allclose(np.linalg.norm(normals + change, axis=1), 1.0, atol=2e-3)
    assert not np.any(mesh["normals"]["nothing"])

"""What `facegen rig` does with files that cannot be rigged: one line that says why, exit code 2, no output touched."""

from __future__ import annotations

import json
import struct

import numpy as np
import pytest

from facegen.data import meshes_dir
from facegen.fileio.avatar import load_avatar, save_avatar

CARTOON = meshes_dir() / "avatars" / "cartoon"


@pytest.fixture
def refused(run, tmp_path):
    """Return a function: an avatar's path, landmarks' path -> what was said, after the checks that every refusal
    passes."""
    def check(avatar, landmarks=CARTOON / "landmarks.yaml", *options):
        kept = {}
        for name in ("a.glb", "a.npz"):
            kept[name] = tmp_path / "out" / name
            kept[name].parent.mkdir(exist_ok=True)
            kept[name].write_bytes(b"what was there before")
        for out in kept.values():
            code, said, err = run("rig", avatar, "-l", landmarks, "-o", out, "--set", "vrm", *options)
            assert (code, said) == (2, "")
            assert err.startswith("facegen: ")
            assert err.count("\n") == 1
            assert "Traceback" not in err
            assert len(err) < 700
        assert {path.name: path.read_bytes() for path in (tmp_path / "out").iterdir()} == \
            dict.fromkeys(kept, b"what was there before")
        return err
    return check


def cartoon_lines():
    return (CARTOON / "cartoon.obj").read_text().splitlines()


@pytest.mark.parametrize(("text", "words"), [
    ("", "empty|no triangles|no vertices|faces"),
    ("v 0 0 0\nv 1 0 0\nv 0 1 0\n", "faces|triangles"),
    ("f 1 2 3\n", "vert"),
    ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n", "4"),
    ("v 0 0 0\nv 1 0 nan\nv 0 1 0\nf 1 2 3\n", "line 2|a.obj:2"),
    ("v 0 0 0\nv 1 0 inf\nv 0 1 0\nf 1 2 3\n", "line 2|a.obj:2"),
    ("v 0 0 0\nv 1 0 1e400\nv 0 1 0\nf 1 2 3\n", "line 2|a.obj:2"),
    ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "landmarks|mesh"),
    ("\x00\x01\x02", "a.obj"),
], ids=["empty", "no faces", "no vertices", "past the end", "nan", "inf", "too large", "one triangle", "no text"])
def test_meshes_that_are_none(refused, tmp_path, text, words):
    import re

    (tmp_path / "a.obj").write_text(text)
    assert re.search(words, refused(tmp_path / "a.obj"))


@pytest.mark.parametrize("value", ["nan", "inf", "-1e999"])
def test_one_number_that_is_none(refused, tmp_path, value):
    lines = cartoon_lines()
    row = next(i for i, line in enumerate(lines) if line.startswith("v "))
    lines[row + 7] = f"v 0.1 {value} 0.2"
    (tmp_path / "cartoon.obj").write_text("\n".join(lines))
    assert f":{row + 8}" in refused(tmp_path / "cartoon.obj") or f"line {row + 8}" in refused(tmp_path / "cartoon.obj")


@pytest.fixture(scope="module")
def small_glb(tmp_path_factory):
    """A pyramid as GLB, with a shape and normals."""
    folder = tmp_path_factory.mktemp("small")
    (folder / "a.obj").write_text("v 0 0 1\nv 1 0 0\nv 0 1 0\nv -1 -1 0\nf 1 2 3\nf 1 3 4\nf 1 4 2\n")
    avatar = load_avatar(folder / "a.obj")
    return save_avatar(avatar, folder / "a.glb", {"up": np.ones((4, 3))}).read_bytes()


def test_a_file_cut_short_anywhere(refused, tmp_path, small_glb):
    path = tmp_path / "cut.glb"
    for length in range(0, len(small_glb), 50):
        path.write_bytes(small_glb[:length])
        assert "cut.glb" in refused(path)


def test_numbers_in_a_glb_that_are_none(refused, tmp_path, small_glb):
    """NaN in the middle of the positions."""
    head = struct.unpack("<I", small_glb[12:16])[0]
    found = json.loads(small_glb[20:20 + head])
    at = found["meshes"][0]["primitives"][0]["attributes"]["POSITION"]
    view = found["bufferViews"][found["accessors"][at]["bufferView"]]
    raw = bytearray(small_glb)
    where = 20 + head + 8 + view.get("byteOffset", 0) + 12
    for bad in (np.nan, np.inf, -np.inf):
        raw[where:where + 4] = struct.pack("<f", bad)
        (tmp_path / "a.glb").write_bytes(raw)
        assert "holds NaN or infinity in 1 of its elements, the first is number 1" in refused(tmp_path / "a.glb")


def test_landmarks_of_another_mesh(refused, tmp_path):
    """By its name, by a vertex it has not, by places that are not there, and by numbers that mean something else."""
    human = meshes_dir() / "avatars" / "human"
    assert "'human.obj'" in refused(CARTOON / "cartoon.obj", human / "landmarks.yaml")
    other = (human / "landmarks.yaml").read_text().replace("mesh: human.obj\n", "")
    (tmp_path / "other.yaml").write_text(other)
    refused(CARTOON / "cartoon.obj", tmp_path / "other.yaml")
    own = (CARTOON / "landmarks.yaml").read_text().replace("mesh: cartoon.obj\n", "")
    (tmp_path / "own.yaml").write_text(own)
    err = refused(meshes_dir() / "avatars" / "cat" / "cat.obj", tmp_path / "own.yaml")
    assert "landmark" in err


def test_no_landmarks(refused, tmp_path):
    (tmp_path / "empty.yaml").write_text("")
    assert "empty.yaml" in refused(CARTOON / "cartoon.obj", tmp_path / "empty.yaml")
    (tmp_path / "none.yaml").write_text("landmarks: {}\n")
    assert "none.yaml" in refused(CARTOON / "cartoon.obj", tmp_path / "none.yaml")
    assert "gone.yaml" in refused(CARTOON / "cartoon.obj", tmp_path / "gone.yaml")

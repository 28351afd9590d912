"""Avatars as faces of data sets and films."""

from __future__ import annotations

import json
import shutil

import numpy as np
import pytest
from PIL import Image

import facegen
from facegen.errors import InputError
from facegen.jobs.batch import run_batch
from facegen.jobs.digests import face_digest
from facegen.jobs.frames import save_clip, save_turn

SMALL = {"size": 32, "renderer": "soft"}


@pytest.fixture
def cat(rig_file, tmp_path):
    """A rig of units by the name of cat.glb."""
    return shutil.copy(rig_file("units"), tmp_path / "cat.glb")


def test_a_data_set(cat, rig_file, tmp_path):
    jobs = {"poses": ["happiness", "6C+12D"], "faces": [str(cat), "akimoto-1986"], "sizes": 48, "masks": True,
            "renderer": "soft"}
    report = run_batch(jobs, tmp_path / "set", workers=1)
    assert report.made == 4
    label = json.loads((tmp_path / "set" / "labels" / "happiness_cat.json").read_text())
    assert label["face"] == str(cat)
    assert set(label["landmarks"]) == set(facegen.load_face(cat).landmarks)
    with Image.open(tmp_path / "set" / label["file"]) as picture:
        expected = facegen.render(facegen.load_face(cat), "happiness", size=48, renderer="soft")
        np.testing.assert_array_equal(np.asarray(picture.convert("RGBA")), expected)
    with Image.open(tmp_path / "set" / label["mask"]) as mask:
        assert set(np.unique(np.asarray(mask))) <= set(range(10))
    assert run_batch(jobs, tmp_path / "set", workers=1).kept == 4
    shutil.copy(rig_file("arkit"), cat)                     # another avatar under the same name: drawn anew
    assert run_batch(jobs, tmp_path / "set", workers=1, update=True).made == 2


def test_what_a_face_cannot_show_is_a_warning(rig_file, tmp_path):
    from facegen.jobs.spec import read_batch

    jobs = {"poses": ["6C+12D", {"points": {"nose_tip": [0, 0.3, 0]}}], "faces": [str(rig_file("arkit"))]}
    warning, = read_batch(jobs).warnings
    assert warning.startswith("arkit.glb has no shapes for")


def test_avatars_have_no_feature_points(cat, tmp_path):
    with pytest.raises(InputError, match=r"faces.0: feature_points: cat is an avatar and has none, only landmarks"):
        run_batch({"poses": ["happiness"], "faces": [str(cat)], "feature_points": True}, tmp_path / "set")
    assert not (tmp_path / "set").exists()


def test_a_bare_mesh_is_refused_before_work(tmp_path):
    (tmp_path / "cat.obj").write_text("v 0 0 0\n")
    with pytest.raises(InputError, match=r"faces.0: face: .*cat.obj has no blendshapes; rig it first"):
        run_batch({"poses": ["happiness"], "faces": [str(tmp_path / "cat.obj")]}, tmp_path / "set")


def test_digests_follow_the_file(cat, rig_file):
    before = face_digest(str(cat))
    assert before == facegen.load_face(cat).digest
    shutil.copy(rig_file("arkit"), cat)
    assert face_digest(str(cat)) != before


def test_a_clip(cat, tmp_path):
    clip = facegen.load_clip({"keyframes": [{"t": 0, "pose": "0"}, {"t": 0.4, "pose": "happiness"}], "idle": 1})
    assert save_clip(clip, tmp_path / "frames", fps=5, face=cat, **SMALL).made == 2
    face = facegen.load_face(cat)
    renderer = facegen.Renderer(face, size=32, renderer="soft")
    with Image.open(tmp_path / "frames" / "frame_00002.png") as picture:
        np.testing.assert_array_equal(np.asarray(picture), renderer.draw(clip.at(0.2))[..., :3])
    assert save_clip(clip, tmp_path / "frames", fps=5, face=cat, **SMALL).kept == 2


def test_a_morph_with_raw_data_and_a_turn(cat, tmp_path):
    clip = facegen.morph("happiness", {"jaw": {"open": 12}}, seconds=0.4, hold=0.0)
    assert save_clip(clip, tmp_path / "morph", fps=5, face=cat, **SMALL).made == 2
    assert save_turn("happiness", tmp_path / "turn", seconds=0.4, fps=5, face=cat, **SMALL).made == 2


def test_workers_load_it_too(cat, tmp_path):
    report = run_batch({"poses": ["happiness", "anger"], "faces": [str(cat)], "sizes": 32}, tmp_path / "set", workers=2)
    assert report.made == 2

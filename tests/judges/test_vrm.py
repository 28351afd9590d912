"""VRM avatars: the presets are bound, what their author bound is kept, and others' readers agree."""

from __future__ import annotations

import gltfs
import numpy as np
import pytest
from browser import chromium, seen_by_threejs
from rigged import missing, picture
from test_threejs import keep
from test_validator import complaints
from vrm_avatars import bound, vrm_avatar

from facegen.blendshapes.recipes import shape_set
from facegen.cli import main
from facegen.face.face import load_face
from facegen.fileio.avatar import load_avatar
from facegen.fileio.vrm import PRESETS

THEIRS = {"preset": {"happy": {"isBinary": True, "overrideMouth": "block", "materialColorBinds": [
    {"material": 0, "type": "color", "targetValue": [1, 0, 0, 1]}]}, "sad": {"overrideBlink": "block"}}}


@pytest.fixture(scope="module")
def rigged(tmp_path_factory):
    folder = tmp_path_factory.mktemp("vrm")
    path, marks = vrm_avatar(folder, expressions=THEIRS)
    assert main(["rig", str(path), "-l", str(marks), "--set", "vrm", "-o", str(folder / "b.vrm")]) == 0
    return folder / "b.vrm"


def test_all_presets_are_bound_and_the_authors_stay(rigged):
    found, _ = gltfs.parts_of(rigged)
    presets = found["extensions"]["VRMC_vrm"]["expressions"]["preset"]
    assert set(presets) == set(PRESETS)
    assert presets["happy"] == THEIRS["preset"]["happy"]                # theirs is bound to something: it stays
    assert presets["sad"]["overrideBlink"] == "block"                   # theirs is empty: it is filled
    shapes = load_avatar(rigged).shapes
    for name, moved in bound(rigged).items():
        np.testing.assert_allclose(moved, shapes[name], atol=1e-7)
        assert moved.any() == (name != "neutral"), name
        assert presets[name]["isBinary"] is False
        if name != "sad":
            assert {presets[name][f"override{what}"] for what in ("Blink", "LookAt", "Mouth")} == {"none"}


def test_presets_move_what_their_names_say(rigged):
    """In the avatar's own axes: it looks to +z, its left is +x."""
    face = load_face(rigged)
    rest = face.landmark_points(face.mesh().vertices)

    def moved(shape, *names):
        posed = face.landmark_points(face.pose_shapes({shape: 1.0}))
        return np.mean([posed[name] - rest[name] for name in names], axis=0)

    assert moved("aa", "mouth_inner_bottom")[1] < -5
    assert moved("blinkLeft", "eye_upper_L")[1] < -5
    assert abs(moved("blinkLeft", "eye_upper_R")[1]) < 0.5
    assert moved("lookLeft", "eye_center_L", "eye_center_R")[0] > 1
    assert moved("lookUp", "eye_center_L", "eye_center_R")[1] > 1
    assert moved("surprised", "brow_mid_L", "brow_mid_R")[1] > 1


def test_an_avatar_of_vrm_0_looks_the_other_way_and_gets_no_expressions(tmp_path, capsys):
    path, marks = vrm_avatar(tmp_path, version="0.0")
    assert main(["rig", str(path), "-l", str(marks), "--set", "vrm", "-o", str(tmp_path / "b.vrm")]) == 0
    assert "a.vrm is a VRM 0.x avatar: it gets the shapes but no expressions" in capsys.readouterr().err
    found, _ = gltfs.parts_of(tmp_path / "b.vrm")
    assert set(found["extensions"]) == {"VRM"}
    avatar = load_avatar(tmp_path / "b.vrm")
    assert {name for name in avatar.shapes if not name.endswith("_half")} == set(shape_set("vrm"))
    left = avatar.shapes["blinkLeft"]
    middle = np.average(avatar.mesh.vertices, axis=0, weights=np.linalg.norm(left, axis=1))
    assert middle[0] < -0.01                                # it looks to -z, so that its left is at -x
    assert middle[2] < 0
    face = load_face(tmp_path / "b.vrm")
    rest, posed = (face.landmark_points(at) for at in (face.mesh().vertices, face.pose_shapes({"blinkLeft": 1.0})))
    assert posed["eye_upper_L"][1] < rest["eye_upper_L"][1] - 5
    assert rest["eye_upper_L"][0] > 0


def test_the_validator_has_no_complaint(rigged, validate):
    assert complaints(validate(rigged)) == []


def test_three_vrm_shows_the_presets(rigged, judges, tmp_path):
    if chromium() is None:
        missing("Chromium is not installed")
    seen = seen_by_threejs(judges, rigged, [f"vrm:{name}" for name in PRESETS], tmp_path / "profile")
    assert set(seen["expressions"]) == set(PRESETS)
    for name in set(PRESETS) - {"happy"}:
        assert set(seen["expressions"][name]) <= {name}             # morph targets at work, by name
        assert all(weight == 1.0 for weight in seen["expressions"][name].values())
        assert seen["expressions"][name] or name == "neutral"
    keep(seen, "vrm")
    neutral = picture(seen["pictures"][""])
    for name in set(PRESETS) - {"happy", "neutral"}:
        assert np.abs(picture(seen["pictures"][f"vrm:{name}"]) - neutral).max() > 30, name

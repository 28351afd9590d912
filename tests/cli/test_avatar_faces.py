"""Avatars as --face, and the list of shapes."""

from __future__ import annotations

import json

import numpy as np
import pytest
from PIL import Image

import facegen


@pytest.fixture
def cat(rig_file):
    return rig_file("units")


def test_a_picture(run, cat, tmp_path):
    out = tmp_path / "cat.png"
    assert run("render", "happiness", "--face", cat, "-o", out, "--size", 64, "--passes", "landmarks") == (0, "", "")
    with Image.open(out) as picture:
        expected = facegen.render(facegen.load_face(cat), "happiness", size=64)
        np.testing.assert_array_equal(np.asarray(picture.convert("RGBA")), expected)
    assert len(json.loads((tmp_path / "cat.landmarks.json").read_text())) == len(facegen.load_face(cat).landmarks)


def test_a_person(run, cat, tmp_path):
    for name in ("one", "two"):
        person = ["--person", "bruno"] if name == "two" else []
        assert run("render", "happiness", "--face", cat, "-o", tmp_path / f"{name}.png", "--size", 48, *person)[0] == 0
    assert (tmp_path / "one.png").read_bytes() != (tmp_path / "two.png").read_bytes()


@pytest.mark.parametrize(("options", "message"), [
    (["--cage"], "'cage' needs a face that has one, such as the base face; take 'mesh' for units"),
    (["--passes", "feature_points"], "'feature_points' needs a face that has them"),
])
def test_what_avatars_have_not(run, cat, tmp_path, options, message):
    code, _, err = run("render", "happiness", "--face", cat, "-o", tmp_path / "a.png", *options)
    assert code == 2
    assert message in err
    assert not list(tmp_path.iterdir())


def test_a_bare_mesh(run, tmp_path):
    (tmp_path / "cat.obj").write_text("v 0 0 0\n")
    code, _, err = run("render", "happiness", "--face", tmp_path / "cat.obj", "-o", tmp_path / "a.png")
    assert code == 2
    assert "has no blendshapes; rig it first: facegen rig cat.obj --landmarks cat.yaml -o cat.glb" in err


def test_warnings(run, rig_file, tmp_path):
    arkit = rig_file("arkit", notes=False)
    out = ["-o", tmp_path / "a.png", "--size", 32]
    code, _, err = run("render", "54D", "--face", arkit, *out)
    assert code == 0
    assert "does not say where its neck is" in err
    assert run("render", "54D", "--face", arkit, *out, "-q") == (0, "", "")


def test_explain(run, rig_file):
    code, out, _ = run("explain", "6C+12D", "--face", rig_file("arkit"))
    assert code == 0
    assert "blendshapes of" in out
    assert "mouthSmileLeft" in out
    assert "feature points" not in out
    data = json.loads(run("explain", "R12D", "--face", rig_file("arkit"), "--json")[1])
    assert data["shapes"] == {"mouthSmileRight": 0.8}
    assert "nothing moves" in run("explain", "neutral", "--face", rig_file("arkit"))[1]


def test_a_film(run, cat, tmp_path):
    out = tmp_path / "turn.gif"
    assert run("turntable", "happiness", "--face", cat, "-o", out, "--seconds", 0.5, "--fps", 4, "--size", 32,
               "--workers", 1)[0] == 0
    assert out.exists()


def test_close_ups_look_at_the_avatars_own_eyes(cat):
    from facegen.cli.gallery import Picture, _close_up

    rig = facegen.load_face(cat)
    points = rig.landmark_points(rig.mesh().vertices)
    for close, names in (("eyes", ("eye_outer_L", "eye_outer_R")), ("mouth", ("mouth_corner_L", "mouth_corner_R"))):
        camera = _close_up(rig, Picture("0", "", close=close), 128, 2)
        x = camera.project(np.array([points[name] for name in names]))[:, 0]
        assert 50 < x.max() - x.min() < 110
        assert abs(x.mean() - 64) < 3


def test_lists(run):
    code, out, _ = run("list", "shapes")
    assert code == 0
    assert len(out.splitlines()) == 52
    assert out.splitlines()[0].split()[:2] == ["eyeBlinkLeft", "L45E"]
    rows = json.loads(run("list", "shapes", "--set", "visemes", "--json")[1])
    assert [row["name"] for row in rows][:3] == ["viseme_sil", "viseme_PP", "viseme_FF"]
    assert all(row["source"] and row["about"] for row in rows)
    mine = json.loads(run("list", "shapes", "--set", "expressions", "--person", "bruno", "--json")[1])
    assert mine != json.loads(run("list", "shapes", "--set", "expressions", "--json")[1])
    code, _, err = run("list", "shapes", "--set", "arkti")
    assert code == 2
    assert "did you mean 'arkit'" in err

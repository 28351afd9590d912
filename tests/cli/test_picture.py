"""facegen render: the picture that was asked for, and an error for each wrong wish."""

from __future__ import annotations

import json

import numpy as np
import pytest
from PIL import Image

import facegen


def test_a_picture(run, tmp_path):
    out = tmp_path / "happiness.png"
    assert run("render", "happiness", "-o", out, "--size", 64) == (0, "", "")
    with Image.open(out) as picture:
        assert picture.size == (64, 64)
        pixels = np.asarray(picture.convert("RGBA"))
    expected = facegen.render(facegen.load_face(), "happiness", size=64)
    np.testing.assert_array_equal(pixels, expected)
    assert list(tmp_path.iterdir()) == [out]


@pytest.mark.parametrize(("options", "arguments"), [
    (["--view", "-30,10"], {"view": (-30, 10)}),
    (["--view", "25"], {"view": (25, 0)}),
    (["--size", "80x48"], {"size": (80, 48)}),
    (["--detail", "1"], {"detail": 1}),
    (["--flat"], {"shading": "flat"}),
    (["--background", "transparent"], {"background": "transparent"}),
    (["--background", "#203040"], {"background": (32, 48, 64)}),
    (["--background", "1,2,3"], {"background": (1, 2, 3)}),
    (["--person", "mika"], {"person": "mika"}),
    (["--intensity", "0.4"], {"intensity": 0.4}),
    (["--orthographic"], {"orthographic": True}),
    (["--renderer", "soft"], {"renderer": "soft"}),
    (["--occlusion", "off"], {"occlusion": "off"}),
    (["--shadows"], {"shadows": True}),
    (["--wireframe"], {"wireframe": True}),
    (["--cage", "--detail", "1"], {"wireframe": facegen.Wireframe(lines="cage"), "detail": 1}),
])
def test_options_mean_what_the_api_means(run, tmp_path, options, arguments):
    out = tmp_path / "a.png"
    assert run("render", "happiness", "-o", out, "--size", 64, *options)[0] == 0
    expected = facegen.render(facegen.load_face(), "happiness", **{"size": 64, **arguments})
    with Image.open(out) as picture:
        np.testing.assert_array_equal(np.asarray(picture.convert("RGBA")), expected)


@pytest.mark.parametrize("face", facegen.face_names())
@pytest.mark.parametrize("what", ["figure-8", "R12A+R14A", "happiness"])
def test_every_face_draws(run, tmp_path, face, what):
    out = tmp_path / "a.webp"
    assert run("render", what, "-o", out, "--face", face, "--size", 48) == (0, "", "")
    assert run("explain", what, "--face", face)[0] == 0
    assert out.stat().st_size > 100


def test_a_file_of_raw_data(run, tmp_path):
    data = tmp_path / "open.yaml"
    data.write_text("jaw: {open: 15}\n")
    out = tmp_path / "open.png"
    assert run("render", data, "-o", out, "--size", 48) == (0, "", "")
    expected = facegen.render(facegen.load_face(), facegen.Deformation(jaw={"open": 15}), size=48)
    with Image.open(out) as picture:
        np.testing.assert_array_equal(np.asarray(picture.convert("RGBA")), expected)


def test_a_preset_by_its_short_name_is_the_preset(run):
    short, whole = (json.loads(run("explain", name, "--json")[1])
                    for name in ("figure-8", "akimoto-1986-figure-8"))
    assert short["deformation"] == whole["deformation"]
    assert short["deformation"]["points"]["F8"] == [-0.07, 0.0, -0.07]


def test_passes_are_written_beside_the_picture(run, tmp_path):
    out = tmp_path / "smile.png"
    (tmp_path / "smile").mkdir()                    # a folder of that name is left alone
    options = ["--size", "64", "--view", "20", "--detail", "0", "--orthographic"]
    code, text, _ = run("render", "happiness", "-o", out, *options, "--passes", "depth, part,feature_points", "--npz",
                        "--json")
    names = {"depth": "smile.depth.png", "part": "smile.part.png", "feature_points": "smile.feature_points.json",
             "passes": "smile.passes.json", "arrays": "smile.passes.npz"}
    assert code == 0
    assert json.loads(text)["passes"] == {name: str(tmp_path / file) for name, file in names.items()}
    assert {p.name for p in tmp_path.iterdir()} == {"smile", "smile.png", *names.values()}
    expected = facegen.render_passes(facegen.load_face(), "happiness", passes=("depth", "part"), size=64, view=(20, 0),
                                     detail=0, orthographic=True)
    with np.load(tmp_path / names["arrays"]) as arrays:
        np.testing.assert_array_equal(arrays["depth"], expected["depth"])
        np.testing.assert_array_equal(arrays["part"], expected["part"])


def test_a_pass_that_cannot_be_written_is_said_before_any_work(run, tmp_path):
    (tmp_path / "a.depth.png").mkdir()
    code, _, err = run("render", "happiness", "-o", tmp_path / "a.png", "--size", 48, "--passes", "depth")
    assert code == 2
    assert "a.depth.png: is a folder" in err
    assert [p.name for p in tmp_path.iterdir()] == ["a.depth.png"]


def test_json(run, tmp_path):
    out = tmp_path / "a.png"
    code, text, err = run("render", "5E+43B", "-o", out, "--size", 48, "--json")
    data = json.loads(text)
    assert code == 0
    assert data["units"] == {"5": 1.0, "43": 0.25}
    assert data["file"] == str(out)
    assert data["size"] == [48, 48]
    assert len(data["warnings"]) == 1
    assert err.startswith("facegen: warning: 5 (upper lid raiser)")


def test_quiet_warns_of_nothing(run, tmp_path):
    assert run("render", "5E+43B", "-o", tmp_path / "a.png", "--size", 48, "-q") == (0, "", "")


@pytest.mark.parametrize(("argv", "words"), [
    (["happiness"], "-o: say where the picture goes"),
    (["hapiness", "-o", "a.png"], "did you mean 'happiness'"),
    (["12F", "-o", "a.png"], "A-E"),
    (["AU99", "-o", "a.png"], "no unit 99"),
    (["", "-o", "a.png"], "empty"),
    (["missing.yaml", "-o", "a.png"], "no such file"),
    (["happiness", "-o", "a.gif"], ".png"),
    (["happiness", "-o", "a"], "no suffix"),
    (["happiness", "-o", "nowhere/a.png"], "does not exist"),
    (["happiness", "-o", "a.png", "--face", "akimoti"], "did you mean 'akimoto'"),
    (["happiness", "-o", "a.png", "--person", "mikka"], "did you mean 'mika'"),
    (["happiness", "-o", "a.png", "--intensity", "2"], "intensity"),
    (["happiness", "-o", "a.png", "--intensity", "nan"], "intensity"),
    (["happiness", "-o", "a.png", "--view", "left"], "--view"),
    (["happiness", "-o", "a.png", "--view", "1,2,3"], "--view"),
    (["happiness", "-o", "a.png", "--view", "nan,0"], "view"),
    (["happiness", "-o", "a.png", "--view", "0,120"], "90 degrees"),
    (["happiness", "-o", "a.png", "--size", "big"], "--size"),
    (["happiness", "-o", "a.png", "--size", "-64"], "--size"),
    (["happiness", "-o", "a.png", "--size", "5000"], "4096"),
    (["happiness", "-o", "a.png", "--background", "blueish"], "--background"),
    (["happiness", "-o", "a.png", "--background", "1,2,300"], "0..255"),
    (["happiness", "-o", "a.png", "--renderer", "sofd"], "did you mean 'soft'"),
    (["happiness", "-o", "a.png", "--occlusion", "none"], "posed, neutral, off"),
    (["happiness", "-o", "a.png", "--passes", "dept"], "did you mean 'depth'"),
    (["happiness", "-o", "a.png", "--passes", ""], "passes: expected"),
    (["happiness", "-o", "a.png", "--npz"], "--npz"),
])
def test_wrong_wishes(run, tmp_path, monkeypatch, argv, words):
    monkeypatch.chdir(tmp_path)
    code, out, err = run("render", *argv)
    assert (code, out) == (2, "")
    assert err.startswith("facegen: ")
    assert words in err
    assert "Traceback" not in err
    assert not list(tmp_path.iterdir())


def test_a_file_in_the_place_of_a_folder(run, tmp_path):
    (tmp_path / "file").write_text("not a folder")
    code, _, err = run("render", "neutral", "-o", tmp_path / "file" / "a.png", "--size", 32)
    assert code == 2
    assert "folder" in err


def test_a_folder_in_the_place_of_the_picture(run, tmp_path):
    (tmp_path / "a.png").mkdir()
    assert run("render", "neutral", "-o", tmp_path / "a.png", "--size", 32)[0] == 2


def test_a_failed_picture_leaves_the_old_one(run, tmp_path, monkeypatch):
    out = tmp_path / "a.png"
    out.write_bytes(b"precious")

    def full(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Image.Image, "save", full)
    code, _, err = run("render", "neutral", "-o", out, "--size", 32)
    assert code == 2
    assert "No space left" in err
    assert out.read_bytes() == b"precious"
    assert list(tmp_path.iterdir()) == [out]


def test_broken_data_name_file_and_key(run, tmp_path):
    data = tmp_path / "bad.yaml"
    data.write_text("jaw: {opne: 15}\n")
    code, _, err = run("render", data, "-o", tmp_path / "a.png")
    assert code == 2
    assert "bad.yaml" in err
    assert "did you mean 'open'" in err


def test_a_point_that_the_face_lacks(run, tmp_path):
    data = tmp_path / "bad.yaml"
    data.write_text("points: {mouth_corner_left: [0, 1, 0]}\n")
    code, _, err = run("render", data, "-o", tmp_path / "a.png")
    assert code == 2
    assert "did you mean 'mouth_corner_L'" in err

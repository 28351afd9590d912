"""facegen play, and films as .glb."""

from __future__ import annotations

import json

import numpy as np
import pytest
from PIL import Image

import facegen
from facegen.animation.streams.gltf import read_gltf_performance

QUICK = ("--rig", "akimoto-1986", "--size", "32", "--workers", "1", "--detail", "0", "--renderer", "soft")


@pytest.fixture
def take(tmp_path, rig_file):
    """A recording in a .glb."""
    t = np.arange(8) / 10
    made = facegen.Performance(t, ("jawOpen", "mouthSmileLeft"), np.stack([t, 1 - t], 1), "arkit",
                               head=np.stack([50 * t, 0 * t, 0 * t], 1))
    path = tmp_path / "take.glb"
    facegen.save_clip(made, path, face=rig_file("arkit"))
    return path


def test_a_film(run, take, tmp_path):
    out = tmp_path / "a.gif"
    assert run("play", take, "-o", out, "--fps", 10, *QUICK) == (0, "", "")
    with Image.open(out) as film:
        assert film.n_frames == 8
    assert sorted(tmp_path.iterdir()) == [out, take]


def test_a_folder_and_what_is_told(run, take, tmp_path, rig_file):
    code, text, err = run("play", take, "-o", tmp_path / "frames", "--fps", 5, "--json", "--view", "20,0", *QUICK)
    assert (code, err) == (0, "")
    told = json.loads(text)
    assert (told["vocabulary"], told["made"], told["recording"]) == ("arkit", 4, str(take))
    assert len(list((tmp_path / "frames").glob("frame_*.png"))) == 4


def test_into_a_glb(run, take, tmp_path, rig_file):
    out = tmp_path / "b.glb"
    code, text, _ = run("play", take, "--rig", rig_file("units"), "-o", out, "--json")
    told = json.loads(text)
    assert (code, told["keys"], told["duration"]) == (0, 8, pytest.approx(0.8))
    back = read_gltf_performance(out)
    assert back.vocabulary == "shapes"
    assert back.column("AU12_L")[0] == 1.0
    assert {"AU12_L"} <= set(told["shapes"])


def test_animate_into_a_glb(run, tmp_path):
    script = tmp_path / "clip.yaml"
    script.write_text("keyframes:\n  - {t: 0, pose: '0'}\n  - {t: 0.4, pose: happiness}\n")
    out = tmp_path / "clip.glb"
    assert run("animate", script, "-o", out, "--fps", 10, "--detail", 0) == (0, "", "")
    assert len(read_gltf_performance(out)) == 4
    assert facegen.load_face(out).pose("happiness").any()


@pytest.mark.parametrize(("options", "words"), [
    (["--id", "tak"], "--id: take.glb has no animation 'tak'"), (["--rig", "akimoti"], "did you mean 'akimoto'"),
    (["--bridge", "-1"], "bridge: expected seconds"), (["--fps", "0"], "fps"), (["-o", "b.avi"], "b.avi"),
    (["-o", "no/b.glb"], "does not exist")])
def test_bad_options(run, take, tmp_path, monkeypatch, options, words):
    monkeypatch.chdir(tmp_path)
    code, out, err = run("play", take, "-o", "a.gif", *QUICK, *options)
    assert (code, out) == (2, "")
    assert words in err
    assert "Traceback" not in err
    assert list(tmp_path.iterdir()) == [take]


@pytest.mark.parametrize(("name", "data", "words"), [
    ("a.glb", b"glTF", "truncated"), ("a.glb", b"PK", "is no GLB file"), ("a.txt", b"hello", "a.txt")])
def test_bad_recordings(run, tmp_path, name, data, words):
    (tmp_path / name).write_bytes(data)
    code, _, err = run("play", tmp_path / name, "-o", tmp_path / "a.gif")
    assert code == 2
    assert words in err
    assert run("play", tmp_path / "none.glb", "-o", tmp_path / "a.gif")[0] == 2
    assert len(list(tmp_path.iterdir())) == 1


def test_a_file_without_an_animation(run, rig_file, tmp_path):
    code, _, err = run("play", rig_file("arkit"), "-o", tmp_path / "a.gif")
    assert code == 2
    assert "has no animation of morph target weights" in err


def test_a_recording_of_a_tracker(run, tmp_path):
    path = tmp_path / "face.csv"
    path.write_text("time,AU12_L,AU12_R,AU26,head_yaw,head_pitch,head_roll\n"
                    + "".join(f"{k / 10},{k / 10},0.1,,{5 * k},0,0\n" for k in range(5)))
    code, _, err = run("play", path, "-o", tmp_path / "a.glb", "--smooth", "1,0")
    assert code == 0
    assert err == "facegen: warning: 26: never recorded, so at rest\n"
    back = read_gltf_performance(tmp_path / "a.glb")
    assert 0.1 < back.column("AU12_L").max() < 0.4
    assert run("play", path, "-o", tmp_path / "b.glb", "--smooth", "much")[2].startswith("facegen: --smooth: expected")
    assert run("play", path, "-o", tmp_path / "b.glb", "--recorded-fps", "-1")[2].startswith("facegen: --recorded-fps:")
    assert not (tmp_path / "b.glb").exists()


def test_convert_into_a_glb_and_back(run, take, tmp_path):
    other = tmp_path / "take.csv"
    assert run("convert", take, "-o", other, "--to", "csv")[0] == 0
    code, text, _ = run("convert", other, "-o", tmp_path / "again.glb", "--json")
    assert (code, json.loads(text)["format"]) == (0, "gltf")
    first, again = (read_gltf_performance(path) for path in (take, tmp_path / "again.glb"))
    np.testing.assert_allclose(again.weights, first.weights[:, [first.names.index(name) for name in again.names]],
                               atol=1e-6)
    np.testing.assert_allclose(again.head, first.head, atol=1e-3)

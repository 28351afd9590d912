"""`facegen fit`: weights out of files, and what is refused before anything is written."""

import json

import numpy as np
import pytest

import facegen
from facegen.animation.streams.files import load_performance
from facegen.fitting.fit import layout_points
from facegen.fitting.head_pose import rotation


@pytest.fixture(scope="module")
def hero(rig_file):
    return rig_file("arkit")


@pytest.fixture(scope="module")
def smile(hero):
    """68 landmarks (3, 68, 2) of a smile that grows, in a camera of 50 degrees."""
    face = facegen.load_face(hero)
    rows, _, _ = layout_points(face, "ibug68", 68)
    camera = facegen.Pinhole.of_view(50, (640, 480))
    return np.array([camera.project(rows @ face.pose_shapes({"mouthSmileLeft": w, "mouthSmileRight": w, "jawOpen": 0.3})
                                    @ rotation(10, 0, 0).T + (0.0, 0.0, -500.0)) for w in (0.0, 0.4, 0.8)])


def test_landmarks_become_weights(run, hero, smile, tmp_path):
    source, out = tmp_path / "points.npz", tmp_path / "weights.csv"
    np.savez(source, points=smile, times=[0.0, 0.1, 0.2])
    code, said, err = run("fit", source, "--rig", hero, "--camera", "fov=50", "--picture", "640x480", "--noise", "0.1",
                          "-o", out, "--json")
    assert code == 0, err
    told = json.loads(said)
    assert (told["frames"], told["fitted"], told["unit"], told["vocabulary"]) == (3, 3, "px", "arkit")
    assert told["residual"] < 0.2
    assert "eyeLookInLeft" in told["unseen"]
    found = load_performance(out)
    assert found.column("mouthSmileLeft") == pytest.approx([0.0, 0.4, 0.8], abs=0.03)
    assert found.head[:, 0] == pytest.approx([10, 10, 10], abs=0.1)
    assert found.times.tolist() == [0.0, 0.1, 0.2]
    assert found.extra["residual_px"].max() < 0.2


def test_the_same_as_a_table_of_named_markers(run, hero, tmp_path):
    face = facegen.load_face(hero)
    places = face.landmark_points(face.pose_shapes({"jawOpen": 0.5}))
    header = ["time", *(f"{name}_{axis}" for name in places for axis in "xyz"), "extra_x", "extra_y", "extra_z"]
    row = [0, *(f"{value:.6f}" for at in places.values() for value in at), 1, 2, 3]
    source, out = tmp_path / "m.csv", tmp_path / "w.csv"
    source.write_text(",".join(header) + "\n" + ",".join(map(str, row)) + "\n")
    code, _, err = run("fit", source, "--rig", hero, "-o", out)
    assert code == 2
    assert "no landmark 'extra'" in err
    marks = tmp_path / "marks.yaml"
    marks.write_text("markers:\n" + "".join(f"  {name}: {name}\n" for name in places))
    code, said, err = run("fit", source, "--rig", hero, "--markers", marks, "-o", out)
    assert code == 0, err
    assert "left out" in err
    assert "1 of 1 frames" in said
    assert load_performance(out).column("jawOpen") == pytest.approx(0.5, abs=0.03)


def test_meshes_of_the_face_itself(run, tmp_path):
    face = facegen.load_face()
    np.savez(tmp_path / "take.npz", vertices=[face.pose("6C+12D"), face.pose("4D")])
    code, said, err = run("fit", tmp_path / "take.npz", "-o", tmp_path / "w.csv", "--fps", "50", "-q")
    assert (code, said, err) == (0, "", "")
    found = load_performance(tmp_path / "w.csv")
    assert found.column("L12")[0] == pytest.approx(0.8, abs=0.02)
    assert found.times.tolist() == [0.0, 0.02]


def test_shares_of_a_picture_want_its_size(run, hero, smile, tmp_path):
    frames = [[{"x": x / 640, "y": y / 480, "z": 0.0} for x, y in frame] for frame in smile.tolist()]
    (tmp_path / "mp.json").write_text(json.dumps(frames))
    code, _, err = run("fit", tmp_path / "mp.json", "--rig", hero, "-o", tmp_path / "w.csv")
    assert code == 2
    assert "picture: the points are shares" in err
    code, _, err = run("fit", tmp_path / "mp.json", "--rig", hero, "--picture", "640x480", "-o", tmp_path / "w.csv")
    assert code == 0, err
    assert load_performance(tmp_path / "w.csv").column("mouthSmileLeft")[2] > 0.6


@pytest.mark.parametrize(("options", "said"), [
    (["--layout", "ibug86"], "did you mean 'ibug68'"),
    (["--layout", "mediapipe478"], "expected 478 points"),
    (["--camera", "fov=60"], "picture's size"),
    (["--camera", "fov=1e9", "--picture", "640x480"], "below 160"),
    (["--noise", "0"], "noise: expected a number above 0"),
    (["--sparsity", "-1"], "sparsity"),
    (["--neutral", "7"], "expected frames 0..2"),
    (["--neutral", "first"], "--neutral"),
    (["--set", "jawOpne"], "jawOpen"),
    (["--scale", "2"], "only places in space"),
    (["--markers", "x.yaml"], "numbered, not named"),
    (["--rig", "nobody"], "face: expected one of"),
    (["--fps", "0"], "fps"),
])
def test_bad_wishes_are_refused_and_nothing_is_touched(run, hero, smile, tmp_path, options, said):
    np.save(tmp_path / "p.npy", smile)
    out = tmp_path / "w.csv"
    out.write_text("what was there before")
    code, printed, err = run("fit", tmp_path / "p.npy", "--rig", hero, "-o", out, *options)
    assert (code, printed) == (2, "")
    assert said in err
    assert err.count("\n") == 1
    assert out.read_text() == "what was there before"


def test_bad_measurements_are_refused(run, hero, smile, tmp_path):
    for points, said in ((np.full((2, 68, 2), np.nan), "NaN everywhere"), (smile[:, :30], "of none that is known"),
                         (np.where(np.arange(68)[:, None] < 3, smile, np.nan), "points enough for a pose"),
                         (np.full((1, 68, 2), 300.0), "points enough for a pose")):
        np.save(tmp_path / "p.npy", points)
        code, _, err = run("fit", tmp_path / "p.npy", "--rig", hero, "-o", tmp_path / "w.csv")
        assert code == 2
        assert said in err
    code, _, err = run("fit", tmp_path / "p.npy", "--rig", hero)
    assert code == 2
    assert "-o: say where" in err
    code, _, err = run("fit", tmp_path / "p.npy", "--rig", hero, "-o", tmp_path / "w.mp3")
    assert code == 2
    assert "w.mp3" in err
    assert not (tmp_path / "w.csv").exists()

"""facegen convert: what it writes, what it says, what it refuses."""

from __future__ import annotations

import json

import numpy as np
import pytest

from facegen.animation.streams import load_performance

OPENFACE = "frame, face_id, timestamp, success, AU01_r, AU12_r, AU28_c\n" + "".join(
    f"{k + 1}, 0, {k * 0.04:.3f}, 1, {0.5 + 0.01 * k:.2f}, {k % 5}.00, 1\n" for k in range(50))
PYFEAT = "frame,FaceScore,AU01,AU12,input\n0,1,0.5,0.2,a.mp4\n1,1,0.5,0.3,a.mp4\n"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "of.csv").write_text(OPENFACE)
    (tmp_path / "pf.csv").write_text(PYFEAT)
    return tmp_path


def test_a_recording_in_another_format(run, folder):
    code, out, err = run("convert", "of.csv", "-o", "take.csv", "--to", "livelink", "--json")
    assert code == 0
    told = json.loads(out)
    assert (told["format"], told["from"], told["vocabulary"], told["frames"]) == ("livelink", "openface", "arkit", 50)
    assert told["residual"] == 0.0
    assert "units 28 are called present or absent only" in err
    one = load_performance("take.csv")
    assert one.rate == pytest.approx(25.0, abs=0.01)
    np.testing.assert_allclose(one.column("mouthSmileLeft")[:5], [0, 0.08, 0.25, 0.5, 0.8], atol=1e-9)


def test_cleaned_on_the_way(run, folder):
    code, out, err = run("convert", "of.csv", "-o", "a.json", "-q", "--calibrate", "0-0.1", "--gain", "12=0.5,1=2",
                         "--smooth", "1.5,2", "--resample", "50", "--presence", "0.3", "--json")
    assert (code, err) == (0, "")
    assert json.loads(out)["rate"] == pytest.approx(50.0)
    assert load_performance("a.json").column("mouthSmileLeft").max() < 0.5


def test_rates_for_files_without_times(run, folder):
    assert run("convert", "pf.csv", "-o", "a.json", "--fps", "30") == (0, "", "facegen: warning: " + str(
        load_performance("pf.csv", fps=30).warnings[0]) + "\n")
    assert load_performance("a.json").times.tolist() == [0.0, pytest.approx(1 / 30)]


def test_into_the_shapes_that_are_wished_for(run, folder):
    assert run("convert", "of.csv", "-o", "v.csv", "--to", "csv", "--vocabulary", "vrm", "-q")[0] == 0
    assert load_performance("v.csv").vocabulary == "vrm"


@pytest.mark.parametrize(("words", "message"), [
    (["of.csv"], "-o: say where it goes"),
    (["nothing.csv", "-o", "x.json"], "nothing.csv: there is no such file"),
    (["pf.csv", "-o", "x.json"], "say how many frames a second it has (--fps)"),
    (["of.csv", "-o", "x.json", "--fps", "0"], "--fps: expected frames a second"),
    (["of.csv", "-o", "x.json", "--id", "3"], "--id: of.csv has no face '3'"),
    (["of.csv", "-o", "x.json", "--presence", "3"], "--presence: expected a weight"),
    (["of.csv", "-o", "x.json", "--calibrate", "soon"], "--calibrate: expected FROM-TO in seconds"),
    (["of.csv", "-o", "x.json", "--calibrate", "7-9"], "--calibrate: no frame with a face in 7-9 s"),
    (["of.csv", "-o", "x.json", "--calibrate-head"], "--calibrate-head: say when head and gaze rest"),
    (["of.csv", "-o", "x.json", "--gain", "much"], "--gain: expected a number, or NAME=NUMBER"),
    (["of.csv", "-o", "x.json", "--gain", "13=2"], "--gain: the performance has no '13'"),
    (["of.csv", "-o", "x.json", "--gain", "-2"], "--gain: all: expected a number in 0..100"),
    (["of.csv", "-o", "x.json", "--smooth", "much"], "--smooth: expected on, CUTOFF"),
    (["of.csv", "-o", "x.json", "--smooth", "0"], "--smooth: cutoff: expected a number"),
    (["of.csv", "-o", "x.json", "--resample", "0"], "--resample: expected frames a second"),
    (["of.csv", "-o", "x.json", "--from", "openfase"], "--from: expected livelink, openface"),
    (["of.csv", "-o", "x.json", "--from", "livelink"], "expected the shapes of ARKit by name"),
    (["of.csv", "-o", "x.json", "--to", "livelnik"], "--to: expected livelink, openface"),
    (["of.csv", "-o", "x.json", "--to", "livelink"], "expected a name that ends in .csv for livelink"),
    (["of.csv", "-o", "x.csv", "--to", "csv", "--vocabulary", "arkitt"], "--vocabulary: expected units"),
    (["of.csv", "-o", "x.film"], "expected a name that ends in .csv"),
    (["of.csv", "-o", "no/x.json"], "the folder no does not exist"),
    (["a.json", "-o", "x.csv"], "say which format it is to be: livelink, openface, libreface, pyfeat"),
    (["junk", "-o", "x.json"], "if it is one of them nevertheless, say which (--from)"),
])
def test_what_is_wrong_is_said_and_nothing_is_written(run, folder, words, message):
    (folder / "junk").write_text("height,width\n1,2\n")
    (folder / "a.json").write_text('[{"time": 0, "blendshapes": {"jawOpen": 0.5}}]')
    before = {path: path.read_bytes() for path in folder.iterdir()}
    code, out, err = run("convert", *words)
    assert (code, out) == (2, "")
    assert message in err
    assert "Traceback" not in err
    assert {path: path.read_bytes() for path in folder.iterdir()} == before


def test_formats_are_listed(run):
    code, out, _ = run("list", "formats")
    assert code == 0
    assert "livelink" in out
    rows = json.loads(run("list", "formats", "--json")[1])
    assert {row["name"] for row in rows} >= {"openface", "pyfeat", "libreface", "livelink", "mediapipe", "csv"}

"""Live Link Face, MediaPipe and our own CSV: what each column becomes, and what is said when something is odd."""

from __future__ import annotations

import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from stream_samples import ARKIT_CSV, MEDIAPIPE, MEDIAPIPE_CSV, SHAPES, UNITS_CSV, livelink, mediapipe_frame

from facegen.animation.performance import Performance
from facegen.animation.streams import save_performance
from facegen.animation.streams.looks import gaze_of
from facegen.animation.streams.timecode import parsed, rate_of, seconds_of, timecodes
from facegen.blendshapes.recipes import shape_set
from facegen.errors import FileError, InputError


def said(one):
    return "\n".join(one.warnings)


def test_live_link_by_name_and_over_the_turn_of_a_minute(load):
    one = load(livelink(120, start=110 * 60.0 - 58 * 60))
    assert (one.about["format"], one.vocabulary) == ("livelink", "arkit")
    assert one.names == tuple(shape_set("arkit"))
    np.testing.assert_allclose(one.times, np.arange(120) * 1.001 / 60, atol=1e-5)
    assert one.column("jawRight")[0] == pytest.approx((SHAPES.index("JawRight") * 13 % 97) / 100)
    assert one.column("jawLeft")[0] == pytest.approx((SHAPES.index("JawLeft") * 13 % 97) / 100)
    assert one.warnings == ()


def test_live_link_frames_without_a_face(load):
    one = load(livelink(10, empty=(0, 4)))
    assert np.flatnonzero(~one.found).tolist() == [0, 4]
    assert np.isnan(one.head[4]).all()
    assert np.isnan(one.gaze[4]).all()
    assert "2 of 10 frames without a face (BlendShapeCount is 0), the first in line 2" in said(one)


def test_live_link_eyes_look_where_its_shapes_look(load):
    """An eye whose LookIn or LookDown is above 0 has a turn above 0 in the application's columns."""
    header = "Timecode,BlendShapeCount," + ",".join([*SHAPES, "HeadYaw", "HeadPitch", "HeadRoll", "LeftEyeYaw",
                                                     "LeftEyePitch", "LeftEyeRoll", "RightEyeYaw", "RightEyePitch",
                                                     "RightEyeRoll"])
    values = dict.fromkeys(SHAPES, 0.0) | {"EyeLookInLeft": 0.2, "EyeLookOutRight": 0.2, "EyeLookDownLeft": 0.1,
                                           "EyeLookDownRight": 0.1}
    turns = [0.3, 0.1, 0.05, 0.1, 0.05, 0.0, 0.1, 0.05, 0.0]
    row = ",".join(["00:00:01:00.000", "61", *map(str, values.values()), *map(str, turns)])
    one = load(f"{header}\n{row}\n")
    by_shapes = gaze_of(Performance(one.times, one.names, one.weights, "arkit"))
    np.testing.assert_array_equal(np.sign(one.gaze), np.sign(by_shapes))
    assert (np.sign(one.gaze[0]) == -1.0).all()         # to the subject's right, and down
    np.testing.assert_allclose(one.head[0], np.degrees([-0.3, -0.1, 0.05]))


@pytest.mark.parametrize(("change", "message"), [
    (lambda text: text.replace("18:4", "1843"), "Timecode: expected HH:MM:SS:FF.sub, got '18433"),
    (lambda text: text.replace("Left", "Links").replace("Right", "Rechts"), "expected the shapes of ARKit by name"),
])
def test_live_link_that_cannot_be_read(load, change, message):
    with pytest.raises(FileError, match=message):
        load(change(livelink(5)))


def test_live_link_with_a_column_missing_and_bad_lines(load):
    lines = livelink(20).splitlines()
    lines[5] = lines[5][:200]
    lines[9] = lines[9].replace("18:43:", "1x:43:")
    text = "\n".join(lines).replace("TongueOut", "Tongue")
    one = load(text[:-60])                              # and it stops in the middle of the last line
    assert len(one) == 17
    for word in ("columns that are missing: tongueOut", "line 10: no time; left out", "line 6 (",
                 "line 21: the file stops in the middle of a line, which is left out", "gaps of"):
        assert word in said(one)


def test_timecodes_that_do_not_show_their_rate(load):
    one = load(livelink(5, start=10.0, step=1.0))
    assert one.rate == pytest.approx(60.0)
    assert "do not show how many frames a second they count in; took 60" in said(one)
    assert load(livelink(5, start=10.0, step=1.0), fps=30).rate == pytest.approx(30.0)


@pytest.mark.parametrize("rate", [24.0, 25.0, 30.0, 50.0, 60.0, 120.0])
@pytest.mark.parametrize("step", [1, 2])
def test_timecodes_there_and_back(rate, step):
    times = np.arange(int(3 * rate)) * step / rate + 86390.0            # over midnight after ten seconds
    codes = [code if int(code[:2]) < 24 else f"{int(code[:2]) - 24:02d}{code[2:]}" for code in timecodes(times, rate)]
    parts = parsed(codes)
    assert rate_of(parts) == (rate, True)
    np.testing.assert_allclose(seconds_of(parts, rate), times - times[0], atol=2e-5)


@pytest.mark.parametrize("text", [
    MEDIAPIPE,
    json.dumps([mediapipe_frame(k) for k in range(3)]),
    json.dumps([mediapipe_frame(k, keys="py") for k in range(3)], indent=2),
    "\n".join(json.dumps(mediapipe_frame(k)) for k in range(3)),
    "\ufeff" + json.dumps({"results": [{"timestamp": 40 * k, "results": mediapipe_frame(k)} for k in range(3)]}),
    json.dumps([{"time": 0.04 * k, "blendshapes": {"_neutral": 0, "browDownLeft": 0.1, "jawOpen": 0.25,
                                                   "mouthSmileLeft": 0.5 + 0.01 * k}} for k in range(3)]),
])
def test_mediapipe_in_many_forms(load, text):
    one = load(text, "r.json")
    assert one.about["format"] == "mediapipe"
    np.testing.assert_allclose(one.times, [0.0, 0.04, 0.08])
    assert set(one.names) == {"browDownLeft", "jawOpen", "mouthSmileLeft"}
    np.testing.assert_allclose(one.column("mouthSmileLeft"), [0.5, 0.51, 0.52])
    assert list(one.extra) == ["_neutral"]
    assert one.warnings == ()


def test_mediapipe_frames_without_a_face_and_several_faces(load):
    frames = [mediapipe_frame(k) for k in range(4)]
    frames[1]["faceBlendshapes"] = []
    frames[2]["faceBlendshapes"] *= 2
    frames[2]["faceBlendshapes"][1] = mediapipe_frame(2, jaw=0.75)["faceBlendshapes"][0]
    one = load(json.dumps(frames), "r.json")
    assert one.found.tolist() == [True, False, True, True]
    assert "1 of 4 frames without a face" in said(one)
    assert "up to 2 faces in a frame; took the first" in said(one)
    other = load(json.dumps(frames), "r.json", person=1)
    assert other.found.tolist() == [False, False, True, False]
    assert other.column("jawOpen")[2] == 0.75
    with pytest.raises(InputError, match="has 2 faces, counted from 0; got '2'"):
        load(json.dumps(frames), "r.json", person=2)


@pytest.mark.parametrize("packed", [lambda m: {"rows": 4, "columns": 4, "data": m.T.ravel().tolist()},
                                    lambda m: m.tolist(), lambda m: m.ravel().tolist()])
def test_mediapipe_head_from_its_matrix(load, packed):
    matrix = np.eye(4)
    matrix[:3, :3] = Rotation.from_euler("YXZ", [20, -10, -5], degrees=True).as_matrix()
    matrix[:3, 3] = [1.0, 2.0, -40.0]
    frame = mediapipe_frame(0) | {"facialTransformationMatrixes": [packed(matrix)]}
    one = load(json.dumps([frame]), "r.json")
    np.testing.assert_allclose(one.head[0], [20.0, 10.0, 5.0], atol=1e-9)
    np.testing.assert_allclose(one.place[0], [10.0, 20.0, -400.0])


@pytest.mark.parametrize("cut", [0.4, 0.7, 0.95])
@pytest.mark.parametrize("form", ["lines", "list", "object"])
def test_mediapipe_that_stops_keeps_what_came_before(load, cut, form):
    frames = [mediapipe_frame(k) for k in range(20)]
    text = {"lines": "\n".join(map(json.dumps, frames)), "list": json.dumps(frames, indent=1),
            "object": json.dumps({"frames": frames})}[form]
    at = text.index("score", int(cut * len(text)))      # in the middle of a frame
    one = load(text[:at], "r.json")
    assert abs(len(one) - 20 * cut) <= 1.5
    np.testing.assert_allclose(one.column("mouthSmileLeft"), 0.5 + 0.01 * np.arange(len(one)))
    assert "the file stops in the middle of a frame" in said(one)


def test_mediapipe_whose_list_does_not_end(load):
    text = json.dumps([mediapipe_frame(k) for k in range(5)])
    one = load(text[:-1], "r.json")
    assert len(one) == 5
    assert "the file stops before its list ends; its 5 frames are kept" in said(one)


def test_mediapipe_with_one_bad_line(load):
    lines = [json.dumps(mediapipe_frame(k)) for k in range(6)]
    lines[3] = lines[3][:50]
    one = load("\n".join(lines), "r.json")
    assert len(one) == 5
    assert "line 4: cannot be read as JSON; left out" in said(one)
    assert "gap of 0.08 s after line 3" in said(one)


@pytest.mark.parametrize(("text", "message"), [
    ('{"faceBlendshapes": ', r"cannot be read as JSON: line 1, column 21"),
    ('{"faceBlendshapes": []}', "no frame has a category that is a shape of ARKit"),
    ('[]  {"jawOpen"', "is none of the recordings"),
    ('["browDownLeft", 3, null]', "no frame has a category"),
    ('{"categoryName": 3, "frames": []}', "has no frames"),
    ('["browDown", ' + "[" * 100_000, "nested too deeply"),
    ('[{"faceBlendshapes": [[{"categoryName": "jawOpen", "score": 1}]]}]', "its frames have no times; say how many"),
    ('[{"time": ' + "9" * 5000 + ', "faceBlendshapes": []}]', "cannot be read as JSON"),
    (b'{"browDown": "\xff\xfe"}', "not UTF-8 text"),
])
def test_mediapipe_that_cannot_be_read(load, text, message):
    with pytest.raises(FileError, match=message):
        load(text, "r.json")


def test_mediapipe_csv(load):
    one = load(MEDIAPIPE_CSV)
    assert one.about["format"] == "mediapipe-csv"
    assert one.found.tolist() == [True, True, False]
    np.testing.assert_allclose(one.times, [0.0, 0.04, 0.08])
    assert "_neutral" not in one.names
    assert "columns that are missing: eyeBlinkLeft" in said(one)
    assert load(MEDIAPIPE_CSV.replace("timestamp_ms", "number"), fps=50).rate == pytest.approx(50.0)


def test_seconds_in_a_column_of_milliseconds(load):
    one = load(MEDIAPIPE_CSV.replace("timestamp_ms", "timestamp").replace(",40,", ",0.04,").replace(",80,", ",0.08,"))
    np.testing.assert_allclose(one.times, [0.0, 0.04, 0.08])


def test_our_own_units(load):
    one = load(UNITS_CSV)
    assert (one.about["format"], one.vocabulary, one.names) == ("csv", "units", ("1", "L12", "R12", "26"))
    assert one.head.tolist() == [[10, 5, -2], [11, 5, -2]]


def test_our_own_shapes_as_others_spell_them(load):
    one = load(ARKIT_CSV)
    assert (one.vocabulary, one.names) == ("arkit", ("jawOpen", "eyeBlinkLeft", "eyeBlinkRight"))
    assert one.gaze[1].tolist() == [1, 2, 3, 4]
    assert list(one.extra["take"]) == ["a", "b"]


def test_our_own_with_names_that_are_nobodys(load):
    one = load("time,Blip,Blop\n0,0.5,1\n")
    assert (one.vocabulary, one.names) == ("shapes", ("Blip", "Blop"))
    with pytest.raises(InputError, match="are those of one rig"):
        save_performance(one, "x.csv", format="livelink")
    mixed = load("time,jawOpen,mouthClose,Blop\n0,0.5,1,1\n")
    assert mixed.names == ("jawOpen", "mouthClose")
    assert "no shapes of arkit, kept aside: Blop" in said(mixed)


def test_our_own_without_shapes(load):
    with pytest.raises(FileError, match="expected a column for each shape"):
        load("time,name\n0,x\n")


def test_many_bad_lines_are_one_warning(load):
    good = json.dumps(mediapipe_frame(0))
    one = load(good + '\n{"x' * 50 + "\n" + json.dumps(mediapipe_frame(1)), "r.json")
    assert len(one) == 2
    assert [warning for warning in one.warnings if "JSON" in warning] == [
        warning for warning in one.warnings if "lines 2, 3, 4 and 47 more: cannot be read as JSON; left out" in warning]

"""Read, written, read again: the same, to the last digit where the format is the same; and no file crashes a reader."""

from __future__ import annotations

import csv
import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from stream_samples import FILES, LIBREFACE, OPENFACE, PYFEAT, livelink

from facegen.animation.performance import Performance
from facegen.animation.streams import FORMATS, load_performance, save_performance, smoothed
from facegen.errors import FacegenError, FileError, InputError


def rows_of(path):
    with open(path, newline="") as file:
        return [[cell.strip() for cell in row] for row in csv.reader(file)]


def values_of(rows):
    def value(cell):
        try:
            return float(cell)
        except ValueError:
            return cell

    return [[value(cell) for cell in row] for row in rows]


@pytest.mark.parametrize(("text", "how"), [(OPENFACE, {}), (OPENFACE, {"presence": 0.5}), (PYFEAT, {"fps": 25}),
                                           (PYFEAT.replace(",0.1,-0.2,0.3,", ",4,-8,12,"), {"fps": 25}),
                                           (LIBREFACE, {}), (FILES["mediapipe-csv"][1], {}), (FILES["csv"][1], {})])
def test_every_value_and_column_comes_back(load, tmp_path, text, how):
    one = load(text, **how)
    save_performance(one, tmp_path / "out.csv")
    before, after = values_of(rows_of(tmp_path / "r.csv")), values_of(rows_of(tmp_path / "out.csv"))
    if one.about["format"] == "csv":                    # its names are put in our spelling
        assert {"time", "jawOpen", "eyeBlinkLeft", "take"} < set(after[0])
        assert [sorted(map(str, row)) for row in before[1:]] == [sorted(map(str, row)) for row in after[1:]]
        return
    added = set(after[0]) - set(before[0])
    assert added == ({"AU28_r"} if how.get("presence") else set())
    assert [name for name in after[0] if name not in added] == before[0]
    keep = [after[0].index(name) for name in before[0]]
    assert [[row[k] for k in keep] for row in after[1:]] == before[1:]


def test_live_link_comes_back_byte_for_byte(load, tmp_path):
    text = livelink(150)
    save_performance(load(text), tmp_path / "out.csv")
    assert (tmp_path / "out.csv").read_text() == text


def test_live_link_frames_without_a_face_come_back(load, tmp_path):
    one = load(livelink(9, empty=(3,)))
    save_performance(one, tmp_path / "out.csv")
    again = load_performance(tmp_path / "out.csv")
    np.testing.assert_array_equal(again.weights, one.weights)
    assert again.found.tolist() == one.found.tolist()


def test_what_was_changed_is_written_changed(load, tmp_path):
    """The columns as they stood do not come back where the performance says something else by now."""
    one = smoothed(load(OPENFACE))
    save_performance(one, tmp_path / "out.csv")
    again = load_performance(tmp_path / "out.csv")
    np.testing.assert_allclose(again.weights, one.weights, atol=1e-9)
    np.testing.assert_allclose(again.head, one.head, atol=1e-7)
    assert list(again.extra["x_0"]) == list(one.extra["x_0"])


@pytest.mark.parametrize("kind", FORMATS)
def test_a_performance_survives_each_format(kind, tmp_path):
    """What a format can hold comes back, with gaps, of a performance that was never in a file."""
    rng = np.random.default_rng(1)
    arkit = FORMATS[kind].vocabulary != "units"
    names = ("eyeBlinkLeft", "jawOpen", "mouthSmileLeft") if arkit else ("1", "4", "12")
    weights = np.round(rng.random((9, 3)), 6)
    weights[4] = np.nan
    gaze = rng.normal(size=(9, 4)) * 5
    gaze[:, 2:] = gaze[:, :2] if kind in ("pyfeat", "libreface") else gaze[:, 2:]       # they know one gaze
    one = Performance(np.arange(9) / 30 + 0.5, names, weights, "arkit" if arkit else "units",
                      head=rng.normal(size=(9, 3)) * 10, place=rng.normal(size=(9, 3)) * 100, gaze=gaze)
    path = tmp_path / f"x{FORMATS[kind].suffixes[0]}"
    written = save_performance(one, path, format=kind)
    again = load_performance(path)
    assert again.about["format"] == kind
    assert again.vocabulary == one.vocabulary
    np.testing.assert_allclose(np.diff(again.times), np.diff(one.times), atol=2e-5)
    for name in names:
        np.testing.assert_allclose(again.column(name), one.column(name), atol=1e-9)
    there = one.found
    for part in ("head", "place", "gaze"):
        if part in FORMATS[kind].parts:
            np.testing.assert_allclose(getattr(again, part)[there], getattr(one, part)[there], atol=1e-5)
        else:
            assert getattr(again, part) is None
            assert any(part in warning for warning in written.warnings)


def test_sides_that_a_format_cannot_tell_are_said(tmp_path):
    one = Performance([0.0, 0.1], ("L12", "R12", "R14", "L30", "23"), [[0.5, 0.3, 0.2, 1, 0.4]] * 2, "units")
    written = save_performance(one, tmp_path / "x.csv", format="openface")
    assert written.names == ("12", "14", "23")
    np.testing.assert_allclose(written.weights[0], [0.4, 0.1, 0.4])
    assert "the sides of 12, 14 are not told apart: their mean is written" in written.warnings
    assert "L30: units of one side only are left out" in written.warnings


def test_the_suffix_and_what_was_read_choose_the_format(load, tmp_path):
    one = load(PYFEAT, fps=30)
    save_performance(one, tmp_path / "a.csv")
    assert load_performance(tmp_path / "a.csv", fps=30).about["format"] == "pyfeat"
    save_performance(one, tmp_path / "a.json")
    assert load_performance(tmp_path / "a.json").about["format"] == "mediapipe"
    bare = Performance([0.0], ("12",), [[0.5]], "units")
    with pytest.raises(InputError, match=r"say which format it is to be: livelink, openface"):
        save_performance(bare, tmp_path / "b.csv")
    for name, match in (("b.xyz", "expected a name that ends in .csv"), ("nothing/b.csv", "does not exist")):
        with pytest.raises(FileError, match=match):
            save_performance(bare, tmp_path / name, *(["csv"] if "/" in name else []))
    with pytest.raises(FileError, match="ends in .csv for livelink, got .json"):
        save_performance(bare, tmp_path / "b.json", format="livelink")
    with pytest.raises(InputError, match="did you mean 'openface'"):
        save_performance(bare, tmp_path / "b.csv", format="openfase")
    with pytest.raises(InputError, match="expected a Performance, got dict"):
        save_performance({}, tmp_path / "b.csv")
    assert not (tmp_path / "b.csv").exists()


@pytest.mark.parametrize(("how", "match"), [
    ({"fps": 0}, "fps: expected frames a second"), ({"fps": "x"}, "fps: expected"),
    ({"presence": 2}, r"presence: expected a weight in 0\.\.1"), ({"presence": True}, "presence"),
    ({"format": "openfase"}, "did you mean 'openface'"), ({"smooth": 3}, "smooth: expected"),
    ({"calibrate": 3}, "calibrate: expected"), ({"person": "7"}, "has no face '7'")])
def test_arguments_that_are_wrong(load, how, match):
    with pytest.raises(InputError, match=match):
        load(OPENFACE, **how)


def test_the_path_must_be_one():
    with pytest.raises(InputError, match="path: expected the path of a recording, got int"):
        load_performance(3)


def test_a_write_that_fails_leaves_what_was_there(load, tmp_path, monkeypatch):
    one = load(OPENFACE)
    (tmp_path / "out.csv").write_text("before")
    from facegen.animation.streams import tabular

    def fails(text):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(tabular, "_quoted", fails)
    with pytest.raises((FileError, OSError)):
        save_performance(one, tmp_path / "out.csv")
    assert (tmp_path / "out.csv").read_text() == "before"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out.csv", "r.csv"]


MUTATIONS = st.lists(st.tuples(st.integers(0, 10_000), st.sampled_from(["cut", "byte", "drop", "twice", "line"]),
                               st.integers(0, 255)), min_size=1, max_size=4)


@pytest.mark.parametrize("kind", FILES)
@given(changes=MUTATIONS)
@settings(deadline=None, max_examples=150)
def test_no_broken_file_crashes_a_reader(kind, changes, tmp_path_factory):
    name, text = FILES[kind]
    content = bytearray(text.encode()[:6000])
    for where, how, value in changes:
        at = where % max(len(content), 1)
        if how == "cut":
            del content[at:]
        elif how == "byte" and content:
            content[at] = value
        elif how == "drop":
            del content[at:at + value]
        elif how == "twice":
            content[at:at] = content[at:at + value]
        else:
            content[at:at] = b"\n"
    path = tmp_path_factory.getbasetemp() / f"broken-{name}"
    path.write_bytes(bytes(content))
    for how in ({"fps": 30.0}, {"format": kind}):
        try:
            one = load_performance(path, **how)
        except FacegenError as error:
            assert str(path) in str(error)
        else:
            assert len(one) == len(one.weights)


JSON = st.recursive(st.none() | st.booleans() | st.floats() | st.text(max_size=4) | st.sampled_from(["jawOpen", "score"]),
                    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.sampled_from(
                        ["frames", "faceBlendshapes", "categories", "categoryName", "score", "timestampMs", "time",
                         "facialTransformationMatrixes", "data", "jawOpen"]), inner, max_size=4), max_leaves=12)


@given(JSON)
@settings(deadline=None, max_examples=200)
def test_no_json_crashes_the_reader(tmp_path_factory, value):
    path = tmp_path_factory.getbasetemp() / "any.json"
    path.write_text(json.dumps(value))
    try:
        load_performance(path, format="mediapipe")
    except FacegenError as error:
        assert str(path) in str(error)

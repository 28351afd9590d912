"""OpenFace, py-feat and LibreFace: what each column becomes, and what is said when something is odd."""

from __future__ import annotations

import numpy as np
import pytest
from stream_samples import LIBREFACE, OPENFACE, PYFEAT

from facegen.animation.streams.openface import intensities_of, weights_of
from facegen.errors import FileError, InputError
from facegen.face.head import turn_head
from facegen.facs.units import load_catalogue


def said(one):
    return "\n".join(one.warnings)


def test_openface_is_known_and_read(load):
    one = load(OPENFACE)
    assert one.about["format"] == "openface"
    assert (one.vocabulary, one.names) == ("units", ("1", "4", "6", "12", "45"))
    assert one.times.tolist() == [0.0, 0.04, 0.08, 0.2]
    assert one.frame(0) == {"1": 0.0, "4": 0.08, "6": 0.375, "12": 0.8, "45": 0.0}
    assert one.found.tolist() == [True, True, False, True]
    for part in (one.head, one.place, one.gaze):
        assert np.isfinite(part).all(axis=1).tolist() == [True, True, False, True]


def test_openface_says_what_is_odd_with_lines(load):
    text = said(load(OPENFACE))
    assert "columns that are missing: AU02_r, AU05_r" in text
    assert "1 of 4 frames without a face (success is not 1), the first in line 4" in text
    assert "gap of 0.12 s after line 4 (at 0.080 s): no frames there" in text
    assert "units 28 are called present or absent only; not among the weights" in text


def test_openface_intensities_are_the_letters():
    letters = load_catalogue()
    np.testing.assert_allclose(weights_of(np.arange(6.0)), [0, *letters.letters.values()])
    values = np.linspace(0, 5, 101)
    np.testing.assert_allclose(weights_of(values), [letters.from_openface(value) for value in values])
    wide = np.linspace(-1, 7, 101)
    np.testing.assert_allclose(intensities_of(weights_of(wide)), wide, atol=1e-12)


def test_openface_presence_counts_as_what_is_said(load):
    one = load(OPENFACE, presence=0.5)
    assert one.column("28").tolist()[:2] == [0.0, 0.5]
    assert "28" not in said(one)


def camera_rotation(x, y, z):
    """Rx Ry Rz, written out: the definition in OpenFace's wiki."""
    cx, cy, cz, sx, sy, sz = *np.cos([x, y, z]), *np.sin([x, y, z])
    return (np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]]) @ np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
            @ np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]]))


def test_the_face_turns_its_head_as_openface_saw_it(load):
    """Points in the camera's axes (x right in the picture, y down, z away), turned there and turned by our head."""
    one = load(OPENFACE.replace("0.10, -0.05, 0.02", "0.40, -0.50, 0.30"))
    points = np.random.default_rng(0).normal(size=(20, 3))
    flip = np.diag([1.0, -1.0, -1.0])
    there = points @ flip @ camera_rotation(0.40, -0.50, 0.30).T @ flip
    ours = turn_head(points, np.array([*one.head[0], 0.0]), np.zeros(3), np.ones((20, 1)))
    np.testing.assert_allclose(ours, there, atol=1e-12)


def test_openface_eyes_and_place_are_the_subjects(load):
    """Eye 0 is the leftmost in the picture, the subject's right; it looks to the picture's right, to the subject's
    left, and the head is turned 2.9 degrees that way."""
    one = load(OPENFACE)
    assert one.head[0, 0] > 2.0                         # Ry < 0: to the subject's left
    assert one.head[0, 1] < -5.0                        # Rx > 0: down
    assert one.gaze[0, 2] > 0.0 > one.gaze[0, 0]        # right eye to the left, left eye to the right: they meet
    assert one.place[0].tolist() == [12.5, 30.1, -580.2]
    straight = OPENFACE.replace("0.10, -0.05, 0.02", "0, 0, 0")
    yaw = np.degrees(np.arctan2(0.100, 0.994))
    np.testing.assert_allclose(load(straight).gaze[0, 2:], [yaw, -np.degrees(np.arctan(0.05 / np.hypot(0.1, 0.994)))])


def test_openface_several_faces(load):
    lines = OPENFACE.splitlines()
    two = "\n".join([lines[0], *(row for line in lines[1:] for row in (line, line.replace(", 0, ", ", 1, ", 1)))])
    two += "\n5, 1, 0.240, 0.95, 1" + ", 0" * 24
    one = load(two)
    assert (len(one), one.about["person"]) == (5, "1")
    assert "2 faces ('0' in 4 frames, '1' in 5 frames); took '1'" in said(one)
    other = load(two, person=0)
    assert (len(other), other.about["person"]) == (4, "0")
    assert "took" not in said(other)
    with pytest.raises(InputError, match="no face '7'; it has 0, 1"):
        load(two, person="7")


def test_openface_values_beyond_the_scale_are_kept_and_told(load):
    one = load(OPENFACE.replace("2.50, 4.00", "2.50, 5.30"))
    assert one.column("12")[0] > 1.0
    assert "AU12_r: 1 value outside 0..5, the first in line 2 (5.3); kept as they are" in said(one)


@pytest.mark.parametrize(("change", "message"), [
    (lambda text: text.replace("AU", "Action"), "is none of the recordings that are known by their content"),
    (lambda text: "\n".join(text.splitlines()[1:]), "expected the names of the columns, got numbers"),
    (lambda text: text.replace("timestamp", "when"), "has no times, only numbers of frames; say how many frames"),
    (lambda text: text.replace(", 4.00", ", four").replace(", 5.00", ", five").replace(", 0.40", ", x")
     .replace(", 3.00,", ", y,"), "column 'AU12_r': expected numbers, got ' four'"),
])
def test_openface_that_cannot_be_read(load, change, message):
    with pytest.raises(FileError, match=message):
        load(change(OPENFACE))


def test_openface_without_times_by_its_frames(load):
    one = load(OPENFACE.replace("timestamp", "when"), fps=50)
    np.testing.assert_allclose(one.times, [0.0, 0.02, 0.04, 0.06])


def test_said_to_be_openface_but_without_units(load):
    with pytest.raises(FileError, match="expected columns such as AU01_r"):
        load("frame,timestamp,success\n1,0,1\n", format="openface")


def test_pyfeat_needs_a_rate_and_skips_where_frames_are_skipped(load):
    with pytest.raises(FileError, match=r"only numbers of frames; say how many frames a second it has \(fps\)"):
        load(PYFEAT)
    one = load(PYFEAT, fps=25)
    assert (one.about["format"], one.vocabulary) == ("pyfeat", "units")
    np.testing.assert_allclose(one.times, [0.0, 0.04, 0.12])
    assert one.frame(0)["12"] == 0.75
    assert len(one.names) == 20
    np.testing.assert_allclose(one.head[0], np.degrees([-0.3, 0.1, 0.2]))


def test_pyfeat_degrees_of_its_first_versions(load):
    one = load(PYFEAT.replace(",0.1,-0.2,0.3,", ",4,-8,12,"), fps=25)
    np.testing.assert_allclose(one.head[0], [-12.0, 4.0, 8.0])


def test_pyfeat_several_faces_in_a_frame(load):
    lines = PYFEAT.splitlines()
    two = "\n".join([*lines[:2], lines[1].replace("0.75", "0.05"), *lines[2:]])
    assert load(two, fps=25).frame(0)["12"] == 0.75
    assert load(two, fps=25, person=1).frame(0)["12"] == 0.05
    named = "\n".join([lines[0] + ",Identity", *(f"{line},{who}" for line, who in zip(
        [lines[1], *lines[1:]], ["Person_1", "Person_0", "Person_0", "Person_0"], strict=True))])
    assert load(named, fps=25).about["person"] == "Person_0"
    with pytest.raises(InputError, match=r"no face 'Person_2'; did you mean"):
        load(named, fps=25, person="Person_2")


def test_libreface(load):
    one = load(LIBREFACE)
    assert (one.about["format"], one.names[:3], len(one.names)) == ("libreface", ("1", "2", "4"), 12)
    np.testing.assert_allclose(one.times, [0.0, 0.033333, 0.066667])
    assert one.frame(0)["12"] == 0.8
    assert one.head[0].tolist() == [-10.25, 3.5, 1.5]
    assert "units 7 are called present or absent only" in said(one)
    assert load(LIBREFACE, presence=0.25).column("7").tolist() == [0.25, 0.0, 0.0]
    assert list(one.extra["facial_expression"]) == ["Happiness", "Happiness", "Neutral"]


@pytest.mark.parametrize(("rows", "times", "message"), [
    ("0,1\n0.04,2\n0.02,3\n0.06,4", [0, 0.02, 0.04, 0.06], "line 4: earlier than the line before; put in the order"),
    ("0,1\n0.04,2\n0.04,3\n0.06,4", [0, 0.04, 0.06], "line 4: the time of another line; left out"),
    ("0,1\nnan,2\n0.02,3\n0.04,4", [0, 0.02, 0.04], "line 3: no time; left out"),
    ("0,1\n0.02,2\n0.04,3\n0.3,4\n0.32,5\n0.6,6", None, r"gaps of 0.26 s after line 4 \(at 0.040 s\), 0.28 s after line 6"),
])
def test_times_that_are_odd(load, rows, times, message):
    one = load(f"time,AU12\n{rows}\n")
    if times is not None:
        assert one.times.tolist() == times
    with pytest.raises(AssertionError, match=message):
        raise AssertionError(said(one))


def test_no_time_at_all(load):
    with pytest.raises(FileError, match="no row has a time"):
        load("time,AU12\nnan,1\nnan,2\n")


def test_units_that_are_none_are_told(load):
    one = load("time,AU12_r,AU99_r,AU30_r\n0,1,1,1\n")
    assert one.names == ("12",)
    assert "AU99, AU30: no units of this face" in said(one)

"""Layouts of landmarks: complete, symmetric, on the skin, and carried over to other rigs."""

import numpy as np
import pytest

import facegen
from facegen.face.landmarks import REQUIRED
from facegen.fitting.fit import layout_points
from facegen.fitting.layouts import layout_names, load_layout

IBUG_PAIRS = {**{i: 16 - i for i in range(17)}, **{17 + i: 26 - i for i in range(5)}, 31: 35, 32: 34, 36: 45, 37: 44,
              38: 43, 39: 42, 40: 47, 41: 46, 48: 54, 49: 53, 50: 52, 58: 56, 59: 55, 60: 64, 61: 63, 67: 65}


def test_all_68_points_have_a_place_and_a_mirror_image(base):
    layout = load_layout("ibug68")
    assert layout_names() == ("ibug68", "mediapipe478")
    assert layout.indices.tolist() == list(range(68))
    rows, share, _ = layout_points(base, "ibug68", 68)
    at = rows @ base.mesh().vertices
    assert rows.sum(axis=1) == pytest.approx(1.0)
    assert (share > 0).all()
    pairs = {**IBUG_PAIRS, **{b: a for a, b in IBUG_PAIRS.items()}}
    for index in range(68):
        assert at[pairs.get(index, index)] == pytest.approx(at[index] * (-1, 1, 1), abs=0.05), index
    assert at[0][0] < -50                               # the subject's right, as annotators count
    assert (np.diff(at[:9, 1]) < 0).all()               # down the outline to the chin
    assert (at[36][0], at[39][0]) == pytest.approx((-42.0, -16.4), abs=0.1)


def test_the_lips_points_lie_on_their_own_lips(base):
    at, opened = (layout_points(base, "ibug68", 68)[0] @ vertices for vertices in
                  (base.mesh().vertices, base.pose({"27": 1.0})))
    moved = (opened - at)[:, 1]
    assert (moved[[49, 50, 51, 52, 53, 61, 62, 63]] > -6.0).all()
    assert (moved[[55, 56, 57, 58, 59, 65, 66, 67]] < -8.0).all()


def test_the_points_of_mediapipe_say_why(base):
    layout = load_layout("mediapipe478")
    assert len(layout.indices) > 120
    assert layout.indices.max() == 473
    assert {468, 473, 33, 263, 61, 291, 13, 14, 152} <= set(layout.indices.tolist())
    assert set(layout.groups) == set(layout.why)
    assert all(layout.why.values())
    at = dict(zip(layout.indices.tolist(), layout_points(base, "mediapipe478", 478)[0] @ base.mesh().vertices,
                  strict=True))
    marks = base.landmark_points(base.mesh().vertices)
    for index, name in {33: "eye_outer_R", 263: "eye_outer_L", 61: "mouth_corner_R", 291: "mouth_corner_L",
                        13: "mouth_inner_top", 468: "eye_center_R", 1: "nose_tip", 152: "chin"}.items():
        assert np.linalg.norm(at[index] - marks[name]) < (16 if name == "chin" else 3), name


def test_carried_over_to_the_same_head_they_come_to_the_same_places(base, avatar):
    for name in layout_names():
        mine, share, indices = layout_points(base, name, None)
        theirs, again, same = layout_points(avatar, name, None)
        assert same.tolist() == indices.tolist()
        assert (again == share).all()
        for pose in ("0", "27E", "12D+25C"):
            off = np.linalg.norm(mine @ base.pose(pose) - theirs @ avatar.pose(pose), axis=1)
            assert np.median(off) < 0.5
            assert off.max() < 4.0


def test_an_avatar_without_pupils_goes_without_those_points(rig_of):
    made = rig_of("arkit")
    marks = {name: at for name, at in made.notes["landmarks"].items() if name in REQUIRED}
    from dataclasses import replace

    face = facegen.AvatarFace(replace(made, notes={**made.notes, "landmarks": marks}))
    rows, share, indices = layout_points(face, "mediapipe478", 478)
    assert not {468, 473} & set(indices.tolist())
    assert rows.shape[0] == len(share) == len(indices)
    assert layout_points(face, "ibug68", 68)[0].shape[0] == 68


def test_a_rig_whose_landmarks_are_unknown_is_refused(rig_of):
    face = facegen.AvatarFace(rig_of("arkit", notes=False))
    with pytest.raises(facegen.InputError, match="facegen rig notes them"):
        layout_points(face, "ibug68", 68)
    with pytest.raises(facegen.InputError, match="did you mean 'ibug68'"):
        load_layout("ibug86")
    with pytest.raises(facegen.InputError, match="expected 68 points"):
        layout_points(facegen.load_face(), "ibug68", 51)

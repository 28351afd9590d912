"""Checks of landmarks while only some are set: right ones pass however few there are, swapped ones are told."""

from functools import cache

import numpy as np
import pytest

from facegen.fileio.avatar import load_avatar
from facegen.transfer.landmark_checks import place_faults
from facegen.transfer.landmarks import load_landmarks
from facegen.transfer.rig import avatar_files, avatar_names


@cache
def avatar(name):
    path, marks = avatar_files(name, None)
    mesh = load_avatar(path).mesh
    return mesh, load_landmarks(marks, mesh)


def faults(name, places):
    """Return the errors for places of an avatar: name -> the landmark that it is set on."""
    mesh, marks = avatar(name)
    rows = [marks.names.index(where) for where in places.values()]
    return place_faults(tuple(places), marks.corners[rows], marks.barycentric[rows], mesh)[0]


@pytest.mark.parametrize("name", avatar_names())
def test_any_few_of_right_places_pass(name):
    names = avatar(name)[1].names
    random = np.random.default_rng(3)
    for count in (1, 2, 3, 5, 6, 8, 10, 14, 20):
        some = random.choice(names, size=count, replace=False)
        assert not faults(name, {one: one for one in some}), list(some)


@pytest.mark.parametrize("name", avatar_names())
def test_left_and_right_swapped_are_told_after_three_clicks(name):
    places = {"eye_outer_L": "eye_outer_R", "eye_outer_R": "eye_outer_L", "mouth_bottom": "mouth_bottom"}
    assert "swapped" in " ".join(faults(name, places))


@pytest.mark.parametrize("name", ["human", "cartoon"])
@pytest.mark.parametrize("swapped", [("nose_wing_L", "nose_wing_R"), ("mouth_top", "mouth_bottom"),
                                     ("mouth_corner_L", "mouth_corner_R")])
def test_a_swapped_pair_among_eight_is_told(name, swapped):
    eight = ("eye_outer_L", "eye_outer_R", "eye_inner_L", "eye_inner_R", "nose_tip", "chin", *swapped)
    places = {one: one for one in eight} | {swapped[0]: swapped[1], swapped[1]: swapped[0]}
    assert faults(name, {one: one for one in eight}) == []
    assert swapped[0] in " ".join(faults(name, places))

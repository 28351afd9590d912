"""The similarity between two faces' landmarks: exact on copies, equivariant, not fooled by a muzzle."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from landmark_sets import average, cat, horse, person
from scipy.spatial.transform import Rotation

from facegen.errors import InputError
from facegen.transfer.alignment import Similarity, align

ANGLES = st.tuples(*[st.floats(-180, 180)] * 3)
MAKERS = [person, cat, horse]


def turned(points, angles=(20.0, -70.0, 140.0), scale=3.7, offset=(10.0, -2000.0, 30.0)):
    move = Similarity(scale, Rotation.from_euler("xyz", angles, degrees=True).as_matrix(), np.array(offset))
    return {name: move.apply(place) for name, place in points.items()}


@settings(max_examples=25, deadline=None)
@given(ANGLES, st.floats(1e-3, 1e3), st.tuples(*[st.floats(-1e3, 1e3)] * 3))
def test_a_moved_copy_comes_back(angles, scale, offset):
    copy = turned(average(), angles, scale, offset)
    found = align(copy, average())
    for name, place in average().items():
        np.testing.assert_allclose(found.apply(copy[name]), place, atol=1e-9)


@pytest.mark.parametrize("make", MAKERS)
@pytest.mark.parametrize("angles", [(0, 0, 0), (90, 0, 0), (0, 180, 0), (-90, 90, 13), (1e-9, 0, 0)])
@pytest.mark.parametrize("scale", [1e-3, 1.0, 400.0])
def test_the_working_frame_does_not_depend_on_the_file_s(make, angles, scale):
    points = make()
    base = align(points, average())
    copy = turned(points, angles, scale, (3 * scale, 90 * scale, -7 * scale))
    found = align(copy, average())
    for name, place in points.items():
        np.testing.assert_allclose(found.apply(copy[name]), base.apply(place), atol=1e-9)


@pytest.mark.parametrize("make", MAKERS)
def test_rotations_are_proper_and_left_stays_left(make):
    found = align(turned(make()), average())
    np.testing.assert_allclose(found.rotation @ found.rotation.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(found.rotation) > 0
    at = {name: found.apply(place) for name, place in turned(make()).items()}
    for name in at:
        if name.endswith("_L"):
            across = at[name] - at[f"{name[:-2]}_R"]
            assert across[0] > 0
            assert make is person or np.abs(across[1:]).max() < 1e-9 * across[0]
    assert at["brow_mid_L"][1] > at["mouth_corner_L"][1] > at["chin"][1]


def test_the_horse_keeps_its_size_and_holds_its_head():
    found = align(horse(), average())
    at = {name: found.apply(place) for name, place in horse().items()}
    eyes = np.linalg.norm(at["eye_upper_L"] - at["eye_upper_R"])
    assert 20 < eyes < 90                               # a person's are 58 apart
    muzzle = at["nose_tip"] - (at["eye_upper_L"] + at["eye_upper_R"]) / 2
    assert 20 < np.degrees(np.arctan2(-muzzle[1], muzzle[2])) < 80      # forward and down, neither level nor hanging
    up = at["eye_upper_L"] - at["eye_lower_L"]
    assert up[1] > 0


def test_one_place_that_slipped_moves_the_others_little():
    points = person()
    points["nose_tip"] = points["nose_tip"] + [0, 0, 80.0]
    a, b = align(person(), average()), align(points, average())
    drift = [np.linalg.norm(a.apply(place) - b.apply(place)) for name, place in points.items() if name != "nose_tip"]
    assert max(drift) < 5.0


@settings(max_examples=20, deadline=None)
@given(ANGLES, st.floats(1e-2, 1e2))
def test_there_and_back(angles, scale):
    one = Similarity(scale, Rotation.from_euler("xyz", angles, degrees=True).as_matrix(), np.array([1.0, 2.0, 3.0]))
    at = np.random.default_rng(0).normal(size=(4, 3))
    np.testing.assert_allclose(one.inverse().apply(one.apply(at)), at, atol=1e-10)
    np.testing.assert_allclose(one.apply_vectors(at), one.apply(at) - one.apply(np.zeros(3)), atol=1e-9 * scale)


def test_without_pairs_it_is_umeyama_s():
    rng = np.random.default_rng(1)
    points = {name: rng.normal(size=3) for name in ("a", "b", "c", "d", "e")}
    found = align(turned(points), points)
    for name, place in turned(points).items():
        np.testing.assert_allclose(found.apply(place), points[name], atol=1e-9)


@pytest.mark.parametrize(("points", "words"), [
    ({"chin": [0, 0, 0], "nose_tip": [0, 1, 0]}, "at least three landmarks"),
    ({"chin": [0, 0, 0], "nose_tip": [0, 1, 0], "mouth_top": [0, 2, 0]}, "on one line"),
    ({"chin": [0, 0, 0], "nose_tip": [0, 0, 0], "mouth_top": [0, 0, 0]}, "on one line or one place"),
    ({"chin": [0, 0, 0], "nose_tip": [0, np.nan, 0], "mouth_top": [1, 2, 0]}, "three finite numbers"),
    ({"chin": [0, 0], "nose_tip": [0, 1, 0], "mouth_top": [1, 2, 0]}, "three finite numbers"),
    ({"chin": "here", "nose_tip": [0, 1, 0], "mouth_top": [1, 2, 0]}, "three finite numbers"),
])
def test_places_that_fix_nothing(points, words):
    with pytest.raises(InputError, match=f"source: .*{words}"):
        align(points, average())

"""A whole performance in another vocabulary: head and eyes as angles, what is lost said."""

from __future__ import annotations

import numpy as np
import pytest
from stream_samples import ARKIT_CSV, OPENFACE

from facegen.animation.performance import Performance
from facegen.animation.streams import translated
from facegen.animation.streams.looks import SHAPES, UNITS, gaze_of, shapes_of, units_of
from facegen.errors import InputError


def made(names, weights, vocabulary="units", **parts):
    weights = np.atleast_2d(np.asarray(weights, float))
    return Performance(np.arange(len(weights)) / 25, names, weights, vocabulary, **parts)


def test_the_same_vocabulary_is_the_same(load):
    one = load(OPENFACE)
    assert translated(one, "units") is one


def test_gaps_stay_gaps_and_the_loss_is_told(load):
    one = load(OPENFACE)
    there = translated(one, "arkit")
    assert there.vocabulary == "arkit"
    assert there.found.tolist() == one.found.tolist()
    assert float(there.about["residual"]) < 0.1
    other = translated(made(("12", "23"), [[0.5, 0.9]] * 3), "arkit")
    assert "% of the movement is lost, most of it of 23" in other.warnings[-1]
    assert float(other.about["residual"]) > 0.1
    assert translated(made(("12",), [[0.5]]), "arkit").warnings == ()


def test_gaze_becomes_looks_and_looks_become_gaze(load):
    one = load(OPENFACE)
    there = translated(one, "arkit")
    assert set(SHAPES) & set(there.names)
    plain = Performance(there.times, there.names, there.weights, "arkit")
    np.testing.assert_allclose(gaze_of(plain)[one.found], one.gaze[one.found], atol=1e-9)


def test_looks_become_units_as_angles():
    gaze = np.array([[12.0, 5, 8, 5], [-20, -10, -20, -10], [3, 0, -3, 0], [-2, 8, 2, 8]])
    shapes = made(SHAPES, np.column_stack([shapes_of(gaze)[name] for name in SHAPES]), "arkit")
    np.testing.assert_allclose(gaze_of(shapes), gaze, atol=1e-12)
    units = translated(shapes, "units")
    assert set(units.names) <= set(UNITS)
    np.testing.assert_allclose(gaze_of(units), gaze, atol=1e-12)
    np.testing.assert_allclose(gaze_of(translated(units, "arkit")), gaze, atol=1e-12)
    far = units_of(np.full((1, 4), 90.0))
    assert (far["61"][0], far["63"][0]) == (1.0, 1.0)


def test_head_units_become_the_heads_turn():
    one = made(("51", "54", "12"), [[0.5, 0.25, 0.5], [0.0, 1.0, 0.5]])
    there = translated(one, "arkit")
    assert there.head.tolist() == [[15.0, -5.0, 0.0], [0.0, -20.0, 0.0]]
    assert set(there.names) == {"mouthSmileLeft", "mouthSmileRight"}
    recorded = translated(made(("51", "12"), [[0.5, 0.5]], head=[[1, 2, 3]]), "arkit")
    assert recorded.head.tolist() == [[1.0, 2.0, 3.0]]


def test_units_of_the_head_that_no_angle_says_are_told():
    assert "left out: 57" in translated(made(("57", "12"), [[0.5, 0.5]]), "arkit").warnings[0]


def test_weights_beyond_the_scale_are_cut_and_told():
    there = translated(made(("12",), [[1.2], [-0.1], [0.5]]), "arkit")
    assert "2 weights outside 0..1 were cut" in there.warnings
    assert there.column("mouthSmileLeft").tolist() == [1.0, 0.0, 0.5]


def test_single_numbers_that_are_missing_count_as_rest():
    there = translated(made(("12", "4"), [[0.5, np.nan], [np.nan, np.nan]]), "arkit")
    assert there.column("mouthSmileLeft")[0] == 0.5
    assert np.isnan(there.weights[1]).all()


def test_a_performance_of_lost_frames_only():
    there = translated(made(("12",), [[np.nan], [np.nan]]), "arkit")
    assert (there.names, there.weights.shape) == ((), (2, 0))


def test_what_cannot_be_translated(load):
    with pytest.raises(InputError, match="did you mean 'arkit'"):
        translated(load(ARKIT_CSV), "arkitt")
    with pytest.raises(InputError, match="are those of one rig"):
        translated(made(("a", "b"), [[0, 1]], "shapes"), "arkit")

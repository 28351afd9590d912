"""A performance in time: gaps, moments between frames, what is warned of."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import facegen
from facegen.animation.performance import Performance
from facegen.animation.playback import Playback, bridged

NAN = np.nan


def recorded(weights, names=("jawOpen",), vocabulary="arkit", start=3.0, rate=10.0, **more):
    weights = np.array(weights, float).reshape(-1, len(names))
    return Performance(start + np.arange(len(weights)) / rate, names, weights, vocabulary, **more)


def test_a_short_gap_is_bridged_and_a_long_one_held():
    times = np.arange(12) / 10
    short = bridged(times[:5], np.array([0.0, NAN, NAN, NAN, 1.0]), 0.5)
    np.testing.assert_allclose(short, [0, 0.25, 0.5, 0.75, 1])
    long = bridged(times, np.array([0.0, *[NAN] * 10, 1.0]), 0.5)
    np.testing.assert_allclose(long, [0] * 7 + [0.2, 0.4, 0.6, 0.8, 1], atol=1e-12)
    np.testing.assert_array_equal(bridged(times[:4], np.array([NAN, 0.3, 0.4, NAN]), 0.5), [0.3, 0.3, 0.4, 0.4])
    np.testing.assert_array_equal(bridged(times[:3], np.full(3, NAN), 0.5), 0)
    np.testing.assert_array_equal(bridged(times[:3], np.array([0.1, NAN, 0.9]), 0.0), [0.1, 0.1, 0.9])


@given(st.lists(st.one_of(st.just(NAN), st.floats(0, 1)), min_size=1, max_size=30), st.floats(0, 2))
def test_what_was_recorded_stays_and_nothing_else_goes_beyond(values, bridge):
    values = np.array(values)
    filled = bridged(np.arange(len(values)) / 7, values, bridge)
    known = np.isfinite(values)
    np.testing.assert_array_equal(filled[known], values[known])
    assert np.isfinite(filled).all()
    low, high = (values[known].min(), values[known].max()) if known.any() else (0, 0)
    assert filled.min() >= low - 1e-12
    assert filled.max() <= high + 1e-12


def test_moments():
    play = Playback(recorded([0.0, 1.0, 0.5]))
    assert play.duration == pytest.approx(0.3)
    assert play.frames(10) == 3
    for t, expected in ((-1, 0), (0, 0), (0.05, 0.5), (0.1, 1), (0.15, 0.75), (0.2, 0.5), (0.29, 0.5), (9, 0.5)):
        assert play.cue(t).weights[0] == pytest.approx(expected), t
    assert Playback(recorded([0.4])).cue(0.0).weights == [0.4]
    assert Playback(recorded([0.4])).frames(25) == 1


def test_shapes_go_before_angles():
    gaze, head = np.tile([5.0, 0, 5, 0], (2, 1)), np.tile([5.0, 0, 0], (2, 1))
    plain = Playback(recorded([0, 1], gaze=gaze, head=head)).cue(0.05)
    np.testing.assert_allclose(plain.gaze, gaze[0])
    np.testing.assert_allclose(plain.head, head[0])
    looking = Playback(recorded([[0, 0], [1, 1]], ("jawOpen", "eyeLookUpLeft"), gaze=gaze))
    assert looking.cue(0).gaze is None
    never = Playback(recorded([[0, NAN], [1, NAN]], ("jawOpen", "eyeLookUpLeft"), gaze=gaze))
    assert never.cue(0).gaze is not None
    turning = Playback(recorded([[0, 0], [1, 1]], ("12", "51"), "units", head=head))
    assert turning.cue(0).head is None
    assert Playback(recorded([0, 1], gaze=np.full((2, 4), NAN))).cue(0).gaze is None


def test_warnings():
    play = Playback(recorded([[0.1, NAN], [NAN, NAN], [0.2, NAN]], ("jawOpen", "cheekPuff"), head=np.array(
        [[50.0, 0, 0], [0, 0, 0], [-3, -25, 0]]), gaze=np.tile([26.0, 0, 0, 0], (3, 1)), warnings=("odd",)))
    assert play.warnings == (
        "odd", "cheekPuff: never recorded, so at rest",
        "1 of 3 frames have gaps: up to 0.5 s are bridged in a straight line, in longer ones the face holds",
        "the head turns beyond reach in 2 frames (yaw -3..50 of -30..30, pitch -25..0 of -20..20 degrees); they are "
        "clipped",
        "the eyes turn beyond reach in 3 frames (yaw_L 26..26 of -25..25 degrees); they are clipped")
    face = facegen.load_face()
    assert play.check(face) == ()
    wild = Playback(recorded([-0.5, 1.5, 0.5]))
    assert wild.check(face) == ("2 frames have weights outside 0..1 (from -0.5 to 1.5); they are clipped",)


def test_an_avatars_own_shapes_may_leave_the_range(rig_file):
    avatar = facegen.load_face(rig_file("arkit"))
    assert Playback(recorded([-0.5, 1.5, 0.5])).check(avatar) == ()


def test_what_workers_get_is_small_and_whole():
    play = Playback(recorded(np.random.default_rng(0).uniform(size=(2000, 3)), ("jawOpen", "cheekPuff", "mouthLeft")))
    assert len(pickle.dumps(play.shown)) < 500
    assert len(pickle.dumps(play.cue(0.3))) < 500
    other = Playback(recorded(play.performance.weights + 1e-9, play.performance.names))
    assert play.shown.digest != other.shown.digest
    assert play.shown == Playback(play.performance).shown


def test_corners_are_where_it_goes_farthest():
    play = Playback(recorded([0, 0.2, 1, 0.3, 0], head=np.array([[0.0, 0, 0], [9, 0, 0], [0, 0, 0], [-9, 0, 0],
                                                                 [0, 0, 0]])))
    assert {0.1, 0.2, 0.3} <= {round(t, 9) for t in play.corners}


@pytest.mark.parametrize(("what", "words"), [({"performance": "a.csv"}, "performance: expected a Performance"),
                                             ({"bridge": -1}, "bridge: expected seconds"),
                                             ({"bridge": NAN}, "bridge: expected seconds")])
def test_bad_input(what, words):
    with pytest.raises(facegen.InputError, match=words):
        Playback(**{"performance": recorded([0.1]), **what})

"""Smoothing, calibration, even steps: laws, oracles, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from stream_samples import OPENFACE

from facegen.animation.performance import Performance
from facegen.animation.streams import Calibration, Filter, OneEuro, calibrated, resampled, smoothed
from facegen.animation.streams.calibrate import LARGEST_OFFSET, parse_calibration
from facegen.animation.streams.smooth import one_euro, parse_smooth
from facegen.errors import InputError


def recording(weights, times=None, names=None, **parts):
    weights = np.asarray(weights, float)
    times = np.arange(len(weights)) / 30 if times is None else times
    names = names or ("1", "2", "4", "5")[:weights.shape[1]]
    return Performance(times, names, weights, "units", **parts)


def one_euro_of_the_paper(times, values, cutoff, beta, speed):
    """The algorithm of Casiez et al. 2012 for one number, line by line; for steps of any length."""
    def alpha(step, frequency):
        tau = 1.0 / (2.0 * np.pi * frequency)
        return 1.0 / (1.0 + tau / step)

    result, x, dx = [values[0]], values[0], 0.0
    for k in range(1, len(values)):
        step = times[k] - times[k - 1]
        a = alpha(step, speed)
        dx = a * (values[k] - x) / step + (1 - a) * dx
        a = alpha(step, cutoff + beta * abs(dx))
        x = a * values[k] + (1 - a) * x
        result.append(x)
    return np.array(result)


@given(st.integers(0, 10_000), st.floats(0.1, 10), st.floats(0, 20), st.floats(0.1, 10))
@settings(deadline=None, max_examples=40)
def test_one_euro_is_the_papers(seed, cutoff, beta, speed):
    rng = np.random.default_rng(seed)
    times, values = np.cumsum(rng.uniform(0.005, 0.1, 40)), rng.random((40, 2))
    ours = one_euro(times, values, OneEuro(cutoff, beta, speed))
    for k in range(2):
        np.testing.assert_allclose(ours[:, k], one_euro_of_the_paper(times, values[:, k], cutoff, beta, speed))


def test_a_still_face_is_calmed_and_a_blink_stays():
    rng = np.random.default_rng(0)
    noise = 0.5 + 0.02 * rng.normal(size=(300, 1))
    assert smoothed(recording(noise)).weights[30:].std() < 0.5 * noise[30:].std()
    blink = np.zeros((60, 1))
    blink[20:28, 0] = [0.3, 0.8, 1, 1, 0.8, 0.5, 0.3, 0.1]
    assert smoothed(recording(blink)).weights.max() > 0.75


def test_constant_stays_constant_and_all_stays_within_what_was_there():
    values = np.full((20, 2), 0.3)
    np.testing.assert_array_equal(smoothed(recording(values)).weights, values)
    rough = np.random.default_rng(1).random((200, 2))
    smooth = smoothed(recording(rough)).weights
    assert smooth.min() >= rough.min()
    assert smooth.max() <= rough.max()


def test_missing_frames_stay_missing_and_do_not_spread():
    values = np.random.default_rng(1).random((60, 2))
    values[20:24, 0] = np.nan
    smooth = smoothed(recording(values)).weights
    assert np.isnan(smooth[20:24, 0]).all()
    assert np.isfinite(smooth).sum() == np.isfinite(values).sum()
    left = np.delete(np.arange(60), range(20, 24))
    np.testing.assert_allclose(smooth[left, :1], one_euro(left / 30, values[left, :1], OneEuro()))


def test_after_a_long_gap_the_filter_starts_anew():
    times = np.array([0.0, 0.03, 0.06, 3.0, 3.03])
    smooth = smoothed(recording([[0.0], [0.0], [0.0], [1.0], [1.0]], times)).weights
    assert smooth[3:, 0].tolist() == [1.0, 1.0]


def test_frame_by_frame_is_the_whole():
    values, times = np.random.default_rng(3).random((50, 4)), np.arange(50) / 60
    state = Filter(OneEuro(2.0, 1.0))
    np.testing.assert_array_equal([state.push(time, row) for time, row in zip(times, values, strict=True)],
                                  one_euro(times, values, OneEuro(2.0, 1.0)))


def test_head_and_gaze_are_smoothed_too(load):
    one = load(OPENFACE, smooth="1,0")
    plain = load(OPENFACE)
    for part in ("weights", "head", "place", "gaze"):
        a, b = getattr(one, part), getattr(plain, part)
        np.testing.assert_array_equal(np.isnan(a), np.isnan(b))
        assert not np.allclose(a[1], b[1], rtol=1e-6)
    assert one.about["smooth"] == "1,0"


@pytest.mark.parametrize(("text", "value"), [("on", OneEuro()), ("2", OneEuro(2.0)), ("2, 0.5", OneEuro(2.0, 0.5))])
def test_what_smooth_means(text, value):
    assert parse_smooth(text) == value


@pytest.mark.parametrize("text", ["", "a", "1,2,3", "-1", "0", "1,-1", "nan", "1e9"])
def test_what_smooth_cannot_mean(text):
    with pytest.raises(InputError, match="smooth: "):
        parse_smooth(text)


def test_a_face_at_rest_is_zero_and_a_full_movement_stays_one():
    weights = np.array([[0.2, 0.1], [0.2, 0.1], [0.2, 0.3], [1.0, 0.55], [0.6, 0.05]])
    one = calibrated(recording(weights), parse_calibration("0-0.05"))
    np.testing.assert_allclose(one.weights, [[0, 0], [0, 0], [0, 0.2 / 0.9], [1, 0.5], [0.5, 0]], atol=1e-12)


def test_a_percentile_is_the_neutral_of_those_who_never_sat_still():
    rng = np.random.default_rng(0)
    weights = 0.3 + 0.7 * rng.random((500, 1)) ** 4
    one = calibrated(recording(weights), parse_calibration("5%"))
    assert np.percentile(one.weights, 5) < 1e-6
    assert one.weights.max() == pytest.approx((weights.max() - 0.3) / 0.7, abs=0.01)


def test_offsets_and_gains_by_name():
    one = recording([[0.5, 0.5]])
    how = Calibration(offsets={"1": 0.2}, gain={"2": 0.5})
    np.testing.assert_allclose(calibrated(one, how).weights, [[0.375, 0.25]])
    np.testing.assert_allclose(calibrated(one, Calibration(gain=2)).weights, [[1.0, 1.0]])
    np.testing.assert_array_equal(calibrated(one, Calibration()).weights, one.weights)
    with pytest.raises(InputError, match=r"gain: the performance has no '12'"):
        calibrated(one, Calibration(gain={"12": 2}))


def test_head_and_gaze_rest_where_they_are_mostly():
    head = np.array([[10.0, 5, 0], [10, 5, 0], [30, 5, 1], [np.nan] * 3])
    one = recording(np.zeros((4, 1)), head=head, gaze=np.ones((4, 4)), place=np.ones((4, 3)))
    still = calibrated(one, parse_calibration("0-0.05", head=True))
    np.testing.assert_allclose(still.head[:3], [[0, 0, 0], [0, 0, 0], [20, 0, 1]])
    assert (still.gaze == 0).all()
    assert (still.place == 1).all()
    assert calibrated(one, parse_calibration("0-0.05")).head is one.head or np.array_equal(
        calibrated(one, parse_calibration("0-0.05")).head, head, equal_nan=True)


def test_a_rest_that_is_no_rest_is_told():
    one = calibrated(recording([[0.95], [0.96]]), parse_calibration("0-9"))
    assert f"at rest 1 are above {LARGEST_OFFSET:g}" in one.warnings[-1]
    assert one.weights.max() == pytest.approx(0.8)


def test_seconds_without_a_face():
    one = recording([[np.nan], [0.5], [0.5]])
    with pytest.raises(InputError, match=r"no frame with a face in 0-0.02 s; the recording is 0.067 s long"):
        calibrated(one, parse_calibration("0-0.02"))


@pytest.mark.parametrize("text", ["", "5", "2-1", "1-1", "101%", "-1-2", "a-b", "5 %5"])
def test_what_calibrate_cannot_mean(text):
    with pytest.raises(InputError, match="calibrate: "):
        parse_calibration(text)


@pytest.mark.parametrize("how", [{"seconds": (0, 1), "percentile": 5}, {"percentile": -1}, {"offsets": {"1": 0.9}},
                                 {"gain": -1}, {"gain": {"1": "x"}}, {"gain": float("nan")}])
def test_calibrations_that_make_no_sense(how):
    with pytest.raises(InputError, match="calibrate: "):
        Calibration(**how)


def test_even_steps_go_through_the_recorded_frames():
    times = np.array([0.0, 0.1, 0.2, 0.3])
    one = recording([[0.0], [0.5], [np.nan], [1.0]], times, head=np.arange(12.0).reshape(4, 3))
    made = resampled(one, 20.0)
    np.testing.assert_allclose(made.times, np.arange(7) / 20)
    np.testing.assert_allclose(made.weights[:, 0], [0, 0.25, 0.5, np.nan, np.nan, np.nan, 1.0])
    np.testing.assert_allclose(made.head[:, 0], [0, 1.5, 3, 4.5, 6, 7.5, 9])
    same = resampled(one, 10.0)
    np.testing.assert_allclose(same.weights, one.weights)


def test_nothing_is_made_up_across_a_gap():
    made = resampled(recording([[0.0], [1.0]], np.array([0.0, 1.0])), 4.0)
    np.testing.assert_array_equal(made.weights[:, 0], [0, np.nan, np.nan, np.nan, 1])
    assert len(resampled(recording([[0.5]], np.array([3.0])), 25.0)) == 1


@pytest.mark.parametrize("fps", [0, -1, float("nan"), "x", True, 1e9])
def test_rates_that_are_none(fps):
    with pytest.raises(InputError, match="resample: expected frames a second"):
        resampled(recording([[0.0], [1.0]]), fps)


def test_a_rate_and_a_time_that_make_too_many_frames():
    with pytest.raises(InputError, match="more than 10,000,000 frames"):
        resampled(recording([[0.0], [1.0]], np.array([0.0, 1e6])), 100.0)

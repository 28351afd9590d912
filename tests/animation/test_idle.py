"""The idle layer: natural numbers, and the same for a seed however it is asked."""

from __future__ import annotations

import numpy as np
import pytest

from facegen.animation.angles import reach
from facegen.animation.idle import Idle, _Blinks, _Gaze, _Head
from facegen.animation.timing import load_timing
from facegen.errors import InputError


def test_it_depends_on_the_seed_alone():
    times = np.random.default_rng(0).uniform(0, 200, 300)
    forward = [Idle(5).at(t) for t in np.sort(times)]
    for make in (_Blinks, lambda seed: _Gaze(seed, True), _Head):
        late, early = make(5), make(5)
        values = [late.at(t) for t in np.sort(times)[::-1]][::-1]       # the end first: all is drawn at once
        assert values == [early.at(t) for t in np.sort(times)]
    assert forward == [Idle(5).at(t) for t in np.sort(times)]
    assert Idle(5).at(10.0) != Idle(6).at(10.0)


def test_parts_can_be_switched_off():
    everything = [Idle(3).at(t) for t in np.arange(0, 30, 0.02)]
    eyes = [Idle(3, blink=False, head=False).at(t) for t in np.arange(0, 30, 0.02)]
    for one, other in zip(everything, eyes, strict=True):
        assert {atom: weight for atom, weight in one.items() if atom[-2] == "6"} == other
    assert Idle(3, blink=False, gaze=False, head=False).at(1.0) == {}


def test_blinks():
    gaps, doubles, full = [], 0, []
    for seed in range(12):
        blinks = _Blinks(seed)
        blinks.at(300.0)
        full += [height == 1.0 for height in blinks.heights]
        gaps += list(np.diff(blinks.starts))
    doubles = np.mean(np.array(gaps) < 0.6)
    assert 0.08 < doubles < 0.22
    rest = np.array(gaps)[np.array(gaps) > 0.6]
    assert 3.7 < rest.mean() < 4.8
    assert 1.5 < rest.std() < 2.6
    assert 0.45 < np.mean(full) < 0.7
    assert load_timing().blink["mean"] == 4.0


def test_a_full_blink_closes_the_lids_at_fifty_frames_a_second():
    blinks = _Blinks(0)
    blinks.at(60.0)
    for start, height in zip(blinks.starts, blinks.heights, strict=True):
        frames = np.arange(np.floor(start * 50), np.ceil((start + 0.275 * blinks._pace(height)) * 50)) / 50
        closed = [blinks.at(t) for t in frames]
        assert max(closed) == 1.0 if height == 1.0 else max(closed) > 0.99 * height
        close, opened = np.array(closed[:np.argmax(closed)]), np.array(closed[np.argmax(closed):])
        assert np.count_nonzero(close > 0.05) < np.count_nonzero(opened > 0.05)         # closing is faster


def test_saccades_lie_on_the_main_sequence():
    gaze, n = _Gaze(1, True), load_timing().gaze
    gaze.at(120.0)
    sizes = []
    for duration, here, there in gaze.moves[1:]:
        size = np.hypot(*np.subtract(there, here))
        assert duration == pytest.approx(0.021 + 0.0022 * size)
        sizes.append(size)
    assert n["delay"] == 0.021
    assert max(sizes) > 4.0
    assert np.median(sizes) < 3.0
    times = np.arange(0, 120, 0.005)
    speed = np.abs(np.diff([gaze.at(t) for t in times], axis=0)).max() / 0.005
    assert 100 < speed < 700                                    # degrees a second
    small = _Gaze(1, False)
    assert np.abs([small.at(t) for t in times]).max() <= 2.0


def test_the_head_sways_slowly_and_less_than_a_degree():
    head = _Head(9)
    angles = np.array([head.at(t) for t in np.arange(0, 120, 0.02)])
    assert np.linalg.norm(angles, axis=1).max() < 1.0
    assert np.abs(angles).max() > 0.2
    assert np.abs(np.diff(angles, axis=0)).max() / 0.02 < 2.0   # degrees a second


@pytest.mark.parametrize("seed", [-1, 1.5, "3", None, True, 2**64])
def test_wrong_seeds(seed):
    with pytest.raises(InputError, match=r"^idle: expected a seed"):
        Idle(seed)


def test_reach_comes_from_the_table():
    assert reach("head", "yaw") == (30, 30)
    assert reach("eyes", "pitch") == (20, 25)

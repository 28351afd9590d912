"""Knots: planned within reach of the recording, written and read alike."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from facegen.codec.plan import REACH, plan_curve, still
from facegen.codec.rangecoder import ONE, RangeDecoder, RangeEncoder
from facegen.codec.syntax import FARTHEST, Models, Motion, PacketError, between, code_motion

courses = st.lists(st.floats(-40, 40), min_size=1, max_size=40).map(np.array)


def played(curve, frames):
    knots = sorted(curve)
    return np.interp(np.arange(frames), knots, [curve[knot] for knot in knots])


@given(courses, st.none() | st.integers(-40, 40))
def test_no_frame_is_farther_than_reach(course, before):
    curve = plan_curve(course, before)
    assert abs(played(curve, len(course)) - course).max() <= REACH + 1e-9
    assert curve.get(-1) == before
    assert {0 if before is None else -1, len(course) - 1} <= set(curve)


@given(courses)
def test_knots_are_where_the_halving_asks(course):
    curve = plan_curve(course, None)

    def asked(a, b):
        middle = (a + b) // 2
        if b - a < 2 or middle not in curve:
            return {a, b}
        return asked(a, middle) | asked(middle, b)

    assert set(curve) == asked(0, len(course) - 1)


@given(courses)
def test_where_bits_are_free_no_rounding_is_better(course):
    off = played(plan_curve(course, None, trade=0.0), len(course)) - course
    rounded = np.rint(course) - course
    assert off @ off <= rounded @ rounded + 1e-9


def test_a_line_takes_its_ends_only_and_rest_even_less():
    assert plan_curve(np.linspace(0, 12, 13), None) == {0: 0, 12: 12}
    assert plan_curve(np.full(9, 3.1), 3) == {-1: 3, 8: 3}


def test_a_blink_of_one_frame_is_kept():
    course = np.zeros(16)
    course[7] = 3.0
    assert played(plan_curve(course, None), 16)[7] >= 1.5


def test_short_courses_are_planned_nearly_as_well_as_all_knots_tried():
    """Against every set of knots within a step, by the bits that the models would take."""
    dice, ours, best = np.random.default_rng(5), 0.0, 0.0
    for _ in range(30):
        course = dice.normal(0, 1.2, 4)
        ours += cost(plan_curve(course, None, trade=0.3), course)
        best += min(cost(dict(one), course) for one in tried(course))
    assert ours <= 1.08 * best          # it estimates its bits, and looks at fewer


def tried(course):
    near = [[round(v) + k for k in (-1, 0, 1)] for v in course]
    for start, end in itertools.product(near[0], near[3]):
        yield ((0, start), (3, end))
        for one in near[1]:
            yield ((0, start), (1, one), (3, end))
            for two in near[2]:
                yield ((0, start), (1, one), (2, two), (3, end))


class Counter:
    """A coder that only counts bits."""

    reads, bits = False, 0.0

    def bit(self, model, bit):
        self.bits -= math.log2((ONE - model.no if bit else model.no) / ONE)
        model.learn(bit)
        return bit

    def even(self, bit):
        self.bits += 1
        return bit


def cost(curve, course):
    coder = Counter()
    code_motion(coder, Models(), [0], 4, None, Motion([True] * 4, [dict(curve)]))
    off = played(curve, 4) - course
    return float(off @ off) + 0.3 * coder.bits if abs(off).max() <= REACH else math.inf


def test_what_stands_still_is_known_at_sight():
    courses = np.array([[0.1, 5.0, 0.0], [0.2, 5.1, 3.0], [0.1, 4.9, 0.0]])
    rests, at = still(courses, None)
    assert rests.tolist() == [True, True, False]
    assert at.tolist() == [0, 5, 1]
    assert still(courses, np.array([0, 0, 0]))[0].tolist() == [True, False, False]


@given(st.integers(-50, 50), st.integers(-50, 50), st.integers(0, 9), st.integers(2, 30), st.data())
def test_between_rounds_the_line(start, end, a, length, data):
    t = data.draw(st.integers(a, a + length))
    found = between({a: start, a + length: end}, a, a + length, t)
    assert abs(found - (start + (end - start) * (t - a) / length)) <= 0.5


@settings(max_examples=60)
@given(st.integers(1, 16), st.integers(1, 6), st.booleans(), st.randoms(use_true_random=False), st.booleans())
def test_motion_comes_back(count, wide, key, dice, gaps):
    kinds = [dice.randrange(4) for _ in range(wide)]
    before = None if key else [dice.randrange(-9, 9) for _ in range(wide)]
    found = [dice.random() < 0.7 for _ in range(count)] if gaps else [True] * count
    curves = [plan_curve(np.clip([dice.gauss(0, 10 ** dice.uniform(-1, 3)) for _ in range(count)], -FARTHEST, FARTHEST),
                         None if key else before[k]) for k in range(wide)] if any(found) else []
    coder = RangeEncoder()
    code_motion(coder, Models(), kinds, 16, before, Motion(found, curves))
    again = code_motion(RangeDecoder(coder.finish()), Models(), kinds, 16, before)
    assert again == Motion(found, curves)


@settings(max_examples=200)
@given(st.binary(max_size=200), st.booleans())
def test_any_bytes_are_motion_or_refused(data, key):
    kinds = [0, 1, 2, 3] * 5
    try:
        motion = code_motion(RangeDecoder(data), Models(), kinds, 16, None if key else [FARTHEST] * 20)
    except PacketError:
        return
    assert 1 <= len(motion.found) <= 16
    assert len(motion.curves) == (20 if any(motion.found) else 0)
    assert all(abs(value) <= FARTHEST for curve in motion.curves for value in curve.values())


def test_an_endless_number_is_refused():
    coder, models = RangeEncoder(), Models()
    for question, context, answer in (("short", 0, 0), ("gaps", 0, 0), ("start", 0, 1), ("start sign", 0, 0),
                                      ("start more", 0, 1), ("start more", 1, 1)):
        coder.bit(models(question, 0, context), answer)
    for k in range(40):
        coder.bit(models("start bits", 0, min(k, 3)), 1)
    with pytest.raises(PacketError, match="longer than any encoder writes"):
        code_motion(RangeDecoder(coder.finish()), Models(), [0], 64, None)

"""The range coder: what goes in comes out, in as few bytes as a coder of exact fractions needs."""

from __future__ import annotations

import math
import random
from fractions import Fraction

from hypothesis import given
from hypothesis import strategies as st

from facegen.codec.rangecoder import LEAST, ONE, Model, RangeDecoder, RangeEncoder

questions = st.lists(st.tuples(st.integers(0, 4), st.integers(0, 1)), max_size=400)


def models():
    return [Model(share, seen) for share, seen in ((0.5, 0), (0.999, 30), (0.01, 8), (1.0, 4))]


def coded(asked):
    known, coder = models(), RangeEncoder()
    for question, bit in asked:
        assert (coder.even(bit) if question == 4 else coder.bit(known[question], bit)) == bit
    return coder.finish()


def exact(asked):
    """Narrow [0, 1) by exact fractions; return the shortest bytes in what is left."""
    known, low, width = models(), Fraction(0), Fraction(1)
    for question, bit in asked:
        no = Fraction(1, 2) if question == 4 else Fraction(known[question].no, ONE)
        low, width = (low + width * no, width * (1 - no)) if bit else (low, width * no)
        if question < 4:
            known[question].learn(bit)
    length = 0
    while True:
        value = math.ceil(low * 256**length)
        if Fraction(value, 256**length) < low + width:
            return value.to_bytes(length, "big")
        length += 1


@given(questions)
def test_answers_come_back(asked):
    known, decoder = models(), RangeDecoder(coded(asked))
    assert [decoder.even() if question == 4 else decoder.bit(known[question]) for question, _ in asked] == \
        [bit for _, bit in asked]


@given(questions)
def test_it_is_never_much_longer_than_exact_arithmetic(asked):
    # bounds are rounded to a 256th at worst, which may spoil a short end
    assert len(coded(asked)) <= len(exact(asked)) * 1.01 + 3


def test_on_average_it_is_as_short_as_exact_arithmetic():
    dice = random.Random(2)
    several = [[(dice.randrange(5), int(dice.random() < 0.3)) for _ in range(dice.randrange(200))] for _ in range(100)]
    ours, best = (sum(len(code(asked)) for asked in several) for code in (coded, exact))
    assert abs(ours - best) <= 0.01 * best


def test_carries_run_back_through_many_bytes():
    sure = Model(1.0, 30)
    asked = [(1, 1)] * 60 + [(4, 1)] * 200 + [(1, 1)] * 60
    assert sure.no == ONE - LEAST
    known, decoder = models(), RangeDecoder(coded(asked))
    assert all(decoder.even() if question == 4 else decoder.bit(known[question]) for question, _ in asked)


def test_what_is_always_so_costs_nothing():
    assert len(coded([(1, 0)] * 4000)) <= 1
    assert len(coded([(4, 0)] * 4000)) <= 1         # zeros at the end are not sent


@given(st.binary(max_size=60), st.lists(st.integers(0, 4), max_size=300))
def test_any_bytes_give_some_answers(data, asked):
    known, decoder = models(), RangeDecoder(data)
    for question in asked:
        assert (decoder.even() if question == 4 else decoder.bit(known[question])) in (0, 1)


@given(st.lists(st.integers(0, 1), max_size=500))
def test_a_model_never_excludes_an_answer(bits):
    model = Model(0.5)
    for bit in bits:
        model.learn(bit)
        assert LEAST <= model.no <= ONE - LEAST


def test_a_model_learns_how_things_are():
    model = Model(0.5)
    for k in range(4000):
        model.learn(int(k % 10 == 0))
    assert abs(model.no / ONE - 0.9) < 0.1

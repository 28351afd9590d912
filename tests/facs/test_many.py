"""The rules over many frames give, frame for frame, what they give one pose."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from facegen.facs.many import coefficients_of_many
from facegen.facs.tables import load_units

ATOMS = load_units().catalogue.atoms


@given(st.integers(0, 100_000), st.integers(1, len(ATOMS)))
@settings(deadline=None, max_examples=60)
def test_frame_for_frame_the_same(seed, count):
    rng = np.random.default_rng(seed)
    chosen = rng.choice(len(ATOMS), count, replace=False)
    weights = np.round(rng.random((4, count)), 3) * (rng.random((4, count)) < 0.7)
    table = load_units()
    many = coefficients_of_many(table, {ATOMS[k]: column for k, column in zip(chosen, weights.T, strict=True)})
    for row in range(4):
        alone = table.coefficients({ATOMS[k]: weights[row, i] for i, k in enumerate(chosen)})
        here = {name: values[row] for name, values in many.items() if values[row]}
        assert set(here) == set(alone)
        for name, value in alone.items():
            assert here[name] == pytest.approx(value, rel=1e-13, abs=1e-15)


def test_nothing_is_nothing():
    assert coefficients_of_many(load_units(), {}) == {}
    assert coefficients_of_many(load_units(), {"L12": np.zeros(3)}) == {}

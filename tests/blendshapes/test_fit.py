"""Few weights that make a movement."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from facegen.blendshapes.fit import Fit

RNG = np.random.default_rng(7)
SHAPES = RNG.normal(size=(8, 60))
ONES = np.ones(8)


@settings(max_examples=40, deadline=None)
@given(st.lists(st.sampled_from([0.0, 0.0, 0.3, 0.6, 1.0]), min_size=8, max_size=8))
def test_what_was_made_is_found_again(weights):
    weights = np.array(weights)
    np.testing.assert_allclose(Fit(SHAPES).weights(weights @ SHAPES, ONES), weights, atol=1e-9)


def test_bounds_are_kept():
    upper = np.full(8, 0.4)
    found = Fit(SHAPES).weights(np.array([1.0, 1, 0, 0, 0, 0, 0, 0]) @ SHAPES, upper)
    assert found.max() == pytest.approx(0.4)
    assert (found >= 0).all()
    assert (Fit(SHAPES).weights(-SHAPES[0], ONES)[0]) == 0.0


def test_nothing_stays_nothing():
    assert not Fit(SHAPES).weights(np.zeros(60), ONES).any()
    assert not Fit(np.zeros((2, 60))).weights(SHAPES[0], np.ones(2)).any()
    assert not Fit(SHAPES).weights(SHAPES[0], np.zeros(8)).any()


def test_no_pull_against_itself():
    """Two opposite shapes whose sum helps by a hair are left out."""
    along, hair, goal = np.eye(60)[0], np.eye(60)[1], np.eye(60)[2]
    shapes = np.array([10 * along + hair, -10 * along + hair, goal])
    found = Fit(shapes).weights(goal + 0.1 * hair, np.ones(3))
    np.testing.assert_allclose(found, [0, 0, 1], atol=1e-9)


def test_one_shape_goes_before_many():
    first, second = np.eye(60)[0], np.eye(60)[1]
    shapes = np.array([first, second, first + second])
    np.testing.assert_allclose(Fit(shapes).weights(0.5 * (first + second), np.ones(3)), [0, 0, 0.5], atol=1e-9)


def test_the_same_bits_every_time():
    goal = RNG.normal(size=60)
    assert Fit(SHAPES).weights(goal, ONES).tobytes() == Fit(SHAPES).weights(goal, ONES).tobytes()


def test_no_worse_than_a_search():
    """Beside SciPy's plain bounded least squares: at most what `ENOUGH` lets go, per shape left out."""
    from scipy.optimize import lsq_linear

    from facegen.blendshapes.fit import ENOUGH

    goal = np.clip(RNG.normal(size=8), 0, 1) @ SHAPES + 0.3 * RNG.normal(size=60)
    best = lsq_linear(SHAPES.T, goal, (0, 1), tol=1e-12).x
    ours = Fit(SHAPES).weights(goal, ONES)
    left = [((goal - w @ SHAPES) ** 2).sum() for w in (ours, best)]
    assert left[0] - left[1] <= 8 * ENOUGH * (goal**2).sum()

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import lsq_linear

from facegen.fitting.box import bowl_minimum, box_minimum


@given(seed=st.integers(0, 10_000), k=st.integers(1, 25), rows=st.integers(0, 30))
@settings(max_examples=60, deadline=None)
def test_the_least_point_in_a_box_is_scipys(seed, k, rows):
    rng = np.random.default_rng(seed)
    parts, goal = rng.normal(size=(k + rows, k)), 3.0 * rng.normal(size=k + rows)
    low, high = -rng.uniform(0, 1, k), rng.uniform(0, 1, k)
    found = box_minimum(parts.T @ parts, parts.T @ goal, low, high)
    best = lsq_linear(parts, goal, (low, high), method="bvls", tol=1e-14).x
    ours, theirs = (np.linalg.norm(parts @ x - goal) for x in (found, best))
    assert ours <= theirs * (1 + 1e-8) + 1e-9
    assert (found >= low).all()
    assert (found <= high).all()


def test_what_has_no_bounds_is_solved_at_once():
    rng = np.random.default_rng(1)
    parts = rng.normal(size=(9, 6))
    hessian, goal = parts.T @ parts, rng.normal(size=6)
    free = np.full(6, np.inf)
    assert box_minimum(hessian, goal, -free, free) == pytest.approx(np.linalg.solve(hessian, goal), abs=1e-9)


def test_where_it_begins_changes_nothing():
    rng = np.random.default_rng(2)
    parts = rng.normal(size=(40, 30))
    hessian, goal = parts.T @ parts, parts.T @ rng.normal(size=40)
    low, high = np.zeros(30), np.full(30, 0.3)
    one = box_minimum(hessian, goal, low, high)
    assert box_minimum(hessian, goal, low, high, rng.uniform(-1, 2, 30)) == pytest.approx(one, abs=1e-7)


@given(seed=st.integers(0, 10_000), loose=st.integers(1, 7), k=st.integers(1, 20), wide=st.booleans())
@settings(max_examples=40, deadline=None)
def test_with_some_variables_free_it_is_the_same(seed, loose, k, wide):
    rng = np.random.default_rng(seed)
    parts = rng.normal(size=(loose + k + 5, loose + k))
    hessian, goal = parts.T @ parts, parts.T @ rng.normal(size=loose + k + 5)
    low = np.concatenate([np.full(loose, -np.inf), -rng.uniform(0, 0.2, k)])
    high = np.concatenate([np.full(loose, np.inf), rng.uniform(0, 0.2, k) + 10.0 * wide])
    best = box_minimum(hessian, goal, low, high)
    assert bowl_minimum(hessian, goal, low, high, loose) == pytest.approx(best, abs=1e-7)

"""A matrix factored once: right, the same with and without the accelerator, and never silently singular."""

import numpy as np
import pytest
from scipy import sparse

from facegen.errors import InputError
from facegen.geometry import factor as module
from facegen.geometry.factor import Factor


def stiff(n=60, seed=0):
    rng = np.random.default_rng(seed)
    half = sparse.random_array((n, n), density=0.1, rng=rng)
    return sparse.csc_array(half @ half.T + sparse.diags_array(np.geomspace(1e-3, 1e4, n)))


@pytest.fixture(params=["scipy", "qdldl"])
def either(request, monkeypatch):
    if request.param == "scipy":
        monkeypatch.setattr(module, "_qdldl", lambda: None)
    else:
        pytest.importorskip("qdldl")


@pytest.mark.usefixtures("either")
@pytest.mark.parametrize("shape", [(60,), (60, 1), (60, 7), (60, 2, 3)])
def test_it_solves(shape):
    matrix, right = stiff(), np.random.default_rng(1).normal(size=shape)
    found = Factor(matrix).solve(right)
    assert found.shape == shape
    assert np.allclose((matrix @ found.reshape(60, -1)).reshape(shape), right, atol=1e-8)


@pytest.mark.usefixtures("either")
@pytest.mark.parametrize("broken", ["floating", "nothing", "nan"])
def test_what_cannot_be_solved_is_refused_by_name(broken):
    beside = np.full(9, -1.0)
    path = sparse.diags_array([beside, np.r_[1.0, np.full(8, 2.0), 1.0], beside], offsets=[-1, 0, 1])
    if broken == "nothing":
        path = sparse.block_diag([path, sparse.csc_array((1, 1))])
    if broken == "nan":
        path = path * np.nan
    with pytest.raises(InputError, match=r"the jaw (is singular|cannot be solved)"):
        Factor(sparse.csc_array(path), what="the jaw")


@pytest.mark.usefixtures("either")
@pytest.mark.parametrize("places", ["same", "others"])
def test_a_spent_factor_changes_nothing_but_the_time(places):
    first = stiff()
    second = first * 2.0 + sparse.diags_array(np.linspace(1, 2, 60)) if places == "same" else stiff(seed=1)
    right = np.random.default_rng(2).normal(size=(60, 3))
    again = Factor(second, spent=Factor(first)).solve(right)
    assert np.allclose(again, Factor(second).solve(right), rtol=1e-12, atol=1e-12 * np.abs(again).max())
    assert np.allclose(second @ again, right, atol=1e-8)

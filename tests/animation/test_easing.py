"""Laws of the eases."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from facegen.animation.easing import EASES, eased

SMOOTH = sorted(set(EASES) - {"step", "hold"})


@pytest.mark.parametrize("name", EASES)
def test_ends_are_exact_and_nothing_lies_outside(name):
    assert eased(name, 0.0) == eased(name, -1.0) == 0.0
    assert eased(name, 1.0) == eased(name, 2.0) == 1.0


@pytest.mark.parametrize("name", EASES)
@given(one=st.floats(0, 1), other=st.floats(0, 1))
def test_it_never_goes_back(name, one, other):
    low, high = sorted((eased(name, min(one, other)), eased(name, max(one, other))))
    assert 0.0 <= low <= high <= 1.0
    assert eased(name, min(one, other)) <= eased(name, max(one, other)) + 1e-15


@pytest.mark.parametrize("name", SMOOTH)
def test_it_does_not_jump(name):
    values = [eased(name, s) for s in np.linspace(0, 1, 1001)]
    assert np.abs(np.diff(values)).max() < 2.1e-3


def test_min_jerk_rests_at_both_ends_and_is_fastest_in_the_middle():
    s = np.linspace(0, 1, 2001)
    speed = np.gradient([eased("min_jerk", x) for x in s], s)
    assert speed[0] < 1e-4
    assert speed[-1] < 1e-4
    assert speed.max() == pytest.approx(15 / 8, rel=1e-4)       # Flash and Hogan 1985
    assert s[speed.argmax()] == pytest.approx(0.5, abs=1e-3)


def test_step_waits():
    assert eased("step", 0.999) == eased("hold", 0.999) == 0.0

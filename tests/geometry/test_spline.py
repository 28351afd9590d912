"""A smooth curve through places, against SciPy's."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from facegen.geometry.spline import smooth_curve


@pytest.mark.parametrize("count", [3, 4, 5, 9])
def test_it_is_the_cubic_spline_of_scipy(count):
    rng = np.random.default_rng(count)
    knots = np.cumsum(rng.uniform(0.1, 3, count))
    places = rng.normal(size=(count, 3))
    at = np.concatenate([np.linspace(knots[0], knots[-1], 50), knots])
    assert np.allclose(smooth_curve(knots, places, at), CubicSpline(knots, places)(at), rtol=0, atol=1e-12)


def test_a_cubic_is_its_own_curve():
    knots, at = np.array([0.0, 0.5, 2.0, 3.0, 3.5]), np.linspace(0, 3.5, 40)
    assert np.allclose(smooth_curve(knots, (knots**3 - knots)[:, None], at)[:, 0], at**3 - at, atol=1e-12)

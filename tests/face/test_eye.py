import numpy as np
import pytest

from facegen.face.eye import EYE_RADIUS, LIMBUS_BLEND, LIMBUS_RADIUS, eyeball_radius

THETA = np.linspace(0.0, np.pi, 20001)
R = eyeball_radius(np.cos(THETA))


def test_the_cornea_stands_in_front_of_the_ball():
    apex = np.sqrt(EYE_RADIUS**2 - LIMBUS_RADIUS**2) - np.sqrt(7.8**2 - LIMBUS_RADIUS**2) + 7.8
    assert R[0] == pytest.approx(apex, abs=1e-12)
    assert 1.4 < R[0] - EYE_RADIUS < 2.0


def test_behind_the_limbus_it_is_the_ball_exactly():
    assert np.array_equal(R[np.degrees(THETA) > 30.0], np.full((np.degrees(THETA) > 30.0).sum(), EYE_RADIUS))


def test_the_radius_falls_steadily_and_without_a_crease():
    slope = np.diff(R) / np.diff(THETA)
    assert np.all(slope <= 1e-12)
    assert np.abs(np.diff(slope)).max() < 0.01     # a crease at the limbus would jump by 6 mm per radian
    sharp = np.diff(eyeball_radius(np.cos(THETA), blend=0.0)) / np.diff(THETA)
    assert np.abs(np.diff(sharp)).max() > 1.0


def test_within_the_blend_the_spheres_meet_at_the_limbus():
    limbus = np.arcsin(LIMBUS_RADIUS / EYE_RADIUS)
    assert eyeball_radius(np.cos(limbus), blend=0.0) == pytest.approx(EYE_RADIUS)
    assert eyeball_radius(np.cos(limbus)) == pytest.approx(EYE_RADIUS + LIMBUS_BLEND / 4.0)


def test_the_apex_has_the_curvature_of_the_cornea():
    z, x = R * np.cos(THETA), R * np.sin(THETA)
    i = 800                                        # about 7 degrees: well inside the cornea
    assert x[i]**2 / (2.0 * (z[0] - z[i])) + (z[0] - z[i]) / 2.0 == pytest.approx(7.8, abs=1e-6)


def test_shape_is_kept():
    assert eyeball_radius(np.zeros((3, 4))).shape == (3, 4)
    assert eyeball_radius(0.5).shape == ()


def test_the_ball_alone():
    ball = eyeball_radius(np.cos(THETA), radius=12.0, cornea_radius=12.0, limbus_radius=5.0, blend=0.0)
    assert np.allclose(ball, 12.0)

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from facegen.errors import InputError
from facegen.geometry.camera import MARGIN, check_view, frame, view_rotation

RNG = np.random.default_rng(3)
HEAD = RNG.normal(size=(300, 3))
HEAD = HEAD / np.linalg.norm(HEAD, axis=1)[:, None] * [80, 130, 100] + [0, -20, -60]
AXES = np.array([[10.0, 0, 0], [0, 10, 0], [0, 0, 10], [0, 0, 0]])


@settings(max_examples=60, deadline=None)
@given(st.floats(-180, 180), st.floats(-90, 90), st.integers(32, 4096), st.integers(32, 4096), st.booleans())
def test_the_head_is_in_frame_with_its_margin_from_everywhere(yaw, pitch, width, height, orthographic):
    camera = frame(HEAD, size=(width, height), view=(yaw, pitch), orthographic=orthographic)
    x, y, depth = camera.project(HEAD).T
    inset = MARGIN * min(width, height)
    free = np.array([x.min(), width - x.max(), y.min(), height - y.max()])
    assert (free >= inset - 1e-6).all()
    assert np.isclose(free.min(), inset)
    assert np.isclose(x.min() + x.max(), width)
    assert np.isclose(y.min() + y.max(), height)
    assert depth.min() > camera.near


def test_the_front_view_shows_the_subjects_left_on_the_right_and_up_above():
    left, up, forward, origin = frame(HEAD, size=(200, 200)).project(AXES)
    assert left[0] > origin[0] + 1
    assert up[1] < origin[1] - 1
    assert forward[2] == pytest.approx(origin[2] - 10)


def test_positive_yaw_goes_to_the_subjects_left_and_positive_pitch_up():
    np.testing.assert_allclose(view_rotation((90, 0))[2], [1, 0, 0], atol=1e-15)
    np.testing.assert_allclose(view_rotation((0, 90))[2], [0, 1, 0], atol=1e-15)
    np.testing.assert_allclose(view_rotation((0, 0)), np.eye(3), atol=1e-15)


@given(st.floats(-360, 360), st.floats(-90, 90))
def test_view_rotations_are_rotations(yaw, pitch):
    rotation = view_rotation((yaw, pitch))
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(rotation) == pytest.approx(1)


def test_a_pose_inside_the_margin_keeps_the_frame_and_a_larger_one_grows_it():
    still = frame(HEAD, size=(256, 256))
    small = frame(HEAD, HEAD * 1.02, size=(256, 256))
    assert (small.scale, small.offset) == (still.scale, still.offset)
    for shift in ([90, 0, 0], [0, 60, 0], [300, 0, 0]):
        posed = HEAD + shift
        grown = frame(HEAD, posed, size=(256, 256))
        assert grown.scale <= still.scale
        both = grown.project(np.concatenate([HEAD, posed]))[:, :2]
        assert both.min() > 0
        assert both.max() < 256


def test_parallel_projection_keeps_sizes_and_the_lens_shrinks_what_is_far():
    near_far = np.array([[-5.0, 0, 40], [5, 0, 40], [-5, 0, -160], [5, 0, -160]])
    for orthographic in (True, False):
        camera = frame(HEAD, size=(512, 512), orthographic=orthographic)
        x = camera.project(near_far)[:, 0]
        depth = camera.project(near_far)[:, 2]
        ratio = (x[3] - x[2]) / (x[1] - x[0])
        assert ratio == pytest.approx(1 if orthographic else depth[0] / depth[2])


def test_rays_point_from_the_surface_to_the_viewer():
    for orthographic in (True, False):
        camera = frame(HEAD, size=(300, 200), view=(25, -10), orthographic=orthographic)
        x, y, _ = camera.project(HEAD).T
        rays = np.stack(camera.rays(x, y), axis=-1) @ camera.rotation
        eye = camera.target + camera.rotation[2] * camera.distance
        expected = np.tile(camera.rotation[2], (len(HEAD), 1)) if orthographic else eye - HEAD
        np.testing.assert_allclose(rays, expected / np.linalg.norm(expected, axis=1)[:, None], atol=1e-12)


def test_points_behind_the_camera_stay_finite_and_keep_their_depth():
    camera = frame(HEAD, size=(64, 64))
    behind = camera.target + camera.rotation[2] * (camera.distance + 7)
    projected = camera.project(behind[None])
    assert np.isfinite(projected).all()
    assert projected[0, 2] == pytest.approx(-7)
    assert np.isfinite(camera.nearness(projected[:, 2])).all()


NAN = float("nan")


@pytest.mark.parametrize("bad", [None, 5, "front", (0,), (0, 1, 2), (NAN, 0), (0, 91), (400, 0), ("a", 0)])
def test_a_bad_view_is_refused(bad):
    with pytest.raises(InputError, match=r"^view: expected"):
        check_view(bad)

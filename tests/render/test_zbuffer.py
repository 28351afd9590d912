from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import Delaunay

from facegen.render.zbuffer import PATTERNS, SUBPIXELS, prepare, scan

SAMPLES = sorted(PATTERNS)


def points(xy, nearness=0.5):
    xy = np.asarray(xy, float)
    return np.column_stack([xy, np.broadcast_to(nearness, len(xy))])


def hits(xy, faces, width, height, samples):
    """How many triangles claim each sample: every triangle is scanned alone."""
    total = np.zeros((height, samples, width), int)
    for face in np.asarray(faces):
        ids, _ = scan(prepare(points(xy), face[None], width=width, height=height, samples=samples))
        total += ids >= 0
    return total


def inside_by_definition(corners, width, height, samples):
    """The top-left rule with rational numbers, sample by sample: an oracle without the scanner's code."""
    corners = [[Fraction(round(c * SUBPIXELS), SUBPIXELS) for c in corner] for corner in corners]
    (ax, ay), (bx, by), (cx, cy) = corners
    if (bx - ax) * (cy - ay) - (cx - ax) * (by - ay) < 0:
        corners.reverse()
    out = np.zeros((height, samples, width), bool)
    for row in range(height):
        for s in range(samples):
            y = row + Fraction(2 * s + 1, 2 * samples)
            for column in range(width):
                x = column + Fraction(PATTERNS[samples][s], SUBPIXELS)
                ok = True
                for (x0, y0), (x1, y1) in zip(corners, corners[1:] + corners[:1], strict=True):
                    side = (x1 - x0) * (y - y0) - (y1 - y0) * (x - x0)
                    top_or_left = y1 < y0 or (y1 == y0 and x1 > x0)
                    ok &= side > 0 or (side == 0 and top_or_left)
                out[row, s, column] = ok
    return out


coordinate = st.integers(-3 * 8, 13 * 8).map(lambda k: k / 8)
corner = st.tuples(coordinate, coordinate)


@settings(max_examples=150, deadline=None)
@given(st.tuples(corner, corner, corner), st.sampled_from(SAMPLES))
def test_coverage_is_the_top_left_rule_exactly(corners, samples):
    ids, _ = scan(prepare(points(corners), np.array([[0, 1, 2]]), width=10, height=9, samples=samples))
    (ax, ay), (bx, by), (cx, cy) = corners
    if (bx - ax) * (cy - ay) == (cx - ax) * (by - ay):
        assert (ids < 0).all()
    else:
        np.testing.assert_array_equal(ids >= 0, inside_by_definition(corners, 10, 9, samples))


def test_a_right_triangle_covers_the_pixels_counted_by_hand():
    # Legs of four pixels on pixel borders: centres strictly inside are 3 + 2 + 1; the 4 on the slanted edge
    # belong to this triangle when it is a left edge, to its neighbour when it is a right edge.
    for corners, count in (([(0, 0), (4, 0), (0, 4)], 6), ([(4, 0), (4, 4), (0, 4)], 10)):
        ids, _ = scan(prepare(points(corners), np.array([[0, 1, 2]]), width=8, height=8, samples=1))
        assert (ids >= 0).sum() == count


@pytest.mark.parametrize("samples", SAMPLES)
def test_area_is_measured_to_the_length_of_the_edge(samples):
    rng = np.random.default_rng(7)
    for _ in range(30):
        corners = rng.uniform(5, 195, (3, 2))
        ids, _ = scan(prepare(points(corners), np.array([[0, 1, 2]]), width=200, height=200, samples=samples))
        (ux, uy), (vx, vy) = corners[1] - corners[0], corners[2] - corners[0]
        edges = np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1).sum()
        assert abs((ids >= 0).sum() / samples - abs(ux * vy - uy * vx) / 2) < 0.25 * edges / np.sqrt(samples)


@pytest.mark.parametrize("samples", SAMPLES)
@pytest.mark.parametrize("seed", range(4))
def test_a_random_triangulation_of_the_picture_covers_every_sample_once(samples, seed):
    rng = np.random.default_rng(seed)
    # Half of the points on a grid of sample positions, so that edges and corners run through samples.
    free, snapped = rng.uniform(0, 24, (20, 2)), rng.integers(1, 191, (20, 2)) / 8
    xy = np.unique(np.concatenate([free, snapped, [[0, 0], [24, 0], [0, 24], [24, 24]]]), axis=0)
    faces = Delaunay(xy).simplices
    faces = np.array([face[rng.permutation(3)] for face in faces])         # any corner first, either winding
    np.testing.assert_array_equal(hits(xy, faces, 24, 24, samples), 1)


@pytest.mark.parametrize("samples", SAMPLES)
def test_a_fan_of_slivers_has_no_cracks_and_no_double_hits(samples):
    angles = np.sort(np.random.default_rng(4).uniform(0, 2 * np.pi, 300))
    xy = np.concatenate([[[16.5, 16.5]], 16.5 + 100 * np.stack([np.cos(angles), np.sin(angles)], axis=1)])
    k = np.arange(300)
    faces = np.stack([np.zeros(300, int), 1 + k, 1 + (k + 1) % 300], axis=1)
    np.testing.assert_array_equal(hits(xy, faces, 33, 33, samples), 1)


@pytest.mark.parametrize("samples", SAMPLES)
def test_depth_of_a_plane(samples):
    rng = np.random.default_rng(5)
    xy = rng.uniform(-10, 42, (40, 2))
    faces = Delaunay(xy).simplices

    def plane(x, y):
        return 0.5 + 0.006 * x - 0.004 * y

    xy = np.rint(xy * SUBPIXELS) / SUBPIXELS
    triangles = prepare(points(xy, plane(*xy.T)), faces, width=32, height=32, samples=samples)
    ids, nearness = scan(triangles)
    row, s, column = np.nonzero(ids >= 0)
    assert len(row) > 500
    expected = plane(column + np.array(triangles.sample_x)[s], row + (s + 0.5) / samples)
    np.testing.assert_allclose(nearness[row, s, column], expected, atol=2e-7)
    assert (nearness[ids < 0] == 0).all()


def test_the_nearer_of_two_crossing_triangles_wins_whatever_their_order():
    xy = [(0, 0), (20, 0), (0, 20), (0, 0), (20, 0), (0, 20)]
    near = [0.2, 0.8, 0.2, 0.6, 0.4, 0.6]
    triangles = np.array([[0, 1, 2], [3, 4, 5]])
    first, depth = scan(prepare(points(xy, near), triangles, width=20, height=20, samples=4))
    second, same = scan(prepare(points(xy, near), triangles[::-1], width=20, height=20, samples=4))
    np.testing.assert_array_equal(depth, same)
    hit = first >= 0
    assert set(first[hit]) == {0, 1}
    np.testing.assert_array_equal(first[hit], 1 - second[hit])
    # 0.2 + 0.6 x / 20 = 0.6 - 0.2 x / 20 at x = 10.
    assert (first[:, :, :9][hit[:, :, :9]] == 1).all()
    assert (first[:, :, 11:][hit[:, :, 11:]] == 0).all()


def test_bands_make_the_same_picture():
    rng = np.random.default_rng(6)
    cloud = np.column_stack([rng.uniform(-5, 45, (60, 2)), rng.uniform(0.1, 0.9, 60)])
    triangles = prepare(cloud, rng.integers(0, 60, (80, 3)), width=40, height=40, samples=4)
    whole_ids, whole_near = scan(triangles)
    bands = [scan(triangles, top, min(top + 7, 40)) for top in range(0, 40, 7)]
    np.testing.assert_array_equal(np.concatenate([ids for ids, _ in bands]), whole_ids)
    np.testing.assert_array_equal(np.concatenate([near for _, near in bands]), whole_near)


def test_nothing_to_draw_gives_an_empty_buffer():
    outside = points([(50, 50), (60, 50), (50, 60)])
    before_the_near_plane = points([(0, 0), (9, 0), (0, 9)], [0.5, np.nan, 0.5])
    for cloud in (outside, before_the_near_plane):
        ids, nearness = scan(prepare(cloud, np.array([[0, 1, 2]]), width=10, height=10, samples=4))
        assert (ids == -1).all()
        assert (nearness == 0).all()
        assert ids.dtype == np.int32
        assert nearness.dtype == np.float32


def test_triangles_far_larger_than_the_picture_still_tile_it():
    xy = np.array([(-9000, -8000), (9100.3, -8000.7), (9000.1, 9000.9), (-9000.2, 9000)])
    np.testing.assert_array_equal(hits(xy, [[0, 1, 2], [0, 2, 3]], 64, 64, 4), 1)

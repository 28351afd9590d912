"""Operators on a triangle surface: exact on linear functions, the same however a surface is cut into triangles."""

import numpy as np
import pytest

from facegen.geometry.operators import Surface, dirichlet, hinge_energy


def grid(n, *, jitter=0.0, seed=0):
    """A flat square of side 1 as 2 n^2 triangles."""
    x, y = np.meshgrid(np.linspace(0, 1, n + 1), np.linspace(0, 1, n + 1), indexing="ij")
    points = np.stack([x, y, 0 * x], -1).reshape(-1, 3)
    inner = ((points[:, :2] > 0) & (points[:, :2] < 1)).all(axis=1)
    points[inner, :2] += jitter / n * np.random.default_rng(seed).uniform(-1, 1, (inner.sum(), 2))
    a = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    b, c, d = a + n + 1, a + n + 2, a + 1
    return Surface(points, np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)]).astype(np.int32))


def test_the_gradient_of_a_linear_function_is_exact_in_every_triangle():
    surface = grid(6, jitter=0.3)
    slope = np.array([2.0, -3.0, 0.0])
    found = (surface.gradient @ (surface.vertices @ slope)).reshape(-1, 3)
    assert np.allclose(found, slope, atol=1e-12)


def test_the_dirichlet_energy_of_a_linear_function_is_area_times_slope_squared():
    u = grid(5, jitter=0.3)
    f = u.vertices @ [2.0, -3.0, 0.0]
    assert f @ (dirichlet(u) @ f) == pytest.approx(13.0)
    assert f @ (dirichlet(u, np.full(len(u.faces), 0.5)) @ f) == pytest.approx(6.5)


def test_the_dirichlet_energy_is_the_gradient_s():
    u = grid(5, jitter=0.3)
    slow = u.gradient.T @ (np.repeat(u.areas, 3)[:, None] * u.gradient.toarray())
    assert np.allclose(dirichlet(u).toarray(), slow, atol=1e-12)


def test_a_linear_function_has_no_hinge_energy_and_a_quadratic_one_the_same_on_other_triangles():
    coarse, fine = grid(8, jitter=0.2), grid(16, jitter=0.2)
    for u in (coarse, fine):
        f = u.vertices @ [2.0, -3.0, 0.0]
        assert abs(f @ (hinge_energy(u) @ f)) < 1e-9
    energies = [f @ (hinge_energy(u) @ f) for u in (coarse, fine) for f in [u.vertices[:, 0] ** 2]]
    assert energies[1] == pytest.approx(energies[0], rel=0.25)      # not four times as much, as sums of jumps


def test_hinges_are_the_inner_edges():
    u = grid(3)
    pairs, edge, side = u.hinges
    edges, of_side = u.edges
    assert len(pairs) == len(edges) - u.border_edges.sum()
    assert (of_side[3 * pairs[:, 0] + side[:, 0]] == edge).all()
    assert (of_side[3 * pairs[:, 1] + side[:, 1]] == edge).all()
    assert u.border_edges.sum() == 12


def test_an_edge_of_three_triangles_gives_two_hinges():
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1]], float)
    fan = Surface(points, np.array([[0, 1, 2], [1, 0, 3], [0, 1, 4]], np.int32))
    assert len(fan.hinges[0]) == 2


def test_triangles_without_an_area_add_nothing_that_is_not_finite():
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 1, 0], [1 + 1e-13, 0, 0]], float)
    flat = Surface(points, np.array([[0, 1, 2], [0, 2, 3], [1, 4, 2]], np.int32))
    for matrix in (dirichlet(flat), hinge_energy(flat)):
        assert np.isfinite(matrix.data).all()
        assert np.abs(matrix.data).max() < 1e6


def test_components_are_counted():
    one = grid(2)
    two = Surface(np.concatenate([one.vertices, one.vertices + 5]), np.concatenate([one.faces, one.faces + 9]))
    count, component = two.components()
    assert count == 2
    assert len(set(component[:9])) == 1
    assert component[0] != component[9]


def test_vertex_areas_add_up():
    assert grid(4, jitter=0.3).vertex_areas.sum() == pytest.approx(1.0)


def test_triangles_of_one_place_twice_or_thrice_add_nothing():
    points = np.array([[0.0, 0, 0], [0, 0, 0], [0, 0, 0], [1, 0, 0]])
    u = Surface(points, np.array([[0, 1, 3], [1, 0, 2]], np.int32))
    assert np.isfinite(hinge_energy(u).toarray()).all()
    assert np.isfinite(dirichlet(u).toarray()).all()

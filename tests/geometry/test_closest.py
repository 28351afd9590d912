"""The nearest place of a surface, against trying every triangle."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize

from facegen.face.face import load_face
from facegen.geometry.closest import ClosestPoints
from facegen.geometry.operators import Surface

SINGLE = Surface(np.array([[0.0, 0, 0], [2, 0, 0], [0.5, 1.5, 0]]), np.array([[0, 1, 2]], np.int32))


@pytest.fixture(scope="module")
def skin():
    mesh = load_face().mesh(0)
    return Surface(mesh.vertices, mesh.faces[mesh.face_parts == 0])


@settings(deadline=None)
@given(st.lists(st.floats(-4, 4), min_size=3, max_size=3))
def test_the_foot_on_one_triangle_is_the_minimum(point):
    feet = ClosestPoints(SINGLE)(np.array([point]))
    assert feet.weights[0].min() >= -1e-12
    assert feet.weights.sum() == pytest.approx(1)
    assert np.allclose(feet.weights @ SINGLE.vertices, feet.points)

    def squared(t):             # barycentric by a square: always inside
        w = np.array([t[0] ** 2, t[1] ** 2, t[2] ** 2])
        w /= w.sum()
        return ((w @ SINGLE.vertices - point) ** 2).sum()

    slow = min(minimize(squared, start, method="Nelder-Mead", options={"xatol": 1e-9, "fatol": 1e-14, "maxiter": 2000}
                        ).fun for start in ((1, 1, 1), (1, 0.1, 0.1), (0.1, 1, 0.1), (0.1, 0.1, 1)))
    assert feet.distances[0] ** 2 <= slow + 1e-6


def test_the_search_finds_what_every_triangle_tried_finds(skin):
    rng = np.random.default_rng(3)
    points = skin.vertices[rng.integers(0, len(skin.vertices), 60)] + rng.normal(0, 12, (60, 3))
    fast = ClosestPoints(skin)(points)
    each = [ClosestPoints(Surface(skin.vertices, skin.faces[[t]]))(points).distances for t in range(len(skin.faces))]
    slow = np.min(each, axis=0)
    assert np.allclose(fast.distances, slow, atol=1e-9)


def test_places_on_the_surface_are_their_own_feet(skin):
    rng = np.random.default_rng(4)
    weights = rng.dirichlet(np.ones(3), len(skin.faces))
    points = np.einsum("mc,mci->mi", weights, skin.corners)
    assert ClosestPoints(skin)(points).distances.max() < 1e-9


def test_normals_and_sides_forbid_triangles():
    both = Surface(np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 1, 1], [1, 0, 1]]),
                   np.array([[0, 1, 2], [3, 4, 5]], np.int32))          # facing +z below, -z above
    search, at = ClosestPoints(both), np.array([[0.2, 0.2, 0.6]])
    assert search(at).faces[0] == 1
    assert search(at, np.array([[0, 0, 1.0]])).faces[0] == 0
    sides = np.array([[1.0], [-1.0]])
    assert search(at, labels=(np.array([[1.0]]), sides)).faces[0] == 0
    assert search(at, labels=(np.array([[0.0]]), sides)).faces[0] == 1
    nowhere = search(at, np.array([[1.0, 0, 0]]))
    assert not nowhere.found[0]
    assert np.isinf(nowhere.distances[0])


def test_rounding_does_not_choose_among_triangles_that_are_as_near(skin):
    """Feet on sides and at vertices: the same triangle for places that differ by rounding only."""
    search, rng = ClosestPoints(skin), np.random.default_rng(5)
    edges, _ = skin.edges
    points = np.concatenate([skin.vertices[edges].mean(axis=1), skin.vertices[np.unique(edges)]])
    first = search(points).faces
    for _ in range(3):
        assert np.array_equal(search(points + rng.uniform(-1e-12, 1e-12, points.shape)).faces, first)

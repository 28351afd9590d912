"""The deformer's laws, and the paper's rule against a slow and obvious implementation."""

import numpy as np
import pytest

from facegen.face.deformer import Jaw, Lids, Region, region_weights

RNG = np.random.default_rng(7)


def state(face, batch=()):
    k = len(face.deformer.points)
    return np.zeros((*batch, k, 3)), np.zeros((*batch, 3)), np.zeros((*batch, 4))


def random_state(face, batch=()):
    vectors, jaw, lids = state(face, batch)
    vectors += RNG.normal(scale=2.0, size=vectors.shape)
    jaw += RNG.uniform([0, -3, -2], [20, 3, 4], size=jaw.shape)
    lids += RNG.uniform(-0.2, 0.5, size=lids.shape)
    return vectors, jaw, lids


def test_zero_is_the_neutral_bit_for_bit(face):
    assert np.array_equal(face.deformer.deform(*state(face)), face.deformer.neutral)


def test_a_batch_is_its_poses_one_by_one(face):
    vectors, jaw, lids = random_state(face, (3, 2))
    batch = face.deformer.deform(vectors, jaw, lids)
    for i in np.ndindex(3, 2):
        assert np.allclose(batch[i], face.deformer.deform(vectors[i], jaw[i], lids[i]), atol=1e-9)


def test_linear_in_the_feature_vectors(face):
    a, b = random_state(face)[0], random_state(face)[0]
    _, jaw, lids = state(face)

    def move(v):
        return face.deformer.deform(v, jaw, lids) - face.deformer.neutral

    assert np.allclose(move(2 * a - 3 * b), 2 * move(a) - 3 * move(b), atol=1e-9)


def test_the_same_vector_everywhere_moves_every_region_alike(face):
    vectors, jaw, lids = state(face)
    vectors[:] = [1.0, -2.0, 0.5]
    move = face.deformer.deform(vectors, jaw, lids) - face.deformer.neutral
    assert np.allclose(move, [1.0, -2.0, 0.5], atol=1e-9)      # weights sum to one at every vertex


def test_a_vertex_on_a_feature_point_moves_with_it(face):
    vectors, _, _ = random_state(face)
    _, jaw, lids = state(face)
    moved = face.deformer.deform(vectors, jaw, lids)
    own = face._data.point_index
    for name, point in face.feature_points.items():
        if name in ("lip_upper", "lip_lower") or name.startswith(("tongue_", "lip_upper_", "lip_lower_")):
            continue                                           # the lips touch: two vertices at one place
        vertex = np.flatnonzero((face.deformer.neutral == point).all(axis=1))
        assert len(vertex) == 1
        assert np.allclose(moved[vertex[0]] - point, vectors[own[name]], atol=1e-6), name


def slow_weights(vertex, corners, centre):
    """Eq. 1 as drawn in figure 4: project toward O, measure the three areas."""
    a, b, c = corners
    normal = np.cross(b - a, c - a)
    t = normal @ (a - centre) / (normal @ (vertex - centre))
    p = centre + t * (vertex - centre)

    def area(x, y, z):
        return np.cross(y - x, z - x) @ normal / np.linalg.norm(normal) / 2

    s = np.array([area(p, b, c), area(p, c, a), area(p, a, b)])
    return s / s.sum()


def test_weights_are_the_papers_areas():
    centre = np.array([0.0, -25.0, -60.0])
    points = np.array([[0.0, 0.0, 20.0], [30.0, 0.0, 10.0], [10.0, 30.0, 15.0], [-25.0, 20.0, 5.0]])
    regions = [Region((0, 1, 2)), Region((0, 2, 3))]
    for _ in range(200):
        which = RNG.integers(2)
        corners = points[list(regions[which].points)]
        s = RNG.dirichlet([1, 1, 1])
        vertex = centre + (s @ corners - centre) * RNG.uniform(0.7, 1.4)     # off the triangle, on the ray
        w, _ = region_weights(vertex[None], points, regions, centre, [None], {})
        expected = np.zeros(4)
        expected[list(regions[which].points)] = slow_weights(vertex, corners, centre)
        assert np.allclose(w.toarray()[0], expected, atol=1e-6)


def test_movement_is_continuous_across_a_border():
    centre = np.array([0.0, -25.0, -60.0])
    points = np.array([[0.0, 0.0, 20.0], [30.0, 0.0, 10.0], [10.0, 30.0, 15.0], [-25.0, 20.0, 5.0]])
    regions = [Region((0, 1, 2)), Region((0, 2, 3))]
    vectors = RNG.normal(size=(4, 3)) * 10
    for s in np.linspace(0.05, 0.95, 19):
        border = centre + ((1 - s) * points[0] + s * points[2] - centre) * RNG.uniform(0.8, 1.2)
        sides = border + np.array([[1e-4, 0, 0], [-1e-4, 0, 0]])
        w, _ = region_weights(sides, points, regions, centre, [None, None], {})
        assert (w.toarray()[0] != w.toarray()[1]).any()        # two different regions
        assert np.linalg.norm((w @ vectors)[0] - (w @ vectors)[1]) < 1e-3


def test_outside_every_region_the_nearest_is_clamped_never_extrapolated():
    points = np.array([[0.0, 0.0, 20.0], [30.0, 0.0, 20.0], [0.0, 30.0, 20.0]])
    far = np.array([[-40.0, -40.0, 20.0], [90.0, 5.0, 20.0], [10.0, 10.0, 25.0]])
    w, _ = region_weights(far, points, [Region((0, 1, 2))], np.array([0.0, 0.0, -60.0]), [None] * 3, {})
    w = w.toarray()
    assert (w >= 0).all()
    assert np.allclose(w.sum(axis=1), 1)
    assert np.allclose(w[0], [1, 0, 0])
    assert (w[2] > 0).all()


def test_sheets_keep_touching_lips_apart(face):
    d = face._data
    upper, lower = d.point_index["lip_upper"], d.point_index["lip_lower"]
    assert np.array_equal(face.deformer.points[upper], face.deformer.points[lower])
    vectors, jaw, lids = state(face)
    vectors[lower] = [0, -5, 0]
    moved = np.linalg.norm(face.deformer.deform(vectors, jaw, lids) - face.deformer.neutral, axis=1)
    at = (face.deformer.neutral == face.deformer.points[upper]).all(axis=1)
    assert sorted(moved[at].round(6)) == [0.0, 5.0]


def test_every_vertex_of_a_region_pair_mirrors(face):
    names = face._data.point_names

    def other(n):
        return n[:-1] + {"L": "R", "R": "L"}[n[-1]] if n.endswith(("_L", "_R")) else n

    vectors, jaw, lids = random_state(face)
    vectors[~face._data.takes_input] = 0.0          # the back of the head hangs on fixed points of either side
    swap = [names.index(other(n)) for n in names]
    flip = np.array([-1.0, 1.0, 1.0])
    one = face.deformer.deform(vectors, jaw, lids)
    two = face.deformer.deform(vectors[swap] * flip, jaw * [1, -1, 1], lids[[2, 3, 0, 1]])
    neutral = face.deformer.neutral
    # the vertex on the other side: the nearest to the mirror image, the lips told apart by what they do
    from scipy.spatial import cKDTree

    distance, near = cKDTree(two).query(one * flip, k=1)
    assert distance.max() < 1e-6
    assert np.allclose(neutral[near], neutral * flip, atol=1e-9)


@pytest.mark.parametrize("degrees", [0.0, 5.0, 24.4])
def test_the_jaw_turns_rigidly_about_its_joints(degrees):
    jaw = Jaw(np.array([0.0, -32.0, -62.0]), np.zeros(3))
    at = RNG.normal(size=(40, 3)) * 30
    moved = at + jaw.movement(at, np.array([degrees, 0, 0]))
    assert np.allclose(np.linalg.norm(moved[1:] - moved[:-1], axis=1), np.linalg.norm(at[1:] - at[:-1], axis=1))
    on_axis = np.array([[50.0, -32.0, -62.0]])
    assert np.allclose(jaw.movement(on_axis, np.array([degrees, 0, 0])), 0)
    chin = np.array([[0.0, -95.0, 24.0]])
    if degrees:
        assert jaw.movement(chin, np.array([degrees, 0, 0]))[0, 1] < 0      # the chin goes down and back
        assert jaw.movement(chin, np.array([degrees, 0, 0]))[0, 2] < 0


def test_lids_meet_exactly_and_never_pass(face):
    for upper, lower in ((1.0, 0.0), (0.7, 0.3), (0.4, 0.9), (2.0, 0.0), (1.0, 1.0), (0.0, 1.5)):
        vectors, jaw, lids = state(face)
        lids[:] = [upper, lower, upper, lower]
        cage = face.deformer.deform(vectors, jaw, lids)
        for lid in face.deformer.lids:
            pair = cage[lid.columns]
            assert np.allclose(pair[:, 0], pair[:, 1], atol=1e-9)


def test_lids_turn_about_the_eye():
    """A lid half way lies at half the angle and keeps its distance from the eye's axis."""
    centre = np.zeros(3)
    upper = np.array([0.0, 16 * np.sin(0.4), 16 * np.cos(0.4)])
    lower = np.array([0.0, -16 * np.sin(0.2), 16 * np.cos(0.2)])
    lids = Lids(centre, np.array([[0, 1]]), np.array([0, 1]), np.array([0, 0]), np.array([False, True]), np.ones(2))
    cage = np.array([upper, lower])
    lids.move(cage, np.array(0.5), np.array(0.0))
    assert np.allclose(cage[0], [0, 16 * np.sin(0.1), 16 * np.cos(0.1)])
    assert np.allclose(cage[1], lower)


def test_the_paper_mode_is_the_papers(paper_face):
    d = paper_face._data
    numbers = {f"F{i}" for i in range(1, 16)}
    assert numbers <= set(d.point_index)
    assert len(d.point_names) == 15
    assert len(d.regions) == 19
    assert sum(r.rigid for r in d.regions) == 3
    six = {d.point_index[n] for n in ("F3", "F4", "F8")}
    assert any(set(r.points) == six for r in d.regions)          # the paper's own example
    # steps 1-3: F4, F14, F15 are derived from the angle, the fixed points stay
    vectors, jaw, lids = np.zeros((15, 3)), np.array([10.0, 0, 0]), np.zeros(4)
    moved = paper_face.deformer.deform(vectors, jaw, lids)
    for name in ("F1", "F2", "F5", "F6", "F7", "F8", "F9", "F10", "F11", "F12", "F13"):
        p = paper_face.deformer.points[d.point_index[name]]
        at = (paper_face.deformer.neutral == p).all(axis=1)
        assert np.isclose(moved[at], p, atol=1e-9).all(axis=1).any(), name
    for name in ("F4", "F14", "F15"):
        i = d.point_index[name]
        p = paper_face.deformer.points[[i]]
        expected = p + paper_face.deformer.jaw.movement(p, jaw)
        at = (paper_face.deformer.neutral == p[0]).all(axis=1)
        assert np.allclose(moved[at], expected, atol=1e-6), name


def test_rigid_regions_of_the_paper_turn_rigidly(paper_face):
    deformer = paper_face.deformer
    rigid = np.flatnonzero(deformer.rigid)
    assert len(rigid) >= 8
    moved = deformer.deform(np.zeros((15, 3)), np.array([10.0, 0, 0]), np.zeros(4))[rigid]
    before = deformer.neutral[rigid]
    assert np.allclose(np.linalg.norm(moved[1:] - moved[:-1], axis=1), np.linalg.norm(before[1:] - before[:-1], axis=1))

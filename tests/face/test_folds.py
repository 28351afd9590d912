import numpy as np
import pytest

from facegen.face.folds import Fold, fold_field

X, Y = np.meshgrid(np.linspace(-40, 40, 161), np.linspace(-20, 20, 81), indexing="ij")
X, Y = X.reshape(-1), Y.reshape(-1)
PLANE = np.column_stack([X, Y, np.zeros(X.size)])
UP = np.broadcast_to([0.0, 0.0, 1.0], PLANE.shape)
STRAIGHT = Fold(np.array([[-20.0, 0, 0], [-5, 0, 0], [20, 0, 0]]), 2.0, 1.5, 0.8, np.array([0.0, 1.0, 0.0]))
BENT = Fold(np.array([[-15, -6, 1], [2, 3, 2], [18, -2, 0]], float), 1.7, 1.2, 0.9, np.array([0.4, 1.0, 0.0]))
FLIP = np.array([-1.0, 1.0, 1.0])


def height(fold, vertices=PLANE, normals=UP):
    return np.einsum("ni,ni->n", fold_field(fold, vertices, normals), normals)


def at(x, y, field):
    return field[np.flatnonzero((x == X) & (y == Y))[0]]


def test_deepest_on_its_curve():
    h = height(STRAIGHT)
    middle = np.abs(X) <= 8                                        # the inner 40 %: nothing fades
    assert np.all(np.abs(Y[middle & (h < h.min() + 0.02)]) <= 0.5)
    valley = h[middle & (Y == 0)]
    np.testing.assert_allclose(valley, valley[0], atol=1e-12)
    assert valley[0] == pytest.approx(-1.5 + 0.8 * np.exp(-4 / 1.4))
    for x in (-8, 0, 8):                                           # it shallows steadily to either side
        column = h[(x == X) & (np.abs(Y) <= 2.0)]
        assert np.all(np.diff(column[:4]) < 0)
        assert np.all(np.diff(column[5:]) > 0)


def test_the_ridge_stands_on_the_side_it_points_to():
    h = height(STRAIGHT)
    assert at(0, 4.0, h) == pytest.approx(0.8 - 1.5 * np.exp(-4))  # twice the half width away
    assert h[Y < 0].max() < 0.01
    turned = height(Fold(STRAIGHT.along, 2.0, 1.5, 0.8, -STRAIGHT.toward))
    np.testing.assert_allclose(turned[np.lexsort((-Y, X))], h[np.lexsort((Y, X))], atol=1e-12)
    assert np.abs(height(Fold(STRAIGHT.along, 2.0, 0.0, 0.0, STRAIGHT.toward))).max() == 0


@pytest.mark.parametrize("fold", [STRAIGHT, BENT], ids=["straight", "bent"])
def test_nothing_moves_far_away_or_at_the_ends(fold):
    h = height(fold)
    t = np.linspace(0, 1, 80)
    pairs = zip(fold.along[:-1], fold.along[1:], strict=True)
    curve = np.concatenate([a + t[:, None] * (b - a) for a, b in pairs])
    away = np.linalg.norm(PLANE[:, None] - curve, axis=2).min(axis=1)
    assert h[away <= fold.width].min() < -0.6
    assert np.abs(h[away > 6.2 * fold.width]).max() == 0
    ends = fold_field(fold, fold.along[[0, -1]], UP[:2])
    np.testing.assert_allclose(ends, 0, atol=1e-15)
    beyond = (PLANE - fold.along[-1]) @ (fold.along[-1] - fold.along[-2]) > 0
    assert np.abs(h[beyond & (np.linalg.norm(PLANE - fold.along[-1], axis=1) < 15)]).max() < 1e-12


def test_nothing_moves_far_away_square_to_where_it_points():
    along = np.array([[-5, 0, 0], [0, 5, 0], [5, 0, 0]], float)
    far = np.array([[0.0, 60.0, 0.0], [0.0, 5.0, 60.0], [0.0, 5.0, -60.0]])
    for toward in ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0]):
        fold = Fold(along, 2.0, 1.0, 0.5, np.array(toward))
        np.testing.assert_array_equal(fold_field(fold, far, UP[:3]), 0)


def test_it_fades_steadily_toward_the_ends():
    h = height(STRAIGHT)[Y == 0]
    x = X[Y == 0]
    assert np.all(np.diff(h[(x >= -20) & (x <= -8)]) < 0)
    assert np.all(np.diff(h[(x >= 8) & (x <= 20)]) > 0)


def test_vertices_move_along_their_normals_and_only_where_the_skin_faces_forward():
    rng = np.random.default_rng(3)
    normals = rng.normal(0, 1, PLANE.shape)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    field = fold_field(BENT, PLANE, normals)
    np.testing.assert_allclose(np.cross(field, normals), 0, atol=1e-14)
    forward = normals[:, 2] >= 0
    amount = np.einsum("ni,ni->n", field, normals)
    np.testing.assert_allclose(amount[forward], height(BENT)[forward], atol=1e-14)
    assert np.abs(field[normals[:, 2] <= -0.25]).max() == 0
    assert np.abs(field[normals[:, 2] > 0]).max() > 0.5


def test_the_mirrored_fold_gives_the_mirrored_field():
    mirrored = Fold(BENT.along * FLIP, BENT.width, BENT.depth, BENT.ridge, BENT.toward * FLIP)
    rng = np.random.default_rng(4)
    vertices = rng.uniform([-25, -15, -3], [25, 15, 3], (3000, 3))
    normals = np.array([0.3, -0.2, 0.933]) + rng.normal(0, 0.1, vertices.shape)
    field = fold_field(BENT, vertices, normals)
    assert np.abs(field).max() > 0.5
    there = fold_field(mirrored, vertices * FLIP, normals * FLIP)
    np.testing.assert_allclose(there, field * FLIP, atol=1e-13)


def test_the_field_moves_and_turns_with_the_face():
    angle = 0.7
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    shift = np.array([3.0, -8.0, 40.0])
    moved = Fold(BENT.along @ turn.T + shift, BENT.width, BENT.depth, BENT.ridge, turn @ BENT.toward)
    np.testing.assert_allclose(fold_field(moved, PLANE @ turn.T + shift, UP), fold_field(BENT, PLANE, UP),
                               atol=1e-12)


def test_it_does_not_matter_how_finely_the_curve_is_given():
    along = np.array([[-20, 0, 0], [-11, 0, 0], [-5, 0, 0], [7.5, 0, 0], [20, 0, 0]])
    finer = Fold(along, 2.0, 1.5, 0.8, STRAIGHT.toward)
    np.testing.assert_allclose(height(finer), height(STRAIGHT), atol=1e-12)


def test_twice_as_deep_and_high_is_twice_the_field():
    double = Fold(BENT.along, BENT.width, 2 * BENT.depth, 2 * BENT.ridge, BENT.toward)
    np.testing.assert_allclose(height(double), 2 * height(BENT), atol=1e-14)

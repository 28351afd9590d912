from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import sparse

from facegen.face.attach import Attachment, attach
from facegen.geometry.mesh import Mesh
from facegen.geometry.subdivision import loop_levels

CAGE = np.array([[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], float) * [50, 40, 60]
FACES = np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4], [1, 0, 5], [2, 1, 5], [3, 2, 5], [0, 3, 5]])
SUB = loop_levels(6, FACES, np.empty((0, 2), int), 2)[2]
SURFACE = SUB.matrix @ CAGE
RNG = np.random.default_rng(9)
FACE = RNG.integers(0, len(SUB.faces), 200)
SHARES = RNG.dirichlet([2.0, 2.0, 2.0], 200)
ON_SURFACE = np.einsum("nk,nki->ni", SHARES, SURFACE[SUB.faces[FACE]])
A, B, C = np.moveaxis(SURFACE[SUB.faces[FACE]], 1, 0)
NORMALS = np.cross(B - A, C - A) / np.linalg.norm(np.cross(B - A, C - A), axis=1, keepdims=True)

PART = Mesh.of(RNG.normal(0, 10, (12, 3)) + np.array([30, 0, 5]), [[0, 1, 2]])
CENTRE = np.array([28.0, 1.0, -3.0])


class Jaw:
    """Stands for a jaw: a movement that is easy to foretell."""

    def movement(self, at, jaw):
        return jaw[..., None, :] * at


RIG = SimpleNamespace(jaw=Jaw())


def controls(batch=(), **given):
    rest = {"vectors": np.zeros((*batch, 4, 3)), "jaw": np.zeros((*batch, 3)), "eyes": np.zeros((*batch, 4))}
    return SimpleNamespace(**{**rest, **{k: np.asarray(v, float) for k, v in given.items()}})


# -- weights ---------------------------------------------------------------------------------------------
def test_weights_sum_to_one_near_and_far():
    points = np.concatenate([ON_SURFACE, RNG.normal(0, 200, (200, 3))])
    weights = attach(points, SURFACE, SUB.faces, SUB.matrix)
    assert weights.shape == (400, 6)
    np.testing.assert_allclose(weights.sum(axis=1), 1.0, atol=1e-13)
    assert weights.toarray().min() >= 0


def test_a_point_on_the_surface_is_its_own_foot():
    weights = attach(ON_SURFACE, SURFACE, SUB.faces, SUB.matrix)
    np.testing.assert_allclose(weights @ CAGE, ON_SURFACE, atol=1e-10)


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 2**32 - 1))
def test_a_point_on_the_surface_stays_on_it(seed):
    """Under any movement of the cage it stays at its place of its triangle; an affine one moves it alike."""
    rng = np.random.default_rng(seed)
    weights = attach(ON_SURFACE, SURFACE, SUB.faces, SUB.matrix)
    moved = CAGE + rng.normal(0, 15, CAGE.shape)
    place = np.einsum("nk,nki->ni", SHARES, (SUB.matrix @ moved)[SUB.faces[FACE]])
    np.testing.assert_allclose(weights @ moved, place, atol=1e-9)
    a, t = rng.normal(0, 1, (3, 3)), rng.normal(0, 30, 3)
    np.testing.assert_allclose(weights @ (CAGE @ a + t), ON_SURFACE @ a + t, atol=1e-9)


def test_a_point_above_a_triangle_follows_the_point_below_it():
    below = attach(ON_SURFACE, SURFACE, SUB.faces, SUB.matrix)
    above = attach(ON_SURFACE + 0.05 * NORMALS, SURFACE, SUB.faces, SUB.matrix)
    inner = SHARES.min(axis=1) > 0.05
    assert inner.sum() > 100
    np.testing.assert_allclose(above.toarray()[inner], below.toarray()[inner], atol=1e-9)


def test_of_two_layers_the_nearer_one_carries():
    """Upper and lower lip touch: what lies on one must not follow the other."""
    layer = np.array([[0, 0, 0], [10, 0, 0], [10, 10, 0], [0, 10, 0]], float)
    surface = np.concatenate([layer, layer + np.array([0.0, 0.0, 1.0])])
    faces = np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]])
    points = np.array([[3.0, 2.0, 0.2], [3.0, 2.0, 0.8], [1.0, 9.5, 0.3]])
    weights = attach(points, surface, faces, sparse.csr_array(np.eye(8))).toarray()
    np.testing.assert_allclose(weights[:, 4:].sum(axis=1), [0, 1, 0], atol=1e-12)
    np.testing.assert_allclose(weights @ surface, [[3, 2, 0], [3, 2, 1], [1, 9.5, 0]], atol=1e-12)


def test_a_surface_of_one_triangle_will_do():
    points, triangle = np.array([[1.0, 1, 4], [-5, -5, 0]]), np.array([[0.0, 0, 0], [4, 0, 0], [0, 4, 0]])
    weights = attach(points, triangle, np.array([[0, 1, 2]]), sparse.csr_array(np.eye(3)))
    np.testing.assert_allclose(weights.toarray(), [[0.5, 0.25, 0.25], [1, 0, 0]], atol=1e-12)


# -- movement --------------------------------------------------------------------------------------------
SKIN = attach(PART.vertices, SURFACE, SUB.faces, SUB.matrix)
CARRIED = {
    "nothing": Attachment(PART),
    "skin": Attachment(PART, skin=SKIN),
    "jaw": Attachment(PART, jaw=np.linspace(0, 1, 12)[:, None]),
    "eye": Attachment(PART, eye=1, centre=CENTRE),
    "point": Attachment(PART, points=((2, np.linspace(0, 1, 12)[:, None]),)),
}


@pytest.mark.parametrize("carrier", CARRIED)
def test_at_rest_it_is_the_part_bit_for_bit_and_ones_own_to_change(carrier):
    out = CARRIED[carrier].move(np.zeros((6, 3)), controls(), RIG)
    np.testing.assert_array_equal(out, PART.vertices)
    out += 1.0
    assert not np.shares_memory(out, PART.vertices)


@pytest.mark.parametrize("carrier", CARRIED)
def test_a_batch_gives_what_single_poses_give(carrier):
    rng = np.random.default_rng(2)
    cage = rng.normal(0, 5, (2, 3, 6, 3))
    c = controls(vectors=rng.normal(0, 3, (2, 3, 4, 3)), jaw=rng.normal(0, 0.1, (2, 3, 3)),
                 eyes=rng.uniform(-30, 30, (2, 3, 4)))
    batch = CARRIED[carrier].move(cage, c, RIG)
    assert batch.shape == (2, 3, 12, 3)
    for i in np.ndindex(2, 3):
        one = controls(vectors=c.vectors[i], jaw=c.jaw[i], eyes=c.eyes[i])
        np.testing.assert_allclose(batch[i], CARRIED[carrier].move(cage[i], one, RIG), atol=1e-12)
    moves = np.abs(batch - PART.vertices).max() > 0.1
    assert moves == (carrier != "nothing")


def test_each_carrier_moves_its_part_and_no_other_does():
    cage = np.full((6, 3), [1.0, 2.0, 3.0])
    c = controls(vectors=np.arange(12).reshape(4, 3), jaw=[0.1, 0.2, 0.3], eyes=[20, 20, 0, 0])
    out = {k: a.move(cage, c, RIG) - PART.vertices for k, a in CARRIED.items()}
    share = np.linspace(0, 1, 12)[:, None]
    np.testing.assert_array_equal(out["nothing"], 0)
    np.testing.assert_allclose(out["skin"], np.tile([1.0, 2.0, 3.0], (12, 1)), atol=1e-12)
    np.testing.assert_allclose(out["jaw"], share * [0.1, 0.2, 0.3] * PART.vertices, atol=1e-12)
    np.testing.assert_allclose(out["point"], share * [6.0, 7.0, 8.0], atol=1e-12)
    np.testing.assert_array_equal(out["eye"], 0)                   # only the left eye turns


def test_what_follows_the_skin_follows_its_movement_not_its_place():
    move = RNG.normal(0, 4, (6, 3))
    out = CARRIED["skin"].move(move, controls(), RIG)
    np.testing.assert_allclose(out, PART.vertices + SKIN @ move, atol=1e-12)


def eye(yaw, pitch, at):
    part = Mesh.of(CENTRE + np.array([at, [0.0, 0.0, 0.0], [1.0, 2.0, 3.0]]), [[0, 1, 2]])
    turned = controls(eyes=[yaw, pitch, 0, 0])
    return Attachment(part, eye=0, centre=CENTRE).move(np.zeros((6, 3)), turned, RIG) - CENTRE


def test_an_eye_looks_to_the_subjects_left_and_up_for_positive_angles():
    s, c = np.sin(np.radians(30)), np.cos(np.radians(30))
    np.testing.assert_allclose(eye(30, 0, [0.0, 0.0, 12.0])[0], [12 * s, 0, 12 * c], atol=1e-12)
    np.testing.assert_allclose(eye(0, 30, [0.0, 0.0, 12.0])[0], [0, 12 * s, 12 * c], atol=1e-12)
    # Pitch first, then yaw about the upright axis: the gaze rises by the pitch whatever the yaw.
    np.testing.assert_allclose(eye(30, 30, [0.0, 0.0, 12.0])[0], [12 * c * s, 12 * s, 12 * c * c], atol=1e-12)


@settings(deadline=None, max_examples=30)
@given(st.floats(-60, 60), st.floats(-60, 60))
def test_an_eye_turns_stiffly_about_its_centre(yaw, pitch):
    rest, out = eye(0, 0, [5.0, -4.0, 9.0]), eye(yaw, pitch, [5.0, -4.0, 9.0])
    np.testing.assert_allclose(out @ out.T, rest @ rest.T, atol=1e-9)
    assert np.linalg.det([out[0], out[2], np.cross(out[0], out[2])]) > 0
    np.testing.assert_allclose(np.cross(out[0], out[2]) @ np.cross(out[0], out[2]),
                               np.cross(rest[0], rest[2]) @ np.cross(rest[0], rest[2]))

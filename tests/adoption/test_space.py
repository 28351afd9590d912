"""What carries places from the base face to a person."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from facegen.adoption.base import base_face
from facegen.adoption.space import similarity_between, space_between

ANGLES = st.floats(-0.4, 0.4)


@settings(max_examples=20, deadline=None)
@given(st.floats(0.6, 1.6), ANGLES, st.lists(st.floats(-50, 50), min_size=3, max_size=3))
def test_similarities_are_found_again(scale, angle, offset):
    points = np.random.default_rng(1).normal(size=(12, 3)) * [20, 10, 15]
    turn = np.array([[1, 0, 0], [0, np.cos(angle), -np.sin(angle)], [0, np.sin(angle), np.cos(angle)]])
    found = similarity_between(points, scale * points @ turn.T + offset)
    assert np.isclose(found.scale, scale)
    assert np.allclose(found.rotation, turn, atol=1e-9)
    assert np.allclose(found.offset, offset, atol=1e-6)


def test_space_is_exact_at_the_cage_and_affine_where_the_cage_moved_affinely():
    cage = base_face().cage.vertices
    rng = np.random.default_rng(2)
    matrix, offset = np.eye(3) + 0.1 * rng.normal(size=(3, 3)), rng.normal(size=3)
    carry = space_between(cage, cage @ matrix.T + offset)
    away = rng.normal(size=(50, 3)) * 100
    assert np.allclose(carry(away), away @ matrix.T + offset, atol=1e-6)
    moved = cage + rng.normal(size=cage.shape) * [1, 1, 0]
    moved[base_face().seam[:, 0]] = moved[base_face().seam[:, 1]]       # closed lips stay closed
    assert np.allclose(space_between(cage, moved)(cage), moved, atol=1e-6)


def test_space_that_did_not_move_stays():
    cage = base_face().cage.vertices
    assert np.allclose(space_between(cage, cage)(cage * 1.3), cage * 1.3, atol=1e-9)

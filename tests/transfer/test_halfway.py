"""Lids half way round large eyes: the corrective is nothing at rest and at full weight, and keeps the ball behind."""

import numpy as np
import pytest

from facegen.face.face import load_face
from facegen.fileio.avatar import load_avatar
from facegen.transfer.halfway import half_name
from facegen.transfer.rig import rig


@pytest.fixture(scope="module")
def cartoon(tmp_path_factory):
    return load_face(rig("cartoon", tmp_path_factory.mktemp("half") / "cartoon.glb", sets=["units"]).path)


def lids_in_the_eye(face, vertices):
    """Return how deep the margin's skin is in the left eye's ball at most, in its radii."""
    mesh = face.mesh()
    ball = mesh.vertices[mesh.part_vertices("eye_L")]
    centre = (ball.min(axis=0) + ball.max(axis=0)) / 2
    radius = np.linalg.norm(ball - centre, axis=1).max()
    rows = np.flatnonzero(np.linalg.norm(face._file.shapes["AU43_L"], axis=1) > 0)
    rows = np.intersect1d(rows, mesh.part_vertices("skin"))
    rows = rows[(np.linalg.norm(mesh.vertices[rows] - centre, axis=1) > radius) & (mesh.vertices[rows, 2] > centre[2])]
    return 1 - np.linalg.norm(vertices[rows] - centre, axis=1).min() / radius


def test_half_closed_lids_go_round_a_large_eye(cartoon):
    moved = cartoon.mesh().vertices + 0.5 * (cartoon.pose_shapes({"AU43_L": 1.0}) - cartoon.mesh().vertices)
    assert lids_in_the_eye(cartoon, moved) > 0.15                          # a straight way goes through the ball
    for weight in (0.25, 0.5, 0.75):
        assert lids_in_the_eye(cartoon, cartoon.pose_shapes({"AU43_L": weight})) < 0.06


def test_the_corrective_is_nothing_at_both_ends(cartoon):
    rest, halves = cartoon.mesh().vertices, dict(cartoon.notes.halves)
    np.testing.assert_array_equal(cartoon.pose_shapes({}), rest)
    whole = cartoon.pose_shapes({"AU43_L": 1.0})
    np.testing.assert_array_equal(cartoon.pose_shapes({"AU43_L": 1.0, halves["AU43_L"]: 0.0}), whole)
    made = rest + cartoon.notes.vectors(load_avatar(cartoon.path).shapes["AU43_L"])
    np.testing.assert_allclose(whole, made, atol=1e-9)
    more = cartoon.pose_shapes({"AU43_L": 1.2}) - rest                      # beyond, a shape goes straight on
    np.testing.assert_allclose(more, 1.2 * (whole - rest), atol=1e-9)


def test_a_corrective_may_be_given_by_name(cartoon):
    half = half_name("AU43_L")
    assert half in cartoon.shapes
    both = cartoon.pose_shapes({"AU43_L": 0.5, half: -1.0})
    straight = cartoon.mesh().vertices + (cartoon.pose_shapes({"AU43_L": 1.0}) - cartoon.mesh().vertices) / 2
    np.testing.assert_allclose(both, straight, atol=1e-9)


def test_small_eyes_need_none(tmp_path):
    made = rig("human", tmp_path / "human.glb", sets=["units"])
    assert not made.found.halves
    assert not any(name.endswith("_half") for name in load_avatar(made.path).shapes)

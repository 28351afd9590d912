import numpy as np
import pytest

from facegen.geometry.normals import face_normals, vertex_normals

CUBE = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
# Two triangles a side, split along diagonals that differ from corner to corner.
CUBE_FACES = np.array([[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
                       [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]])


def test_face_normals_are_unit_and_point_outwards():
    normals = face_normals(CUBE, CUBE_FACES)
    outwards = CUBE[CUBE_FACES].mean(axis=1) - 0.5
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1)
    assert ((normals * outwards).sum(axis=1) > 0.3).all()


def test_a_cubes_corner_normals_do_not_depend_on_how_its_sides_are_split():
    expected = (CUBE - 0.5) / np.sqrt(0.75)
    np.testing.assert_allclose(vertex_normals(CUBE, CUBE_FACES), expected, atol=1e-12)


def test_batches_give_what_single_frames_give():
    rng = np.random.default_rng(1)
    frames = CUBE + rng.normal(0, 0.1, (2, 3, 8, 3))
    batch = vertex_normals(frames, CUBE_FACES)
    assert batch.shape == frames.shape
    for index in np.ndindex(2, 3):
        np.testing.assert_allclose(batch[index], vertex_normals(frames[index], CUBE_FACES), atol=1e-14)


def test_normals_turn_with_the_mesh_and_ignore_its_size():
    rng = np.random.default_rng(2)
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    turn *= np.sign(np.linalg.det(turn))
    normals = vertex_normals(CUBE, CUBE_FACES)
    moved = vertex_normals(1e-3 * CUBE @ turn.T + 5, CUBE_FACES)
    np.testing.assert_allclose(moved, normals @ turn.T, atol=1e-9)


@pytest.mark.parametrize("scale", [1e-8, 1.0, 1e8])
def test_triangles_without_area_and_lone_vertices_give_zero_not_nan(scale):
    vertices = scale * np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0], [9, 9, 9]], float)
    normals = vertex_normals(vertices, [[0, 1, 2], [0, 1, 3]])
    np.testing.assert_allclose(normals, [[0, 0, 1], [0, 0, 1], [0, 0, 0], [0, 0, 1], [0, 0, 0]], atol=1e-12)
    np.testing.assert_array_equal(face_normals(vertices, [[0, 1, 2]]), [[0, 0, 0]])

import numpy as np
import pytest
from shapes import box, sphere

from facegen.geometry.mesh import merge
from facegen.geometry.normals import vertex_normals
from facegen.render.occlusion import DIRECTIONS, directions, light_shares, visibility

UP = np.array([[0.0, 1.0, 0.0]])


def shares(mesh, towards=UP):
    normals = vertex_normals(mesh.vertices, mesh.faces)
    return light_shares(visibility(mesh), normals, mesh.faces, towards, np.full(len(towards), 5.0))


def test_directions_are_even_and_come_in_opposite_pairs():
    ways = directions()
    assert ways.shape == (DIRECTIONS, 3)
    np.testing.assert_allclose(np.linalg.norm(ways, axis=1), 1, atol=1e-6)
    np.testing.assert_array_equal(ways[: DIRECTIONS // 2], -ways[DIRECTIONS // 2 :])
    np.testing.assert_allclose(ways.T @ ways / DIRECTIONS, np.eye(3) / 3, atol=0.015)
    closest = np.sort(ways @ ways.T, axis=1)[:, -2]
    assert closest.max() < np.cos(np.radians(13))


def test_a_lone_sphere_is_open_everywhere():
    light = shares(sphere())
    assert light[:, 0].min() > 0.93
    # Its own far side is hidden from above, and so dark there by its slope, not by a shadow.
    assert light[sphere().vertices[:, 1] > 0.2, 1].min() > 0.9


def test_the_floor_is_dark_under_a_ball_and_open_far_from_it():
    ball = sphere(radius=1.0, centre=(0, 1.02, 0), part="ball")
    floor = box(half=(4, 0.2, 4), centre=(0, -0.2, 0), cells=40)
    both = merge([ball, floor])
    light = shares(both)
    x, y, z = both.vertices.T
    top = (np.arange(len(x)) >= len(ball.vertices)) & (y > -0.001)
    away = np.hypot(x, z)
    under, far = top & (away < 0.4), top & (away > 2.8) & (np.maximum(abs(x), abs(z)) < 3.7)
    assert light[under].max() < 0.25
    assert light[far].min() > 0.85
    # The shadow lies away from a slanting light.
    slanting = shares(both, np.array([[0.8, 0.6, 0.0]]))[:, 1]
    beside = top & (abs(z) < 0.4)
    towards_it, behind = beside & (x > 1.4) & (x < 2), beside & (x < -1.4) & (x > -2)
    assert slanting[towards_it].mean() > slanting[behind].mean() + 0.25


def test_the_inside_of_a_closed_box_is_dark():
    light = shares(merge([box(half=(2, 2, 2), cells=20), sphere(radius=0.5, part="inner")]))
    inner = len(box(half=(2, 2, 2), cells=20).vertices)
    assert light[inner:, 0].mean() < 0.01
    assert np.quantile(light[inner:], 0.98) < 0.1
    assert light[:inner, 0].min() > 0.7


def test_a_bake_does_not_depend_on_size_or_place():
    mesh = merge([sphere(radius=1.0, centre=(0, 1.1, 0)), box(half=(2, 0.2, 2), cells=12)])
    moved = mesh.with_vertices(mesh.vertices * 100 + [500, -300, 50])
    np.testing.assert_allclose(shares(mesh)[:, 0], shares(moved)[:, 0], atol=0.08)


def test_a_bake_is_kept_for_the_same_mesh_and_made_anew_for_another_pose():
    mesh = sphere(rings=6)
    assert visibility(mesh) is visibility(mesh.with_vertices(mesh.vertices.copy()))
    assert visibility(mesh) is not visibility(mesh.with_vertices(mesh.vertices * 1.0000001))


@pytest.mark.parametrize("scale", [0.0, 1.0])
def test_degenerate_meshes_give_numbers(scale):
    mesh = sphere(rings=4)
    assert np.isfinite(shares(mesh.with_vertices(mesh.vertices * [scale, scale, 0]))).all()

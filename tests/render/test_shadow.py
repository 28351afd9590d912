"""Cast shadows fall where geometry says, softly, and nothing that is lit is spotted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from shapes import box, shadow_change, sphere

from facegen import load_face
from facegen.geometry.camera import frame
from facegen.geometry.mesh import Mesh, merge
from facegen.geometry.normals import vertex_normals
from facegen.render import Renderer, render
from facegen.render.scene import Light, Scene
from facegen.render.shadow import SOFT_EDGE, shadow, with_shadows


def unit(vector):
    return np.array(vector, float) / np.linalg.norm(vector)


def ground(half=4.0, cells=80):
    """A plane at y = 0 that looks up, and its own vertices as a grid (cells + 1, cells + 1)."""
    k = np.linspace(-half, half, cells + 1)
    x, z = (a.ravel() for a in np.meshgrid(k, k, indexing="ij"))
    a = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).ravel()
    faces = np.concatenate([np.stack([a, a + 1, a + cells + 2], 1), np.stack([a, a + cells + 2, a + cells + 1], 1)])
    return Mesh.of(np.stack([x, np.zeros_like(x), z], axis=1), faces, part="ground")


@pytest.mark.parametrize("towards", [(0.0, 1.0, 0.0), (1.0, 1.0, 0.0), (-0.5, 1.0, 0.8)])
def test_a_boxes_shadow_lies_where_the_light_casts_it_with_a_soft_edge(towards):
    plane, towards = ground(), unit(towards)
    mesh = merge([plane, box(half=(1, 0.05, 1), centre=(0, 1.0, 0))])
    lit = shadow(mesh, towards)[: len(plane.vertices)]
    # A point of the plane lies in shadow if its ray to the light passes the box's middle plane within the box.
    over = plane.vertices + towards / towards[1]
    signed = np.maximum(np.abs(over[:, 0]), np.abs(over[:, 2])) - 1                  # < 0 within
    soft = SOFT_EDGE * np.sqrt(8**2 + 8**2 + 1.05**2) + 0.1 / towards[1]
    assert (lit[signed < -soft] < 0.2).all()
    assert (signed < -soft).sum() > 100
    assert lit[signed > soft].min() > 0.99
    edge = np.abs(signed) < soft / 2
    assert lit[edge].std() > 0.1                                                     # neither all nor nothing
    assert ((lit[edge] > 0.25) & (lit[edge] < 0.95)).mean() > 0.3


def test_a_box_that_stands_on_the_ground_keeps_its_shadow_at_its_foot():
    plane = ground()
    mesh = merge([plane, box(half=(1, 1, 1), centre=(0, 1.0, 0))])
    lit = shadow(mesh, unit((1, 1, 0)))[: len(plane.vertices)]
    x, z = plane.vertices[:, 0], plane.vertices[:, 2]
    foot = (x < -1.2) & (x > -2.5) & (np.abs(z) < 0.7)
    assert lit[foot].max() < 0.2
    # Light from the right: the ground before the box's right side is free.
    assert lit[(x > 1.35) & (np.abs(z) < 3)].min() > 0.99


@pytest.mark.parametrize("rings", [12, 24, 60])
@pytest.mark.parametrize("towards", [(0, 0, 1), (-0.46, 0.56, 0.88), (1, 0, 0), (0.1, -1, 0.2)])
def test_a_ball_has_no_acne(rings, towards):
    ball, towards = sphere(rings=rings, radius=90, centre=(5, -3, 2)), unit(towards)
    lit = shadow(ball, towards)
    facing = vertex_normals(ball.vertices, ball.faces) @ towards
    assert lit[facing > 0.3].min() >= 0.99
    assert lit.min() >= 0
    assert lit.max() <= 1


def test_the_shades_edge_on_a_ball_stays_soft():
    ball, towards = sphere(rings=60), unit((-0.46, 0.56, 0.88))
    lit, facing = shadow(ball, towards), vertex_normals(ball.vertices, ball.faces) @ towards
    assert lit[facing > 0.1].min() > 0.9
    assert lit[facing < -0.36].min() == 1                       # there the light is gone without a shadow


def test_a_mirrored_scene_has_the_mirrored_shadow():
    nose = merge([sphere(rings=40), sphere(rings=16, radius=0.3, centre=(0.1, 0, 1.1))])
    mirror = np.array([-1, 1, 1])
    mirrored = replace(nose.with_vertices(nose.vertices * mirror), faces=nose.faces[:, ::-1])
    towards = unit((-0.6, 0.5, 0.6))
    one, two = shadow(nose, towards), shadow(mirrored, towards * mirror)
    assert one.min() < 0.5
    assert np.abs(one - two).mean() < 0.002
    assert np.abs(one - two).max() < 0.1


def test_order_and_empty_triangles_change_nothing():
    mesh = merge([ground(cells=30), box(half=(1, 0.1, 1), centre=(0, 1.0, 0))])
    towards = unit((0.3, 1, 0.2))
    expected = shadow(mesh, towards)
    np.testing.assert_array_equal(shadow(mesh, towards), expected)
    spoilt = Mesh(np.append(mesh.vertices, [[100.0, 100, 100]], axis=0),
                  np.concatenate([mesh.faces, [[0, 0, 0], [2, 5, 5]]]), mesh.materials,
                  np.append(mesh.face_materials, [0, 0]), mesh.parts, np.append(mesh.face_parts, [0, 0]))
    again = shadow(spoilt, towards)
    np.testing.assert_allclose(again[:-1], expected, atol=1e-6)
    assert again[-1] == 1
    line = Mesh.of([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 1, 2]])
    assert np.isfinite(shadow(line, towards)).all()
    assert (shadow(Mesh.of([[0, 0, 0]], np.zeros((0, 3), int)), towards) == 1).all()


def test_only_the_keys_share_is_shadowed():
    mesh = merge([ground(cells=30), box(half=(1, 0.1, 1), centre=(0, 1.0, 0))])
    camera = frame(mesh.vertices, size=(64, 64), view=(0, 40))
    light = np.full((len(mesh.vertices), 3), 0.5, np.float32)
    scene = Scene(lights=(Light((0, 1, 0.2), (1, 1, 1)), Light((1, 1, 0), (1, 1, 1))))
    changed = with_shadows(light, mesh, camera, scene)
    assert (light == 0.5).all()
    assert (changed[:, [0, 2]] == 0.5).all()
    np.testing.assert_allclose(changed[:, 1], 0.5 * shadow(mesh, unit((0, 1, 0.2)) @ camera.rotation), rtol=1e-6)
    np.testing.assert_array_equal(with_shadows(light, mesh, camera, Scene(lights=())), light)


def test_off_is_bit_for_bit_as_without_and_on_darkens_the_neck():
    face = load_face()
    options = {"size": 160, "detail": 1, "renderer": "soft"}
    plain, off, on = (render(face, "happiness", **options, **more) for more in ({}, {"shadows": False},
                                                                                 {"shadows": True}))
    np.testing.assert_array_equal(off, plain)
    change = on[..., :3].astype(int) - plain[..., :3]
    assert change.max() <= 0
    camera = Renderer(face, **options).camera
    x, y, _ = camera.project([[25.0, -125.0, 20.0]])[0].astype(int)              # under the chin, away from the key
    assert change[y - 2:y + 3, x - 2:x + 3].mean() < -10
    x, y, _ = camera.project([[0.0, 30.0, 80.0]])[0].astype(int)                 # the forehead
    assert abs(change[y - 2:y + 3, x - 2:x + 3]).max() <= 2


@pytest.mark.parametrize("occlusion", ["posed", "neutral", "off"])
def test_the_compiled_renderer_casts_the_same_shadow(occlusion):
    pytest.importorskip("numba")
    soft, fast = (shadow_change(load_face(), name, occlusion) for name in ("soft", "fast"))
    assert (np.abs(soft - fast).max(axis=2) > 2).mean() <= 0.002
    assert (np.abs(soft).max(axis=2) > 2).mean() > 0.02

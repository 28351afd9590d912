from dataclasses import replace

import numpy as np
import pytest
from shapes import box, sphere

from facegen.geometry.camera import frame
from facegen.geometry.mesh import Mesh
from facegen.render.scene import MATERIALS, Light, Material, Scene
from facegen.render.shading import _barycentrics, from_srgb, shade, surface, to_srgb

CHALK = {"skin": Material((128, 128, 128), 0.0, 1.0)}


def ids_at(camera, mesh):
    """A point inside each triangle that faces the camera: its id and pixel, and the corner weights used."""
    rng = np.random.default_rng(1)
    ids = np.arange(len(mesh.faces))
    weights = rng.dirichlet([1, 1, 1], len(ids))
    place = np.einsum("mk,mki->mi", weights, mesh.vertices[mesh.faces])
    return ids, camera.project(place), weights


@pytest.mark.parametrize("orthographic", [False, True])
def test_interpolation_is_perspective_correct(orthographic):
    rng = np.random.default_rng(2)
    vertices = rng.normal(size=(90, 3)) * 60
    mesh = Mesh.of(vertices, np.arange(90).reshape(30, 3))
    # A lens so close that interpolating in the picture would be far off.
    camera = frame(vertices, size=(400, 300), view=(20, 10), orthographic=orthographic)
    camera = replace(camera, distance=camera.distance / 6)
    ids, pixel, weights = ids_at(camera, mesh)
    prepared = surface(mesh, camera, Scene())
    found = _barycentrics(prepared, ids, pixel[:, 0], pixel[:, 1]).T
    np.testing.assert_allclose(found, weights, atol=2e-3)
    if not orthographic:
        depth = camera.project(vertices)[:, 2][mesh.faces]
        assert (depth.max(axis=1) / depth.min(axis=1)).max() > 1.5


def test_chalk_under_one_light_follows_the_cosine():
    towards = np.array([0.3, 0.4, 0.8660254])
    lamp = Light(tuple(towards), (0.5, 0.5, 0.5))
    scene = Scene(materials=CHALK, lights=(lamp,), sky=(0, 0, 0), ground=(0, 0, 0))
    mesh = sphere(rings=48)
    camera = frame(mesh.vertices, size=(100, 100), orthographic=True)
    prepared = surface(mesh, camera, scene)
    ids, pixel, weights = ids_at(camera, mesh)
    front = mesh.vertices[mesh.faces].mean(axis=1)[:, 2] > 0.2
    colour = shade(prepared, camera, scene, ids[front], pixel[front, 0], pixel[front, 1])
    normal = np.einsum("mk,mki->mi", weights, mesh.vertices[mesh.faces])[front]
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    expected = 0.5 * from_srgb((128, 128, 128))[0] * np.maximum(normal @ towards, 0)
    np.testing.assert_allclose(colour[1], expected, atol=0.003)


def test_flat_shading_gives_a_triangle_one_brightness():
    mesh = sphere(rings=6)
    scene = Scene(materials=CHALK, sky=(0.5,) * 3, ground=(0.1,) * 3)
    camera = frame(mesh.vertices, size=(64, 64), orthographic=True)
    ids = np.repeat(np.flatnonzero(mesh.vertices[mesh.faces].mean(axis=1)[:, 2] > 0.3), 2)
    place = camera.project(mesh.vertices)[mesh.faces[ids]]
    weights = np.tile([[0.7, 0.2, 0.1], [0.1, 0.2, 0.7]], (len(ids) // 2, 1))
    x, y, _ = np.einsum("mk,mki->mi", weights, place).T
    for flat in (True, False):
        colour = shade(surface(mesh, camera, scene, flat=flat), camera, scene, ids, x, y)
        change = np.abs(colour[:, ::2] - colour[:, 1::2]).max(axis=0)
        assert change.max() < 1e-6 if flat else np.median(change) > 0.005


def test_the_inner_side_of_skin_is_dark_and_not_lit_from_behind():
    mesh = box(half=(1, 1, 0.01))
    inside_out = Mesh.of(mesh.vertices, mesh.faces[:, ::-1])
    camera = frame(mesh.vertices, size=(64, 64))
    centre = np.full(1, 32.0)
    front = np.flatnonzero(mesh.vertices[mesh.faces].mean(axis=1)[:, 2] > 0.005)
    middles = camera.project(mesh.vertices[mesh.faces[front]].mean(axis=1))[:, :2]
    one = front[[np.abs(middles - 32).sum(axis=1).argmin()]]
    lit = shade(surface(mesh, camera, Scene()), camera, Scene(), one, centre, centre)
    dark = shade(surface(inside_out, camera, Scene()), camera, Scene(), one, centre, centre)
    assert lit.min() > 0.2
    assert dark.max() < 0.05
    assert dark[0] > dark[1]


def test_teeth_in_half_shadow_are_brighter_than_other_surfaces_and_dark_where_hidden():
    mesh = sphere("teeth")
    camera = frame(mesh.vertices, size=(64, 64))
    one = np.flatnonzero(mesh.vertices[mesh.faces].mean(axis=1)[:, 2] > 0.99)[:1]
    middle = np.full(1, 32.0)

    def brightness(seen, lift):
        scene = Scene(materials={"teeth": Material((240, 230, 210), 0.0, 1.0, lift=lift)})
        light = np.full((len(mesh.vertices), 1 + len(scene.lights)), seen, np.float32)
        return shade(surface(mesh, camera, scene, light=light), camera, scene, one, middle, middle)[1, 0]

    assert brightness(0.15, 0.7) > 1.8 * brightness(0.15, 0.0)
    assert brightness(1.0, 0.7) == pytest.approx(brightness(1.0, 0.0))
    assert brightness(0.0, 0.7) < 0.05


def test_srgb_table_is_the_standards_curve_to_a_level():
    levels = np.arange(256)
    linear = np.array([from_srgb((v, v, v))[0] for v in levels])
    assert np.abs(to_srgb(linear).astype(int) - levels).max() <= 1
    np.testing.assert_array_equal(to_srgb(np.array([-1.0, 0.0, 1.0, 7.0])), [0, 0, 255, 255])


def test_every_material_of_a_face_is_there_and_brighter_light_never_darkens():
    assert {"skin", "lips", "brows", "sclera", "iris", "pupil", "teeth", "gums", "limbus", "nostril", "tongue",
            "mouth", "hair", "lashes", "flesh"} == set(MATERIALS)
    mesh = sphere()
    camera = frame(mesh.vertices, size=(64, 64))
    ids, pixel, _ = ids_at(camera, mesh)
    front = mesh.vertices[mesh.faces].mean(axis=1)[:, 2] > 0.3
    previous = np.zeros((3, front.sum()), np.float32)
    for strength in (0.2, 0.5, 1.0, 3.0):
        scene = Scene(lights=(Light((0, 0, 1), (strength,) * 3),))
        lit = surface(mesh, camera, scene)
        colour = shade(lit, camera, scene, ids[front], pixel[front, 0], pixel[front, 1])
        assert (colour >= previous - 1e-6).all()
        assert colour.max() <= 1
        previous = colour

"""Colours of vertices, and what a rig brings for its look."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from shapes import box, sphere

from facegen.errors import InputError
from facegen.face.avatar import AvatarFace
from facegen.geometry.mesh import merge
from facegen.render import Renderer, render, render_passes
from facegen.render.dress import dressed, portrait
from facegen.render.scene import CLAY, MATERIALS, Light, Scene


def painted(mesh):
    """Colours that change slowly over a mesh of about size 2."""
    return replace(mesh, colours=np.clip(130 + 100 * np.sin(mesh.vertices * [2.0, 1.5, 1.0] + 0.5), 0, 255))


BALL = painted(sphere("sclera"))


def gl():
    from facegen.render.backends import load

    try:
        return load("gl")
    except InputError as error:
        pytest.skip(str(error))


@pytest.mark.parametrize("name", ["soft", "fast", "gl"])
def test_one_colour_everywhere_is_that_material(name):
    if name == "gl":
        gl()
    colour = (10.0, 120.0, 240.0)
    ball = sphere("hat")
    own = replace(ball, colours=np.tile(colour, (len(ball.vertices), 1)))
    scene = Scene(materials={"hat": replace(CLAY, albedo=colour)})
    one, other = render(own, size=64, renderer=name), render(ball, size=64, scene=scene, renderer=name)
    assert np.abs(one.astype(int) - other).max() <= 2


@pytest.mark.parametrize("options", [{}, {"shading": "flat"}, {"orthographic": True, "view": (40, 10)},
                                     {"background": "transparent", "shadows": True}], ids=str)
@pytest.mark.parametrize("name", ["fast", "gl"])
def test_all_renderers_draw_the_same(name, options):
    if name == "gl":
        gl()
    thing = merge([BALL, painted(box("cap", centre=(0, 1.2, 0), half=(0.6, 0.3, 0.6)))])
    soft, other = (render(thing, size=128, renderer=one, **options).astype(int) for one in ("soft", name))
    assert (np.abs(soft - other).max(axis=2) > 4).mean() < (0.002 if name == "fast" else 0.03)
    assert np.abs(soft - other).mean() < 0.5


def test_colours_are_interpolated():
    """A red and a blue end: the middle is neither."""
    plate = box("skin", half=(1, 1, 0.05), cells=1)
    red = np.where(plate.vertices[:, :1] > 0, [[255, 0, 0]], [[0, 0, 255]])
    pixels = render(replace(plate, colours=red), size=64, occlusion="off", renderer="soft")
    right, middle, left = pixels[32, 56], pixels[32, 32], pixels[32, 8]
    assert right[0] > 2 * right[2]              # +x is on the right of the picture
    assert left[2] > 2 * left[0]
    assert middle[0] < right[0]
    assert middle[2] < left[2]


def test_the_inside_keeps_its_own_colour():
    ball = sphere()
    hole = replace(BALL, faces=BALL.faces[:, ::-1])
    inner = replace(ball, faces=ball.faces[:, ::-1])
    for name in ("soft", "fast"):
        np.testing.assert_array_equal(render(hole, size=64, renderer=name), render(inner, size=64, renderer=name))


def test_colours_of_a_mesh():
    assert BALL.with_vertices(2 * BALL.vertices).colours is BALL.colours or \
        np.array_equal(BALL.with_vertices(2 * BALL.vertices).colours, BALL.colours)
    assert merge([BALL, sphere()]).colours is None
    assert len(merge([BALL, BALL]).colours) == 2 * len(BALL.vertices)
    with pytest.raises(InputError, match="colours: expected shape"):
        replace(BALL, colours=BALL.colours[:3])
    for bad in (-1.0, 256.0, np.nan):
        with pytest.raises(InputError, match=r"colours: expected sRGB values 0\.\.255"):
            replace(BALL, colours=np.full(BALL.vertices.shape, bad))


def test_gl_has_room_for_fewer_lights():
    gl()
    from facegen.render.gl import MAX_LIGHTS

    scene = Scene(lights=(Light((0, 0, 1), (0.1, 0.1, 0.1)),) * (MAX_LIGHTS - 2))
    render(sphere(), size=32, renderer="gl", scene=scene)
    with pytest.raises(InputError, match=f"draws up to {MAX_LIGHTS - 3} lights where vertices have colours"):
        render(BALL, size=32, renderer="gl", scene=scene)


class Dummy:
    """Something that brings colours."""

    def __init__(self, mesh, **colours):
        self.colours, self._mesh = colours, mesh

    def mesh(self, detail=0):
        return self._mesh

    def pose(self, what=None, *, person=None, intensity=1.0, detail=0):
        return self._mesh.vertices


@pytest.mark.parametrize(("name", "part", "kind"), [
    ("EyeBall_L", "x", "sclera"), ("Wolf3D_Teeth", "x", "teeth"), ("M_Head", "x", "skin"), ("Hair_01", "x", "hair"),
    ("eyelashes", "x", "lashes"), ("Brow.001", "x", "brows"), ("Material.003", "tongue", "tongue"),
    ("lips", "x", "lips"), ("blob", "x", None), ("EyeIris", "x", "iris"),
])
def test_what_a_material_is(name, part, kind):
    mesh = sphere(name, part=part)
    look = dressed(Scene(), Dummy(mesh, **{name: (1.0, 2.0, 3.0)}), mesh).materials[name]
    assert look == replace(MATERIALS[kind] if kind else CLAY, albedo=(1.0, 2.0, 3.0))
    assert dressed(Scene(), Dummy(mesh), mesh).materials[name] == (MATERIALS[kind] if kind else CLAY)


def test_things_without_colours_change_nothing():
    scene = Scene()
    assert dressed(scene, sphere(), sphere()) is scene
    assert dressed(scene, object(), sphere()) is scene


def test_pictures_wear_them(rig_of):
    green = {"skin": (20.0, 160.0, 40.0)}
    plain, own = (AvatarFace(rig_of("arkit", colours=colours)) for colours in ({}, green))
    one, other = render(plain, size=64), render(own, size=64)
    cheek = other[40, 28].astype(int)
    assert cheek[1] > cheek[0] + 40
    np.testing.assert_array_equal(Renderer(own, size=64).draw("neutral"), other)
    assert (one != other).any()


def test_the_portrait_frames_the_head(rig_of):
    """A body far below changes neither the picture's frame nor that of its passes."""
    one = rig_of("units")
    mesh, far = one.mesh, one.mesh.vertices.copy()
    far[mesh.part_vertices("hair")] -= [0.0, 3.0, 0.0]
    tall = AvatarFace(replace(one, mesh=mesh.with_vertices(far)))
    camera = Renderer(tall, size=64).camera
    bald = tall.mesh().vertices[tall.focus]
    xy = camera.project(bald)[:, :2]
    assert 0 < xy.min() < 12
    assert xy.max() < 64
    found = render_passes(tall, "51E", passes=("part",), size=64)
    assert (found["part"] == 1 + mesh.parts.index("skin")).mean() > 0.2
    assert portrait(tall, tall.mesh().vertices).shape == bald.shape
    assert portrait(object(), far) is far

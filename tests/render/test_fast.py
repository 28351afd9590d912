"""The compiled renderer draws the pictures of the NumPy one."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapes import box, shuffled, sphere

from facegen import load_face
from facegen.errors import InputError
from facegen.geometry.mesh import Mesh, merge
from facegen.render import Renderer, render
from facegen.render.backends import load
from facegen.render.request import Look
from facegen.render.scene import Light, Scene

SEVERAL = merge([sphere("sclera", rings=16, radius=0.5, centre=(-0.9, 0.6, 0.6)),
                 sphere("iris", rings=16, radius=0.5, centre=(0.9, 0.6, 0.6)),
                 box("teeth", half=(1.5, 0.3, 0.8), centre=(0, -0.6, 0)), sphere("lips", rings=12, radius=0.4)])


def different(one, other):
    """Share of the pixels that differ by more than two levels."""
    return (np.abs(one.astype(int) - other).max(axis=-1) > 2).mean()


def both(thing, pose=None, **options):
    return (render(thing, pose, renderer=name, **options) for name in ("soft", "fast"))


@pytest.mark.parametrize("options", [
    {}, {"view": (-60, 20)}, {"background": "transparent"}, {"background": (10, 200, 30), "orthographic": True},
    {"shading": "flat"}, {"occlusion": "neutral"}, {"occlusion": "off", "size": (333, 130)}, {"detail": 0},
    {"detail": 3, "size": 100},
], ids=str)
@pytest.mark.parametrize("pose", ["surprise", "6C+12D"])
def test_a_face_looks_the_same(options, pose):
    soft, fast = both(load_face(), pose, **{"size": 192, **options})
    assert different(soft, fast) <= 0.001
    assert len(np.unique(fast)) > 20


@pytest.mark.parametrize("scene", [
    Scene(lights=()), Scene(lights=tuple(Light((k - 3, 1, 2), (0.1, 0.2, 0.05 * k)) for k in range(7))),
    Scene(background=((0, 0, 0), (255, 0, 255))),
], ids=["dark", "seven", "ground"])
def test_any_scene_looks_the_same(scene):
    soft, fast = both(SEVERAL, scene=scene, size=128)
    assert different(soft, fast) <= 0.001


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from([0.05, 1.0, 40.0]))
def test_random_triangles_are_covered_alike(seed, stretch):
    """Small ones, large ones, and ones that reach far out of the picture; of several materials and from both sides."""
    draw = np.random.default_rng(seed)
    corners = draw.normal(size=(30, 1, 3)) + stretch * draw.normal(size=(30, 3, 3)) * (1, 1, 0.02)
    mesh = Mesh.of(corners.reshape(-1, 3), np.arange(90).reshape(-1, 3))
    mesh = replace(mesh, materials=("skin", "lips", "iris"), face_materials=draw.integers(0, 3, 30))
    camera = Renderer(sphere(radius=2.0), size=(61, 83), renderer="soft").camera
    soft, fast = both(mesh, camera=camera, shading="flat", occlusion="off", background="transparent")
    assert np.array_equal(soft[..., 3], fast[..., 3])
    assert different(soft, fast) <= 0.001


def test_a_camera_before_half_of_the_mesh():
    """The door turns such a camera away; the backends leave out what lies behind it alike."""
    camera = replace(Renderer(SEVERAL, size=96).camera, distance=0.4)
    soft, fast = (load(name)(SEVERAL, camera, Scene(), Look(occlusion="off")).draw(SEVERAL.vertices)
                  for name in ("soft", "fast"))
    assert different(soft, fast) <= 0.001


def test_the_threads_make_no_difference():
    face = load_face()
    one, three = (render(face, "fear", renderer="fast", size=300, threads=threads) for threads in (1, 3))
    assert np.array_equal(one, three)


def draw_in_child(renderer, queue):
    queue.put(renderer.draw())


@pytest.mark.skipif(not hasattr(__import__("os"), "fork"), reason="this system does not fork")
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_a_forked_child_draws_too():
    import multiprocessing

    renderer = Renderer(SEVERAL, size=300, renderer="fast", threads=2)
    expected = renderer.draw()
    fork = multiprocessing.get_context("fork")
    queue = fork.Queue()
    child = fork.Process(target=draw_in_child, args=(renderer, queue))
    child.start()
    try:
        assert np.array_equal(queue.get(timeout=30), expected)
    finally:
        child.kill()
        child.join()


def test_frames_do_not_depend_on_those_before():
    renderer = Renderer(load_face(), size=128, renderer="fast")
    assert renderer.renderer == "fast"
    first = renderer.draw("happiness")
    kept = first.copy()
    renderer.draw("anger")
    assert np.array_equal(first, kept)
    assert np.array_equal(renderer.draw("happiness"), first)


def test_the_order_of_faces_makes_no_difference():
    one, other = (render(mesh, size=96, renderer="fast") for mesh in (SEVERAL, shuffled(SEVERAL)))
    assert different(one, other) == 0


def test_degenerate_meshes_are_drawn_as_what_is_left():
    flat = Mesh.of([[0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0], [9, 9, 9]], [[0, 1, 2], [0, 1, 3], [3, 3, 3]])
    soft, fast = both(flat, size=64, background="transparent")
    assert np.array_equal(soft[..., 3], fast[..., 3])
    assert fast[..., 3].any()


def test_without_numba_it_says_what_to_install(monkeypatch):
    import facegen.render.backends as backends

    monkeypatch.setattr(backends, "find_spec", lambda name: None)
    with pytest.raises(InputError, match=r'needs the package numba.*pip install "facegen\[fast\]"'):
        Renderer(SEVERAL, renderer="fast")
    assert Renderer(SEVERAL).renderer == "soft"


def test_auto_takes_the_compiled_one_where_it_pays(monkeypatch):
    import sys

    from facegen.render.backends import choose

    assert choose("auto") == "fast"
    monkeypatch.delitem(sys.modules, "facegen.render.fast", raising=False)
    assert choose("auto", pictures=1, pixels=512 * 512) == "soft"
    assert choose("auto", pictures=100, pixels=512 * 512) == "fast"
    assert choose("auto", pictures=1, pixels=4096 * 4096) == "fast"
    assert choose("soft") == "soft"


@pytest.mark.parametrize("threads", [0, -1, 1.5, True, "2"])
def test_wrong_threads(threads):
    with pytest.raises(InputError, match="threads: expected a whole number of 1 or more"):
        render(SEVERAL, threads=threads)


def test_an_unknown_renderer():
    with pytest.raises(InputError, match=r"renderer: expected auto, soft, fast.*did you mean 'fast'"):
        render(SEVERAL, renderer="fats")

"""The OpenGL renderer against `soft`. Where OpenGL cannot be had these tests skip, but not in the project's check."""

import gc
import os
import subprocess
import sys
import threading
from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter
from shapes import box, shadow_change, sphere

from facegen import load_face
from facegen.errors import InputError
from facegen.geometry.camera import frame
from facegen.geometry.mesh import merge
from facegen.render import Renderer, render
from facegen.render.backends import load
from facegen.render.request import Look
from facegen.render.scene import Light, Scene

SIMILAR = 0.99

try:
    from facegen.render import gl

    with gl._current():
        pass
except InputError as error:
    if "FACEGEN_CI" in os.environ:
        raise
    pytest.skip(str(error), allow_module_level=True)


def similarity(a, b):
    """Mean structural similarity of two pictures' greyscale (Wang et al., "Image quality assessment", 2004)."""
    grey = [picture[..., :3] @ np.array([0.299, 0.587, 0.114]) for picture in (a, b)]

    def blurred(values):
        return gaussian_filter(values, 1.5, truncate=3.5)

    mean = [blurred(g) for g in grey]
    spread = [blurred(g * g) - m * m for g, m in zip(grey, mean, strict=True)]
    together = blurred(grey[0] * grey[1]) - mean[0] * mean[1]
    c1, c2 = (0.01 * 255) ** 2, (0.03 * 255) ** 2
    return float(((2 * mean[0] * mean[1] + c1) * (2 * together + c2)
                  / ((mean[0] ** 2 + mean[1] ** 2 + c1) * (spread[0] + spread[1] + c2))).mean())


@pytest.fixture(scope="module")
def face():
    return load_face()


def pair(face, pose, **options):
    return [render(face, pose, renderer=renderer, **options) for renderer in ("soft", "gl")]


def check_same(soft, drawn):
    """The outline to the sample, the light nearly everywhere to the level, and the structure."""
    assert drawn.shape == soft.shape
    assert drawn.dtype == np.uint8
    assert (drawn[..., 3] != soft[..., 3]).mean() < 0.001
    difference = np.abs(drawn.astype(int) - soft) * (soft[..., 3:] > 0)
    assert difference.mean() < 0.5
    assert (difference.max(axis=2) > 2).mean() < 0.05
    assert similarity(soft, drawn) > SIMILAR


def test_similarity_tells_pictures_apart():
    ball = render(sphere(), size=64, occlusion="off")
    assert similarity(ball, ball) == pytest.approx(1)
    assert similarity(ball, np.roll(ball, 1, axis=1)) < 0.97
    assert similarity(ball, ball[::-1]) < 0.9


@pytest.mark.parametrize("view", [(-60, 0), (-30, 0), (0, 0), (30, 0), (60, 0), (0, -25)])
@pytest.mark.parametrize("expression", ["happiness", "surprise"])
def test_views_of_expressions(face, expression, view):
    check_same(*pair(face, expression, view=view, size=256))


@pytest.mark.parametrize("expression", ["neutral", "sadness", "anger", "fear", "disgust"])
def test_basic_expressions(face, expression):
    check_same(*pair(face, expression, view=(30, 0), size=256))


@pytest.mark.parametrize("options", [
    {"size": 512, "view": (-30, 0)}, {"shading": "flat"}, {"shading": "flat", "view": (60, 0), "detail": 2},
    {"orthographic": True}, {"orthographic": True, "view": (0, -25), "shading": "flat"},
    {"background": "transparent"}, {"background": (20, 60, 200)}, {"size": (200, 320)}, {"size": (320, 131)},
    {"occlusion": "neutral"}, {"occlusion": "off"},
], ids=str)
def test_looks(face, options):
    check_same(*pair(face, "surprise", **{"size": 256} | options))


def test_inner_sides_unknown_materials_and_other_lights():
    """A bowl seen from within, far from the origin, in a scene of its own."""
    away = np.array([1e5, -2e5, 3e5])
    ball = sphere("clay", rings=24)
    open_ball = replace(ball, faces=ball.faces[ball.vertices[ball.faces].mean(axis=1)[:, 2] < 0.3],
                        face_materials=ball.face_materials[ball.vertices[ball.faces].mean(axis=1)[:, 2] < 0.3],
                        face_parts=ball.face_parts[ball.vertices[ball.faces].mean(axis=1)[:, 2] < 0.3])
    mesh = merge([open_ball, sphere("teeth", rings=16, radius=0.4), box("lips", half=(1.5, 0.1, 0.1))])
    mesh = mesh.with_vertices(mesh.vertices + away)
    lights = tuple(Light((np.cos(k), np.sin(k), 1.0), (0.2, 0.15, 0.1), highlight=2.0) for k in range(gl.MAX_LIGHTS))
    for scene in (Scene(lights=()), Scene(lights=lights[:1]), Scene(lights=lights[:6]), Scene(lights=lights)):
        check_same(*pair(mesh, None, view=(20, 30), size=128, scene=scene))


@pytest.mark.parametrize("occlusion", ["posed", "neutral", "off"])
def test_shadows_are_those_of_the_other_renderers(face, occlusion):
    soft, card = (shadow_change(face, name, occlusion) for name in ("soft", "gl"))
    assert np.abs(soft).max() > 25
    assert np.abs(soft - card).max() <= 10                       # beside edges, where the samples lie elsewhere
    assert np.abs(soft - card).mean() < 0.15 * np.abs(soft).mean()


def test_a_camera_inside_the_mesh_draws_without_trouble():
    ball = sphere()
    camera = frame(ball.vertices * 0.2, size=(64, 64))
    around = merge([ball, sphere(radius=5, part="around")])                 # the door turns it away, the backend copes
    pixels = load("gl")(around, camera, Scene(), Look()).draw(around.vertices)
    assert len(np.unique(pixels.reshape(-1, 4), axis=0)) > 20
    behind = ball.with_vertices(ball.vertices + np.array([0, 0, 1000]))
    assert (render(behind, camera=camera, background="transparent", renderer="gl") == 0).all()


def test_a_vertex_of_several_materials_is_uploaded_once_for_each(face):
    mesh = face.mesh(0)
    corners, faces, material = gl._expanded(mesh, False)
    np.testing.assert_array_equal(corners[faces], mesh.faces)
    np.testing.assert_array_equal(material[faces], np.repeat(mesh.face_materials[:, None], 3, axis=1))
    assert len(np.unique(mesh.faces)) < len(corners) < 1.2 * len(mesh.vertices)


def test_poses_drawn_in_turn_equal_fresh_renderers(face):
    options = {"size": 128, "detail": 1, "renderer": "gl", "view": (20, 0)}
    kept = Renderer(face, **options)
    other = Renderer(face, **options | {"size": (96, 160), "shading": "flat", "background": "transparent"})
    for name in ("happiness", "anger", "neutral", "surprise"):
        np.testing.assert_array_equal(kept.draw(name), Renderer(face, **options).draw(name))
        assert other.draw(name).shape == (160, 96, 4)
    np.testing.assert_array_equal(kept.draw("anger"), kept.draw("anger"))
    assert (kept.draw("anger") != kept.draw("surprise")).any()


def test_the_size_and_the_scene_decide_what_is_shared(face):
    options = {"detail": 0, "occlusion": "off", "renderer": "gl"}
    first, second, third = (Renderer(face, size=size, **options)._backend for size in (64, 64, 96))
    assert first._renderer.framebuffer is second._renderer.framebuffer
    assert first._renderer.framebuffer is not third._renderer.framebuffer
    assert first._renderer.program is third._renderer.program
    assert Renderer(face, scene=Scene(lights=()), **options)._backend._renderer.program is not first._renderer.program


def living():
    """Return how many buffers, vertex arrays, renderbuffers, framebuffers and programs OpenGL has."""
    kinds = (gl.GL.glIsBuffer, gl.GL.glIsVertexArray, gl.GL.glIsRenderbuffer, gl.GL.glIsFramebuffer, gl.GL.glIsProgram)
    gc.collect()
    with gl._current():
        return [sum(bool(is_one(name)) for name in range(1, 400)) for is_one in kinds]


def test_draws_and_renderers_leave_nothing_behind():
    ball = sphere()
    before = living()
    kept = Renderer(ball, size=80, renderer="gl", occlusion="off")
    kept.draw()
    with_one = living()
    assert [a - b for a, b in zip(with_one, before, strict=True)][:4] == [3, 1 + (with_one[4] > before[4]), 3, 2]
    for k in range(50):
        kept.draw(ball.vertices * (1 + 0.001 * k))
    for k in range(20):
        Renderer(ball, size=81 + k, renderer="gl", occlusion="off").draw()
    assert living() == with_one
    kept._backend.close()
    kept._backend.close()
    del kept
    assert living() == before


def test_any_thread_may_draw(face):
    renderer = Renderer(face, size=96, detail=0, renderer="gl", occlusion="neutral")
    poses = [renderer.thing.pose(name, detail=0) for name in ("happiness", "anger", "fear")]
    expected = [renderer.draw(pose) for pose in poses]
    wrong = []

    def work(k):
        own = Renderer(face, size=96, detail=0, renderer="gl", occlusion="neutral")
        wrong.extend(k for _ in range(5) if (own.draw(poses[k]) != expected[k]).any())
        wrong.extend(k for _ in range(5) if (renderer.draw(poses[k]) != expected[k]).any())

    threads = [threading.Thread(target=work, args=(k,)) for k in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(timeout=60)
        assert not thread.is_alive()
    assert not wrong
    np.testing.assert_array_equal(renderer.draw(poses[0]), expected[0])


def test_too_many_lights_and_too_large_pictures_are_refused(monkeypatch):
    light = Light((0, 0, 1), (1, 1, 1))
    with pytest.raises(InputError, match=r"^scene: renderer='gl' draws up to 10 lights, got 11; the other renderers"):
        Renderer(sphere(), scene=Scene(lights=(light,) * (gl.MAX_LIGHTS + 1)), renderer="gl")
    with gl._current() as context:
        assert context.largest >= 4096
        monkeypatch.setattr(context, "largest", 2048)
    with pytest.raises(InputError, match=r"^size: this OpenGL draws up to 2048 pixels a side, got 2049x64; the other"):
        Renderer(sphere(), size=(2049, 64), renderer="gl")


def run(code, *flags, **environment):
    """Run Python code in a process of its own, in which warnings are errors."""
    start = "import facegen\nfrom facegen.geometry.mesh import Mesh\n" \
            "mesh = Mesh.of([[0., 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])\n"
    done = subprocess.run([sys.executable, "-W", "error", *flags, "-c", start + code], capture_output=True, text=True,
                          timeout=120, check=False, env=os.environ | environment)
    return done.returncode, done.stdout, done.stderr


ERROR = """
try:
    facegen.render(mesh, size=64, renderer='gl')
except facegen.InputError as error:
    print(error)
"""
DRAW = "pixels = facegen.render(mesh, size=64, renderer='gl', occlusion='off')\nprint(pixels.shape)\n"


def test_a_process_that_draws_ends_quietly_and_needs_no_display():
    environment = {"DISPLAY": ":99"}
    code = DRAW + "import sys\nassert 'pyglet' not in sys.modules and 'pyrender.viewer' not in sys.modules\n"
    assert run(code, **environment) == (0, "(64, 64, 4)\n", "")


@pytest.mark.parametrize("package", ["pyrender", "trimesh", "OpenGL"])
def test_missing_packages_are_named(package):
    code = f"""
import sys
class Missing:
    def find_spec(self, name, path=None, target=None):
        if name == {package!r}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)
sys.meta_path.insert(0, Missing())
"""
    status, out, err = run(code + ERROR + ERROR)
    assert (status, err) == (0, "")
    mend = f'{package} is not installed: pip install "facegen[gl]"; the other renderers need no OpenGL'
    assert out.count(mend) == 2


def test_a_missing_library_names_the_debian_packages():
    code = """
import ctypes
load = ctypes.CDLL.__init__
def fail(self, name, *args, **kwargs):
    if name and "EGL" in str(name):
        raise OSError(f"{name}: cannot open shared object file")
    load(self, name, *args, **kwargs)
ctypes.CDLL.__init__ = fail
"""
    status, out, err = run(code + ERROR)
    assert (status, err) == (0, "")
    assert "renderer: 'gl' cannot start OpenGL" in out
    assert "apt-get install libegl1 libgl1 libgl1-mesa-dri; the other renderers need no OpenGL" in out


@pytest.mark.parametrize("environment", [{"__EGL_VENDOR_LIBRARY_DIRS": "/nonexistent"}, {"EGL_DEVICE_ID": "99"}],
                         ids=["no driver", "no such device"])
def test_no_context_names_the_debian_packages(environment):
    status, out, err = run(ERROR + ERROR, **environment)
    assert (status, err) == (0, "")
    assert out.count("renderer: 'gl' cannot start OpenGL (") == 2
    assert "apt-get install libegl1 libgl1 libgl1-mesa-dri; the other renderers need no OpenGL" in out


def test_optimised_python_is_refused():
    status, out, err = run(ERROR, "-O")
    assert (status, err) == (0, "")
    assert out.startswith("renderer: 'gl' does not work under python -O")


def test_a_forked_process_is_told_to_be_spawned():
    code = DRAW + """
import os, sys, warnings
warnings.simplefilter("ignore")
sys.stdout.flush()
child = os.fork()
if not child:
""" + "".join(f"    {line}\n" for line in ERROR.splitlines()) + """    sys.exit()
assert os.waitpid(child, 0)[1] == 0
"""
    status, out, err = run(code + DRAW)
    assert (status, err) == (0, "")
    assert out.splitlines()[0] == out.splitlines()[2] == "(64, 64, 4)"
    assert 'multiprocessing.get_context("spawn")' in out.splitlines()[1]


def test_the_callers_context_is_left_current():
    from OpenGL import EGL

    with gl._current() as context:
        platform = context._platform
    mine = EGL.eglGetCurrentContext()
    assert not mine
    EGL.eglMakeCurrent(platform._egl_display, EGL.EGL_NO_SURFACE, EGL.EGL_NO_SURFACE, platform._egl_context)
    try:
        render(sphere(), size=64, renderer="gl", occlusion="off")
        assert EGL.eglGetCurrentContext().address == platform._egl_context.address
    finally:
        EGL.eglMakeCurrent(platform._egl_display, EGL.EGL_NO_SURFACE, EGL.EGL_NO_SURFACE, EGL.EGL_NO_CONTEXT)

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from shapes import box, shuffled, sphere

from facegen.errors import InputError
from facegen.geometry.camera import frame
from facegen.geometry.mesh import Mesh, merge
from facegen.render import Renderer, render, render_passes
from facegen.render.scene import Light, Scene

GOLDEN = Path(__file__).parent / "golden"
BALL = sphere()


def eyes_and_box():
    return merge([
        sphere("sclera", rings=16, radius=0.5, centre=(-0.9, 0.6, 0.6), part="eye_R"),
        sphere("iris", rings=16, radius=0.5, centre=(0.9, 0.6, 0.6), part="eye_L"),
        box("hair", half=(1.5, 0.3, 0.8), centre=(0, -0.6, 0)),
        sphere("lips", rings=12, radius=0.4, centre=(0, 0.05, 0.7), part="mouth"),
    ])


class BallRig:
    """The smallest rig: a ball that can be moved."""

    def __init__(self):
        self.details = []

    def mesh(self, detail):
        self.details.append(detail)
        return sphere(rings=6 + 2 * detail)

    def pose(self, what, *, person=None, intensity=1.0, detail=2):
        return self.mesh(detail).vertices + np.array([0.1 * intensity * len(what), 0, 0])


SCENES = {
    "ball": lambda: render(BALL, size=64, view=(20, 10)),
    "eyes_and_box": lambda: render(eyes_and_box(), size=64, view=(-25, 15), background="transparent"),
}


@pytest.mark.parametrize("name", SCENES)
def test_pictures_stay_as_they_were_approved(name):
    """Run this file as a script to approve new ones, after looking at them."""
    with Image.open(GOLDEN / f"{name}.png") as image:
        expected = np.asarray(image.convert("RGBA")).astype(int)
    got = SCENES[name]().astype(int)
    visible = expected[..., 3:] > 0
    assert np.abs(got[..., 3] - expected[..., 3]).max() <= 2
    assert np.abs((got - expected) * visible).max() <= 2


def test_the_picture_does_not_depend_on_the_order_of_faces():
    mesh = eyes_and_box()
    first = render(mesh, size=96, background="transparent").astype(int)
    for seed in range(2):
        second = render(shuffled(mesh, seed), size=96, background="transparent").astype(int)
        assert np.abs(first - second).max() <= 1
        assert (first[..., 3] == second[..., 3]).all()


def test_a_mirrored_scene_gives_the_mirrored_picture():
    scene = Scene(lights=(Light((0, 0.5, 0.9), (0.7, 0.7, 0.7)),))
    pixels = render(BALL, size=128, scene=scene, occlusion="off").astype(int)
    # The samples' pattern is its own mirror image only when turned by 180 degrees: edges may differ, faces
    # not.
    inner = np.hypot(*(np.indices((128, 128)) + 0.5 - 64)) < 50
    assert np.abs(pixels - pixels[:, ::-1])[inner].max() <= 1
    assert np.abs(pixels - pixels[::-1])[inner].max() > 20


def test_a_spheres_area_and_soft_edge():
    alpha = render(BALL, size=256, background="transparent", orthographic=True)[..., 3] / 255.0
    radius = 256 * (1 - 2 * 0.08) / 2
    assert alpha.sum() == pytest.approx(np.pi * radius**2, rel=0.006)     # 48 sides: 0.3 % less than a circle
    assert set(np.unique(np.rint(alpha * 4))) == {0, 1, 2, 3, 4}


def test_backgrounds():
    plain = render(BALL, size=64)
    clear = render(BALL, size=64, background="transparent")
    blue = render(BALL, size=64, background=(10, 20, 200))
    assert (plain[..., 3] == 255).all()
    assert (blue[..., 3] == 255).all()
    assert (clear[..., 3][0] == 0).all()
    assert clear[32, 32, 3] == 255
    np.testing.assert_array_equal(blue[0, 0, :3], (10, 20, 200))
    assert plain[0, 0, :3].min() > plain[-1, 0, :3].max() > 180
    solid = clear[..., 3] == 255
    np.testing.assert_array_equal(plain[solid], clear[solid])
    np.testing.assert_array_equal(blue[solid], clear[solid])


def test_resolving_is_done_in_linear_light():
    """A half-covered pixel of white on black is sRGB 188, not 128."""
    quad = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], float)
    # Edges at x = 16 and 48 less half a pixel: half of the samples of column 16 are hit, each side of the
    # middle.
    camera = frame(quad, size=(64, 64), orthographic=True)
    half = 15.5 / camera.scale
    mesh = Mesh.of(quad * [half, half, 1], [[0, 1, 2], [0, 2, 3]], material="chalk")
    scene = Scene(lights=(), sky=(9, 9, 9), ground=(9, 9, 9))
    pixels = render(mesh, camera=camera, scene=scene, occlusion="off", background=(0, 0, 0))
    white = int(pixels[32, 32, 0])
    assert white > 245
    assert pixels[32, 16, 0] == pytest.approx(188 * white / 255, abs=3)


def test_a_view_turns_the_camera_to_the_subjects_left_and_up():
    mesh = merge([sphere(rings=8), sphere("pupil", rings=8, radius=0.3, centre=(0.9, 0, 0), part="left"),
                  sphere("lips", rings=8, radius=0.3, centre=(0, 0.9, 0), part="up")])

    def pupil(view):
        pixels = render(mesh, size=96, view=view, occlusion="off").astype(int)
        return np.argwhere(pixels[..., :3].max(axis=2) < 90)

    def lips(view):
        pixels = render(mesh, size=96, view=view, occlusion="off").astype(int)
        return len(np.argwhere(pixels[..., 0] > 1.6 * pixels[..., 1]))

    assert pupil((0, 0))[:, 1].min() > 60
    assert abs(pupil((90, 0))[:, 1].mean() - 48) < 5
    assert len(pupil((-90, 0))) == 0
    assert lips((0, 80)) > 1.3 * lips((0, 0)) > lips((0, -80))


def test_eyes_have_a_catch_light_and_skin_has_none():
    eye = render(sphere("pupil", rings=40), size=128, background=(0, 0, 0))[..., :3].astype(int).sum(axis=2)
    skin = render(sphere("skin", rings=40), size=128, background=(0, 0, 0))[..., :3].astype(int).sum(axis=2)
    row, column = np.unravel_index(eye.argmax(), eye.shape)
    assert eye.max() > 600
    assert 5 < (eye > 500).sum() < 0.03 * eye.size
    assert 40 < row < 62
    assert 45 < column < 63
    assert np.median(eye[40:90, 40:90]) < 120
    assert skin.max() < 735


def test_deep_cavities_are_dark_and_posed_bakes_follow_the_pose():
    closed = merge([box(half=(2, 2, 0.2), centre=(0, 0, 1), part="wall"),
                    box("tongue", half=(2, 2, 0.2), centre=(0, 0, -1), part="back")])
    # Only the wall moves away: what it hid lies open.
    moved = closed.vertices.copy()
    moved[: len(moved) // 2] += [0, 4.2, -2]
    camera = frame(np.concatenate([closed.vertices, moved]), size=(64, 64))

    def brightness(occlusion):
        pixels = render(closed, moved, camera=camera, occlusion=occlusion)
        x, y, _ = camera.project(np.array([[0.0, 0.0, -0.8]]))[0]
        return int(pixels[int(y), int(x), :3].sum())

    assert brightness("neutral") < 0.8 * brightness("posed")
    assert brightness("off") >= brightness("posed") - 3


def test_rigs_are_asked_for_a_mesh_and_a_pose():
    rig = BallRig()
    still, posed = render(rig, size=64), render(rig, "abc", size=64, intensity=0.5)
    assert still.shape == posed.shape == (64, 64, 4)
    assert np.abs(still.astype(int) - posed).max() > 20
    np.testing.assert_array_equal(posed, render(rig, rig.mesh(1).vertices + np.array([0.15, 0, 0]), size=64))


@pytest.mark.parametrize(("size", "options", "detail"), [
    (32, {}, 0), (128, {}, 2), (512, {}, 3), (64, {"detail": 3}, 3), (64, {"shading": "flat"}, 0),
    (64, {"shading": "flat", "detail": 2}, 2),
])
def test_detail_follows_the_size(size, options, detail):
    rig = BallRig()
    render(rig, size=size, occlusion="off", **options)
    assert rig.details[-1] == detail


def test_detail_gives_triangles_of_a_few_pixels():
    from facegen import load_face

    face = load_face()
    chosen = [Renderer(face, size=size, occlusion="off").detail for size in (32, 128, 256, 512, 1024, 4096)]
    assert chosen == sorted(chosen)
    assert chosen[0] == 0
    assert chosen[3:] == [2, 3, 3]


def test_wide_tall_and_large_pictures():
    assert render(BALL, size=(96, 48)).shape == (48, 96, 4)
    assert render(BALL, size=(32, 300)).shape == (300, 32, 4)
    large = render(BALL, size=1500, background="transparent")[..., 3]
    assert (large[::2, 750] == 255).sum() > 600                                 # bands join without gaps
    column = np.flatnonzero(large[:, 750])
    np.testing.assert_array_equal(np.diff(column), 1)


def test_a_mesh_behind_the_camera_is_out_of_the_picture():
    camera = frame(BALL.vertices, size=(64, 64))
    behind = BALL.with_vertices(BALL.vertices + np.array([0, 0, 1000]))
    assert (render(behind, camera=camera, background="transparent")[..., 3] == 0).all()


@pytest.mark.parametrize("orthographic", [False, True])
def test_a_camera_inside_the_head_is_said(orthographic):
    camera = frame(BALL.vertices * 0.2, size=(64, 64), orthographic=orthographic)
    around = merge([BALL, sphere(radius=5, part="around")])
    for call in (lambda: render(around, camera=camera), lambda: Renderer(around, camera=camera),
                 lambda: render_passes(around, camera=camera)):
        with pytest.raises(InputError, match=r"^camera: the camera stands inside the mesh .*move the camera away"):
            call()
    drawn = Renderer(BALL, size=64)
    with pytest.raises(InputError, match=r"^pose: the camera stands inside the mesh"):
        drawn.draw(BALL.vertices * 40)
    with pytest.raises(InputError, match=r"^pose: the camera stands inside the mesh"):
        render(BALL, BALL.vertices * 40, size=64)


def with_isolated(place):
    return Mesh(np.append(BALL.vertices, [place], axis=0), BALL.faces, BALL.materials, BALL.face_materials, BALL.parts,
                BALL.face_parts)


def test_isolated_vertices_and_triangles_without_area_are_drawn_as_nothing():
    camera = frame(BALL.vertices, size=(64, 64))
    expected = render(BALL, camera=camera)
    inside = with_isolated((0, 0, 0))
    np.testing.assert_array_equal(render(inside, camera=camera), expected)
    # Behind the camera it is no cause for alarm either.
    np.testing.assert_array_equal(render(with_isolated((0, 0, 50)), camera=camera, occlusion="off"),
                                  render(BALL, camera=camera, occlusion="off"))
    flat = Mesh(BALL.vertices, np.concatenate([BALL.faces, [[0, 0, 0], [3, 9, 9], [5, 5, 7]]]), BALL.materials,
                np.append(BALL.face_materials, [0, 0, 0]), BALL.parts, np.append(BALL.face_parts, [0, 0, 0]))
    np.testing.assert_array_equal(render(flat, camera=camera, wireframe=True, shadows=True),
                                  render(BALL, camera=camera, wireframe=True, shadows=True))


@pytest.mark.parametrize("size", [32, (32, 4096), (4096, 32)])
@pytest.mark.parametrize("orthographic", [False, True])
def test_the_smallest_and_the_longest_pictures(size, orthographic):
    pixels = render(BALL, size=size, orthographic=orthographic, occlusion="off", background="transparent")
    width, height = size if isinstance(size, tuple) else (size, size)
    assert pixels.shape == (height, width, 4)
    assert pixels[height // 2, width // 2, 3] == 255
    assert pixels[0, 0, 3] == 0


def test_the_largest_picture():
    pytest.importorskip("numba")                                    # NumPy alone takes some seconds
    triangle = np.array([[-1, -1, 0], [1, -1, 0], [0, 1, 0]], float)
    camera = frame(triangle, size=(4096, 4096))
    small = Mesh.of(triangle / 10, [[0, 1, 2]])                     # few pixels: quick, and yet the whole buffer
    alpha = render(small, camera=camera, background="transparent", occlusion="off", renderer="fast")[..., 3]
    assert alpha.shape == (4096, 4096)
    assert (alpha == 255).mean() == pytest.approx(0.084**2 / 2, rel=0.02)


def nan_ball():
    vertices = BALL.vertices.copy()
    vertices[7, 1] = np.nan
    return BALL.with_vertices(vertices)


@pytest.mark.parametrize(("call", "message"), [
    (lambda: render(BALL, size=31), r"^size: expected .*32\.\.4096, got 31"),
    (lambda: render(BALL, size=4097), r"^size: .*got 4097"),
    (lambda: render(BALL, size=64.0), r"^size: .*got 64\.0"),
    (lambda: render(BALL, size=True), r"^size: .*got True"),
    (lambda: render(BALL, size=(64, 64, 64)), r"^size: "),
    (lambda: render(BALL, view=30), r"^view: expected two angles"),
    (lambda: render(BALL, view=(0, 100)), r"^view: .*pitch within"),
    (lambda: render(BALL, background="plane"), r"^background: .*got 'plane'; did you mean 'plain'"),
    (lambda: render(BALL, background=(1, 2)), r"^background: .*\(r, g, b\)"),
    (lambda: render(BALL, background=(1, 2, 256)), r"^background: "),
    (lambda: render(BALL, background=7), r"^background: "),
    (lambda: render(BALL, shading="gouraud"), r"^shading: expected smooth, flat, got 'gouraud'"),
    (lambda: render(BALL, occlusion="of"), r"^occlusion: .*did you mean 'off'"),
    (lambda: render(BALL, detail=2), r"^detail: a Mesh has one level"),
    (lambda: render(BALL, person="anna"), r"^person: a Mesh"),
    (lambda: render(BALL, "happiness"), r"^pose: .*'happiness'"),
    (lambda: render(BALL, np.zeros((3, 3))), r"^pose: expected vertices of shape .*got \(3, 3\)"),
    (lambda: render(BALL, np.full(BALL.vertices.shape, np.inf)), r"^pose: expected finite"),
    (lambda: render(BALL, np.full(BALL.vertices.shape, "a")), r"^pose: expected vertices as numbers"),
    (lambda: render(nan_ball()), r"^thing: expected finite vertices, vertex 7 "),
    (lambda: render(Mesh.of(np.zeros((3, 3)), np.zeros((0, 3), int))), r"^thing: .*no triangles"),
    (lambda: render("happiness"), r"^thing: expected a Mesh or a face, got str"),
    (lambda: render(with_isolated((0, np.nan, 0))),
     r"^thing: expected finite vertices, vertex 1106 is \[0\.0, nan, 0\.0\]"),
    (lambda: render(BALL, size=0), r"^size: .*got 0"),
    (lambda: render(BALL, size=(100000, 100000)), r"^size: .*got \(100000, 100000\)"),
    (lambda: render(BALL, camera=frame(BALL.vertices, size=(16, 64))), r"^camera: expected pixels .*got \(16, 64\)"),
    (lambda: render(BALL, camera=frame(BALL.vertices, size=(64, 5000))), r"^camera: .*32\.\.4096"),
    (lambda: render(BALL, camera="front"), r"^camera: expected a facegen\.geometry\.camera\.Camera or None, got str"),
    (lambda: render(BALL, camera=replace(frame(BALL.vertices, size=(64, 64)), scale=0)), r"^camera: .*a scale above 0"),
    (lambda: render(BALL.with_vertices(np.ones_like(BALL.vertices))), r"^thing: all triangles lie in one point"),
    (lambda: render(BALL, np.ones_like(BALL.vertices)), r"^pose: all triangles lie in one point"),
    (lambda: render(BALL, renderer="sotf"), r"^renderer: .*did you mean 'soft'"),
    (lambda: render(BALL, shadows="yes"), r"^shadows: expected True or False, got 'yes'"),
    (lambda: render(BallRig(), detail=4), r"^detail: expected a subdivision level"),
])
def test_wrong_arguments_are_named_at_the_door(call, message):
    with pytest.raises(InputError, match=message):
        call()


if __name__ == "__main__":
    GOLDEN.mkdir(exist_ok=True)
    for scene_name, draw in SCENES.items():
        Image.fromarray(draw()).save(GOLDEN / f"{scene_name}.png")

"""Lines lie where the edges are, whole, and hide where the surface hides them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import maximum_filter
from shapes import box, sphere

from facegen import load_face
from facegen.errors import InputError
from facegen.geometry.camera import Camera, frame
from facegen.geometry.mesh import Mesh, merge
from facegen.render import RENDERERS, Renderer, Wireframe, render
from facegen.render.overlay import draw_wireframe

BALL = sphere(rings=10)
BLACK = {"colour": (0, 0, 0), "opacity": 1.0}


def flat_camera(size=64, scale=10.0):
    """Pixel (x, y) shows the place (x, -y) / scale from the upper left."""
    return Camera(np.eye(3), np.zeros(3), 100.0, scale, (0.0, 0.0), size, size, orthographic=True)


def ink(mesh, camera, sides=None, **look):
    """How much ink (h, w) 0..1 lies on white paper."""
    paper = np.full((camera.height, camera.width, 4), 255, np.uint8)
    sides = np.ones(mesh.faces.shape, bool) if sides is None else sides
    return 1 - draw_wireframe(paper, mesh, camera, Wireframe(**BLACK, **look), sides)[..., 0] / 255


def quad(x0, y0, x1, y1, z=0.0):
    """A rectangle in the flat camera's pixels, cut from its lower left to its upper right."""
    corners = np.array([[x0, -y1], [x1, -y1], [x1, -y0], [x0, -y0]]) / 10.0
    return Mesh.of(np.column_stack([corners, np.full(4, z)]), [[0, 1, 2], [0, 2, 3]])


@pytest.mark.parametrize("width", [1.0, 2.0, 5.0])
def test_a_line_has_its_width_and_lies_on_its_edge(width):
    mesh = quad(4, 4, 60, 60)
    drawn = ink(mesh, flat_camera(), np.array([[False, False, True], [False, False, False]]), width=width)
    diagonal = ink(mesh, flat_camera(), np.array([[False, False, True], [True, False, False]]), width=width)
    # The diagonal has a triangle on both sides; along its middle the ink across sums to its width.
    y, x = np.indices(diagonal.shape) + 0.5
    off = (x + y - 64) / np.sqrt(2)
    middle = np.abs(x - y) < 40
    assert diagonal[middle].sum() / (80 / np.sqrt(2)) == pytest.approx(width, rel=0.08)
    assert (off * diagonal)[middle].sum() == pytest.approx(0, abs=2.0)
    assert diagonal[np.abs(off) > width / 2 + 1.3].max() == 0
    assert drawn.sum() == pytest.approx(diagonal.sum() / 2, rel=0.05)            # one triangle draws one half


def test_the_outline_is_as_wide_as_inner_lines():
    drawn = ink(quad(8, 8, 56, 56), flat_camera(), np.array([[True, False, False], [False, True, False]]), width=3.0)
    lower, upper = drawn[32:, 20:40].sum(axis=0), drawn[:32, 20:40].sum(axis=0)
    np.testing.assert_allclose(lower, 3, atol=0.15)
    np.testing.assert_allclose(upper, 3, atol=0.15)
    assert (drawn[56:] == 0).all()                                               # nothing beside the surface


def test_lines_of_seen_triangles_are_unbroken():
    camera = frame(BALL.vertices, size=(200, 200))
    near = maximum_filter(ink(BALL, camera, width=2.0), 3)
    x, y, _ = camera.project(BALL.vertices[BALL.faces]).transpose(2, 0, 1)
    area = (x[:, 1] - x[:, 0]) * (y[:, 2] - y[:, 0]) - (x[:, 2] - x[:, 0]) * (y[:, 1] - y[:, 0])
    front = area < -330                                     # smaller ones are thinned
    assert front.sum() > 40
    for t in (0.1, 0.3, 0.5, 0.7, 0.9):
        for k in range(3):
            column = x[front, k] + t * (x[front, (k + 1) % 3] - x[front, k])
            row = y[front, k] + t * (y[front, (k + 1) % 3] - y[front, k])
            # The outline's line lies on the surface, which need not cover the edge's own pixel: look beside it too.
            assert near[row.astype(int), column.astype(int)].min() > 0.5


def test_hidden_lines_are_removed():
    wall, behind = quad(0, 0, 64, 64, z=1.0), quad(20, 20, 44, 44)
    both = merge([wall, behind])
    none = np.zeros((2, 3), bool)
    only_behind = np.concatenate([none, ~none])
    assert ink(both, flat_camera(), only_behind).max() == 0
    turned = merge([quad(0, 0, 64, 64, z=-1.0), behind])
    np.testing.assert_array_equal(ink(turned, flat_camera(), only_behind), ink(behind, flat_camera()))


def test_dense_triangles_do_not_turn_black():
    dense, coarse = sphere(rings=60), sphere(rings=6)
    camera = frame(dense.vertices, size=(96, 96))
    inner = np.hypot(*(np.indices((96, 96)) + 0.5 - 48)) < 25
    assert ink(dense, camera)[inner].mean() < 0.3
    assert 0.05 < ink(coarse, camera)[inner].mean() < 0.3
    assert ink(coarse, camera)[inner].max() > 0.9


def test_wireframe_goes_over_any_renderers_picture():
    face = load_face()
    options = {"size": 96, "detail": 0, "shading": "flat"}
    for name in [r for r in RENDERERS if r in ("soft", "fast")]:
        plain, lined = (render(face, "happiness", renderer=name, wireframe=w, **options) for w in (False, True))
        direct = draw_wireframe(plain, face.mesh(0).with_vertices(face.pose("happiness", detail=0)),
                                Renderer(face, **options).camera, Wireframe(), np.ones(face.mesh(0).faces.shape, bool))
        np.testing.assert_array_equal(lined, direct)
        changed = (lined != plain).any(axis=2)
        assert 0.1 < changed.mean() < 0.5
        assert lined[changed][:, :3].mean() < plain[changed][:, :3].mean() - 20
        assert (lined[..., 3] == plain[..., 3]).all()
        kept = Renderer(face, renderer=name, wireframe=True, **options)
        np.testing.assert_array_equal(kept.draw("happiness"), lined)
        np.testing.assert_array_equal(kept.draw("happiness"), lined)


def test_a_transparent_ground_stays_transparent_and_its_edge_takes_the_whole_colour():
    mesh, camera = quad(8, 8, 55.5, 56), flat_camera()
    red = Wireframe(colour=(255, 0, 0), opacity=1.0, width=4.0)
    pixels = render(mesh, camera=camera, wireframe=red, background="transparent", occlusion="off")
    assert (pixels[:7, :, 3] == 0).all()
    assert pixels[30, 55, 3] == pytest.approx(128, abs=1)
    np.testing.assert_array_equal(pixels[30, 55, :3], (255, 0, 0))


def test_parts_choose_where_lines_go():
    mesh = merge([box(half=(1, 1, 0.2), centre=(-1.2, 0, 0), part="right"),
                  box(half=(1, 1, 0.2), centre=(1.2, 0, 0), part="left")])
    plain = render(mesh, size=64)
    lined = render(mesh, size=64, wireframe=Wireframe(parts=["left"]))
    changed = (plain != lined).any(axis=2)
    assert not changed[:, :32].any()
    assert changed[:, 32:].any()
    np.testing.assert_array_equal(render(mesh, size=64, wireframe=Wireframe(parts=[])), plain)


@pytest.mark.parametrize("detail", [0, 1, 2])
def test_the_cages_edges_run_along_the_surface(detail):
    face = load_face()
    sides, mesh = face.cage_sides(detail), face.mesh(detail)
    assert sides.shape == mesh.faces.shape
    skin = mesh.face_parts == mesh.parts.index("skin")
    assert not sides[~skin].any()
    coarse = len(face.mesh(0).faces) - (~(face.mesh(0).face_parts == 0)).sum()
    assert sides.sum() == 3 * coarse * 2**detail           # each of the cage's sides is halved once a level
    # Every marked side belongs to a chain that joins two vertices of the cage: their degree along it is two.
    ends = np.sort(np.stack([mesh.faces, mesh.faces[:, [1, 2, 0]]], axis=2)[sides], axis=1)
    degree = np.bincount(np.unique(ends, axis=0).ravel())
    n_cage = face.mesh(0).faces[face.mesh(0).face_parts == 0].max() + 1
    assert set(degree[n_cage:]) <= {0, 2}
    assert (degree[np.unique(face.mesh(0).faces[face.mesh(0).face_parts == 0])] >= 2).all()


def test_a_faces_cage_over_its_smooth_skin():
    face = load_face()
    plain, cage, every = (render(face, size=128, detail=2, wireframe=w)
                          for w in (False, Wireframe(lines="cage"), True))
    share = [(x != plain).any(axis=2).mean() for x in (cage, every)]
    assert 0.03 < share[0] < 0.8 * share[1]


@pytest.mark.parametrize(("wireframe", "message"), [
    ("yes", r"^wireframe: expected True, False or a Wireframe, got 'yes'"),
    (Wireframe(colour=(1, 2)), r"^wireframe\.colour: expected an sRGB colour"),
    (Wireframe(colour=(1, 2, 300)), r"^wireframe\.colour: "),
    (Wireframe(width=0), r"^wireframe\.width: expected a number 0\.2\.\.50, got 0"),
    (Wireframe(width=np.nan), r"^wireframe\.width: "),
    (Wireframe(opacity=1.5), r"^wireframe\.opacity: expected a number 0\.\.1, got 1\.5"),
    (Wireframe(opacity="a"), r"^wireframe\.opacity: "),
    (Wireframe(lines="cag"), r"^wireframe\.lines: expected mesh, cage, got 'cag'; did you mean 'cage'"),
    (Wireframe(lines="cage"), r"^wireframe\.lines: 'cage' needs a face that has one, .*for a Mesh"),
    (Wireframe(parts=["skim"]), r"^wireframe\.parts: .*did you mean 'skin'"),
    (Wireframe(parts="skin"), r"^wireframe\.parts: expected a list"),
])
def test_wrong_wishes_are_named_at_the_door(wireframe, message):
    for door in (render, Renderer):
        with pytest.raises(InputError, match=message):
            door(BALL, size=64, wireframe=wireframe)

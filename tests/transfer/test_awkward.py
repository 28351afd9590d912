"""Avatars as other people's files have them: the shapes of the plain avatar, or words about what cannot be done."""

from types import SimpleNamespace

import awkward
import numpy as np
import pytest
from scipy.spatial import cKDTree

from facegen.blendshapes.recipes import shape_sets
from facegen.cli import main
from facegen.errors import InputError
from facegen.face.face import load_face
from facegen.fileio.avatar import load_avatar
from facegen.fileio.obj import load_obj
from facegen.geometry.mesh import Mesh
from facegen.geometry.operators import Surface
from facegen.transfer.landmarks import check_places, load_landmarks
from facegen.transfer.margins import LIDS, LIPS, facing_margins, find_margins
from facegen.transfer.rig import _shipped
from facegen.transfer.skin_mesh import skin_mesh
from facegen.transfer.template import template_of
from facegen.transfer.transfer import transfer

SHAPES = ("jawOpen", "eyeBlinkLeft", "mouthSmileLeft", "mouthSmileRight")
# Of the largest movement of a shape. The same skin has the same shapes, however a file writes it.
SAME = 1e-9
# More skin, a fin or a torso, or the mirror image of one that is its own, decides otherwise between places that are
# equally near.
ALIKE = 0.03


@pytest.fixture(scope="module")
def few():
    recipes = shape_sets(["arkit"])
    return template_of(load_face(), {name: recipes[name] for name in SHAPES})


@pytest.fixture(scope="module")
def plain(few):
    """The cartoon: mesh, landmarks, shapes."""
    path = _shipped()["cartoon"]
    mesh = load_obj(path)
    marks = load_landmarks(path.with_name("landmarks.yaml"), mesh)
    return mesh, marks, transfer(mesh, marks, few)


def skin_rows(mesh):
    return np.flatnonzero(awkward.of_part(mesh, "skin"))


def cheek(mesh):
    """A triangle of the cheek, its corners and a place before it."""
    rows = skin_rows(mesh)
    middles = mesh.vertices[mesh.faces[rows]].mean(axis=1)
    row = rows[np.abs(middles - [0.6, -0.2, 0.6]).sum(axis=1).argmin()]
    return mesh.faces[row], mesh.vertices[mesh.faces[row]].mean(axis=0) + np.array([0.1, 0.0, 0.1])


def flat(mesh):
    """Triangles without an area: corners that are one, one place, or on a line; and vertices that nothing uses."""
    (a, b, c), _ = cheek(mesh)
    n, v = len(mesh.vertices), mesh.vertices
    return awkward.plus(awkward.same(mesh), [v[a], 0.5 * (v[a] + v[b]), 0.25 * v[a] + 0.75 * v[b], [1e6, 0, 0]],
                        [[a, a, b], [c, c, c], [a, n, b], [a, n + 1, n + 2], [a, n + 2, b]])


def branching(mesh):
    """A fin on a side that has two triangles, and a triangle that touches a vertex only."""
    (a, b, c), out = cheek(mesh)
    n = len(mesh.vertices)
    return awkward.plus(awkward.same(mesh), [out, out + np.array([0.0, 0.05, 0.0])], [[a, b, n], [c, n, n + 1]])


def twice(mesh):
    rows = skin_rows(mesh)
    again = np.concatenate([mesh.faces[rows[::5]], mesh.faces[rows[::7]][:, ::-1]])
    return awkward.plus(awkward.same(mesh), np.empty((0, 3)), again)


QUARTER, UP = np.array([[0.0, 0, -1], [0, 1, 0], [1, 0, 0]]), np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])


@pytest.mark.parametrize(("change", "told", "tolerance"), [
    (awkward.moved(0.1 * QUARTER @ UP), "", SAME),                          # a head of 0.2, facing +x, z up
    (awkward.moved(80.0 * np.diag([-1.0, 1.0, -1.0])), "", SAME),           # of 200, facing -z
    (awkward.moved(4e-4 * np.eye(3), (10.0, -10.0, 10.0)), "", SAME),       # of 0.001, ten thousand heads away
    (lambda mesh: awkward.wound(mesh, slice(None)), "inside out", SAME),
    (lambda mesh: awkward.wound(mesh, skin_rows(mesh)[::7]), "wound against their neighbours (first: 0, 7, 14", SAME),
    (twice, "twice or more", SAME),
    (flat, "", SAME),
    (branching, "", ALIKE),
    (awkward.soup, "", SAME),
    (awkward.shuffled, "", SAME),
    (awkward.with_body, "", SAME),
    (lambda mesh: awkward.with_torso(mesh, -0.7), "", ALIKE),
    (lambda mesh: awkward.loose(mesh, "hair", "cap"), "", SAME),
    (lambda mesh: awkward.only(mesh, ~awkward.of_part(mesh, "teeth", "tongue", "cap", "hair")), "", SAME),
], ids=["0.2, +x, z up", "200, -z", "0.001, far away", "inside out", "some wound inward", "faces twice", "no area",
        "non-manifold", "soup", "shuffled", "body", "torso", "hundreds of pieces", "no teeth"])
def test_the_shapes_are_the_plain_avatars(plain, few, change, told, tolerance):
    mesh, marks, wanted = plain
    copy = change(mesh)
    own = copy.landmarks(marks)
    found = transfer(copy.mesh, own, few)
    assert told in " ".join(found.warnings)
    assert bool(told) == bool(found.warnings)
    assert check_places(own, copy.mesh) == []
    for name in SHAPES:
        assert np.isfinite(found.shapes[name]).all()
        off = np.abs(copy.back(found.shapes[name]) - wanted.shapes[name])
        assert np.nanmax(off) < tolerance * np.abs(wanted.shapes[name]).max(), name


def test_a_mirrored_avatar_has_the_mirrored_shapes(plain, few):
    mesh, marks, wanted = plain
    copy = awkward.mirrored(mesh)
    other = {"L": "R", "R": "L"}
    own = copy.landmarks(marks)
    names = tuple(name[:-1] + other[name[-1]] if name[-2:] in ("_L", "_R") else name for name in own.names)
    found = transfer(copy.mesh, type(own)(names, own.faces, own.corners, own.barycentric), few)
    for name, mirror in (("mouthSmileLeft", "mouthSmileRight"), ("jawOpen", "jawOpen")):
        off = np.abs(copy.back(found.shapes[name]) - wanted.shapes[mirror])
        assert off.max() < ALIKE * np.abs(wanted.shapes[mirror]).max()


def test_what_closes_a_crack_goes_with_its_edge(plain, few):
    mesh, marks, _ = plain
    copy = flat(mesh)
    (a, b, _), _ = cheek(mesh)
    smile = transfer(copy.mesh, copy.landmarks(marks), few).shapes["mouthSmileLeft"]
    n = len(mesh.vertices)
    assert np.abs(smile[a]).max() > 0.01
    for vertex, share in ((n, 1.0), (n + 1, 0.5), (n + 2, 0.25)):
        np.testing.assert_allclose(smile[vertex], share * smile[a] + (1 - share) * smile[b], atol=1e-5)
    assert not smile[n + 3].any()


def test_a_speck_in_a_seam_goes_with_its_edge(plain, few):
    """A triangle of no size, which flat ones alone hold: it used to rest where it was."""
    mesh, marks, _ = plain
    (a, b, _), _ = cheek(mesh)
    n, middle = len(mesh.vertices), 0.5 * (mesh.vertices[a] + mesh.vertices[b])
    copy = awkward.plus(awkward.same(mesh), middle + 1e-6 * np.eye(3), [[n, n + 1, n + 2], [a, n, b], [n, n + 1, b]])
    smile = transfer(copy.mesh, copy.landmarks(marks), few).shapes["mouthSmileLeft"]
    assert np.abs(smile[a]).max() > 0.01
    np.testing.assert_allclose(smile[n:], np.tile(0.5 * (smile[a] + smile[b]), (3, 1)), atol=1e-4)


def test_a_torso_rests(plain, few):
    mesh, marks, _ = plain
    copy = awkward.with_torso(mesh, -0.7)
    found = transfer(copy.mesh, copy.landmarks(marks), few)
    far = np.arange(len(copy.mesh.vertices)) >= len(mesh.vertices) + 44
    for name in SHAPES:
        assert np.abs(found.shapes[name][far]).max() < 2e-3 * np.abs(found.shapes[name]).max(), name


def test_a_mask_moves_as_the_whole_head_does(plain, few):
    """Cut off before the ears: no back of the head, no jaw's angle, an open border."""
    mesh, marks, wanted = plain
    copy = awkward.only(mesh, (mesh.vertices[mesh.faces][..., 2] > 0.0).all(axis=1))
    own = copy.landmarks(marks)
    found = transfer(copy.mesh, own, few)
    for name, place, most in (("jawOpen", "mouth_inner_bottom", 0.05), ("eyeBlinkLeft", "eye_upper_L", 0.05),
                              ("mouthSmileLeft", "mouth_corner_L", 0.05)):
        now, then = (points[place] for points in (own.points(found.shapes[name]), marks.points(wanted.shapes[name])))
        assert np.linalg.norm(now - then) < most * np.linalg.norm(then)


def opposite(mesh, marks, found, slit):
    """Pairs of vertices that face each other across a slit."""
    rows = cKDTree(found.frame.apply(mesh.vertices)).query(found.skin.surface.vertices)[1]
    _, own = facing_margins(found.skin, slit)
    upper, lower = (rows[own.rows[of][np.argsort(own.at[of])]] for of in (own.is_upper, ~own.is_upper))
    few, many = sorted((upper, lower), key=len)
    across = np.linspace(0, len(few) - 1, len(many)).round().astype(int)            # each has a partner, none is left
    return list(zip(few[across], many, strict=True))


def test_a_painted_mouth_stays_whole(plain, few):
    """Lips that are one line: it used to tear into points where some of it went with the jaw and some did not."""
    mesh, marks, found = plain
    pairs = np.array(opposite(mesh, marks, found, LIPS))
    copy = awkward.welded(mesh, pairs)
    own = copy.landmarks(marks)
    assert "its mouth moves but cannot open" in " ".join(check_places(own, copy.mesh))
    opened = transfer(copy.mesh, own, few).shapes["jawOpen"]
    line = np.unique(copy.rows[pairs])
    line = line[np.argsort(copy.mesh.vertices[line, 0])]
    down = opened[line, 1]
    assert np.abs(np.diff(down)).max() < 0.25 * np.abs(opened[:, 1]).max()


def test_painted_lids_stay_as_they_are(plain, few):
    mesh, marks, found = plain
    copy = awkward.welded(mesh, np.concatenate([opposite(mesh, marks, found, lid) for lid in LIDS]))
    own = copy.landmarks(marks)
    assert "cannot open or close over an eye" in " ".join(check_places(own, copy.mesh))
    blink = transfer(copy.mesh, own, few).shapes["eyeBlinkLeft"]
    assert np.isfinite(blink).all()
    assert np.abs(blink).max() < 0.2 * np.abs(found.shapes["eyeBlinkLeft"]).max()


@pytest.mark.parametrize("gone", [("eye",), ("eye_R",), ("eye", "teeth", "tongue", "brow", "moustache", "cap", "hair")])
def test_without_eyes_the_lids_still_meet(plain, few, gone):
    mesh, marks, wanted = plain
    copy = awkward.only(mesh, ~awkward.of_part(mesh, *gone))
    own = copy.landmarks(marks)
    found = transfer(copy.mesh, own, few)
    rest, shut = own.points(copy.mesh.vertices), own.points(copy.mesh.vertices + found.shapes["eyeBlinkLeft"])
    gap = [np.linalg.norm(at["eye_upper_L"] - at["eye_lower_L"]) for at in (rest, shut)]
    assert gap[1] < 0.07 * gap[0]           # without a ball they go straight, and their edges end less close
    off = np.abs(copy.back(found.shapes["jawOpen"]) - wanted.shapes["jawOpen"])
    assert np.nanmax(off) < 0.05 * np.abs(wanted.shapes["jawOpen"]).max()


def write_obj(path, mesh):
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in mesh.vertices.tolist()]
    for p, part in enumerate(mesh.parts):
        lines += [f"g {part}", *("f " + " ".join(str(i + 1) for i in face)
                                 for face in mesh.faces[mesh.face_parts == p].tolist())]
    path.write_text("\n".join(lines) + "\n")


def write_landmarks(path, mesh, marks):
    points = marks.points(mesh.vertices)
    path.write_text("landmarks:\n" + "".join(f"  {name}: {at.tolist()}\n" for name, at in points.items()))


def test_the_file_keeps_what_it_has_and_the_command_says_what_is_odd(plain, tmp_path, capsys):
    mesh, marks, _ = plain
    bad = awkward.plus(awkward.wound(twice(mesh).mesh, slice(None)), [[0.0, 0.0, 9.0]], [[0, 0, 1]]).mesh
    write_obj(tmp_path / "bad.obj", bad)
    write_landmarks(tmp_path / "bad.yaml", bad, marks)
    out = tmp_path / "bad.npz"
    assert main(["rig", str(tmp_path / "bad.obj"), "-l", str(tmp_path / "bad.yaml"), "-o", str(out), "--set",
                 "vrm"]) == 0
    told = capsys.readouterr().err
    assert "inside out" in told
    assert "twice or more" in told
    kept = np.load(out)
    again = load_avatar(tmp_path / "bad.obj").mesh
    assert np.array_equal(kept["neutral"], again.vertices)
    assert np.array_equal(kept["faces"], again.faces)
    assert np.isfinite(kept["deltas"]).all()


def test_a_skin_without_area_is_refused_by_number():
    line = np.linspace(0, 1, 12)[:, None] * [1.0, 2.0, 3.0]
    faces = np.stack([np.arange(10), np.arange(1, 11), np.arange(2, 12)], axis=1)
    with pytest.raises(InputError, match=r"none of the skin's 10 triangles has an area \(first: 40, 41, "):
        skin_mesh(line, faces, 40 + np.arange(10), {})


def test_vertices_beyond_all_numbers_are_refused_by_number(plain, few):
    mesh, marks, _ = plain
    vertices = mesh.vertices.copy()
    vertices[[3, 40]] = 1e200
    with pytest.raises(InputError, match=rf"2 of {len(vertices)} vertices lie beyond 1e\+30 \(first: 3, 40\)"):
        transfer(mesh.with_vertices(vertices), marks, few)


def test_a_one_sided_strip_is_told():
    """A Moebius strip: no winding fits."""
    k = 20
    turn = np.linspace(0, 2 * np.pi, k, endpoint=False)
    middle, across = (np.stack([np.cos(a), np.sin(a), 0 * a], 1) for a in (turn, turn))
    across = across * np.cos(turn / 2)[:, None] + np.sin(turn / 2)[:, None] * [0.0, 0.0, 1.0]
    vertices = np.concatenate([middle - 0.2 * across, middle + 0.2 * across])
    a = np.arange(k)
    b, c = np.where(a == k - 1, k, a + 1), np.where(a == k - 1, 0, a + k + 1)
    faces = np.concatenate([np.stack([a, b, a + k], 1), np.stack([b, c, a + k], 1)])
    found = skin_mesh(vertices, faces, np.arange(len(faces)), {"nose_tip": vertices[0]})
    assert any("40 triangles (first: 0, 1, 2, 3, 4, ...) of a surface with one side only" in n for n in found.notes)
    assert len(found.turned) == 0


def test_landmarks_of_a_face_on_a_ball_are_refused(plain, tmp_path, capsys):
    """A mesh with no face."""
    mesh, marks, _ = plain
    ball = awkward.with_body(mesh).mesh
    ball = awkward.only(ball, awkward.of_part(ball, "body")).mesh
    write_obj(tmp_path / "ball.obj", Mesh.of(ball.vertices, ball.faces))
    write_landmarks(tmp_path / "ball.yaml", mesh, marks)
    out = tmp_path / "ball.glb"
    out.write_bytes(b"old")
    assert main(["rig", str(tmp_path / "ball.obj"), "-l", str(tmp_path / "ball.yaml"), "-o", str(out)]) == 2
    told = capsys.readouterr().err
    assert "miss the surface" in told
    assert "Traceback" not in told
    assert out.read_bytes() == b"old"


def test_an_edge_that_goes_round_the_head_is_none():
    """Where skin without lids has no side, the way above an eye went round the head; a blink moved all of that."""
    a, b = np.meshgrid(np.arange(20) * np.pi / 10, np.linspace(0.05, np.pi - 0.05, 15))
    ball = 60 * np.stack([np.sin(b) * np.sin(a), np.cos(b), np.sin(b) * np.cos(a)], -1).reshape(-1, 3)
    k = np.arange(14 * 20)
    after = k - k % 20 + (k + 1) % 20
    faces = np.concatenate([np.stack([k, k + 20, after], 1), np.stack([after, k + 20, after + 20], 1)])
    surface = Surface(ball, faces.astype(np.int32))
    places = {}
    for name, (x, y) in {"eye_inner_L": (0, 0), "eye_outer_L": (57, 0), "eye_upper_L": (18, 13),
                         "eye_lower_L": (18, -13)}.items():
        near = int(np.linalg.norm(ball - [x, y, np.sqrt(3600 - x * x - y * y)], axis=1).argmin())
        places[name] = (np.full(3, near), np.array([1.0, 0.0, 0.0]))
    nowhere = np.zeros((2, 5, 3))
    guide = SimpleNamespace(line=nowhere, paths=[(edge, np.arange(5) / 4) for edge in nowhere])
    flat = {"shape": np.zeros_like(ball), "guide": guide}
    right = np.sign(ball[:, 1:2]) * [0.0, 1.0, 0.0]
    assert find_margins(surface, LIDS[0], places, right, **flat) is not None
    wall = np.isin(np.arange(len(ball)) % 20, (2, 3))[:, None]
    assert find_margins(surface, LIDS[0], places, np.where(wall, [0.0, -1.0, 0.0], right), **flat) is None

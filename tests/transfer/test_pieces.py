"""The pieces of an avatar: found by place and shape, with names or without; overruled by what the user says."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from piece_avatars import ball, disc, dressed, head, lashes, moustache, template, together, tube, with_body
from scipy.spatial.transform import Rotation

from facegen.errors import InputError
from facegen.geometry.mesh import Mesh
from facegen.geometry.normals import vertex_normals
from facegen.transfer.alignment import Similarity, align
from facegen.transfer.keep_apart import keep_apart
from facegen.transfer.landmarks import check_places, snap
from facegen.transfer.piece_motion import PieceMotion
from facegen.transfer.piece_names import KINDS, kind_of_name, row_of_name, words_of
from facegen.transfer.pieces import describe, find_pieces
from facegen.transfer.weld import weld

EXPECTED = {
    "skin": "skin", "eye_L": "eye_L", "eye_R": "eye_R", "teeth_upper": "teeth_upper", "teeth_lower": "teeth_lower",
    "tongue": "tongue", "mouth": "mouth", "brows": "carried", "hair": "skull", "cornea_L": "eye_L", "cornea_R": "eye_R",
    "spot_L": "eye_L", "spot_R": "eye_R", "lashes_L": "carried", "lashes_R": "carried", "moustache": "carried",
    "cap": "skull", "glasses": "skull", "trunk": "body",
}


# -- what is what --------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("named", [True, False])
def test_a_head_with_everything(named):
    found = dressed().kinds(named)
    assert {name: {kind} for name, kind in EXPECTED.items()} == found


@pytest.mark.parametrize("named", [True, False])
def test_every_triangle_is_in_one_piece(named):
    avatar = dressed()
    pieces = avatar.pieces(named)
    rows = np.concatenate([piece.faces for piece in pieces])
    np.testing.assert_array_equal(np.sort(rows), np.arange(len(avatar.faces)))
    for piece in pieces:
        np.testing.assert_array_equal(piece.vertices, np.unique(avatar.faces[piece.faces]))
        assert piece.kind in KINDS
        assert piece.why
    assert pieces[0].kind == "skin"


def test_a_body_in_one_with_the_head_is_skin():
    avatar = with_body()
    assert avatar.kinds()["body"] == {"skin"}
    assert avatar.kinds(named=False)["teeth_lower"] == {"teeth_lower"}


def test_a_face_in_several_shells():
    """The skin cut in two at the nose's tip: both halves carry landmarks."""
    avatar = head()
    left = avatar.vertices[avatar.faces].mean(axis=1)[:, 0] > 0
    own = np.array([name.startswith("skin|") for name in avatar.names])
    faces = avatar.faces.copy()
    faces[left & own] += len(avatar.vertices)
    cut = replace(avatar, vertices=np.concatenate([avatar.vertices, avatar.vertices]), faces=faces)
    skin = cut.pieces(named=False)[0]
    assert len(skin.components) == 2
    assert len(skin.faces) == own.sum()


def test_eyes_painted_on_the_skin_are_none():
    kinds = {piece.kind for piece in head().without("eye_L", "eye_R").pieces()}
    assert not kinds & {"eye_L", "eye_R"}


@pytest.mark.parametrize("named", [True, False])
def test_lashes_of_single_hairs(named):
    avatar = head()
    points = avatar.points
    for k in range(12):
        root = points["eye_upper_L"] + [k - 6.0, 0.4 - 0.03 * (k - 6) ** 2, 0.3 - 0.05 * (k - 6) ** 2]
        avatar = avatar.plus("hair_card" if named else "", *tube([root + np.array([0, 0.3 * t, t]) for t in
                                                                np.linspace(0, 8, 5)], 0.3, around=3))
    found = avatar.plus("eyelash", *lashes(points, "R")).kinds(named)
    assert found["eyelash"] == {"carried"}


def test_spots_discs_and_shells_belong_to_their_eye():
    avatar = head().without("eye_L", "eye_R")
    for s, x in (("L", 29.0), ("R", -29.0)):
        avatar = avatar.plus(f"a{s}", *ball([x, 0, 0], 14.8)).plus(f"b{s}", *ball([x, 0, 0], 15.0, part=0.6))
        avatar = avatar.plus(f"c{s}", *disc([x, 0, 14.5], 5.0)).plus(f"d{s}", *disc([x, 0, 15.2], 2.0))
        avatar = avatar.plus(f"e{s}", *disc([x - 2, 2, 15.6], 0.8))
    found = avatar.kinds(named=False)
    for s in "LR":
        for part in "abcde":
            assert found[f"{part}{s}"] == {f"eye_{s}"}, part


def test_big_cartoon_eyes_that_stand_out():
    avatar = head().without("eye_L", "eye_R")
    for s, x in (("L", 29.0), ("R", -29.0)):
        avatar = avatar.plus(f"toon{s}", *ball([x, 0, 2], [17, 22, 17]))
    found = avatar.kinds(named=False)
    assert (found["toonL"], found["toonR"]) == ({"eye_L"}, {"eye_R"})


def test_both_rows_of_teeth_in_one_piece_go_as_a_lining():
    avatar = head().without("teeth_upper", "teeth_lower", "tongue", "mouth")
    path = [[22 * np.sin(t), -66.9, 2 + 16 * np.cos(t)] for t in np.linspace(-1.6, 1.6, 24)]
    one = tube(path, 8.0)
    assert avatar.plus("teeth", *one).kinds()["teeth"] == {"mouth"}
    rows = together([tube(np.array(path) - [0, shift, 0], 3.5) for shift in (-5, 5)])
    assert avatar.plus("teeth", *rows).kinds()["teeth"] == {"teeth_upper", "teeth_lower"}
    assert avatar.plus("thing", *rows).kinds(named=False)["thing"] == {"teeth_upper", "teeth_lower"}


def test_a_mask_open_at_the_back():
    avatar = head()
    own = np.array([name.startswith("skin|") for name in avatar.names])
    keep = ~own | (avatar.vertices[avatar.faces].mean(axis=1)[:, 2] > -70)
    mask = replace(avatar, faces=avatar.faces[keep], names=[n for n, k in zip(avatar.names, keep, strict=True) if k])
    found = mask.kinds(named=False)
    for part in ("eye_L", "eye_R", "teeth_upper", "teeth_lower", "tongue", "brows", "hair"):
        assert found[part] == {EXPECTED[part]}, part


def test_a_mouth_that_stands_open():
    from facegen.face.face import load_face

    face = load_face()
    avatar = head()
    mesh, _ = template()
    posed = face.pose("25D+26D", detail=1)
    vertices, inverse = weld(posed)             # parted lips: nothing of the skin touches
    assert len(inverse) == len(mesh.vertices)
    points = face.landmark_points(posed, detail=1)
    opened = replace(avatar, vertices=vertices, faces=inverse[mesh.faces], points=points)
    for named in (True, False):
        found = opened.kinds(named)
        for part in ("eye_L", "teeth_upper", "teeth_lower", "brows"):
            assert found[part] == {EXPECTED[part]}, (named, part)


def test_names_do_not_beat_the_place():
    """What is called an eye but sits on the head is none, nor is a tooth on a necklace."""
    avatar = head().plus("third eye", *ball([0, 90, -10], 9.0)).plus("tooth", *ball([0, -180, 0], 5.0))
    found = avatar.kinds()
    assert found["third eye"] == {"skull"}
    assert found["tooth"] == {"body"}


def test_a_thick_moustache_and_a_pipe_are_carried():
    avatar = head().plus("a", *moustache(head().points, 9.0))
    lip = head().points["mouth_corner_L"]
    pipe = tube([lip + np.array([t * 0.3, -t * 0.2, t]) for t in np.linspace(-1, 45, 9)], 3.0)
    found = avatar.plus("b", *pipe).kinds(named=False)
    assert (found["a"], found["b"]) == ({"carried"}, {"carried"})


@pytest.mark.parametrize(("turn", "scale"), [((0, 90, 0), 1e-3), ((-90, 0, 0), 200 / 250), ((180, 30, 77), 40.0)])
def test_from_a_file_s_own_axes_and_units(turn, scale):
    """A head on a body, in any axes and units: landmarks pass, and in the working frame all is as before."""
    avatar = with_body()
    move = Similarity(scale, Rotation.from_euler("xyz", turn, degrees=True).as_matrix(), np.array([3.0, 500.0, -8.0]))
    mesh = Mesh.of(move.apply(avatar.vertices), avatar.faces)
    marks = snap({name: move.apply(at) for name, at in avatar.points.items()}, mesh)
    assert check_places(marks, mesh) == []
    found = align(marks.points(mesh.vertices), avatar.points)
    vertices = found.apply(mesh.vertices)
    np.testing.assert_allclose(vertices, avatar.vertices, atol=0.5)
    moved = replace(avatar, vertices=vertices, points={
        name: found.apply(at) for name, at in marks.points(mesh.vertices).items()})
    assert moved.kinds(named=False) == avatar.kinds(named=False)


# -- what the user says --------------------------------------------------------------------------------------------
def test_explicit_entries_win():
    avatar = dressed()
    assert avatar.kinds(explicit={"hair": "carried", "cap": "body"})["hair"] == {"carried"}
    assert avatar.kinds(explicit={"sclera": "skull"})["eye_L"] == {"skull"}              # a material
    number = next(piece.components[0] for piece in avatar.pieces() if piece.name == "moustache")
    for key in (number, str(number)):
        assert avatar.kinds(explicit={key: "skull"})["moustache"] == {"skull"}
    pieces = avatar.pieces(explicit={"hair": "skin"})
    assert len(pieces[0].components) == 2
    assert {row["name"]: row["why"] for row in describe(avatar.pieces(explicit={"cap": "skull"}))}["cap"] == "given"


@pytest.mark.parametrize(("explicit", "words"), [
    ({"hair": "skul"}, r"pieces: unknown kind 'skul' for 'hair'; did you mean 'skull'\? \(known: skin, eye_L"),
    ({"hairs": "skull"}, r"no part, material or component 'hairs'; did you mean 'hair'\? \(components: 0\.\.\d+\)"),
    ({999: "skull"}, "no part, material or component '999'"), ({-1: "skull"}, "no part, material or component '-1'"),
    ({"": "skull"}, "no part, material or component ''"), ({"hair": None}, "unknown kind None"),
    ({"lips": "mouth"}, r"'lips' is no piece of its own: its triangles are joined to 'skin'"),
    ({"skin": "skull"}, "'skin' carries the landmarks, so it is the skin"),
])
def test_explicit_entries_that_make_no_sense(explicit, words):
    with pytest.raises(InputError, match=words):
        dressed().pieces(explicit=explicit)


def test_wrong_arrays():
    avatar = head()
    with pytest.raises(InputError, match="expected finite vertices"):
        find_pieces(np.full_like(avatar.vertices, np.nan), avatar.faces, avatar.points)
    with pytest.raises(InputError, match="at least one triangle"):
        find_pieces(avatar.vertices, np.zeros((0, 3), int), avatar.points)
    with pytest.raises(InputError, match=r"faces: indices must lie in 0\.\.3, got"):
        find_pieces(avatar.vertices[:4], avatar.faces, avatar.points)
    with pytest.raises(InputError, match="names: expected one for each of"):
        find_pieces(avatar.vertices, avatar.faces, avatar.points, names=["a"])
    some = {name: place for name, place in avatar.points.items() if name not in ("chin", "nose_tip")}
    with pytest.raises(InputError, match="points: the landmarks nose_tip, chin are missing"):
        find_pieces(avatar.vertices, avatar.faces, some)
    with pytest.raises(InputError, match="points: expected three finite numbers for chin"):
        find_pieces(avatar.vertices, avatar.faces, {**avatar.points, "chin": [0, np.nan, 0]})


def test_degenerate_and_tiny_pieces():
    """Triangles without area, doubled triangles, an edge used by three, a vertex that nothing uses."""
    avatar = head()
    first = avatar.faces[avatar.faces[:, 0] != avatar.faces[0, 1]][:1]
    more = np.concatenate([avatar.faces, avatar.faces[:3], first[:, [0, 0, 0]], first[:, [0, 1, 1]]])
    n = len(avatar.vertices)
    eye = (avatar.points["eye_upper_L"] + avatar.points["eye_lower_L"]) / 2
    more = np.concatenate([more, [[n, n, n], [n + 1, n + 2, n + 2], [0, 1, n + 3]]])
    vertices = np.concatenate([avatar.vertices, [eye, eye + np.array([1, 0, 0]), eye, [0, 60, 30], [0, 0, 0]]])
    names = avatar.names + ["x"] * (len(more) - len(avatar.names))
    broken = replace(avatar, vertices=vertices, faces=more, names=names)
    for named in (True, False):
        pieces = broken.pieces(named)
        assert sum(len(piece.faces) for piece in pieces) == len(more)
        moves = PieceMotion(pieces, broken.vertices, broken.faces, broken.points)
        motion = np.random.default_rng(0).normal(size=(2, len(vertices), 3))
        out, found = keep_apart(moves, moves.move(motion, gaze=np.full((2, 4), 9.0)), np.full((2, 4), 9.0))
        assert np.isfinite(out).all()
        assert "eye_L" in found


def test_an_outline_round_the_face_follows_it():
    avatar = head()
    own = avatar.faces[[name.startswith("skin|") for name in avatar.names]]
    used, local = np.unique(own, return_inverse=True)
    at = avatar.vertices[used] + 0.8 * vertex_normals(avatar.vertices, own)[used]
    outlined = avatar.plus("contour", at, local.reshape(-1, 3)[:, ::-1])
    assert outlined.kinds(named=False)["contour"] == {"carried"}


def test_thousands_of_cards_of_hair():
    avatar = head()
    rng = np.random.default_rng(0)
    card = tube([[0, 0, 0], [0, 4, 3], [0, 9, 5]], 0.5, around=3)
    places = avatar.points["head_top"] + rng.normal(scale=[40, 12, 40], size=(2000, 3))
    many = avatar.plus("strands", *together([(card[0] + at, card[1]) for at in places]))
    start = time.perf_counter()
    found = many.kinds(named=False)
    assert time.perf_counter() - start < 15.0                # a second on a free machine
    assert "skull" in found["strands"]
    assert found["teeth_lower"] == {"teeth_lower"}


# -- the report ----------------------------------------------------------------------------------------------------
def test_the_report_joins_what_is_alike():
    avatar = dressed()
    rows = describe(avatar.pieces())
    assert sum(row["triangles"] for row in rows) == len(avatar.faces)
    teeth = next(row for row in rows if row["name"] == "teeth_upper|teeth")
    assert teeth == {"name": "teeth_upper|teeth", "kind": "teeth_upper", "triangles": 602, "why": "named 'upper'",
                     "components": teeth["components"]}
    assert len(teeth["components"]) == 14
    assert rows[0]["why"] == "carries 19 landmarks"
    unnamed = {row["why"] for row in describe(avatar.pieces(named=False))}
    assert {"round, in the left eye", "behind the lips, below their line", "thin, on the skin"} <= unnamed


def test_a_large_avatar_in_a_second():
    avatar = dressed()
    vertices, faces = [avatar.vertices], [avatar.faces]
    for k in range(60):                                      # a coat of sixty buttons
        at, rows = ball([0, -260 - 4 * k, 60], 30.0, rings=25, around=32)
        faces.append(rows + sum(map(len, vertices)))
        vertices.append(at)
    big = replace(avatar, vertices=np.concatenate(vertices), faces=np.concatenate(faces))
    big = replace(big, names=avatar.names + ["button"] * (len(big.faces) - len(avatar.faces)))
    assert len(big.faces) > 100_000
    start = time.perf_counter()
    found = big.kinds()
    took = time.perf_counter() - start
    assert found["button"] == {"body"}
    assert took < 10.0                                       # a second on a free machine


# -- names ---------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(("name", "kind"), [
    ("EyeBall_L.001", "eye"), ("CC_Base_Eye", "eye"), ("eyelashes_upper", "carried"), ("Eyebrows", "carried"),
    ("eyelid", "skin"), ("Upper_Teeth", "teeth"), ("gums", "teeth"), ("tongue01", "tongue"), ("HatBrim", "skull"),
    ("sun_glasses", "skull"), ("F00_000_HairBack", "skull"), ("mouthCavity", "mouth"), ("Shirt", "body"),
    ("mustache", "carried"), ("Mesh.017", ""), ("", ""), ("FaceSkin", "skin"), ("head|iris", "eye"),
    ("beige", ""), ("chair", ""), ("capsule", ""),
])
def test_what_names_say(name, kind):
    assert kind_of_name(name) == kind


@pytest.mark.parametrize(("name", "row"), [("teeth_upper", "upper"), ("LowerTeeth", "lower"), ("teeth", ""),
                                           ("upper_and_lower", ""), ("bottom teeth", "lower"), ("toptoe", "")])
def test_which_row_names_say(name, row):
    assert row_of_name(name) == row


@given(st.text())
def test_any_name_can_be_read(name):
    assert kind_of_name(name) in {"", "eye", "teeth", *KINDS}
    assert words_of(name) == words_of(name + ".001")


# -- welding -------------------------------------------------------------------------------------------------------
@settings(max_examples=30)
@given(st.lists(st.tuples(*[st.sampled_from([-0.0, 0.0, 1.0, 1.0 + 2e-16, 1e-300, -7.5])] * 3), max_size=40))
def test_welding_loses_nothing(rows):
    vertices = np.array(rows, float).reshape(-1, 3)
    unique, inverse = weld(vertices)
    np.testing.assert_array_equal(unique[inverse], vertices)
    assert len({tuple(row) for row in (vertices + 0.0).tolist()}) == len(unique)
    assert not len(inverse) or (np.diff(np.maximum.accumulate(inverse)) <= 1).all()      # in their order


def test_welding_by_the_mesh_joins_seams_but_no_lips():
    mesh, _ = template()
    vertices, inverse = weld(mesh.vertices, mesh.faces)
    assert len(vertices) == len(mesh.vertices)                   # its closed lips touch, and stay two lips
    assert len(weld(mesh.vertices)[0]) < len(mesh.vertices)
    split = mesh.vertices[mesh.faces].reshape(-1, 3)             # every triangle for itself
    again, inverse = weld(split, np.arange(len(split)).reshape(-1, 3))
    assert len(again) == len(weld(mesh.vertices)[0])
    np.testing.assert_array_equal(again[inverse], split)


@pytest.mark.parametrize("bad", [np.full((3, 3), np.inf), np.zeros((3, 2)), np.zeros(3)])
def test_what_cannot_be_welded(bad):
    with pytest.raises(InputError, match="vertices: expected finite positions"):
        weld(bad)

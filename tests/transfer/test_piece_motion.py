"""How pieces move: at rest exactly not at all, rigidly with rigid skin, as the base face moves its own."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from piece_avatars import ball, disc, dressed, head, lashes, moustache, template, tube
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from facegen.blendshapes.names import shape_of
from facegen.blendshapes.recipes import shape_set
from facegen.errors import InputError
from facegen.face.face import load_face
from facegen.transfer.eyeball import fit_eye, gaze_rotation
from facegen.transfer.keep_apart import keep_apart
from facegen.transfer.piece_motion import PieceMotion, RigidMotions
from facegen.transfer.template import template_of
from facegen.transfer.tongue import Tongue

ANGLE = st.floats(-40, 40)


@cache
def prepared(named=True):
    avatar = dressed()
    return avatar, PieceMotion(avatar.pieces(named), avatar.vertices, avatar.faces, avatar.points)


def identity(k):
    return RigidMotions(np.tile(np.eye(3), (k, 1, 1)), np.zeros((k, 3)))


@cache
def posed(*units):
    """Return (avatar, motion object, true motion (k, n, 3), jaw, gaze) of the base face in some units."""
    face = load_face()
    avatar = head()
    mesh, _ = template()
    controls = [face.controls(face.resolve(unit).deformation, strict=False) for unit in units]
    motion = np.array([face.pose(unit, detail=1) for unit in units]) - mesh.vertices
    assert len(avatar.vertices) == len(mesh.vertices)
    angles = np.array([one.jaw for one in controls])
    jaw = RigidMotions.of(lambda at: face.deformer.jaw.movement(at, angles))
    moves = PieceMotion(avatar.pieces(), avatar.vertices, avatar.faces, avatar.points)
    return avatar, moves, motion, jaw, np.array([one.eyes for one in controls])


# -- laws ----------------------------------------------------------------------------------------------------------
def test_nothing_moves_by_itself():
    avatar, moves = prepared()
    rest = np.zeros((3, *avatar.vertices.shape))
    for more in ({}, {"jaw": identity(3), "gaze": np.zeros((3, 4))}):
        out = moves.move(rest, **more)
        assert out.shape == rest.shape
        assert not out.any()
        assert not keep_apart(moves, out)[0].any()


def test_the_skin_is_left_as_it_is():
    avatar, moves = prepared()
    motion = np.random.default_rng(0).normal(size=(2, *avatar.vertices.shape))
    out = moves.move(motion, identity(2))
    np.testing.assert_array_equal(out[:, moves.rows("skin")], motion[:, moves.rows("skin")])
    assert not out[:, moves.rows("skull", "body", "teeth_upper", "teeth_lower", "tongue")].any()


@settings(max_examples=15, deadline=None)
@given(ANGLE, ANGLE, ANGLE, st.tuples(*[st.floats(-50, 50)] * 3))
def test_rigid_skin_carries_rigidly(x, y, z, shift):
    avatar, moves = prepared()
    turn = Rotation.from_euler("xyz", [x, y, z], degrees=True).as_matrix()
    motion = (avatar.vertices @ turn.T + shift - avatar.vertices)[None]
    out = moves.move(motion)
    rows = moves.rows("carried")
    assert len(rows) > 300
    np.testing.assert_allclose(out[:, rows], motion[:, rows], atol=1e-8)


@settings(max_examples=15, deadline=None)
@given(ANGLE, ANGLE, st.tuples(*[st.floats(-20, 20)] * 3))
def test_the_jaw_carries_its_teeth_rigidly(x, y, shift):
    avatar, moves = prepared()
    turn = Rotation.from_euler("xy", [x, y], degrees=True).as_matrix()
    jaw = RigidMotions(turn[None], np.array([shift]))
    out = moves.move(np.zeros((1, *avatar.vertices.shape)), jaw)
    rows = moves.rows("teeth_lower", "tongue")
    np.testing.assert_allclose(out[0, rows], avatar.vertices[rows] @ turn.T + shift - avatar.vertices[rows], atol=1e-10)
    assert not out[:, moves.rows("teeth_upper", "skull", "carried", "eye_L", "eye_R")].any()


def test_rigid_motions_of_a_jaw():
    face = load_face()
    angles = np.array([[0.0, 0, 0], [20, 0, 0], [5, 3, 2]])
    motions = RigidMotions.of(lambda at: face.deformer.jaw.movement(at, angles))
    at = np.random.default_rng(0).normal(scale=60, size=(20, 3))
    np.testing.assert_allclose(motions.displacements(at), face.deformer.jaw.movement(at, angles), atol=1e-9)
    assert not motions.displacements(at)[0].any()


def test_far_pieces_stay_when_the_brows_rise():
    avatar, moves = prepared()
    near = np.linalg.norm(avatar.vertices - avatar.points["brow_mid_L"], axis=1) < 25
    motion = np.zeros((1, *avatar.vertices.shape))
    motion[0, near, 1] = 5.0
    out = moves.move(motion)
    own = {piece.name: np.abs(out[0, piece.vertices]).max() for piece in moves.pieces if piece.kind == "carried"}
    assert own["moustache"] < 1e-12
    assert own["lashes_R"] < 1e-12
    assert own["brows"] > 2.0 or max(own.values()) > 2.0


def test_the_batch_is_the_single_shapes():
    _, moves, motion, jaw, gaze = posed("27E", "12E", "61E", "43E")
    whole = moves.move(motion, jaw, gaze)
    for k in range(len(motion)):
        one = moves.move(motion[k:k + 1], RigidMotions(jaw.rotations[k:k + 1], jaw.translations[k:k + 1]),
                         gaze[k:k + 1])
        np.testing.assert_allclose(one[0], whole[k], atol=1e-12)


def test_the_input_is_not_changed():
    _, moves, motion, jaw, gaze = posed("27E", "12E", "61E", "43E")
    before = motion.copy()
    out = moves.move(motion, jaw, gaze)
    np.testing.assert_array_equal(motion, before)
    keep = out.copy()
    keep_apart(moves, out, gaze)
    np.testing.assert_array_equal(out, keep)


# -- against the base face -----------------------------------------------------------------------------------------
def test_the_base_face_s_own_parts():
    """Eyes, teeth and tongue as the face itself moves them; brows nearly so. Its own lining stays where lips and cheeks
    draw over it; on avatars it goes with them."""
    _, moves, motion, jaw, gaze = posed("27E", "12E", "61E", "63E", "1E+2E", "4E", "9E")
    out = moves.move(motion, jaw, gaze)
    for kinds, limit in ((("eye_L", "eye_R"), 1e-3), (("teeth_upper", "teeth_lower"), 1e-9), (("tongue",), 1e-9),
                         (("carried",), 2.0), (("mouth",), 11.0)):
        rows = moves.rows(*kinds)
        assert np.linalg.norm(out[:, rows] - motion[:, rows], axis=2).max() < limit, kinds
    assert np.abs(motion[:, moves.rows("mouth")]).max() > 20


def test_a_tongue_s_own_motion_is_added():
    """As the base face moves it, on the base face; from farther behind the lips it goes farther."""
    whole = template_of(load_face(), shape_set("units"))
    row = whole.names.index(shape_of("19"))
    avatar, moves, motion, jaw, gaze = posed("19E")
    tongue = Tongue(whole.shapes.tongue.surface, whole.shapes.tongue.motion[row:row + 1], whole.shapes.tongue.face)
    out, plain = moves.move(motion, jaw, gaze, tongue=tongue), moves.move(motion, jaw, gaze)
    rows = moves.rows("tongue")
    np.testing.assert_allclose(out[:, rows], motion[:, rows], atol=1e-6)
    assert np.linalg.norm(out[:, rows] - plain[:, rows], axis=2).max() > 10.0
    others = np.setdiff1d(np.arange(len(avatar.vertices)), rows)
    np.testing.assert_array_equal(out[:, others], plain[:, others])
    own = whole.shapes.tongue.surface.vertices
    ahead = [tongue.moves(own - [0.0, 0.0, back], whole.shapes.tongue.face)[0, :, 2].max() for back in (0.0, 5.0)]
    assert ahead[1] - ahead[0] == pytest.approx(5.0, rel=0.15)
    assert tongue.comes_out()[0] > 5.0


def with_part(name, at, faces):
    base = head()
    avatar = base.plus(name, at, faces)
    mesh, _ = template()
    face = load_face()
    moves = PieceMotion(avatar.pieces(), avatar.vertices, avatar.faces, avatar.points)

    def true(unit):
        motion = np.zeros((1, *avatar.vertices.shape))
        motion[0, :len(base.vertices)] = face.pose(unit, detail=1) - mesh.vertices
        return motion

    return avatar, moves, true, np.arange(len(base.vertices), len(avatar.vertices))


def test_lashes_follow_the_lid_s_margin():
    at, faces = lashes(head().points)
    avatar, moves, true, rows = with_part("lashes", at, faces)
    out = moves.move(true("43E"))[0, rows].reshape(4, 15, 3)
    face = load_face()
    margin = face.landmark_points(face.pose("43E", detail=1), detail=1)["eye_upper_L"] - avatar.points["eye_upper_L"]
    assert margin[1] < -5
    root, tip = out[0, 7], out[3, 7]
    np.testing.assert_allclose(root, margin, atol=1.5)
    assert tip[1] < root[1] - 1.0                     # the lid turns, and the tips with it
    lengths = np.linalg.norm(np.diff(at.reshape(4, 15, 3) + out, axis=0), axis=2)
    rest = np.linalg.norm(np.diff(at.reshape(4, 15, 3), axis=0), axis=2)
    assert np.abs(lengths / rest - 1).max() < 0.35


@pytest.mark.parametrize(("thick", "stretch"), [(3.0, 0.8), (9.0, 1e-6)])
def test_a_moustache_follows_the_lip_and_does_not_tear(thick, stretch):
    at, faces = moustache(head().points, thick)
    avatar, moves, true, rows = with_part("moustache", at, faces)
    skin = moves.rows("skin")
    under = skin[cKDTree(avatar.vertices[skin]).query(at)[1]]
    for unit in ("10E", "12E", "18E", "25E"):
        motion = true(unit)
        out = moves.move(motion)[0, rows]
        below = motion[0, under]
        assert np.linalg.norm(below, axis=1).max() > 1.5, unit
        assert np.linalg.norm(out.mean(axis=0) - below.mean(axis=0)) < 0.3 * np.linalg.norm(below, axis=1).max(), unit
        sides = np.concatenate([faces[:, :2], faces[:, 1:]])
        before, after = (np.linalg.norm(p[sides[:, 0]] - p[sides[:, 1]], axis=1) for p in (at, at + out))
        assert np.abs(after / before - 1).max() < stretch, unit


def test_one_piece_of_teeth_bends_between_the_jaws():
    path = [[22 * np.sin(t), -66.9, 2 + 16 * np.cos(t)] for t in np.linspace(-1.6, 1.6, 24)]
    base = head().without("teeth_upper", "teeth_lower", "tongue", "mouth")
    avatar = base.plus("teeth", *tube(path, 8.0))
    moves = PieceMotion(avatar.pieces(), avatar.vertices, avatar.faces, avatar.points)
    jaw = RigidMotions(np.eye(3)[None], np.array([[0, -10.0, 0]]))
    rows = moves.rows("mouth")
    out = moves.move(np.zeros((1, *avatar.vertices.shape)), jaw)[0, rows]
    height = avatar.vertices[rows] @ moves.face.lip_normal
    assert np.abs(out[height > height.max() - 3]).max() == 0
    np.testing.assert_allclose(out[height < height.min() + 3] - [0, -10.0, 0], 0.0, atol=1e-12)
    assert (np.diff(out[np.argsort(height), 1]) > -1e-9).all()       # smoothly from one to the other


# -- eyes ----------------------------------------------------------------------------------------------------------
def eye_of(parts, **more):
    wants = {"outward": np.array([0, 0, 1.0]), "width": 26.0, "opening": np.array([0, 0, 13.0])}
    return fit_eye([(at, np.ones(len(at))) for at in parts], **{**wants, **more})


@pytest.mark.parametrize("part", [np.pi, 1.8, 1.0, 0.8])
def test_the_centre_of_a_ball_or_of_its_front(part):
    found = eye_of([ball([3, -2, 1], 14.0, part=part)[0], disc([3, -2, 15], 2.0)[0]])
    np.testing.assert_allclose(found.centre, [3, -2, 1], atol=1e-6)
    assert found.radius == pytest.approx(14.0)
    assert found.slide is None


def test_a_cornea_does_not_shift_the_centre():
    at, _ = ball([0, 0, 0], 12.0, rings=40, around=40)
    front = at[:, 2] > 10.8
    at[front] *= 1.0 + 0.12 * ((at[front, 2] - 10.8) / 1.2)[:, None]
    assert np.abs(eye_of([at]).centre).max() < 1e-6


@pytest.mark.parametrize("angles", [(0, 0), (30, 0), (-20, 25)])
def test_an_egg_turns_within_its_own_shape(angles):
    at, _ = ball([5, 0, 0], [14, 20, 12], rings=20, around=24)
    found = eye_of([at], width=30.0)
    np.testing.assert_allclose(found.centre, [5, 0, 0], atol=1e-6)
    moved = at + found.turned(np.array([angles[0]]), np.array([angles[1]]), at)[0]
    assert np.abs(np.linalg.norm((moved - [5, 0, 0]) / [14, 20, 12], axis=1) - 1).max() < 1e-9
    pupil = np.array([[5, 0, 12.0]])
    way = found.turned(np.array([angles[0]]), np.array([angles[1]]), pupil)[0, 0]
    assert np.sign(way[0]) == np.sign(angles[0])
    assert np.sign(way[1].round(9)) == np.sign(angles[1])


def test_a_painted_disc_slides_in_its_plane_and_stays_in_its_lids():
    small = eye_of([disc([0, 0, 10], 4.0)[0]])
    way = small.turned(np.array([20.0, -90.0, 0.0]), np.array([0.0, 0.0, 30.0]), np.zeros((2, 3)))
    assert way[0, 0, 0] > 3
    assert np.abs(way[..., 2]).max() < 1e-9
    assert np.linalg.norm(way, axis=2).max() <= 9.01          # (26 - 8) / 2
    assert way[2, 0, 1] > 3
    whole = eye_of([disc([0, 0, 10], 13.5)[0]])
    assert not whole.turned(np.array([30.0]), np.array([10.0]), np.zeros((2, 3))).any()


def test_a_nearly_flat_ball_is_a_disc():
    assert eye_of([ball([0, 0, -400], 410.0, part=0.03)[0]]).slide is not None
    assert eye_of([np.array([[0, 0, 1.0], [1, 0, 1], [0, 1, 1]])]).slide is not None


def test_an_eye_that_looks_aside_looks_up_by_its_own_axis():
    at, _ = ball([0, 0, 0], 10.0)
    found = eye_of([at], opening=np.array([9.0, 0, 1.0]), pupil=np.array([10.0, 0, 0.5]))
    pupil = np.array([[10.0, 0, 0.5]])
    up = found.turned(np.array([0.0]), np.array([20.0]), pupil)[0, 0]
    assert up[1] > 3
    straight = eye_of([at], opening=np.array([1.0, 0, 9.0]))
    assert straight.azimuth == 0.0


def test_gaze_is_the_base_face_s():
    turn = gaze_rotation(np.array([30.0, 0.0]), np.array([0.0, 30.0]))
    np.testing.assert_allclose(turn @ [0, 0, 1.0], [[0.5, 0, 0.75**0.5], [0, 0.5, 0.75**0.5]], atol=1e-12)


# -- nothing pokes through -----------------------------------------------------------------------------------------
def deep_in_ball(moves, motion, s):
    """How deep the front of the lids is in the eye's fitted ball, mm: an independent measure."""
    eye = moves.eyes[s]
    skin = moves.skin
    at = moves.vertices + motion
    middle = at[skin.faces].mean(axis=1) - eye.centre
    front = (skin.normals * (skin.corners.mean(axis=1) - eye.centre)).sum(axis=1) > 0.5 * eye.radius
    near = front & (np.linalg.norm(skin.corners.mean(axis=1) - eye.centre, axis=1) < 1.3 * eye.radius)
    return eye.radius - np.linalg.norm(middle[near], axis=1).min()


def test_a_lid_is_pushed_out_of_the_eye():
    avatar, moves, motion, jaw, gaze = posed("43E", "12E", "61E", "27E")
    pressed = moves.move(motion, jaw, gaze)
    near = np.linalg.norm(avatar.vertices - moves.eyes["L"].centre, axis=1) < 22
    own = np.isin(np.arange(len(avatar.vertices)), moves.rows("skin")) & near & (avatar.vertices[:, 2] > 5)
    pressed[0, own, 2] -= 3.0
    out, found = keep_apart(moves, pressed, gaze)
    assert found["eye_L"].before[0] > 1.5
    assert found["eye_L"].after.max() < 0.02
    assert deep_in_ball(moves, pressed[0], "L") > 1.5
    assert deep_in_ball(moves, out[0], "L") < 0.4
    moved = np.linalg.norm(out[0] - pressed[0], axis=1)
    assert moved.max() < 6.0
    assert not moved[np.linalg.norm(avatar.vertices - moves.eyes["L"].centre, axis=1) > 45].any()
    edges, _ = moves.skin.edges                                # smoothly: no dent
    assert np.abs(moved[edges[:, 0]] - moved[edges[:, 1]]).max() < 3.2


def test_teeth_give_way_and_then_the_lip():
    _, moves, motion, jaw, gaze = posed("12E", "27E", "18E", "26C")
    pushed = moves.move(motion, jaw, gaze)
    rows = moves.rows("teeth_lower")
    pushed[:, rows, 2] += 16.0
    out, found = keep_apart(moves, pushed, gaze)
    assert found["teeth_lower"].before.max() > 3.0
    assert found["teeth_lower"].after.max() < 0.02
    back = (out - pushed)[:, rows]
    np.testing.assert_allclose(back, back[:, :1].repeat(len(rows), axis=1), atol=1e-9)       # the row stays rigid
    assert np.linalg.norm(back, axis=2).max() < 2.5
    assert np.linalg.norm((out - pushed)[:, moves.rows("skin")], axis=2).max() > 0.5
    again, quiet = keep_apart(moves, out, gaze)
    assert np.abs(again - out).max() < 0.05
    assert quiet["teeth_lower"].before.max() < 0.02


def test_a_lining_does_not_come_through_the_lip():
    """A lower lip that is drawn back by eight millimetres takes its lining along, or that gives way."""
    avatar, moves = prepared()
    at = moves.vertices - avatar.points["mouth_bottom"]
    front = moves.rows("skin")
    front = front[at[front, 2] > -1.5]              # the skin that is seen, not what lies behind
    motion = np.zeros((1, *moves.vertices.shape))
    motion[0, front, 2] = -8.0 * np.exp(-(at[front] ** 2).sum(axis=1) / 15.0**2)
    out, found = keep_apart(moves, motion)
    assert found["mouth"].before[0] > 1.0
    assert found["mouth"].after[0] < 0.02
    np.testing.assert_array_equal(out[:, front], motion[:, front])           # the lining gives way, not the lip
    assert np.linalg.norm(out - motion, axis=2).max() < 12.0


def test_what_does_not_touch_is_left_alone():
    _, moves, motion, jaw, gaze = posed("12E", "27E", "43E", "18E")
    out = moves.move(motion, jaw, gaze)
    kept, found = keep_apart(moves, out, gaze)
    np.testing.assert_array_equal(kept, out)
    assert set(found) == {"eye_L", "eye_R", "teeth_upper", "teeth_lower", "tongue", "mouth"}
    assert all(not one.before.any() for one in found.values())


def test_buck_teeth_may_stand_out_as_far_as_they_do():
    avatar = head()
    rows = np.unique(avatar.faces[[name.startswith("teeth_upper") for name in avatar.names]])
    vertices = avatar.vertices.copy()
    vertices[rows, 2] += 16.0
    buck = replace(avatar, vertices=vertices)
    moves = PieceMotion(buck.pieces(), buck.vertices, buck.faces, buck.points)
    motion = np.zeros((1, *vertices.shape))
    motion[0, moves.rows("skin")] = [0, 0, -1e-3]
    out, found = keep_apart(moves, motion)
    assert found["teeth_upper"].before[0] < 0.01
    np.testing.assert_allclose(out, motion, atol=0.01)


def test_what_is_allowed():
    _, moves, motion, jaw, gaze = posed("61E", "12E")
    out = moves.move(motion, jaw, gaze)
    first = keep_apart(moves, out, gaze)[1]
    allowed = {name: one.before for name, one in first.items()}
    assert allowed["eye_L"][0] > 0.05                    # the base face's cornea is a little under its lid
    kept, found = keep_apart(moves, out, gaze, allowed=allowed)
    np.testing.assert_allclose(kept, out, atol=1e-9)
    assert found["eye_L"].before.max() < 1e-9


# -- wrong input ---------------------------------------------------------------------------------------------------
def test_wrong_shapes():
    avatar, moves = prepared()
    n = len(avatar.vertices)
    rest = np.zeros((2, n, 3))
    with pytest.raises(InputError, match=rf"skin_motion: expected shape \(k, {n}, 3\), got \(4, 3\)"):
        moves.move(np.zeros((4, 3)))
    with pytest.raises(InputError, match="jaw: expected 2 motions"):
        moves.move(rest, identity(3))
    with pytest.raises(InputError, match=r"gaze: expected shape \(2, 4\), got \(2, 2\)"):
        moves.move(rest, gaze=np.zeros((2, 2)))
    one = Tongue(moves.skin, np.zeros((1, n, 3)), moves.face)
    with pytest.raises(InputError, match="tongue: expected 2 motions, got 1"):
        moves.move(rest, tongue=one)
    with pytest.raises(InputError, match="motion: expected shape"):
        keep_apart(moves, rest[:, :5])
    with pytest.raises(InputError, match="gaze: expected shape"):
        keep_apart(moves, rest, np.zeros(4))
    with pytest.raises(InputError, match="expected a piece of the kind 'skin'"):
        PieceMotion(avatar.pieces()[1:], avatar.vertices, avatar.faces, avatar.points)


def test_an_avatar_of_skin_alone():
    avatar = head().without("eye_L", "eye_R", "teeth_upper", "teeth_lower", "tongue", "mouth", "brows", "hair")
    moves = PieceMotion(avatar.pieces(), avatar.vertices, avatar.faces, avatar.points)
    motion = np.broadcast_to(np.array([[[0.5, -3.0, 1.0]], [[0, 8, 0]]]), (2, *avatar.vertices.shape))
    out, found = keep_apart(moves, moves.move(motion, identity(2), np.ones((2, 4))), np.ones((2, 4)))
    assert not found["mouth"].before.any()
    np.testing.assert_array_equal(out[:, moves.rows("skin")], motion[:, moves.rows("skin")])

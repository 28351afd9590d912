"""An avatar with blendshapes as a face: made of the base face itself, it must do what the base face does."""

from __future__ import annotations

import os
from dataclasses import replace

import numpy as np
import pytest

from facegen.animation.script import morph
from facegen.blendshapes.names import member_of, shape_of
from facegen.blendshapes.recipes import shape_set
from facegen.errors import InputError, TableError
from facegen.face.avatar import AvatarFace
from facegen.face.face import Face, load_face
from facegen.facs.deformation import Deformation
from facegen.facs.expression_table import load_expressions
from facegen.facs.expressions import resolve
from facegen.facs.tables import load_units

DETAIL = 1
TURN = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])


@pytest.fixture(scope="module")
def units(rig_of):
    return AvatarFace(rig_of("units"))


@pytest.fixture(scope="module")
def arkit(rig_of):
    return AvatarFace(rig_of("arkit"))


def error(face, avatar, what, **how):
    """Largest distance to the base face's own pose, as a share of the largest movement."""
    own, base = avatar.pose(what, **how), face.pose(what, detail=DETAIL, **how)
    moved = np.linalg.norm(base - face.mesh(DETAIL).vertices, axis=1).max()
    return np.linalg.norm(own - base, axis=1).max() / moved


def test_the_neutral_bit_for_bit(face, units, arkit):
    for rig in (units, arkit):
        assert rig.pose("neutral").tobytes() == rig.mesh().vertices.tobytes()
        assert rig.pose("0").tobytes() == rig.pose().tobytes() == rig.pose_shapes({}).tobytes()
        np.testing.assert_allclose(rig.mesh().vertices, face.mesh(DETAIL).vertices, atol=1e-9)
        assert rig.mesh(3) is rig.mesh(0)


def test_the_neutral_is_not_the_callers_to_change(units):
    units.pose("neutral")[:] = 0
    assert units.pose("neutral").any()


@pytest.mark.parametrize("script", ["6C+12D", "L12E", "4E+17C", "9D+10D", "18E+22B", "1+2+5"])
def test_units_follow_the_tables_rules_exactly(face, units, script):
    """The sum of unit shapes with the unit table's coefficients, to rounding."""
    made = units.mesh().vertices.copy()
    basis = {member: face.pose(one, detail=DETAIL) - face.mesh(DETAIL).vertices
             for member, one in load_units().basis.items()}
    for member, value in load_units().coefficients(resolve(script).units).items():
        made += value * basis[member]
    np.testing.assert_allclose(units.pose(script), made, atol=1e-9)
    assert error(face, units, script) < 0.05


@pytest.mark.parametrize("name", list(load_expressions().expressions))
def test_every_expression(face, units, name):
    if name != "neutral":
        assert error(face, units, name) < 0.25, name
        assert units.check(units.resolve(name)) == ()


@pytest.mark.parametrize("code", ["51", "54", "55", "57", "58"])
def test_the_head_turns_as_the_base_faces(face, units, code):
    np.testing.assert_allclose(units.pose({code: 0.7}), face.pose({code: 0.7}, detail=DETAIL), atol=1e-6)


def test_another_frame_is_turned_back(face, rig_of):
    """Facing +x, in units of five centimetres, somewhere else: the same millimetres come out."""
    rig = AvatarFace(rig_of("units", scale=0.02, rotation=TURN, offset=(3.0, 1.0, -2.0)))
    np.testing.assert_allclose(rig.mesh().vertices, face.mesh(DETAIL).vertices, atol=1e-8)
    np.testing.assert_allclose(rig.pose("6C+12D+51B"), AvatarFace(rig_of("units")).pose("6C+12D+51B"), atol=1e-8)
    there = rig.landmark_points(rig.pose("27E"))
    here = face.landmark_points(face.pose("27E", detail=DETAIL), detail=DETAIL)
    assert set(there) == set(here)
    for name, place in here.items():
        np.testing.assert_allclose(there[name], place, atol=1e-6, err_msg=name)


def test_without_notes_the_axes_are_gltfs(face, rig_of):
    rig = AvatarFace(rig_of("units", notes=False))
    np.testing.assert_allclose(rig.mesh().vertices, face.mesh(DETAIL).vertices, atol=1e-9)
    assert rig.landmarks == ()
    assert rig.landmark_points(rig.mesh().vertices) == {}
    np.testing.assert_array_equal(rig.pose("12C+51D"), rig.pose("12C"))
    assert "does not say where its neck is" in rig.check(rig.resolve("12C+51D"))[0]


def test_avatars_of_vrm_0_look_backward(face, rig_of):
    from types import SimpleNamespace

    one = rig_of("arkit", notes=False, rotation=np.diag([-1.0, 1.0, -1.0]))
    source = SimpleNamespace(file=SimpleNamespace(json={"extensions": {"VRM": {}}}))
    np.testing.assert_allclose(AvatarFace(replace(one, source=source)).mesh().vertices, face.mesh(DETAIL).vertices,
                               atol=1e-9)
    source = SimpleNamespace(file=SimpleNamespace(json={"extensions": {"VRMC_vrm": {}}}))
    ahead = rig_of("arkit", notes=False)
    np.testing.assert_allclose(AvatarFace(replace(ahead, source=source)).mesh().vertices, face.mesh(DETAIL).vertices,
                               atol=1e-9)


@pytest.mark.parametrize(("sets", "what", "most"), [
    (("arkit",), "6C+12D", 0.02), (("arkit",), "R12D", 0.02), (("arkit",), "L45E+61D", 0.05),
    (("arkit",), "happiness", 0.2), (("arkit",), "surprise", 0.2), (("arkit",), "27E", 1e-6),
    (("expressions",), "happiness", 1e-6), (("expressions",), "surprise", 1e-6), (("expressions",), "6C+12D", 1e-6),
    (("vrm", "visemes"), "6C+12D", 1e-6), (("vrm", "visemes"), "45E", 1e-6), (("vrm", "visemes"), "27D", 0.35),
])
def test_other_vocabularies(face, rig_of, sets, what, most):
    assert error(face, AvatarFace(rig_of(*sets)), what) <= most


def test_what_is_taken(rig_of):
    def weights(*sets, what="happiness"):
        rig = AvatarFace(rig_of(*sets))
        return set(rig.shape_weights(rig.resolve(what)))

    assert weights("units", "arkit", "expressions") == {f"AU{n}_{s}" for n in (6, 12, 25) for s in "LR"}
    assert weights("expressions", "arkit") == {"happiness"}
    assert weights("vrm", "arkit", what="6C+12D") == {"mouthSmileLeft", "mouthSmileRight", "cheekSquintLeft",
                                                      "cheekSquintRight"}
    assert weights("expressions", what="45E") == {"blink"}


def test_other_peoples_spelling(rig_of):
    def theirs(shape):
        return "A99_" + shape.replace("Left", "_L").replace("Right", "_R")

    rig = AvatarFace(rig_of("arkit", notes=False, rename=theirs))
    assert rig.shape_weights(rig.resolve("L45E")) == {"A99_eyeBlink_L": 1.0}


def test_names_that_say_nothing(rig_of):
    rig = AvatarFace(rig_of("arkit", notes=False, rename=lambda shape: f"key {shape[::-1]}"))
    assert rig.pose("neutral").any()
    with pytest.raises(InputError, match=r"none of the 52 blendshapes of rig\.glb has a name that is understood"):
        rig.pose("happiness")
    assert rig.pose_shapes({rig.shapes[0]: 0.5}).any()


def test_shapes_by_their_own_names(face, arkit):
    moved = arkit.pose_shapes({"jawOpen": 1.0}) - arkit.mesh().vertices
    np.testing.assert_allclose(arkit.pose_shapes({"jawOpen": -0.5}) - arkit.mesh().vertices, -0.5 * moved, atol=1e-12)
    with pytest.raises(InputError, match=r"rig\.glb has no shape 'jawOpn'; did you mean 'jawOpen'"):
        arkit.pose_shapes({"jawOpn": 1.0})
    with pytest.raises(InputError, match="jawOpen: expected a finite number, got nan"):
        arkit.pose_shapes({"jawOpen": float("nan")})


def test_an_eye_closes_once(units):
    """Units that close an eye twice stop where the lids meet; the base face's lids do, blendshapes would not."""
    weights = units.shape_weights(units.resolve("43E+7E+6E"))
    lids = {name: sum(one.lids.get(f"{lid}_L", 0.0) for lid in ("upper", "lower"))
            for name, one in load_units().basis.items()}
    assert sum(value * lids[member_of(name)] for name, value in weights.items()) == pytest.approx(1.0)
    assert weights["AU6_L"] == 1.0
    assert units.shape_weights(units.resolve("43E"))["AU43_L"] == 1.0


def test_raw_data(face, units, arkit):
    smile = {"points": {name: list(vector) for name, vector in load_units().basis["L12"].points.items()},
             "folds": dict(load_units().basis["L12"].folds)}
    assert units.shape_weights(units.resolve(smile)) == {"AU12_L": pytest.approx(1.0, abs=1e-6)}
    assert arkit.shape_weights(arkit.resolve(smile)) == {"mouthSmileLeft": pytest.approx(1.0, abs=1e-6)}
    assert arkit.check(arkit.resolve(smile)) == ()
    odd = {"points": {"nose_tip": [0.0, 0.3, 0.0]}}
    warning, = arkit.check(arkit.resolve(odd))
    assert "rig.glb has no shapes for" in warning
    assert "% of this movement" in warning
    assert error(face, units, {"head": {"yaw": 12}}) < 1e-9
    assert "no shapes for" in units.check(units.resolve("akimoto-1986-figure-8"))[0]


def test_raw_lengths_of_other_units(units):
    mouth = 44.8 * 0.1
    one = units.pose({"units": "face", "head": {"forward": 0.1}})
    np.testing.assert_allclose(one, units.pose({"units": "millimetre", "head": {"forward": mouth}}), atol=0.05)


def test_people(face, units):
    for person in ("bruno", "mika"):
        assert error(face, units, "happiness", person=person) < 0.1
    assert not np.array_equal(units.pose("happiness", person="bruno"), units.pose("happiness"))
    assert error(face, units, "anger", intensity=0.4) < 0.1


def test_clips(face, units, arkit):
    """Weights mix, and raw data beside units are shown too."""
    clip = morph("happiness", "anger", seconds=1.0, hold=0.0)
    for t in (0.0, 0.3, 1.0):
        base = face.pose(clip.at(t), detail=DETAIL)
        moved = np.abs(base - face.mesh(DETAIL).vertices).max()
        assert np.abs(units.pose(clip.at(t)) - base).max() < 0.1 * moved
        assert np.abs(arkit.pose(clip.at(t)) - base).max() < 0.5 * moved
    np.testing.assert_allclose(units.pose(clip.at(0.0)), units.pose("happiness"), atol=1e-12)
    mixed = morph("6C+12D", {"jaw": {"open": 12}}, seconds=1.0, hold=0.0)
    half = units.shape_weights(mixed.at(0.5))
    assert half["AU12_L"] == pytest.approx(0.4)
    assert any(shape_of(jaw) in half for jaw in ("26", "27"))


def test_a_body_is_not_in_the_portrait(rig_of):
    one = rig_of("units")
    assert AvatarFace(one).focus is None
    mesh = one.mesh
    far = mesh.vertices.copy()
    hair = mesh.part_vertices("hair")
    far[hair] -= [0.0, 1.5, 0.0]            # a body: metres below
    tall = AvatarFace(replace(one, mesh=mesh.with_vertices(far)))
    assert tall.focus is not None
    assert not set(tall.focus) & set(hair)
    assert set(mesh.part_vertices("skin")) <= set(tall.focus)
    named = AvatarFace(replace(one, notes={**one.notes, "pieces": {"hair": "body"}}))
    turned = named.pose("51E")
    assert np.array_equal(turned[hair], named.mesh().vertices[hair])


def test_an_avatar_without_shapes(rig_of):
    with pytest.raises(InputError, match=r"has no blendshapes .* facegen rig rig.glb --landmarks rig.yaml"):
        AvatarFace(replace(rig_of("units"), shapes={}))


@pytest.mark.parametrize(("notes", "message"), [
    ({"frame": {"scale": 0, "rotation": np.eye(3).tolist(), "offset": [0, 0, 0]}}, "facegen.frame.scale"),
    ({"frame": {"scale": 1, "rotation": [[1, 0, 0], [0, 1, 0]], "offset": [0, 0, 0]}}, "three rows"),
    ({"frame": {"scale": 1, "rotation": (2 * np.eye(3)).tolist(), "offset": [0, 0, 0]}}, "facegen.frame.rotation"),
    ({"frame": {"scale": 1, "rotation": np.diag([1, 1, -1]).tolist(), "offset": [0, 0, 0]}}, "do not mirror"),
    ({"frame": {"scale": 1}}, "the key 'rotation' is missing"),
    ({"landmarks": {"chin": [0, 0]}}, "facegen.landmarks.chin"),
    ({"neck": "here"}, "facegen.neck"),
    ({"shapes": [1]}, "facegen.shapes"),
])
def test_notes_that_lie(rig_of, notes, message):
    with pytest.raises(TableError, match=message):
        AvatarFace(replace(rig_of("units"), notes=notes))


def test_notes_of_a_later_version(rig_of):
    one = rig_of("units")
    rig = AvatarFace(replace(one, notes={**one.notes, "version": 2, "new": [1], "landmarks": {"third_eye": [0, 0, 0]}}))
    assert rig.landmarks == ()


def test_wrong_vertices(units):
    with pytest.raises(InputError, match="vertices: expected shape"):
        units.landmark_points(np.zeros((3, 3)))


# -- files ------------------------------------------------------------------------------------------------------

def test_load_face_takes_a_file(face, rig_file):
    path = rig_file("units")
    rig = load_face(path)
    assert isinstance(rig, AvatarFace)
    assert rig.name == "units"
    assert rig is load_face(str(path))
    assert set(rig.shapes) == set(shape_set("units"))
    assert error(face, rig, "happiness") < 0.02
    assert rig.pose("neutral").tobytes() == rig.mesh().vertices.tobytes()
    assert isinstance(load_face(), Face)


def test_a_file_that_changed_is_read_again(rig_file, tmp_path):
    path = tmp_path / "one.glb"
    path.write_bytes(rig_file("arkit").read_bytes())
    before = load_face(path)
    path.write_bytes(rig_file("units").read_bytes())
    os.utime(path, ns=(1, 1))
    assert load_face(path).digest != before.digest


@pytest.mark.parametrize("suffix", [".obj", ".ply", ".stl"])
def test_files_that_cannot_have_shapes(tmp_path, suffix):
    path = tmp_path / f"cat{suffix}"
    path.write_text("v 0 0 0\n")
    with pytest.raises(InputError, match=rf"rig it first: facegen rig cat{suffix} --landmarks cat.yaml -o cat.glb"):
        load_face(path)


def test_other_wrong_faces(tmp_path):
    with pytest.raises(InputError, match=r"or of a rigged avatar \(.glb\)"):
        load_face(tmp_path / "none.glb")
    (tmp_path / "broken.glb").write_bytes(b"glTF")
    with pytest.raises(InputError, match=r"broken\.glb"):
        load_face(tmp_path / "broken.glb")


def test_threads_may_pose_one_avatar(rig_of, monkeypatch):
    """Pages of the studio share a face: what one thread throws from the memory of fits, another may be reading."""
    from concurrent.futures import ThreadPoolExecutor


    class Forgetful(dict):
        def __setitem__(self, key, value):
            super().__setitem__(key, value)
            self.clear()                    # as if another thread had, at once

    shared = AvatarFace(rig_of("units"))
    poses = [f"AU12={k / 40!r}" for k in range(1, 9)]
    expected = [shared.pose(one) for one in poses]
    monkeypatch.setattr("facegen.face.avatar._KEPT", 1)
    shared._fitted = Forgetful()
    with ThreadPoolExecutor(4) as pool:
        for got, right in zip(pool.map(shared.pose, poses), expected, strict=True):
            assert np.array_equal(got, right)


@pytest.mark.parametrize("length", ["millimetre", "face"])
def test_a_head_that_is_turned_by_hand_turns_and_moves_no_shape(units, length):
    """Movements beside the units come as ``more``, as the studio's do."""
    forward = 4.0 if length == "millimetre" else 0.1
    by_hand = Deformation(head={"yaw": 15.0, "roll": 5.0, "forward": forward}, jaw={"open": 6.0}, units=length)
    found = replace(resolve("12D+55C"), more=(by_hand,))
    head = units.head_angles(found)
    assert head == pytest.approx(load_face().head_angles(found))
    assert head[:3] == pytest.approx([15.0, 0.0, 5.0 + resolve("55C").deformation.head["roll"]])
    still = replace(found, deformation=replace(found.deformation, head={}), more=(replace(by_hand, head={}),))
    assert units.shape_weights(found) == units.shape_weights(still)
    assert units.pose(found) == pytest.approx(units.turned(units.pose(still), head), abs=1e-9)
    away = np.linalg.norm(units.pose(found) - load_face().pose(found, detail=DETAIL), axis=1)
    assert np.median(away) < 0.5

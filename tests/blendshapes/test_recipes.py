"""The sets of shapes, and the file of vocabularies."""

from __future__ import annotations

import pickle
from pathlib import Path

import pytest

from facegen.blendshapes.recipes import CLASH, SETS, half, is_head, read_vocabularies, shape_set
from facegen.data import tables_dir
from facegen.errors import InputError, TableError
from facegen.facs.deformation import Deformation
from facegen.facs.expression_table import load_expressions
from facegen.facs.tables import load_units

# Apple, ARFaceAnchor.BlendShapeLocation, in the order of its documentation.
APPLE = [
    "eyeBlinkLeft", "eyeLookDownLeft", "eyeLookInLeft", "eyeLookOutLeft", "eyeLookUpLeft", "eyeSquintLeft",
    "eyeWideLeft", "eyeBlinkRight", "eyeLookDownRight", "eyeLookInRight", "eyeLookOutRight", "eyeLookUpRight",
    "eyeSquintRight", "eyeWideRight", "jawForward", "jawLeft", "jawRight", "jawOpen", "mouthClose", "mouthFunnel",
    "mouthPucker", "mouthLeft", "mouthRight", "mouthSmileLeft", "mouthSmileRight", "mouthFrownLeft",
    "mouthFrownRight", "mouthDimpleLeft", "mouthDimpleRight", "mouthStretchLeft", "mouthStretchRight",
    "mouthRollLower", "mouthRollUpper", "mouthShrugLower", "mouthShrugUpper", "mouthPressLeft", "mouthPressRight",
    "mouthLowerDownLeft", "mouthLowerDownRight", "mouthUpperUpLeft", "mouthUpperUpRight", "browDownLeft",
    "browDownRight", "browInnerUp", "browOuterUpLeft", "browOuterUpRight", "cheekPuff", "cheekSquintLeft",
    "cheekSquintRight", "noseSneerLeft", "noseSneerRight", "tongueOut",
]
OCULUS = ["sil", "PP", "FF", "TH", "DD", "kk", "CH", "SS", "nn", "RR", "aa", "E", "I", "O", "U"]
VRM = [
    "happy", "angry", "sad", "relaxed", "surprised", "neutral", "aa", "ih", "ou", "ee", "oh", "blink", "blinkLeft",
    "blinkRight", "lookUp", "lookDown", "lookLeft", "lookRight",
]


def test_names_and_order():
    assert list(shape_set("arkit")) == APPLE
    assert len(APPLE) == 52
    assert list(shape_set("visemes")) == [f"viseme_{name}" for name in OCULUS]
    assert list(shape_set("vrm")) == VRM
    assert list(shape_set("expressions")) == list(load_expressions().expressions)


def test_units_are_the_basis_without_the_head():
    basis = {member: one for member, one in load_units().basis.items() if not is_head(member)}
    units = shape_set("units")
    assert [dict(one.members) for one in units.values()] == [{member: 1.0} for member in basis]
    assert [one.deformation for one in units.values()] == [(one,) for one in basis.values()]
    assert len(units) == len(load_units().basis) - 8


def test_all_has_every_shape_once():
    whole = shape_set("all")
    assert len(whole) == sum(len(shape_set(name)) for name in SETS)
    assert {name for name in whole if name.startswith(CLASH)} == {f"{CLASH}blink", f"{CLASH}neutral"}
    assert whole["blink"].set == "vrm"


@pytest.mark.parametrize("name", SETS)
def test_recipes_are_whole(name):
    for shape, one in shape_set(name).items():
        assert one.set == name
        assert one.about, shape
        assert one.source, shape
        assert all(not d.head for d in one.deformation), shape
        for member in one.members:
            assert member in load_units().basis
    assert pickle.loads(pickle.dumps(shape_set(name))) == shape_set(name)


def test_what_moves():
    still = {"viseme_sil", "neutral", CLASH + "neutral"}
    heads = {"look_up"}
    for shape, one in shape_set("all").items():
        if shape not in heads:
            assert any(one.deformation) == (shape not in still), shape


@pytest.mark.parametrize("left", [name for name in APPLE if name.endswith("Left")])
def test_pairs_mirror_exactly(left):
    arkit = shape_set("arkit")
    right = arkit[left.removesuffix("Left") + "Right"]
    assert right.deformation == tuple(one.mirrored() for one in arkit[left].deformation)
    assert {m.translate(str.maketrans("LR", "RL")): v for m, v in arkit[left].members.items()} == right.members
    assert "left" not in right.about


@pytest.mark.parametrize("shape", ["jawOpen", "jawForward", "mouthFunnel", "mouthPucker", "mouthRollLower",
                                   "mouthClose", "mouthShrugUpper", "mouthShrugLower", "browInnerUp", "cheekPuff",
                                   "tongueOut"])
def test_shapes_of_the_middle_are_symmetric(shape):
    for one in shape_set("arkit")[shape].deformation:
        assert one.mirrored() == one


def test_one_eye_looks_alone():
    for name, unit in (("In", "62"), ("Out", "61"), ("Up", "63"), ("Down", "64")):
        one = shape_set("arkit")[f"eyeLook{name}Left"].deformation[0]
        assert all(key.endswith("_L") for key in (*one.eyes, *one.points)), name
        assert {key: value for key, value in load_units().basis[unit].eyes.items() if key.endswith("_L")} == one.eyes


def test_halves_make_the_whole():
    for unit in ("24", "61", "64", "17"):
        whole = load_units().basis[unit]
        both = half(whole, "L") + half(whole, "R")
        assert set(both.points) == set(whole.points)
        for name, vector in whole.points.items():
            assert both.points[name] == pytest.approx(vector, abs=1e-15)
        assert both.eyes == whole.eyes
        assert both.folds == whole.folds


def test_mouth_close_corrects_jaw_open():
    arkit = shape_set("arkit")
    assert [name for name, one in arkit.items() if one.minus] == ["mouthClose"]
    close = arkit["mouthClose"]
    assert close.minus == "jawOpen"
    assert close.deformation[0].jaw == arkit["jawOpen"].deformation[0].jaw


def test_a_persons_expressions():
    mine, common = shape_set("expressions", "bruno"), shape_set("expressions")
    assert set(mine) >= set(common)
    assert any(mine[name].members != common[name].members for name in common)
    assert shape_set("all", "bruno")["happiness"].members == mine["happiness"].members
    assert shape_set("arkit", "bruno") == shape_set("arkit")


def test_what_there_is_not():
    with pytest.raises(InputError, match="got 'arkitt'; did you mean 'arkit'"):
        shape_set("arkitt")
    with pytest.raises(InputError, match="unknown person"):
        shape_set("expressions", "nobody at all")


def test_the_caller_may_change_what_it_got():
    shape_set("arkit").clear()
    assert len(shape_set("arkit")) == 52


def table(path: Path, entries: str) -> Path:
    text = ["sources: {s: somebody}", "sets:"]
    for name in ("arkit", "visemes", "vrm"):
        text += [f"  {name}:", "    about: a set", "    source: [s]", "    shapes:"]
        text += [f"      {line}" for line in (entries if name == "arkit" else "x: {units: 12, about: y}").splitlines()]
    path.write_text("\n".join(text))
    return path


@pytest.mark.parametrize(("entry", "message"), [
    ("a: {units: 12}", "the key 'about' is missing"),
    ("a: {units: 12Q, about: b}", "shapes.a.units"),
    ("a: {units: 12, abuot: b}", "unknown key 'abuot'; did you mean 'about'"),
    ("a: {units: 53, about: b}", "no shapes"),
    ("a: {units: 27, jaw: 0.2, about: b}", "the jaw is given twice"),
    ("a: {jaw: 2, about: b}", "0..1"),
    ("a: {units: 12, half: X, about: b}", "unknown half 'X'"),
    ("a: {mirror_of: b}", "unknown shape 'b'"),
    ("a: {mirror_of: a}", "written out"),
    ("a: {mirror_of: b, about: c}\nb: {units: L12, about: c}", "nothing of its own"),
    ("a: {mirror_of: b}\nb: {mirror_of: c}\nc: {units: L12, about: c}", "written out"),
    ("a: {corrects: b, units: 24, about: b}\nb: {corrects: c, units: 26, about: b}\nc: {units: 27, about: b}",
     "written out"),
    ("a: {add: {points: {lip: [0, 0]}}, about: b}", "three numbers"),
    ("a: {both: {points: {lip_R: [0, 0, 1]}}, about: b}", "write the left"),
    ("a: {units: 12, add: {units: millimetre, points: {lip: [0, 0, 1]}}, about: b}", "cannot be added"),
])
def test_errors_of_a_table(tmp_path, entry, message):
    with pytest.raises(TableError, match=message):
        read_vocabularies(table(tmp_path / "v.yaml", entry))


def test_a_table_of_ones_own(tmp_path):
    made = read_vocabularies(table(tmp_path / "v.yaml", "a: {units: 61, about: to the left}\nb: {mirror_of: a}"))
    assert made["arkit"]["a"].members == {"61": 0.8}
    b = made["arkit"]["b"]
    assert b.members == {}                  # the mirror image of 61 is 62, not 61: raw data say it
    assert b.deformation == (load_units().basis["61"].mirrored() * 0.8,)
    assert b.about == "to the right"


def test_the_shipped_table_says_where_it_is_from():
    text = (tables_dir() / "vocabularies.yaml").read_text(encoding="utf-8")
    for word in ("developer.apple.com", "OVRLipSync", "vrm-specification"):
        assert word in text
    assert isinstance(shape_set("visemes")["viseme_aa"].deformation[0], Deformation)

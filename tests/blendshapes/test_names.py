"""Names of shapes: our own there and back, and other people's spellings."""

from __future__ import annotations

import pytest

from facegen.blendshapes.names import folded, match, member_of, shape_of
from facegen.blendshapes.recipes import shape_set
from facegen.facs.tables import load_units


def test_every_member_there_and_back():
    members = [*load_units().basis, "1+4:L", "6+12", "1+4-2:R", "T22"]
    names = [shape_of(member) for member in members]
    assert len(set(names)) == len(set(members))
    assert [member_of(name) for name in names] == members


def test_the_names_of_the_contract():
    assert [shape_of(m) for m in ("L12", "R12", "17", "T22", "B22", "1+4:L", "6+12")] == \
        ["AU12_L", "AU12_R", "AU17", "AU22_T", "AU22_B", "AU1+4_L", "AU6+12"]
    assert member_of("AU01_L") == "L1"
    assert [member_of(name) for name in ("AU", "AU12L", "12", "jawOpen", "AU12_X")] == [None] * 5


@pytest.mark.parametrize("spelt", ["eyeBlinkLeft", "eyeBlink_L", "EyeBlinkLeft", "A14_Eye_Blink_Left", "eyeblink_left",
                                   "Head.eyeBlinkLeft", "blendShape1:eyeBlink_L", "EYE_BLINK_LEFT"])
def test_spellings_of_one_shape(spelt):
    arkit = shape_set("arkit")
    assert match([spelt], {name: one.also for name, one in arkit.items()}) == {spelt: "eyeBlinkLeft"}


def test_sides_are_not_confused():
    assert folded("jawLeft") != folded("jawRight")
    assert folded("jaw_open") == folded("jawOpen") == "jawopen"
    assert folded("mouthFunnel") == "mouthfunnel"       # the l at the end is no side


def test_no_two_shapes_of_a_set_are_spelt_alike():
    for name in ("arkit", "visemes", "vrm", "units", "expressions"):
        words = [folded(word) for shape, one in shape_set(name).items() for word in {shape, *one.also}]
        assert len(words) == len(set(words)), name


def test_exact_names_first_and_each_shape_once():
    known = {"jawOpen": ("mouthOpen",), "happy": ("joy",)}
    assert match(["JawOpen", "jawOpen", "mouth_open", "Joy", "other"], known) == {"jawOpen": "jawOpen", "Joy": "happy"}

"""Weights of one vocabulary as weights of another."""

from __future__ import annotations

import pytest

from facegen.blendshapes.recipes import SETS, is_head, shape_set
from facegen.errors import InputError
from facegen.face.convert import convert
from facegen.facs.tables import load_units

# Units that ARKit has a shape of its own for.
ONE_TO_ONE = ["1", "L2", "R2", "L4", "L5", "R6", "L7", "R9", "L10", "R12", "L14", "L15", "R16", "17", "18", "19", "L20",
              "22", "24", "27", "T28", "B28", "29", "L30", "R30", "34", "L45", "R45", "61", "62", "63", "64"]


@pytest.mark.parametrize("code", ONE_TO_ONE)
@pytest.mark.parametrize("weight", [1.0, 0.37])
def test_there_and_back(code, weight):
    there = convert({code: weight}, "units", "arkit")
    assert there.residual < 0.02
    back = convert(there.weights, "arkit", "units")
    assert back.residual < 0.02
    assert back.weights == {code: pytest.approx(weight, abs=0.02)}


@pytest.mark.parametrize("name", [name for name, one in shape_set("arkit").items() if one.members])
def test_shapes_that_are_units_are_exact(name):
    there = convert({name: 0.6}, "arkit", "units")
    assert there.residual == pytest.approx(0, abs=1e-12)
    assert convert(there.weights, "units", "arkit").weights == {name: pytest.approx(0.6, abs=1e-9)}


def test_combinations_are_undone():
    """6 with 12 counts less: the weights that come back are those before."""
    there = convert({"6": 0.5, "12": 0.8}, "units", "arkit")
    assert there.weights["cheekSquintLeft"] == pytest.approx(0.5 * (1 - 0.5 * 0.2))
    back = convert(there.weights, "arkit", "units")
    assert back.weights == {"6": pytest.approx(0.5), "12": pytest.approx(0.8)}
    assert back.residual < 1e-9


def test_vrm_presets_are_units():
    assert convert({"happy": 1.0}, "vrm", "units").weights == {"6": pytest.approx(0.5), "12": pytest.approx(0.8)}
    assert convert({"blinkLeft": 0.4}, "vrm", "arkit").weights == {"eyeBlinkLeft": 0.4}
    both = convert({"45": 1.0, "61": 0.5}, "units", "vrm")
    assert both.weights == {"blink": 1.0, "lookLeft": 0.5}
    assert both.residual == 0.0


def test_expressions():
    assert convert({"6": 0.8, "12": 1.0, "25": 0.8}, "units", "expressions").weights == {
        "happiness": pytest.approx(1.0)}
    arkit = convert({"happiness": 1.0}, "expressions", "arkit")
    assert arkit.weights["mouthSmileLeft"] == 1.0
    assert arkit.residual < 0.2
    assert convert({"happiness": 1.0}, "expressions", "arkit", person="bruno") != arkit


@pytest.mark.parametrize("source", SETS)
@pytest.mark.parametrize("target", SETS)
def test_every_way(source, target):
    """All pairs of sets, all shapes that move together: weights in range, in order, and the same again."""
    names = list(shape_set(source))[3:40:9]
    weights = {load_units().catalogue.atoms[3]: 0.5, "26": 0.4} if source == "units" else dict.fromkeys(names, 0.5)
    found = convert(weights, source, target)
    assert 0.0 <= found.residual <= 1.0
    assert all(0.0 < weight <= 1.0 for weight in found.weights.values())
    if target != "units":
        assert list(found.weights) == [name for name in shape_set(target) if name in found.weights]
    assert convert(weights, source, target) == found
    if source == target != "units" and source != "expressions":
        assert found.residual < 0.2


def test_visemes_into_presets():
    found = convert({"viseme_O": 1.0}, "visemes", "vrm")
    assert max(found.weights, key=found.weights.get) == "oh"
    assert found.residual < 0.1


def test_mouth_close_goes_with_the_jaw_only():
    assert convert({"mouthClose": 1.0}, "arkit", "units").weights == {}
    closed = convert({"jawOpen": 0.6, "mouthClose": 0.6}, "arkit", "visemes")
    half = convert({"jawOpen": 0.6, "mouthClose": 1.0}, "arkit", "visemes")
    assert half == closed
    for code in ("24", "B28", "17", "23"):
        found = convert({code: 1.0, "26": 1.0}, "units", "arkit").weights
        assert found.get("mouthClose", 0.0) <= found.get("jawOpen", 0.0)
    same = convert({"jawOpen": 0.6, "mouthClose": 0.6}, "arkit", "arkit")
    assert same.weights == {"jawOpen": pytest.approx(0.6, abs=0.01), "mouthClose": pytest.approx(0.6, abs=0.01)}


def test_what_has_no_counterpart_says_so():
    assert convert({"mouthLeft": 1.0}, "arkit", "units").residual > 0.3
    assert convert({"11": 1.0}, "units", "arkit").residual > 0.3
    left = convert({"mouthLeft": 1.0}, "arkit", "arkit")
    assert left.weights == {"mouthLeft": 1.0}
    assert left.residual == 0.0


def test_few_shapes():
    """Left and right are not pulled at once, and a smile needs no shape of the brow."""
    for code in ("12", "23", "25", "16"):
        found = convert({code: 0.8}, "units", "arkit").weights
        assert not {"mouthLeft", "mouthRight"} & set(found), code
        assert not any(name.startswith(("brow", "eye")) for name in found), code


def test_the_head_is_left_out():
    found = convert({"12": 1.0, "51": 0.5}, "units", "arkit")
    assert found.left_out == ("51",)
    assert set(found.weights) == {"mouthSmileLeft", "mouthSmileRight"}
    assert is_head("51")
    kept = convert({"12": 1.0, "51": 0.5}, "units", "units")
    assert kept.weights == {"12": 1.0, "51": 0.5}
    assert kept.left_out == ()


def test_other_spellings():
    plain = convert({"eyeBlinkLeft": 1.0}, "arkit", "units")
    assert convert({"EyeBlink_L": 1.0}, "arkit", "units") == plain
    assert convert({"AU12_L": 0.5}, "units", "arkit").weights == {"mouthSmileLeft": 0.5}


@pytest.mark.parametrize(("arguments", "message"), [
    (({"a": 1}, "arkti", "units"), "source: expected units.*did you mean 'arkit'"),
    (({"a": 1}, "arkit", "all"), "target: expected units"),
    (({"jawOpn": 1.0}, "arkit", "units"), "'jawOpn' is no shape of arkit; did you mean 'jawOpen'"),
    (({"jawOpen": 1.5}, "arkit", "units"), "jawOpen: expected a number in 0..1, got 1.5"),
    (({"jawOpen": float("nan")}, "arkit", "units"), "expected a number"),
    (({"jawOpen": True}, "arkit", "units"), "expected a number"),
    ((["jawOpen"], "arkit", "units"), "expected a mapping"),
    (({"12": 2.0}, "units", "arkit"), "expected a weight in 0..1"),
    (({"smile": 1.0}, "units", "arkit"), "smile"),
    (({"happiness": 1.0}, "expressions", "arkit", "nobody at all"), "unknown person"),
])
def test_wrong_input(arguments, message):
    *three, person = arguments if len(arguments) == 4 else (*arguments, None)
    with pytest.raises(InputError, match=message):
        convert(*three, person=person)


def test_the_neutral_loses_nothing():
    for target in SETS:
        assert convert({"neutral": 1.0}, "vrm", target).residual == 0.0
        assert convert({"neutral": 1.0}, "expressions", target).weights == {}


def test_nothing_is_nothing():
    for source in SETS:
        for target in SETS:
            assert convert({}, source, target).weights == {}
            assert convert({}, source, target).residual == 0.0

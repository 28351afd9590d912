import copy
import json
import math
import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from facegen.errors import FileError, InputError, TableError
from facegen.facs.deformation import (
    Deformation,
    deformation_from_dict,
    load_deformation,
    load_deformation_file,
    mirror_name,
    weighted_sum,
)

NUMBER = st.integers(-64, 64).map(lambda n: n / 16)  # sums and products of these are exact
NAMES = st.sampled_from(["chin", "mouth_corner_L", "mouth_corner_R", "brow_L", "brow_R"])


def numbers_for(*names):
    return st.dictionaries(st.sampled_from(names), NUMBER)


DEFORMATION = st.builds(
    Deformation, points=st.dictionaries(NAMES, st.tuples(NUMBER, NUMBER, NUMBER)),
    jaw=numbers_for("open", "side", "forward"), lids=numbers_for("upper_L", "upper_R", "lower_L", "lower_R"),
    eyes=numbers_for("yaw_L", "yaw_R", "pitch_L", "pitch_R"),
    head=numbers_for("yaw", "pitch", "roll", "forward"),
    folds=numbers_for("nasolabial_L", "nasolabial_R", "nose_root"))
ZERO = Deformation()


@settings(max_examples=60, deadline=None)
@given(DEFORMATION, DEFORMATION, DEFORMATION, NUMBER, NUMBER)
def test_deformations_are_a_vector_space(a, b, c, s, t):
    assert a + b == b + a
    assert (a + b) + c == a + (b + c)
    assert a + ZERO == a
    assert a - a == ZERO
    assert -a == a * -1
    assert a * 1 == a
    assert not a * 0
    assert s * (a + b) == s * a + s * b
    assert (s + t) * a == s * a + t * a
    assert weighted_sum([(s, a), (t, b)]) == s * a + t * b


@settings(max_examples=60, deadline=None)
@given(DEFORMATION, DEFORMATION, NUMBER)
def test_mirroring_is_a_linear_involution(a, b, s):
    assert a.mirrored().mirrored() == a
    assert (a + s * b).mirrored() == a.mirrored() + s * b.mirrored()
    both = a + a.mirrored()
    assert both.mirrored() == both


@settings(max_examples=60, deadline=None)
@given(DEFORMATION)
def test_plain_data_copies_and_pickles(a):
    assert deformation_from_dict(a.as_dict()) == a
    assert deformation_from_dict(json.loads(json.dumps(a.as_dict()))) == a
    assert pickle.loads(pickle.dumps(a)) == a
    assert copy.deepcopy(a) == a
    assert hash(copy.copy(a)) == hash(a)
    assert bool(a) == (a != ZERO)


def test_mirror_by_hand():
    a = Deformation(points={"mouth_corner_L": (1, 2, 3), "chin": (4, 5, 6), "F8": (7, 8, 9)},
                    jaw={"open": 1, "side": 2, "forward": 3}, lids={"upper_L": 0.5, "lower_R": 0.25},
                    eyes={"yaw_L": 1, "pitch_R": 2}, head={"yaw": 1, "pitch": 2, "roll": 3, "forward": 4},
                    folds={"nasolabial_L": 1, "nose_root": 2}, with_jaw=("F14", "F3"))
    assert a.mirrored() == Deformation(
        points={"mouth_corner_R": (-1, 2, 3), "chin": (-4, 5, 6), "F9": (-7, 8, 9)},
        jaw={"open": 1, "side": -2, "forward": 3}, lids={"upper_R": 0.5, "lower_L": 0.25},
        eyes={"yaw_R": -1, "pitch_L": 2}, head={"yaw": -1, "pitch": 2, "roll": -3, "forward": 4},
        folds={"nasolabial_R": 1, "nose_root": 2}, with_jaw=("F15", "F3"))
    assert [mirror_name(n) for n in ("F1", "F2", "F9", "F12", "F15", "x_R", "L")] == \
        ["F1", "F2", "F8", "F13", "F14", "x_L", "L"]


def test_both_sides_mirrors_the_left_only():
    half = Deformation(points={"a_L": (1, 2, 3), "chin": (0, 5, 6)}, lids={"upper_L": 0.5}, jaw={"open": 4},
                       eyes={"yaw_L": 2}, folds={"f_L": 1, "g": 2})
    assert half.both_sides() == Deformation(
        points={"a_L": (1, 2, 3), "a_R": (-1, 2, 3), "chin": (0, 5, 6)},
        lids={"upper_L": 0.5, "upper_R": 0.5},
        jaw={"open": 4}, eyes={"yaw_L": 2, "yaw_R": -2}, folds={"f_L": 1, "f_R": 1, "g": 2})


def test_zeros_are_nothing():
    assert Deformation(points={"a": (0, -0.0, 0)}, jaw={"open": 0.0}, with_jaw=("F3",)) == ZERO
    assert not Deformation(points={"a": (0, 0, 0)})


def test_units_do_not_mix():
    paper = Deformation(points={"F8": (1, 0, 0)}, units="paper")
    face = Deformation(points={"mouth_corner_L": (1, 0, 0)})
    with pytest.raises(InputError, match="'paper' and in 'face'"):
        paper + face
    with pytest.raises(InputError, match="cannot be added"):
        Deformation(jaw={"forward": 1}, units="millimetre") + face
    with pytest.raises(InputError, match="cannot be added"):
        Deformation(head={"forward": 1}, units="millimetre") + face
    angles = Deformation(jaw={"open": 10}, lids={"upper_L": 1})
    assert (paper + angles).units == "paper" == (angles + paper).units


def test_points_that_turn_with_the_jaw():
    a = Deformation(jaw={"open": 10}, units="paper", with_jaw=("F3",))
    b = Deformation(jaw={"open": 5}, units="paper", with_jaw=("F2",))
    assert (a + b).with_jaw == ("F2", "F3")
    assert (a * 0.5).with_jaw == ("F3",)
    assert (a - a).with_jaw == () == (a * 0).with_jaw


def test_frozen_and_typed():
    a = Deformation(points={"a": (1, 2, 3)})
    with pytest.raises(TypeError):
        a.points["b"] = (1, 2, 3)
    with pytest.raises(AttributeError):
        a.units = "paper"
    for wrong in ("2", None, True, [1]):
        with pytest.raises(TypeError):
            a * wrong
    with pytest.raises(TypeError):
        a + 1
    with pytest.raises(InputError, match="factor"):
        a * math.nan
    assert np.float64(2) * a == a * 2 == a * np.float32(2)


def test_numpy_values_are_numbers():
    a = deformation_from_dict({"points": {"chin": np.array([1, 2, 3])}, "jaw": {"open": np.float32(0.5)}})
    assert a == Deformation(points={"chin": (1, 2, 3)}, jaw={"open": 0.5})
    assert type(a.points["chin"][0]) is float


@pytest.mark.parametrize(("data", "words"), [
    ({"pionts": {}}, "unknown key 'pionts'; did you mean 'points'"),
    ({"jaw": {"opne": 1}}, "pose: jaw: unknown key 'opne'; did you mean 'open'"),
    ({"lids": {"upper": 1}}, "unknown key 'upper'; did you mean 'upper_"),
    ({"jaw": 10}, "jaw: expected a mapping"),
    ({"jaw": {"open": "10"}}, r"jaw\.open: expected a number, got '10'"),
    ({"jaw": {"open": True}}, "expected a number, got True"),
    ({"jaw": {"open": None}}, "expected a number, got nothing"),
    ({"jaw": {"open": math.inf}}, "expected a finite number"),
    ({"jaw": {"open": 10**400}}, "expected a finite number"),
    ({"jaw": {"open": 1e9}}, r"jaw\.open: expected a number in -1e\+06\.\.1e\+06"),
    ({"points": {"chin": [1, 2]}}, r"points\.chin: expected three numbers"),
    ({"points": {"chin": "123"}}, "expected three numbers"),
    ({"points": {"chin": [1, 2, math.nan]}}, r"points\.chin\.2: expected a finite number"),
    ({"points": {"chin": [1, 2, "3"]}}, r"points\.chin\.2: expected a number"),
    ({"points": {"chin": [1, 2, 1e300]}}, r"points\.chin\.2"),
    ({"points": [1]}, "points: expected a mapping"),
    ({"points": {1.5: [1, 2, 3]}}, "a key must be text"),
    ({"units": "inch"}, "unknown unit of length 'inch'"),
    ({"units": "milimetre"}, "did you mean 'millimetre'"),
    ({"units": None}, "units: expected a text"),
    ({"turns_with_jaw": "F3"}, "turns_with_jaw: expected a list"),
    ({"turns_with_jaw": [3]}, r"turns_with_jaw\.0: expected a text"),
    ({"folds": {"x": []}}, r"folds\.x: expected a number"),
    ([], "expected a mapping"),
    (None, "got nothing"),
])
def test_wrong_data_are_refused_with_their_path(data, words):
    with pytest.raises(TableError, match=words) as caught:
        deformation_from_dict(data, source="pose")
    assert str(caught.value).startswith("pose: ")


def test_the_constructor_checks_too():
    with pytest.raises(InputError, match="unknown key 'opne'"):
        Deformation(jaw={"opne": 1})
    with pytest.raises(InputError, match="three numbers"):
        Deformation(points={"chin": (1, 2)})
    with pytest.raises(InputError, match="unit of length"):
        Deformation(units="feet")


def test_unknown_names_are_found():
    a = Deformation(points={"chim": (0, 1, 0)}, folds={"nasolabial_L": 1}, jaw={"open": 1}, with_jaw=("F3",))
    with pytest.raises(TableError, match=r"pose: points\.chim: unknown feature point .* mean 'chin'"):
        a.check_names(points={"chin", "F3"}, source="pose")
    with pytest.raises(TableError, match=r"turns_with_jaw\.F3: unknown feature point"):
        a.check_names(points={"chim"})
    with pytest.raises(TableError, match="unknown fold 'nasolabial_L'"):
        a.check_names(points={"chim", "F3"}, folds={"chin"})
    a.check_names(points={"chim", "F3"})
    a.check_names(points={"chim", "F3"}, folds={"nasolabial_L"})


def test_files(tmp_path):
    path = tmp_path / "pose.yaml"
    path.write_text("about: test\nsource: me\nunits: millimetre\npoints: {chin: [0, 1, 2]}\njaw: {open: 3}\n")
    expected = Deformation(points={"chin": (0, 1, 2)}, jaw={"open": 3}, units="millimetre")
    assert load_deformation(path) == expected
    assert load_deformation_file(path) == (expected, "me")
    json_path = tmp_path / "pose.json"
    json_path.write_text(json.dumps(expected.as_dict()))
    assert load_deformation(str(json_path)) == expected
    for text, words in (("about: x", "holds no deformation"), ("", "expected a mapping"),
                        ("- 1", "expected a mapping"),
                        ("jaws: {}", "did you mean 'jaw'"), ("about: 3\njaw: {}", "about: expected a text")):
        path.write_text(text)
        with pytest.raises(TableError, match=words) as caught:
            load_deformation(path)
        assert str(path) in str(caught.value)
    json_path.write_text('{"jaw": {"open": NaN}}')
    with pytest.raises(TableError, match=r"jaw\.open: expected a finite number"):
        load_deformation(json_path)
    with pytest.raises(FileError):
        load_deformation(tmp_path / "none.yaml")

import itertools
import re

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from facegen.errors import InputError, NotationError
from facegen.facs.notation import canonical, looks_like_units, parse, parse_weights
from facegen.facs.units import load_catalogue

CATALOGUE = load_catalogue()


@pytest.mark.parametrize(("text", "weights"), [
    ("6+12", {"6": 0.8, "12": 0.8}),
    ("AU6C + AU12D", {"6": 0.5, "12": 0.8}),
    ("R12A+R14A", {"R12": 0.08, "R14": 0.08}),
    ("1,2,5B,26", {"1": 0.8, "2": 0.8, "5": 0.25, "26": 0.8}),
    ("AU12_r=3.2", {"12": 0.56}),
    ("AU45_c=1", {"45": 0.8}),
    ("AU45_c=0", {}),
    ("12L", {"L12": 0.8}),
    ("12_left", {"L12": 0.8}),
    ("AU12_L", {"L12": 0.8}),
    ("12_R", {"R12": 0.8}),
    ("12C_right", {"R12": 0.5}),
    ("12LC", {"L12": 0.5}),
    ("12CL", {"L12": 0.5}),
    ("AU_L12", {"L12": 0.8}),
    ("LAU12", {"L12": 0.8}),
    ("T23", {"T23": 0.8}),
    ("B28E", {"B28": 1.0}),
    ("L12C", {"L12": 0.5}),
    ("26/27", {"26": 0.8}),
    ("26/27C", {"26": 0.5}),
    ("26B/27C", {"26": 0.25}),
    ("25/26/27", {"25": 0.8}),
    ("51", {"51": 0.8}),
    ("L30E", {"L30": 1.0}),
    ("AU01_r", {"1": 0.8}),
    ("au12_r", {"12": 0.8}),
    ("0", {}),
    ("AU0", {}),
    ("12:0.4", {"12": 0.4}),
    ("12=.4", {"12": 0.4}),
    ("12 = 0.4 + 6 : 1", {"6": 1.0, "12": 0.4}),
    ("12=0", {}),
    ("B12C", {"12": 0.5}),
    ("6 12", {"6": 0.8, "12": 0.8}),
    ("6; 12", {"6": 0.8, "12": 0.8}),
    ("  6+12\n", {"6": 0.8, "12": 0.8}),
    ("AU 6 AU 12", {"6": 0.8, "12": 0.8}),
    ("12=1,25=1", {"12": 1.0, "25": 1.0}),
    ("L12C+R12C", {"12": 0.5}),
    ("T23B+B23B", {"23": 0.25}),
    ("L12C+R12B", {"L12": 0.5, "R12": 0.25}),
    ("12C+12C", {"12": 0.5}),
    ("12C+L12C", {"12": 0.5}),
    ("L46E+R46E", {"L46": 1.0, "R46": 1.0}),
])
def test_what_people_type_is_understood(text, weights):
    assert parse(text) == weights
    assert parse(canonical(weights)) == weights


@pytest.mark.parametrize(("text", "position", "words"), [
    ("", 0, "neutral face is written 0"),
    ("   ", 0, "empty"),
    ("AU12F", 4, "intensity is A-E, from 12A"),
    ("6+5Z", 3, "intensity is A-E"),
    ("12dimple", 2, "intensity is A-E"),
    ("12CD", 3, "one intensity letter"),
    ("6++12", 2, "a unit is missing before '+'"),
    ("+6", 0, "a unit is missing before '+'"),
    ("6+", 1, "missing after the last separator"),
    ("26/", 3, "the script ends here"),
    ("12=0,4", 4, "decimal point"),
    ("12=3.2", 3, "AU12_r=3.2"),
    ("12=-0.1", 3, "0..1"),
    ("12=7", 3, "0..1"),
    ("12=nan", 3, "expected a number"),
    ("12=", 3, "expected a number"),
    ("12C=0.5", 3, "a letter or a number, not both"),
    ("AU12_r=7", 7, "0..5"),
    ("AU12_c=0.5", 7, "0 or 1"),
    ("M59", 0, "M59 is a nod"),
    ("M12", 0, "movement"),
    ("U12", 0, "L12 or R12"),
    ("30", 0, "L30 or R30"),
    ("6+46E", 2, "L46 or R46"),
    ("8", 0, "parted lips"),
    ("50", 0, "not a shape"),
    ("6+99", 2, "there is no unit 99; near it"),
    ("6+" + "9" * 5000, 2, "there is no unit 999999"),
    ("51L", 0, "not scored by side"),
    ("T12", 0, "has no 'T'"),
    ("L23", 0, "has no 'L'; write 23, T23, B23"),
    ("L12R", 0, "one side or lip"),
    ("LAUR12", 0, "one side or lip"),
    ("L0", 0, "no side"),
    ("0+12", 0, "stands alone"),
    ("6+0", 2, "stands alone"),
    ("12C+L12D", 4, "given twice, as 0.5 and as 0.8"),
    ("6+12C+12D", 6, "given twice"),
    ("L12=0+12", 6, "given twice"),
    ("12 C", 3, "right behind its unit: 12C"),
    ("A12", 0, "right behind its unit"),
    ("T 23", 1, "right behind 'T'"),
    ("6+x", 2, "expected a unit"),
    ("23T", 2, "write T23"),
    ("(20)+1", 0, "optional"),
    ("1+[26]", 2, "optional"),
    ("5*", 1, "any intensity"),
    ("51@52", 2, "alternatives"),
    ("6-12", 1, "join units with '+'"),
    ("6&12", 1, "join units with '+'"),
    ("6|12", 1, "expected '+'"),
    ("12=0.4x", 6, "expected '+'"),
    ("12=0.4C", 6, "expected '+'"),
    ("12=0.4L", 6, "expected '+'"),
    ("12=1=1", 4, "expected '+'"),
    ("12=1E+25", 4, "expected '+'"),
    ("6+" * 6000, 0, "longer than"),
])
def test_the_rest_is_refused_where_it_stands(text, position, words):
    with pytest.raises(NotationError, match=re.escape(words)) as caught:
        parse(text)
    assert caught.value.text == text
    assert caught.value.position == position
    assert str(caught.value).splitlines()[-1] == " " * (position + 2) + "^"


def test_caret_stays_under_its_character_in_a_long_script():
    text = "+".join(["6", "12"] * 40) + "+12F"
    with pytest.raises(NotationError) as caught:
        parse(text)
    _, snippet, caret = str(caught.value).splitlines()
    assert snippet[caret.index("^")] == "F"


def test_only_text_is_a_script():
    with pytest.raises(InputError, match="expected a text"):
        parse(12)


def test_letters_and_openface_numbers_meet():
    for letter, number in zip("ABCDE", range(1, 6), strict=True):
        assert parse(f"12{letter}") == parse(f"AU12_r={number}")
    values = [CATALOGUE.from_openface(n / 10) for n in range(51)]
    assert values[0] == 0.0
    assert values[-1] == 1.0
    assert all(low < high for low, high in itertools.pairwise(values))
    with pytest.raises(InputError, match=r"0\.\.5"):
        CATALOGUE.from_openface(float("nan"))


@pytest.mark.parametrize(("weights", "expected"), [
    ({"AU12": 0.8, "AU06": 0.5}, {"6": 0.5, "12": 0.8}),
    ({12: 0.3}, {"12": 0.3}),
    ({"12L": 1}, {"L12": 1.0}),
    ({"AU12_r": 5.0, "AU06_r": 0.0}, {"12": 1.0}),
    ({"L12": 0.4, "R12": 0.4}, {"12": 0.4}),
    ({"0": 1}, {}),
    ({}, {}),
])
def test_mappings_of_weights(weights, expected):
    assert parse_weights(weights) == expected


@pytest.mark.parametrize(("weights", "words"), [
    ({"AU99": 0.5}, "no unit 99"),
    ({"12C": 0.5}, "without intensity"),
    ({"12=0.1": 0.5}, "without intensity"),
    ({"6+12": 0.5}, "without intensity"),
    ({"smile": 0.5}, "expected a unit"),
    ({True: 0.5}, "expected a unit"),
    ({"12": 1.5}, r"0\.\.1"),
    ({"12": float("nan")}, r"0\.\.1"),
    ({"12": True}, "expected a number"),
    ({"12": "0.5"}, "expected a number"),
    ({"12": None}, "expected a number"),
    ({"AU12_r": 5.5}, r"0\.\.5"),
    ({"12": 0.5, "L12": 0.4}, "given twice"),
])
def test_wrong_mappings_are_refused(weights, words):
    with pytest.raises(InputError, match=words):
        parse_weights(weights)


def test_canonical_order_letters_and_numbers():
    assert canonical({}) == "0"
    assert canonical({"12": 0.0}) == "0"
    mixed = {"26": 0.5, "R12": 0.25, "6": 0.37, "L12": 1.0, "T23": 0.08}
    assert canonical(mixed) == "6=0.37+L12E+R12B+T23A+26C"
    assert canonical({"L12": 0.5, "R12": 0.5}) == "12C"
    for wrong in ({"99": 0.5}, {"12": 2.0}, {"12": -0.1}, {"30": 0.5}, {"x": 0.5}, {12: 0.5}):
        with pytest.raises(InputError, match="unit"):
            canonical(wrong)


WEIGHT = st.one_of(st.sampled_from([0.08, 0.25, 0.5, 0.8, 1.0]), st.floats(0.0, 1.0, exclude_min=True))
ATOMS = st.dictionaries(st.sampled_from(CATALOGUE.atoms), WEIGHT, max_size=20)


@settings(max_examples=200, deadline=None)
@given(ATOMS)
def test_round_trip_is_exact(atoms):
    weights = CATALOGUE.fold(atoms)
    text = canonical(weights)
    assert parse(text) == weights
    assert canonical(parse(text)) == text
    assert canonical(atoms) == text
    assert CATALOGUE.expand(parse(text)) == atoms
    assert parse(text.lower()) == weights
    assert parse_weights(weights) == weights


@settings(max_examples=300, deadline=None)
@given(st.text(alphabet="0123456789ABCDELRTBUMX_rc=:.,;+-/ ()*@\n\tau", max_size=24))
def test_any_text_is_parsed_or_refused_with_its_position(text):
    error, weights = None, {}
    try:
        weights = parse(text)
    except NotationError as caught:
        error = caught
    assert error is None or (0 <= error.position <= len(text) and error.text == text)
    assert parse(canonical(weights)) == weights


def test_what_begins_like_units():
    for text in ("6+12", "AU6", " L12", "T23", "+6", "(20)", "M59", "U12", "AU_12"):
        assert looks_like_units(text), text
    for text in ("happiness", "fear2", "smile+12", "", "x.yaml", "-"):
        assert not looks_like_units(text), text

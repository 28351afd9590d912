"""Mixtures of expressions, and expressions by chance."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import facegen
from facegen.facs.chance import _GROUPS
from facegen.facs.units import load_catalogue

NAMES = sorted(facegen.load_expressions().expressions)
SHARES = st.dictionaries(st.sampled_from(NAMES), st.floats(0.0, 1.0), max_size=5)


@settings(deadline=None, max_examples=30)
@given(SHARES)
def test_a_mixture_is_the_slow_sum_of_its_units(shares):
    catalogue, table = load_catalogue(), facegen.load_expressions().expressions
    found = catalogue.expand(facegen.blend(shares))
    for atom in catalogue.atoms:
        total = sum(share * catalogue.expand(table[name].units).get(atom, 0.0) for name, share in shares.items())
        assert found.get(atom, 0.0) == pytest.approx(min(total, 1.0), abs=1e-12)


@pytest.mark.parametrize("name", ["happiness", "contempt", "joy"])
def test_one_whole_expression_is_itself(name):
    assert facegen.blend({name: 1.0}) == facegen.resolve(name).units
    assert facegen.blend({name: 0.0}) == {} == facegen.blend({})


def test_a_mixture_of_a_person_is_of_their_habits():
    person = next(one for one in facegen.people() if "happiness" in facegen.load_person(one).expressions)
    own = facegen.load_person(person).expressions["happiness"].units
    assert facegen.blend({"happiness": 1.0}, person=person) == dict(own) != facegen.blend({"happiness": 1.0})


@pytest.mark.parametrize(("shares", "says"), [
    ({"hapiness": 1.0}, "did you mean 'happiness'"),
    ({"happiness": 1.5}, "shares: happiness: expected a number in 0..1, got 1.5"),
    ({"happiness": True}, "expected a number in 0..1"),
    ({"figure-8": 0.5}, "unknown expression"),
    ({"akimoto-1986-figure-8": 0.5}, "is raw data"),
    (dict.fromkeys(map(str, range(101)), 0.1), "at most 100"),
])
def test_what_cannot_be_mixed_is_refused(shares, says):
    with pytest.raises(facegen.InputError, match=says):
        facegen.blend(shares)


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 2**64 - 1))
def test_chance_makes_what_a_face_could_do(seed):
    units = facegen.random_expression(seed)
    assert units == facegen.random_expression(seed)
    assert units
    assert all(0.05 <= weight <= 1.0 for weight in units.values())
    assert facegen.resolve(units).warnings == ()            # nothing works against anything
    assert facegen.parse(facegen.canonical(units)) == units


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 2**64 - 1))
def test_each_part_of_the_face_does_what_a_named_expression_does(seed):
    """The law of the generator, read off the table: units of a group stand together in some recipe."""
    catalogue = load_catalogue()
    numbers = {catalogue.unit_of(code).number for code in facegen.random_expression(seed)}
    recipes = [{catalogue.unit_of(code).number for code in one.units}
               for one in facegen.load_expressions().expressions.values()]
    for regions in _GROUPS:
        group = {number for number in numbers if catalogue.units[number].region in regions}
        assert any(group <= recipe for recipe in recipes)


def test_chance_is_not_always_the_same():
    assert len({facegen.canonical(facegen.random_expression(seed)) for seed in range(50)}) > 45
    assert len({facegen.canonical(facegen.random_expression()) for _ in range(20)}) > 1


@pytest.mark.parametrize("seed", [-1, 1.5, True, "x", 2**64])
def test_a_seed_is_a_whole_number(seed):
    with pytest.raises(facegen.InputError, match="seed: expected a whole number"):
        facegen.random_expression(seed)

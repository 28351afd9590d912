"""The sliders of units: what they show and what they set."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from facegen.facs.notation import parse
from facegen.facs.units import load_catalogue
from facegen.studio.unit_rows import Stand, groups, moved

ROWS = {row.code: row for _, rows in groups() for row in rows}
ATOMS = st.dictionaries(st.sampled_from(load_catalogue().atoms), st.floats(0.01, 1.0))


def test_every_code_has_one_slider_with_words():
    assert set(ROWS) == set(load_catalogue().codes)
    assert ROWS["12"].label == "Lip corners up (12)"
    assert ROWS["L12"].label == "Lip corners up, left (L12)"
    assert ROWS["T23"].label == "Lips tight, upper lip (T23)"
    assert len({row.label for row in ROWS.values()}) == len(ROWS)
    assert all(row.hint.endswith(").") or row.hint.endswith(".") for row in ROWS.values())
    assert [title for title, _ in groups()] == ["Brows", "Eyelids", "Nose", "Cheeks", "Mouth and chin", "Jaw", "Tongue",
                                                "Neck", "Head", "Gaze"]


@settings(deadline=None, max_examples=30)
@given(ATOMS, st.booleans())
def test_what_is_shown_covers_each_atom_once(atoms, apart):
    stand = Stand.of(atoms, apart=apart)
    shown = [row for row in ROWS.values() if stand.shows(row)]
    covered = [atom for row in shown for atom in row.atoms]
    assert sorted(covered) == sorted(load_catalogue().atoms)
    assert {atom: stand.weight(row) for row in shown for atom in row.atoms if stand.weight(row)} == atoms


@settings(deadline=None, max_examples=30)
@given(ATOMS, st.sampled_from(sorted(ROWS)), st.floats(0.0, 1.0))
def test_a_slider_sets_its_own_units_and_no_other(atoms, code, value):
    before, after = dict(atoms), load_catalogue().expand(moved(ROWS[code], atoms, value))
    for atom in load_catalogue().atoms:
        assert after.get(atom, 0.0) == (value if atom in ROWS[code].atoms else before.get(atom, 0.0))
    assert Stand.of(after, apart=False).weight(ROWS[code]) == value


@pytest.mark.parametrize(("script", "apart", "shown", "hidden"), [
    ("12C", False, {"12", "L30", "R30"}, {"L12", "R12"}),
    ("R12C", False, {"L12", "R12", "14"}, {"12", "L14"}),
    ("12C", True, {"L12", "R12", "L14", "T23", "17"}, {"12", "14", "23"}),
    ("T23C", False, {"T23", "B23", "12"}, {"23"}),
])
def test_a_pair_stands_apart_where_it_is_asked_for_or_differs(script, apart, shown, hidden):
    stand = Stand.of(parse(script), apart=apart)
    found = {code for code, row in ROWS.items() if stand.shows(row)}
    assert shown <= found
    assert not hidden & found

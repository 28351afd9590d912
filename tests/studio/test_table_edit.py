"""A person's table, edited: what is taken from the tab of points is what the unit then does."""

import pytest

from facegen.errors import InputError
from facegen.facs.deformation import Deformation
from facegen.facs.expression_table import person_from_data
from facegen.facs.expressions import resolve
from facegen.facs.tables import load_units
from facegen.facs.yamlfile import parse_yaml
from facegen.facs.yamltext import yaml_text
from facegen.studio import table_edit as edit

EMPTY = edit.new_table("Ada")


def person(data):
    return person_from_data(parse_yaml(yaml_text(data), "t"))


@pytest.mark.parametrize("code", edit.unit_choices().values())
def test_every_unit_takes_a_movement_and_makes_it(code):
    crooked = Deformation(points={"mouth_corner_L": (0.1, 0.2, 0.0), "chin": (0.1, 0.0, 0.0)}, jaw={"side": 0.1})
    straight = Deformation(points={"chin": (0.0, 0.2, 0.1)}, lids={"upper_L": 0.5, "upper_R": 0.5})
    for movement in (crooked, straight):
        data = edit.with_movement(EMPTY, code, movement)
        found = resolve({code: 1.0}, person=person(data)).deformation
        assert found == edit.movement_of(data, code)
        assert (found - movement).as_dict() == {"units": "face"}
        assert "own" in edit.unit_says(data, code)
        assert edit.without_unit(data, code) == EMPTY


def test_a_side_and_both():
    data = edit.with_scale(edit.with_scale(EMPTY, "12", 0.5), "L12", 1.5)
    assert data["units"] == {"12": {"scale": 0.5}, "L12": {"scale": 1.5}}
    assert (edit.scale_of(data, "L12"), edit.scale_of(data, "R12"), edit.scale_of(data, "12")) == (1.5, 0.5, 0.5)
    assert edit.with_scale(data, "12", 0.8)["units"] == {"12": {"scale": 0.8}}
    assert edit.with_scale(data, "L12", 1.0)["units"]["L12"] == {"scale": 1.0}      # not 12's half
    assert edit.with_scale(edit.with_scale(EMPTY, "4", 0.5), "4", 1.0) == EMPTY
    assert person(data).units["L12"].scale == 1.5


def test_a_recipe_overrides_or_is_added_and_goes_again():
    data = edit.with_recipe(EMPTY, "happiness", "12E", "A grin.")
    data = edit.with_recipe(data, "Ada Maybe", "14C", "Perhaps.")
    assert (list(data["overrides"]), list(data["adds"])) == (["happiness"], ["ada_maybe"])
    found = edit.recipes(data)
    assert (found["happiness"].units, found["happiness"].own, found["anger"].own) == ("12E", True, False)
    assert resolve("ada_maybe", person=person(data)).units == {"14": 0.5}
    assert edit.without_recipe(edit.without_recipe(data, "happiness"), "ada_maybe") == EMPTY


def test_what_an_entry_has_beside_stays():
    data = {**EMPTY, "adds": {"maybe": {"units": "14C", "about": "P.", "also": ["perhaps"]}}}
    assert edit.with_recipe(data, "maybe", "14D", "P.")["adds"]["maybe"]["also"] == ["perhaps"]


def test_names_and_nothing_are_refused():
    for call in (lambda: edit.new_table(" "), lambda: edit.file_name("//"),
                 lambda: edit.with_movement(EMPTY, "12", Deformation()),
                 lambda: edit.with_movement(EMPTY, "12", Deformation(points={"chin": (1, 0, 0)}, units="millimetre"))):
        with pytest.raises(InputError):
            call()
    assert edit.file_name("../Ada Lovelace") == "ada_lovelace.yaml"


def test_every_movable_atom_can_be_chosen():
    table = load_units()
    covered = {atom for code in edit.unit_choices().values() for atom in table.catalogue.expand({code: 1.0})}
    assert covered == set(table.catalogue.atoms)

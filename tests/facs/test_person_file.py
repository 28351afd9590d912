"""A person's table is changed line by line: what its owner wrote stays."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from facegen.data import tables_dir
from facegen.errors import FileError, InputError, TableError
from facegen.facs.person_file import changed_text, person_change, read_person_data
from facegen.facs.yamlfile import parse_yaml
from facegen.facs.yamltext import yaml_text

TEXT = """# Ada, as her sister knows her.
name: Ada
about: A person who smiles with one side.   # mostly
source: "invented"

overrides:
  # the left one, always
  happiness: {units: "6B+L12E", about: One-sided.}     # gone if changed
  anger:
    units: "4D+7C"
    about: >
      Folded text
      of two lines.
  # after anger
units:
  "12":   # a comment of hers
    points:
      mouth_corner_L: [0.1, 0.2, 0.3]   # corner
      cheek_L: [0.0, 0.1, 0.0]
# the end
"""


def data():
    return parse_yaml(TEXT, "t")


def test_nothing_changed_is_the_same_text():
    assert changed_text(TEXT, data()) == (TEXT, True)


def test_only_what_changed_is_written_anew():
    new = data()
    new["overrides"]["happiness"]["units"] = "12E"
    new["units"]["12"]["points"]["cheek_L"] = [0.0, 0.2, 0.0]
    new["units"]["4"] = {"scale": 0.5}
    new["adds"] = {"ada_maybe": {"units": "14C", "about": "Perhaps."}}
    text, kept = changed_text(TEXT, new)
    assert kept
    assert parse_yaml(text, "t") == new
    for comment in ("as her sister", "# mostly", "# the left one", "# after anger", "# a comment of hers", "# corner",
                    "# the end"):
        assert comment in text
    assert "of two lines" in text
    assert '  happiness: {units: "12E", about: "One-sided."}\n' in text


def test_what_is_taken_out_goes_with_its_lines_only():
    new = data()
    del new["overrides"]["anger"], new["units"]
    text, kept = changed_text(TEXT, new)
    assert (parse_yaml(text, "t"), kept) == (new, True)
    assert "Folded" not in text
    assert "# the left one" in text


@pytest.mark.parametrize("text", ["{name: Ada, about: a, source: s, units: {12: {scale: 0.5}}}  # one line\n",
                                  '{"name": "Ada"}', "", "# only a comment\n"])
def test_other_ways_of_writing_are_written_whole(text):
    new = {"about": "a", "source": "s", "units": {"12": {"scale": 0.25}}}
    assert changed_text(text, new) == (yaml_text(new), "#" not in text)


NAMES = st.sampled_from(["a", "b", "c", "12", "true"])
LEAVES = st.one_of(st.integers(0, 9), st.text("ab #:'", max_size=4), st.lists(st.integers(0, 9), max_size=3))
TREES = st.recursive(LEAVES, lambda inner: st.dictionaries(NAMES, inner, max_size=4), max_leaves=10)
TABLES = st.dictionaries(NAMES, TREES, min_size=1, max_size=5)


@settings(deadline=None)
@given(TABLES, TABLES)
def test_any_table_becomes_any_other(old, new):
    text, _ = changed_text("# kept\n" + yaml_text(old), new)
    assert parse_yaml(text, "t") == new


@settings(deadline=None)
@given(TABLES, TABLES)
def test_comments_above_what_is_not_touched_stay(old, new):
    new = {**old, **{f"new_{key}": value for key, value in new.items()}}
    commented = "".join(f"# of {key}\n{yaml_text({key: value})}" for key, value in old.items())
    text, kept = changed_text(commented, new)
    assert kept
    assert parse_yaml(text, "t") == new
    assert all(f"# of {key}\n" in text for key in old)


def test_a_change_is_shown_then_saved_whole(tmp_path):
    path = tmp_path / "ada.yaml"
    path.write_text(TEXT)
    new = data()
    new["units"]["12"] = {"scale": 0.5}
    change = person_change(new, path)
    assert change.diff.startswith("--- ada.yaml\n+++ ada.yaml\n@@")
    assert "+    scale: 0.5\n" in change.diff
    assert path.read_text() == TEXT
    assert change.person.units["L12"].scale == 0.5
    assert change.save() == path
    assert path.read_text() == change.after
    assert person_change(new, path).diff == ""
    assert list(tmp_path.iterdir()) == [path]


def test_a_new_person(tmp_path):
    new = {"about": "a", "source": "s", "units": {"12": {"scale": 0.5}}}
    change = person_change(new, tmp_path / "new.yaml")
    assert "--- (new)" in change.diff
    change.save()
    assert (tmp_path / "new.yaml").read_text() == yaml_text(new)


def test_what_is_wrong_is_told_before_anything_is_written(tmp_path):
    path = tmp_path / "ada.yaml"
    path.write_text(TEXT)
    with pytest.raises(TableError, match=r"ada\.yaml: units\.12\.scale: expected a number in 0\.\.5"):
        person_change({**data(), "units": {"12": {"scale": 50}}}, path)
    with pytest.raises(FileError, match=r"expected a name that ends in \.yaml"):
        person_change(data(), tmp_path / "ada.txt")
    assert path.read_text() == TEXT


def test_a_file_that_changed_meanwhile_is_not_overwritten(tmp_path):
    path = tmp_path / "ada.yaml"
    path.write_text(TEXT)
    change = person_change({**data(), "about": "Other."}, path)
    path.write_text(TEXT + "# mine\n")
    with pytest.raises(InputError, match="changed meanwhile"):
        change.save()
    assert path.read_text().endswith("# mine\n")


def test_shipped_people_can_be_read_and_changed():
    for path in (tables_dir() / "people").glob("*.yaml"):
        text = path.read_text()
        new = {**read_person_data(text.encode(), path.name), "units": {"12": {"scale": 0.5}}}
        changed, kept = changed_text(text, new)
        assert kept
        assert changed.startswith(text)


def test_habits_are_counted_before_they_are_read():
    """Half a megabyte of them takes ten seconds to read: whoever serves others says how many it takes."""
    head = "about: a\nsource: b\n"
    text = head + "adds: {maybe: {units: 14C, about: c, also: [perhaps, hm]}}\nunits: {12: {scale: 0.5}}\n" \
        "aliases: {glee: happiness}\n"
    assert read_person_data(text.encode(), "a.yaml", most=5)["aliases"] == {"glee": "happiness"}
    with pytest.raises(InputError, match=r"^a.yaml: has 5 habits .* expected up to 4"):
        read_person_data(text.encode(), "a.yaml", most=4)
    for wrong in ("[]", "adds: 3", head + "adds: [1]", head + "adds: {a: 1}", head + "adds: {a: {also: {}}}"):
        with pytest.raises(TableError):
            read_person_data(wrong.encode(), "a.yaml", most=4)

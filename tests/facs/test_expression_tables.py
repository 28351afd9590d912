import pytest

from facegen.data import tables_dir
from facegen.errors import FileError, InputError, TableError
from facegen.facs.expression_table import fold_name, is_path
from facegen.facs.expressions import resolve
from facegen.facs.notation import canonical, parse
from facegen.facs.tables import load_expressions, load_person, load_units, people
from facegen.facs.units import load_catalogue

TABLE = load_expressions()
BASIC = {  # units without which the prototype is not the emotion's (EMFACS)
    "happiness": "6+12", "sadness": "1+4+15", "surprise": "1+2+5", "fear": "1+2+4+5+20", "anger": "4+5+7+23",
    "disgust": "9", "contempt": "R12+R14",
}
NAMES = {
    "amusement", "awe", "embarrassment", "pride", "shame", "interest", "confusion", "boredom",
    "contentment", "coyness", "desire", "relief", "sympathy", "triumph", "love", "pain", "smile", "wink",
    "smirk", "pout", "frown", "blink", "sneer", "grimace", "kiss", "yawn", "contempt_left",
    "happily_surprised", "happily_disgusted", "sadly_fearful", "sadly_angry", "sadly_surprised",
    "sadly_disgusted", "fearfully_angry", "fearfully_surprised", "fearfully_disgusted",
    "angrily_surprised", "angrily_disgusted", "disgustedly_surprised", "appalled", "hatred", "awed",
}


def test_enough_names_each_with_source_and_description():
    assert len(TABLE.expressions) >= 45
    assert set(BASIC) | NAMES <= set(TABLE.expressions)
    for expression in TABLE.expressions.values():
        assert len(expression.source) > 20, expression.name
        assert expression.about.endswith("."), expression.name
        assert "\n" not in expression.about
        assert bool(expression.units) == (expression.name != "neutral")


def test_expressions_differ_from_one_another():
    scripts = [canonical(expression.units) for expression in TABLE.expressions.values()]
    assert len(set(scripts)) == len(scripts)


@pytest.mark.parametrize("name", TABLE.expressions)
def test_each_expression_resolves_at_every_intensity_without_antagonists(name):
    full = resolve(name)
    assert full.kind == "expression"
    assert full.expression is TABLE.expressions[name]
    assert full.warnings == ()
    half = resolve(name, intensity=0.5)
    assert half.units == {code: weight * 0.5 for code, weight in full.units.items()}
    assert resolve(name, intensity=0).units == {}
    assert not resolve(name, intensity=0).deformation
    assert parse(canonical(half.units)) == half.units


@pytest.mark.parametrize("name", BASIC)
def test_basic_expressions_hold_their_prototype_with_a_clear_peak(name):
    units = TABLE.expressions[name].units
    assert set(parse(BASIC[name])) <= set(units)
    assert max(units.values()) >= 0.8


@pytest.mark.parametrize("name", ["happiness", "surprise", "fear", "anger", "disgust"])
def test_peaks_open_the_lips(name):
    catalogue = load_catalogue()
    assert any(catalogue.unit_of(code).parts_lips for code in TABLE.expressions[name].units)


def test_basic_expressions_have_variants():
    for name in ("happiness", "sadness", "surprise", "fear", "anger", "disgust", "contempt"):
        assert sum(other.startswith(name + "_") for other in TABLE.expressions) >= 2, name


@pytest.mark.parametrize(("word", "name"), [
    ("joy", "happiness"), ("Happy", "happiness"), (" SAD ", "sadness"), ("scared", "fear"),
    ("scorn", "contempt"),
    ("contempt-left", "contempt_left"), ("Happily Surprised", "happily_surprised"), ("neutral", "neutral"),
    ("eyes   closed", "eyes_closed"), ("angry", "anger"), ("duchenne smile", "happiness_closed"),
])
def test_synonyms_case_and_spaces(word, name):
    assert resolve(word).name == name


def test_left_and_right_are_mirror_images():
    for left, right in (("contempt_left", "contempt"), ("wink", "wink_right"), ("smirk", "smirk_right"),
                        ("sneer_left", "sneer"), ("eyebrow_raised_left", "eyebrow_raised_right"),
                        ("look_left", "look_right")):
        assert resolve(left).deformation == resolve(right).deformation.mirrored(), left


def test_symmetric_expressions_are_symmetric():
    for name in ("happiness", "sadness", "surprise", "fear", "anger", "disgust", "pain", "kiss"):
        deformation = resolve(name).deformation
        assert deformation == deformation.mirrored(), name


TEXT = """
sources: {s: a source}
expressions:
  neutral: {units: 0, about: At rest., source: s}
  glee: {units: "6C+12D", about: Glee., source: s, also: [cheer]}
  gloom: {units: "4+15", about: Gloom., source: s, also: [murk]}
"""


def test_other_tables(tmp_path):
    path = tmp_path / "e.yaml"
    path.write_text(TEXT)
    table = load_expressions(path)
    assert resolve("cheer", expressions=table).units == {"6": 0.5, "12": 0.8}
    with pytest.raises(InputError, match="did you mean 'gloom'"):
        resolve("glom", expressions=table)


@pytest.mark.parametrize(("old", "new", "words"), [
    ("6C+12D", "6C+12F", r"expressions\.glee\.units: AU12F: intensity is A-E"),
    ("6C+12D", "6C+99", r"expressions\.glee\.units: there is no unit 99"),
    ('"6C+12D"', "[6, 12]", r"expressions\.glee\.units: expected a text"),
    ('"6C+12D"', "true", r"expressions\.glee\.units: expected a text"),
    ("about: Glee.", "abuot: Glee.", r"expressions\.glee: unknown key 'abuot'; did you mean 'about'"),
    (", source: s, also: [cheer]", "", r"expressions\.glee: the key 'source' is missing"),
    ("about: Glee., ", "", "the key 'about' is missing"),
    ("source: s, also: [cheer]", "source: t", r"expressions\.glee\.source: unknown source 't'"),
    ("glee:", "gloom:", "the key 'gloom' is given twice"),
    ("glee:", "Glee:", "no name for an expression"),
    ("glee:", "gl-ee:", "no name for an expression"),
    ("glee:", "au12:", "no name for an expression"),
    ("glee:", "l12:", "no name for an expression"),
    ("cheer", "gloom", r"glee: also: 'gloom' already means the expression 'gloom'"),
    ("cheer", "murk", r"gloom: also: 'murk' already means the expression 'glee'"),
    ("cheer", "T23", r"glee\.also\.0: 'T23' is no name"),
    ("[cheer]", "cheer", r"glee\.also: expected a list"),
    ("neutral:", "nothing:", "the expression 'neutral' is missing"),
    ("units: 0", "units: 12", "the expression 'neutral' is missing or not 0"),
    ("sources: {s: a source}", "sources: {s: }", r"sources\.s: expected a text"),
])
def test_wrong_tables_are_refused_with_file_and_path(tmp_path, old, new, words):
    assert old in TEXT
    path = tmp_path / "e.yaml"
    path.write_text(TEXT.replace(old, new, 1))
    with pytest.raises(TableError, match=words) as caught:
        load_expressions(path)
    assert str(caught.value).startswith(str(path))


def test_shipped_people_override_and_resolve():
    assert len(people()) >= 2
    assert {path.stem for path in (tables_dir() / "people").glob("*.yaml")} == set(people())
    for name in people():
        person = load_person(name)
        assert person.about.endswith(".")
        assert person.source
        changed = 0
        for word in person.words:
            mine = resolve(word, person=name)
            assert mine.warnings == ()
            assert mine.expression in person.expressions.values()
            if word in TABLE.expressions:
                changed += mine.units != resolve(word).units
        assert changed >= 5, name
        assert resolve("pain", person=name).units == resolve("pain").units
        assert resolve("joy", person=name) .units == resolve("happiness", person=name).units


def test_people_have_the_habits_they_are_told_of():
    mika, bruno = (resolve("happiness", person=name).units for name in ("mika", "bruno"))
    assert mika["L12"] > mika["R12"]
    assert mika["L2"] > 0
    assert "26" not in mika
    assert bruno["2"] >= 0.5


PERSON = """
about: Someone.
source: me
overrides:
  happiness: {units: "12B", about: Faint.}
adds:
  gurn: {units: "29+17", about: Gurning., also: [gurning]}
aliases: {glee: happiness, mirth: gurn}
"""


def test_own_person_by_path(tmp_path):
    path = tmp_path / "me.yaml"
    path.write_text(PERSON)
    for person in (path, str(path), load_person(path)):
        assert resolve("happiness", person=person).units == {"12": 0.25}
        assert resolve("joy", person=person).units == {"12": 0.25}
        assert resolve("glee", person=person).units == {"12": 0.25}
        assert resolve("gurning", person=person).name == resolve("mirth", person=person).name == "gurn"
        assert resolve("gurn", person=person).source == "me"
    assert load_person(path).name == "me"
    with pytest.raises(InputError, match="unknown expression 'gurn'"):
        resolve("gurn")
    with pytest.raises(InputError, match="did you mean 'gurning'"):
        resolve("gurnig", person=path)


@pytest.mark.parametrize(("old", "new", "words"), [
    ("  happiness:", "  hapiness:", r"overrides\.hapiness: unknown expression .*; did you mean 'happiness'"),
    ("  happiness:", "  joy:", "'joy' is a synonym of 'happiness': override that"),
    ("  gurn:", "  anger:", r"adds\.anger: 'anger' is an expression of the common table"),
    ("12B", "12Q", r"overrides\.happiness\.units: AU12Q"),
    ("about: Faint.", "source: me", r"overrides\.happiness: unknown key 'source'"),
    ("about: Someone.\n", "", "the key 'about' is missing"),
    ("source: me\n", "", "the key 'source' is missing"),
    ("glee: happiness", "glee: hapiness", r"aliases\.glee: unknown expression 'hapiness'; did you mean"),
    ("glee: happiness", "gurn: happiness", r"aliases\.gurn: 'gurn' already means"),
    ("glee: happiness", "gurning: happiness", "already means"),
    ("glee: happiness", "l12: happiness", r"aliases\.l12: 'l12' is no name"),
    ("adds:", "add:", "unknown key 'add'; did you mean 'adds'"),
])
def test_wrong_people_are_refused_with_file_and_path(tmp_path, old, new, words):
    assert old in PERSON
    path = tmp_path / "me.yaml"
    path.write_text(PERSON.replace(old, new, 1))
    with pytest.raises(TableError, match=words) as caught:
        load_person(path)
    assert str(caught.value).startswith(str(path))


def test_unknown_people(tmp_path):
    with pytest.raises(InputError, match="unknown person 'mikka'; did you mean 'mika'"):
        load_person("mikka")
    with pytest.raises(FileError, match="no such file"):
        load_person(tmp_path / "none.yaml")
    with pytest.raises(InputError, match="expected a name or a path"):
        load_person(3)
    path = tmp_path / "p.yaml"
    path.write_text("about: A.\nsource: s\n")
    with pytest.raises(TableError, match="at least one of"):
        load_person(path)


def test_names_and_paths():
    assert fold_name("  Wide-Eyes ") == "wide_eyes"
    assert is_path("a.yaml")
    assert is_path("A.JSON")
    assert is_path("x/y")
    assert not is_path("26/27")
    assert not is_path("happiness")
    assert load_units().catalogue is not None

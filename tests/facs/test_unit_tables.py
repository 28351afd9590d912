import itertools

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from facegen.data import tables_dir
from facegen.errors import InputError, TableError
from facegen.facs.deformation import Deformation
from facegen.facs.tables import load_units
from facegen.facs.units import load_catalogue

TABLE = load_units()
CATALOGUE = TABLE.catalogue
ASKED = [1, 2, *range(4, 8), *range(9, 19), 19, *range(20, 31), *range(32, 36), 38, 39, *range(41, 47),
         *range(51, 59), *range(61, 67)]
MIRROR = {"51": "52", "52": "51", "55": "56", "56": "55", "61": "62", "62": "61"}


def test_every_asked_unit_is_there_with_its_facts():
    assert [int(number) for number in CATALOGUE.units] == sorted(ASKED)
    for unit in CATALOGUE.units.values():
        assert unit.name
        assert unit.effect
        assert unit.source
        assert unit.muscles or unit.region == "head"
    assert {n for n, u in CATALOGUE.units.items() if u.variants} == {"22", "23", "28", "32"}
    assert {n for n, u in CATALOGUE.units.items() if u.sides == "direction"} == {"30", "46"}
    assert CATALOGUE.units["12"].codes == ("12", "L12", "R12")
    assert CATALOGUE.units["23"].codes == ("23", "T23", "B23")
    assert CATALOGUE.units["30"].codes == ("L30", "R30")
    assert CATALOGUE.units["51"].codes == ("51",)
    assert CATALOGUE.unit("L12").name == "Lip corner puller"
    assert set(CATALOGUE.not_shown).isdisjoint(CATALOGUE.units)
    assert CATALOGUE.letters == {"A": 0.08, "B": 0.25, "C": 0.5, "D": 0.8, "E": 1.0}


@pytest.mark.parametrize("code", ["99", "x", "L51", "30", "", "012", "LL12", "3", 12, None])
def test_unknown_codes(code):
    with pytest.raises(InputError, match="unit"):
        CATALOGUE.unit(code)


def mirrored_code(code):
    mark = code[0] if code[0] in "LR" else ""
    return {"L": "R", "R": "L"}[mark] + code[1:] if mark else MIRROR.get(code, code)


def test_each_unit_alone_is_its_basis():
    for code in CATALOGUE.atoms:
        for weight in (0.3, 1.0):
            assert TABLE.coefficients({code: weight}) == {code: weight}
        assert TABLE.deformation({code: 1.0}) == (TABLE.basis[code] * 1.0, [])


ATOM_WEIGHTS = st.dictionaries(st.sampled_from(CATALOGUE.atoms), st.floats(0.01, 1.0), max_size=8)


@settings(max_examples=60, deadline=None)
@given(ATOM_WEIGHTS)
def test_mirrored_units_make_the_mirrored_deformation(weights):
    mirrored = {mirrored_code(code): weight for code, weight in weights.items()}
    assert TABLE.deformation(mirrored)[0] == TABLE.deformation(weights)[0].mirrored()


@settings(max_examples=60, deadline=None)
@given(ATOM_WEIGHTS, st.sampled_from(CATALOGUE.atoms), st.floats(0.0, 1.0))
def test_combinations_never_jump(weights, code, value):
    step = 1e-6
    before = TABLE.coefficients(weights | {code: value})
    after = TABLE.coefficients(weights | {code: min(value + step, 1.0)})
    for name in before.keys() | after.keys():
        assert abs(before.get(name, 0.0) - after.get(name, 0.0)) < 400 * step, name


@settings(max_examples=60, deadline=None)
@given(ATOM_WEIGHTS)
def test_rules_do_not_depend_on_the_order_and_strengthen_nothing(weights):
    backward = dict(reversed(weights.items()))
    assert TABLE.coefficients(weights) == pytest.approx(TABLE.coefficients(backward), abs=1e-12)
    for code, value in TABLE.coefficients(weights).items():
        if code in weights:
            assert 0.0 <= value <= weights[code] + 1e-12


def test_neutral_is_nothing():
    assert TABLE.deformation({}) == (Deformation(units=TABLE.units), [])
    assert TABLE.deformation({"12": 0.0}) == (Deformation(units=TABLE.units), [])


def test_declared_combinations():
    full = TABLE.coefficients
    assert full({"1": 1, "4": 1})["L4"] < 1
    assert full({"1": 1, "2": 1, "4": 1})["L1"] < 1
    assert full({"1": 1, "4": 1})["L1"] == 1
    assert full({"4": 1, "5": 1})["L5"] < 1
    assert full({"6": 1, "12": 1})["L6"] < 1
    assert full({"9": 1, "10": 1})["L10"] < 1
    assert full({"12": 1, "15": 1})["L12"] < 1
    assert full({"18": 1, "20": 1})["18"] < 1
    assert full({"25": 1, "26": 1})["L25"] < 1
    assert full({"24": 1, "25": 1})["24"] < 0.5
    assert "26" not in full({"26": 0.5, "27": 0.8})
    whole = next(rule for rule in TABLE.rules if rule.when == ("1", "2", "4"))
    assert full({"1": 1, "2": 1, "4": 1}) == {f"{side}{n}": pytest.approx(whole.scale[n])  # no pair rule too
                                              for n in ("1", "2", "4") for side in "LR"}
    assert full({"26": 1.0, "27": 0.25})["26"] == 0.75
    assert "L5" not in full({"5": 1, "43": 1})
    assert full({"18": 1, "22": 1})["18"] + full({"18": 1, "22": 1})["T22"] <= 1.2 + 1e-12


def test_combinations_hold_on_their_side_only():
    found = TABLE.coefficients({"6": 1, "L12": 1})
    assert found["L6"] < 1
    assert found["R6"] == 1
    wink = TABLE.coefficients({"5": 1, "L46": 1})
    assert "L5" not in wink
    assert wink["R5"] == 1


def test_jaw_is_never_opened_further_by_two_units_than_by_the_stronger():
    most = max(TABLE.basis["26"].jaw["open"], TABLE.basis["27"].jaw["open"])
    for a, b in itertools.product((0.0, 0.3, 0.7, 1.0), repeat=2):
        jaw = TABLE.deformation({"26": a, "27": b})[0].jaw.get("open", 0.0)
        alone = max(TABLE.deformation({"26": a})[0].jaw.get("open", 0.0),
                    TABLE.deformation({"27": b})[0].jaw.get("open", 0.0))
        assert alone - 1e-9 <= jaw <= most + 1e-9


@pytest.mark.parametrize(("weights", "count"), [
    ({"5": 0.5, "43": 0.5}, 1), ({"L5": 0.5, "R43": 0.5}, 0), ({"18": 1, "R20": 1}, 1),
    ({"51": 1, "52": 1}, 1),
    ({"L30": 1, "R30": 1}, 1), ({"L30": 1}, 0), ({"T22": 1, "B28": 1}, 0), ({"T22": 1, "T28": 1}, 1),
    ({"5": 0.0, "43": 1.0}, 0), ({"6": 1, "12": 1}, 0),
])
def test_antagonists_warn_and_are_kept(weights, count):
    warnings = TABLE.deformation(weights)[1]
    assert len(warnings) == count
    assert all("work against each other; both are applied" in warning for warning in warnings)
    if weights == {"5": 0.5, "43": 0.5}:
        assert warnings[0].startswith("5 (upper lid raiser) and 43 (eye closure)")


def test_signs_of_head_eyes_and_lids():
    def of(code):
        return TABLE.deformation({code: 1.0})[0]
    assert of("51").head["yaw"] > 0 > of("52").head["yaw"]
    assert of("53").head["pitch"] > 0 > of("54").head["pitch"]
    assert of("55").head["roll"] > 0 > of("56").head["roll"]
    assert of("57").head["forward"] > 0 > of("58").head["forward"]
    assert of("61").eyes["yaw_L"] == of("61").eyes["yaw_R"] > 0 > of("62").eyes["yaw_L"]
    assert of("63").eyes["pitch_L"] > 0 > of("64").eyes["pitch_R"]
    assert of("65").eyes["yaw_L"] > 0 > of("65").eyes["yaw_R"]
    assert of("66").eyes["yaw_L"] < 0 < of("66").eyes["yaw_R"]
    assert of("5").lids["upper_L"] < 0 < of("7").lids["lower_R"]
    closed = of("43").lids
    assert closed["upper_L"] + closed["lower_L"] >= 1.0
    assert set(of("L46").lids) == {"upper_L", "lower_L"}


def test_unknown_names_point_to_their_unit():
    everything = {name for deformation in TABLE.basis.values() for name in deformation.points}
    folds = {name for deformation in TABLE.basis.values() for name in deformation.folds}
    TABLE.check_names(points=everything, folds=folds)
    if everything:
        with pytest.raises(TableError, match=r"yaml: deformations\.\w+\.points\.\w+: unknown feature point"):
            TABLE.check_names(points=set())
    if folds:
        with pytest.raises(TableError, match=r"deformations\.\w+\.folds\.\w+: unknown fold"):
            TABLE.check_names(points=everything, folds=set())


UNITS = """
sources: {s: a source}
intensity: {A: 0.1, B: 0.2, C: 0.5, D: 0.8, E: 1.0}
units:
  "12": {name: Twelve, effect: e, muscles: [m], region: mouth, sides: true, source: s}
  "17": {name: Seventeen, effect: e, muscles: [m], region: mouth, source: s}
  "23": {name: Twentythree, effect: e, muscles: [m], region: mouth, variants: [T, B], source: s}
  "30": {name: Thirty, effect: e, muscles: [m], region: jaw, sides: direction, source: s}
  "51": {name: Fiftyone, effect: e, muscles: [], region: head, sides: asymmetric, source: s}
"""
MOVES = """
source: test
units: face
deformations:
  "12": {points: {corner_L: [1, 2, 3], corner_R: [0.25, 0, 0], mid: [1, 1, 0]}}
  "17": {points: {chin: [0, 1, 0], side_L: [1, 1, 0]}}
  "T23": {points: {lip: [0, 1, 0]}}
  "B23": {same_as: "T23", scale: -0.0}
  "30": {jaw: {side: 2}}
  "51": {head: {yaw: 30}}
"""


@pytest.fixture
def load(tmp_path):
    def write(units=UNITS, moves=MOVES):
        (tmp_path / "action_units.yaml").write_text(units)
        (tmp_path / "deformations.yaml").write_text(moves)
        return load_units(tmp_path / "action_units.yaml")
    return write


def test_sides_by_hand(load):
    table = load()
    assert table.basis["R12"].points == {"corner_R": (-1, 2, 3), "corner_L": (-0.25, 0, 0), "mid": (-1, 1, 0)}
    assert table.deformation({"12": 1.0})[0].points == {"corner_L": (0.75, 2, 3), "corner_R": (-0.75, 2, 3),
                                                       "mid": (0, 2, 0)}
    assert table.deformation({"17": 0.5})[0].points == {"chin": (0, 0.5, 0), "side_L": (0.5, 0.5, 0),
                                                       "side_R": (-0.5, 0.5, 0)}
    assert table.deformation({"23": 1.0})[0].points == {"lip": (0, 1, 0)}
    assert table.deformation({"R30": 1.0})[0].jaw == {"side": -2}
    assert load_catalogue(table.path).units["51"].name == "Fiftyone"


def test_correctives_are_added_per_side(load):
    table = load(UNITS + """
combinations:
  - {when: ["12", "17"], add: {points: {corner_L: [0, 0, 1]}}, scale: {"17": 0.5}, why: test}
  - {when: ["17", "23"], add: {points: {chin: [0, 0, 1], side_L: [1, 0, 0]}}, why: test}
""")
    found = table.coefficients({"L12": 0.5, "17": 1.0})
    assert found == {"L12": 0.5, "17": 1.0 * (1 - 0.5 * 0.5 * 0.5), "12+17:L": 0.5}
    assert table.basis["12+17:R"].points == {"corner_R": (0, 0, 1)}
    assert table.coefficients({"17": 1.0, "T23": 1.0})["17+23"] == 0.5
    assert table.basis["17+23"].points["side_R"] == (-1, 0, 0)


@pytest.mark.parametrize(("old", "new", "words"), [
    ("sides: true,", "side: true,", r"units\.12: unknown key 'side'; did you mean 'sides'"),
    ("name: Twelve, ", "", r"units\.12: the key 'name' is missing"),
    ("name: Twelve", "name: 3", r"units\.12\.name: expected a text, got 3"),
    ("sides: true", "sides: left", r"units\.12\.sides: unknown kind of sides 'left'"),
    ("sides: true", "sides: 1", r"units\.12\.sides"),
    ("region: jaw", "region: jwa", r"units\.30\.region: unknown region 'jwa'; did you mean 'jaw'"),
    ("variants: [T, B]", "variants: [T]", r"units\.23\.variants: expected \[T, B\]"),
    ("variants: [T, B]", "variants: [T, B], sides: true", r"units\.23\.variants"),
    ("muscles: [m], region: jaw", "muscles: m, region: jaw", r"units\.30\.muscles: expected a list"),
    ('"17": {name', '"117": {name', r"units\.117: a unit's key is its number"),
    ('"17": {name', '"0": {name', "its number"),
    ('"17": {name', '"12": {name', "the key '12' is given twice"),
    ('"17": {name', 'L17: {name', "its number"),
    ("source: s}", "source: t}", r"units\.12\.source: unknown source 't'"),
    ("B: 0.2", "B: 0.05", "intensity: expected weights above 0 that rise"),
    ("B: 0.2", "F: 0.2", r"intensity: unknown key 'F'"),
    ("E: 1.0", "E: 1.5", r"intensity\.E: expected a number in 0\.\.1"),
    ("sources:", "source:", "unknown key 'source'; did you mean 'sources'"),
])
def test_wrong_units_are_refused_with_file_and_path(load, old, new, words):
    assert old in UNITS
    with pytest.raises(TableError, match=words) as caught:
        load(UNITS.replace(old, new, 1))
    assert "action_units.yaml: " in str(caught.value)


@pytest.mark.parametrize(("old", "new", "words"), [
    ('"30": {jaw: {side: 2}}', "", "deformations: unit 30 is missing"),
    ('"30":', '"31":', r"deformations\.31: unknown unit '31'"),
    ('"T23":', '"23":', r"deformations\.23: unknown unit '23'"),
    ("chin: [0, 1, 0]", "chin: [1, 1, 0]", r"deformations\.17: points\.chin: a unit without sides"),
    ("side_L: [1, 1, 0]", "side_R: [1, 1, 0]", r"deformations\.17: points\.side_R: write the left"),
    ("jaw: {side: 2}", "jaw: {sid: 2}", r"deformations\.30\.jaw: unknown key 'sid'"),
    ("jaw: {side: 2}", "units: paper", r"deformations\.30: unknown key 'units'"),
    ("[1, 2, 3]", "[1, 2, .nan]", r"deformations\.12\.points\.corner_L\.2: expected a finite number"),
    ("[1, 2, 3]", "[1, 2]", r"deformations\.12\.points\.corner_L: expected three numbers"),
    ('same_as: "T23"', 'same_as: "12"', r"deformations\.B23\.same_as: refers to a unit with other sides"),
    ('same_as: "T23"', 'same_as: "T24"', r"B23\.same_as: unknown unit 'T24'; did you mean 'T23'"),
    ('same_as: "T23"', 'same_as: "B23"', "refers to itself: B23 -> B23"),
    ('same_as: "T23", scale: -0.0', 'same_as: "T23", jaw: {}', r"B23: unknown key 'jaw'"),
    ("scale: -0.0", "scale: 9", r"B23\.scale: expected a number in 0\.\.2"),
    ("units: face", "units: furlong", "units: unknown unit of length 'furlong'"),
    ("source: test", "sauce: test", "unknown key 'sauce'"),
])
def test_wrong_movements_are_refused_with_file_and_path(load, old, new, words):
    assert old in MOVES
    with pytest.raises(TableError, match=words) as caught:
        load(moves=MOVES.replace(old, new, 1))
    assert "deformations.yaml: " in str(caught.value)


def rule(text):
    return "combinations: [{" + text + ", why: x}]"


@pytest.mark.parametrize(("extra", "words"), [
    (rule('when: ["12", "18"]'), r"combinations\.0\.when\.1: unknown unit '18'"),
    (rule('when: ["12"], scale: {"12": 0.5}'), "at least two different units"),
    (rule('when: ["12", "12"], scale: {"12": 0.5}'), "at least two different units"),
    (rule('when: ["12", "17"]'), "needs one of: scale, yields, add"),
    ('combinations: [{when: ["12", "17"], scale: {"17": 0.5}}]', "the key 'why' is missing"),
    (rule('when: ["12", "17"], scale: {"23": 0.5}'), "'23' is not one of the combination"),
    (rule('when: ["12", "17"], scale: {"17": -1}'), r"scale\.17: expected a number in 0\.\.2"),
    (rule('when: ["12", "17"], yields: {"17": "23"}'), r"yields\.17: unknown partner '23'"),
    (rule('when: ["12", "17"], yields: {"23": "17"}'), "'23' is not one of"),
    (rule('when: ["12", "17"], without: ["99"], scale: {"17": 1}'), r"without\.0: unknown unit '99'"),
    (rule('when: ["12", "17"], add: {points: {a: [0]}}'), r"add\.points\.a: expected three"),
    (rule('when: ["17", "23"], add: {points: {a_R: [0, 1, 0]}}'), r"add: points\.a_R: write the"),
    (rule('when: ["12", "17"], add: {units: paper, points: {a: [1, 0, 0]}}'), "add.units"),
    (rule('when: ["12", "17"], scael: {}'), "did you mean 'scale'"),
    (rule('when: ["12", "17"], scale: {"17": 1}, why: x}, {when: ["12", "17"], scale: {"17": 1}'),
     "declared twice"),
    ("combinations: {}", "combinations: expected a list"),
    ('limits: [{units: ["17", "99"], most: 1, why: x}]', r"limits\.0\.units\.1: unknown unit '99'"),
    ('limits: [{units: ["17", "23"], most: 0, why: x}]', r"limits\.0\.most: expected a number"),
    ('antagonists: [["12"]]', r"antagonists\.0: expected two units"),
    ('antagonists: [["12", "L17"]]', r"antagonists\.0\.1: unknown unit 'L17'; did you mean"),
    ("antagonist: []", "did you mean 'antagonists'"),
    ("not_shown: {a: }", r"not_shown\.a: expected a text, got nothing"),
])
def test_wrong_combinations_are_refused_with_file_and_path(load, extra, words):
    with pytest.raises(TableError, match=words) as caught:
        load(UNITS + extra + "\n")
    assert "action_units.yaml: " in str(caught.value)


def test_shipped_tables_are_read_once_and_by_path():
    assert load_units() is load_units()
    again = load_units(tables_dir() / "action_units.yaml")
    assert again.basis == TABLE.basis

"""A person's own units: read strictly, and honoured wherever a person is given."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from facegen import load_face
from facegen.animation.script import load_clip, morph
from facegen.errors import InputError, TableError
from facegen.facs.expression_table import load_person, person_from_data
from facegen.facs.expressions import resolve
from facegen.facs.person_file import read_person_data
from facegen.facs.tables import load_units
from facegen.facs.yamlfile import parse_yaml

HEAD = {"about": "Somebody.", "source": "invented"}
CORNER = {"points": {"mouth_corner_L": [0.1, 0.3, 0.0]}}


def someone(**units):
    return person_from_data({**HEAD, "units": {key.lstrip("u"): one for key, one in units.items()}})


def test_a_share_of_the_common_unit():
    person, table = someone(u12={"scale": 0.5}), load_units()
    assert set(person.units) == {"L12", "R12"}
    found = resolve("12E", person=person).deformation
    assert found == table.deformation({"12": 1.0})[0] * 0.5
    assert resolve("6E", person=person).deformation == resolve("6E").deformation


def test_one_side_goes_before_both_whatever_the_order():
    for units in ({"u12": {"scale": 0.5}, "R12": CORNER}, {"R12": CORNER, "u12": {"scale": 0.5}}):
        found = resolve("12E", person=someone(**units)).deformation
        common = load_units().basis["L12"] * 0.5
        own = person_from_data({**HEAD, "units": {"L12": CORNER}}).units["L12"].deformation
        assert found == common + own


def test_the_right_is_the_mirror_image_and_a_unit_without_sides_is_completed():
    person = someone(u12=CORNER, u17={"points": {"lip_lower_out_L": [0.1, 0.2, 0.0], "chin": [0.0, 0.1, 0.0]}})
    assert person.units["R12"].deformation.points == {"mouth_corner_R": (-0.1, 0.3, 0.0)}
    assert person.units["17"].deformation == person.units["17"].deformation.mirrored()


def test_a_unit_without_sides_may_be_crooked_if_that_is_said():
    crooked = {"points": {"chin": [0.1, 0.1, 0.0]}}
    with pytest.raises(TableError, match="midline"):
        someone(u17=crooked)
    person = someone(u17={**crooked, "sides": "asymmetric"})
    assert person.units["17"].deformation.points == {"chin": (0.1, 0.1, 0.0)}


@pytest.mark.parametrize(("units", "words"), [
    ({"12": {}}, r"units\.12: says nothing"),
    ({"12": {"scale": 9}}, r"units\.12\.scale: expected a number in 0\.\.5"),
    ({"12": {"scale": 1, "jaw": {"open": 3}}}, "scale takes the common unit's data, so it goes without jaw"),
    ({"12": {"points": {"mouth_corner_L": [1, 2]}}}, r"units\.12\.points\.mouth_corner_L: expected three numbers"),
    ({"12": {"jaws": {"open": 3}}}, "unknown key 'jaws'; did you mean 'jaw'"),
    ({"12": {"units": "millimetre", **CORNER}}, "unknown key 'units'"),
    ({"112": CORNER}, "unknown unit '112'"),
    ({"L17": CORNER}, "unknown unit 'L17'"),
    ({"23": CORNER}, "unit 23 has an upper and a lower lip: write T23 and B23"),
    ({"12": {**CORNER, "sides": "asymmetric"}}, "write L12 and R12 instead"),
    ({"12": {**CORNER, "about": 3}}, r"units\.12\.about: expected a text"),
])
def test_wrong_units_are_refused_with_their_place(units, words):
    with pytest.raises(TableError, match=words):
        person_from_data({**HEAD, "units": units}, "ada.yaml")


@pytest.mark.parametrize(("data", "words"), [
    ({"points": {"mouth_cornr_L": [0, 0.1, 0]}}, r"units\.12\.points\.mouth_cornr_L: unknown feature point .*corner_L"),
    ({"folds": {"nose_fold": 1}}, r"units\.12\.folds\.nose_fold: unknown fold"),
])
def test_a_name_that_no_face_has_is_refused_when_it_is_used(data, words):
    with pytest.raises(TableError, match=words):
        resolve("12", person=someone(u12=data))


@pytest.mark.parametrize(("name", "text", "line"), [
    ("ada.yaml", "units:\n  17: {scale: 0.5}\n  12:\n    jaw: {open: 3}\n    points:\n      chin: [0, 0.1, 0]\n"
     "      mouth_cornr_L: [0, 0.1, 0]\n", 9),
    ("ada.yaml", "units:\n  12: {points: {mouth_cornr_L: [0, 0.1, 0]}}\n", 4),
    ("ada.json", '"units": {\n"12": {"points": {\n"mouth_cornr_L": [0, 0.1, 0]}}}}', 3)])
def test_a_file_that_names_no_point_is_refused_when_it_is_read(tmp_path, name, text, line):
    path = tmp_path / name
    head = "about: a\nsource: b\n" if name.endswith("yaml") else '{"about": "a", "source": "b", '
    path.write_text(head + text)
    said = rf"line {line}: units\.12\.points\.mouth_cornr_L: unknown feature point .* did you mean 'mouth_corner_L'"
    with pytest.raises(TableError, match=f"^{re.escape(str(path))}: {said}"):
        load_person(path)
    with pytest.raises(TableError, match=f"^{re.escape(name)}: {said}"):
        read_person_data(path.read_bytes(), name)
    path.write_text(path.read_text().replace("cornr", "corner"))
    assert load_person(path).units


def test_a_face_moves_as_the_person_and_the_rest_as_everybody():
    face, person = load_face(), someone(u12={"scale": 0.5})
    assert np.allclose(face.pose("12E", person=person, detail=0), face.pose({"12": 0.5}, detail=0), atol=1e-9)
    assert np.array_equal(face.pose("4E", person=person, detail=0), face.pose("4E", detail=0))


def test_a_clip_shows_the_person_at_every_moment_and_mirrored():
    person = someone(L12={"scale": 0.5}, u45={"lids": {"upper_L": 0.5}})
    script = {"keyframes": [{"t": 0, "pose": "neutral"}, {"t": 1, "pose": "12E"}, {"t": 2, "pose": "12E+45E"}]}
    clip = load_clip(script, person=person)
    for t in (0.0, 0.3, 1.0, 1.5, 2.0):
        wanted = resolve(clip.units_at(t) or "neutral", person=person).deformation
        assert clip.at(t).deformation == wanted
    assert clip.mirrored().at(1.0).deformation == clip.at(1.0).deformation.mirrored()
    both = [resolve("12", person=one) for one in (person, None)]
    with pytest.raises(InputError, match="a clip shows one person"):
        morph(*both)
    assert morph(both[0], both[0]).own == both[0].own


def test_an_animation_of_the_base_face_has_the_person_in_its_shapes(tmp_path):
    from facegen.animation.animated import save_animation
    from facegen.face.face import load_face as load

    person = someone(u12={"points": {"mouth_corner_L": [0.1, 0.5, 0.2]}})
    clip = load_clip({"keyframes": [{"t": 0, "pose": "neutral"}, {"t": 1, "pose": "12E"}]}, person=person)
    path = save_animation(clip, tmp_path / "a.glb", detail=0, fps=2).path
    made, face = load(path), load_face()
    moved = made.motion("AU12_L") + made.motion("AU12_R")
    wanted = face.pose("12E", person=person, detail=0) - face.pose(detail=0)
    assert np.linalg.norm(moved, axis=1).max() == pytest.approx(np.linalg.norm(wanted, axis=1).max(), rel=0.05)


@pytest.fixture(scope="module")
def avatar():
    from facegen.animation.animated import as_avatar

    return as_avatar(load_face(), {}, 0)[0]


def test_an_avatar_shows_less_of_a_shape_for_less_of_a_unit(avatar):
    weights = avatar.shape_weights(avatar.resolve("12E", person=someone(u12={"scale": 0.25})))
    assert weights == {"AU12_L": 0.25, "AU12_R": 0.25}
    assert avatar.shape_weights(avatar.resolve("12E", person=someone(u12={"scale": 0.0}))) == {}


def test_an_avatar_shows_another_movement_as_well_as_its_shapes_can(avatar):
    person = someone(u12={"points": dict(load_units().basis["L2"].points)})      # her 12 lifts the brows
    found = avatar.resolve("12E", person=person)
    assert avatar.check(found) == ()
    weights = avatar.shape_weights(found)
    assert max(weights, key=weights.get) in ("AU2_L", "AU2_R")
    assert weights.get("AU12_L", 0.0) < 0.05
    nearest = avatar.pose({"2": 1.0}) - avatar.pose()
    moved = avatar.pose("12E", person=person) - avatar.pose()
    assert np.vdot(moved, nearest) > 0.9 * np.linalg.norm(moved) * np.linalg.norm(nearest)


def test_the_head_of_a_person_on_an_avatar_turns_as_on_a_face(avatar):
    person = someone(u51={"head": {"yaw": 7.0}})
    assert avatar.head_angles(avatar.resolve("51E", person=person))[0] == pytest.approx(7.0)
    assert avatar.check(avatar.resolve("51E", person=person)) == ()


def test_expressions_as_shapes_are_the_persons_and_units_are_everybodys():
    from facegen.blendshapes.recipes import shape_set

    person = someone(u12={"scale": 0.5})
    assert shape_set("units", person) == shape_set("units")
    own, common = shape_set("expressions", person), shape_set("expressions")
    assert own["happiness"].deformation == (resolve("happiness", person=person).deformation,)
    assert own["happiness"].members == {} != common["happiness"].members
    assert own["anger"] == common["anger"]


def test_a_batch_draws_the_person_and_knows_when_the_person_changed(tmp_path):
    from facegen.jobs.picture import picture_tasks
    from facegen.jobs.spec import read_batch

    def batch(text):
        (tmp_path / "ada.yaml").write_text("about: A.\nsource: s\nunits:\n" + text)
        (tmp_path / "jobs.yaml").write_text("people: [ada.yaml]\nposes: [12E, 4E]\nsizes: [64]\n"
                                            "detail: 0\nrenderer: soft\n")
        for folder in ("images", "labels"):
            (tmp_path / folder).mkdir(exist_ok=True)
        made = read_batch(tmp_path / "jobs.yaml")
        return picture_tasks(tmp_path, ["a", "b"], list(made.pictures), made.settings)

    half, same = batch("  12: {scale: 0.5}\n")
    full, again = batch("  12: {scale: 0.9}\n")
    assert half.fingerprint != full.fingerprint
    assert same.fingerprint == again.fingerprint            # 4 is everybody's
    pictures = {}
    for name, task in (("half", half), ("full", full)):
        task.make()
        pictures[name] = (tmp_path / task.file).read_bytes()
    assert pictures["half"] != pictures["full"]


def test_the_table_of_the_docs_is_one():
    text = (Path(__file__).parents[2] / "docs" / "tables.md").read_text()
    person = person_from_data(parse_yaml(re.search(r"```yaml\n(name: Ada.*?)```", text, re.S)[1], "tables.md"))
    assert resolve("grin", person=person).expression is person.expressions["happiness"]
    assert resolve("R12E", person=person).deformation == person.units["R12"].deformation
    assert resolve("4", person=person).deformation == resolve("4").deformation * 0.5


def test_explain_and_people_tell(tmp_path):
    from facegen.cli.app import app

    path = tmp_path / "ada.yaml"
    path.write_text('name: Ada\nabout: A.\nsource: s\nunits:\n  12: {scale: 0.5}\n')
    assert load_person(path).name == "Ada"
    run = CliRunner().invoke(app, ["explain", "12", "--person", str(path)])
    assert "moves otherwise than the common table: L12, R12" in run.output
    run = CliRunner().invoke(app, ["explain", "12", "--person", str(path), "--json"])
    assert json.loads(run.output)["own"] == ["L12", "R12"]

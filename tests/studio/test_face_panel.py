"""The Face tab without a browser: what a person does, and what the work and the face then are."""

import base64
import io

import numpy as np
import pytest
from fake_client import FakeClient
from PIL import Image

import facegen
from facegen.face.chain import chain
from facegen.studio.chain_words import chain_markdown
from facegen.studio.desk import Desk
from facegen.studio.face_panel import FacePanel
from facegen.studio.figure import SCALE
from facegen.studio.page import FACE, Page
from facegen.studio.take_away import command, movements, picture, view_of
from facegen.studio.thumbnails import SIZE, Thumbnails
from facegen.studio.vocabulary import search, vocabulary
from facegen.studio.work import FaceWork


@pytest.fixture
def page(tmp_path):
    made = Page(FakeClient(), "work-of-one", Desk(tmp_path), {"Face": FacePanel})
    made.client.gui.find("Script")
    yield made
    made.close()


def find(page, label):
    return page.client.gui.find(label)


def shown(page):
    assert page.stage.settle()
    return page.stage.figures[FACE].vertices


def wrong(page):
    return [one.content for one in page.client.gui.made if one.kind == "markdown" and one.visible
            and "Not shown yet" in one.content]


def test_a_picture_is_clicked_mixed_and_undone(page):
    find(page, "happiness").press()
    assert page.work.face.blend == {"happiness": 1.0}
    assert shown(page) == pytest.approx(page.rig.pose("happiness"))
    find(page, "Click adds to the mixture").enter(True)
    find(page, "surprise").press()
    find(page, "Happiness").enter(0.25)
    assert page.work.face.blend == {"happiness": 0.25, "surprise": 0.5}
    assert shown(page) == pytest.approx(page.rig.pose(facegen.blend(page.work.face.blend)))
    find(page, "surprise").press()                      # once more: it leaves
    assert page.work.face.blend == {"happiness": 0.25}
    page.undo()
    assert find(page, "Surprise").value == 0.5
    find(page, "Click adds to the mixture").enter(False)
    find(page, "neutral").press()
    assert page.work.face.script == "0"
    assert page.work.face.blend == {}


def test_a_slider_moves_its_unit_and_the_names_are_forgotten(page):
    find(page, "happiness").press()
    find(page, "Jaw dropped (26)").enter(0.4)
    assert page.work.face.script == "6D+12E+25D+26=0.4"
    assert page.work.face.blend == {}
    assert find(page, "Script").value == page.work.face.script
    assert not find(page, "Lip corners up, left (L12)").visible
    find(page, "Left and right apart").enter(True)
    find(page, "Lip corners up, left (L12)").enter(0.1)
    assert "L12=0.1+R12E" in page.work.face.script
    find(page, "Left and right apart").enter(False)
    assert find(page, "Lip corners up, left (L12)").visible         # its sides differ
    assert not find(page, "Lip corners down, left (L15)").visible


def test_a_wrong_script_is_told_where_and_stays_for_mending(page):
    box = find(page, "Script")
    box.enter("R12A+R14A")
    box.enter("R12A+R14A+")
    text, = wrong(page)
    assert "a unit is missing after the last separator\n  R12A+R14A+\n           ^" in text
    assert box.value == "R12A+R14A+"
    assert page.work.face.script == "R12A+R14A"
    assert page.client.notices == []                    # no notice at every key
    find(page, "Intensity").enter(0.5)                  # something else changes
    assert box.value == "R12A+R14A+"
    box.enter("12c")                                    # as a person writes it, and it stays so
    assert (box.value, page.work.face.script, wrong(page)) == ("12c", "12C", [])
    page.undo()
    assert box.value == "R12A+R14A"


def test_raw_movements_are_text_too(page):
    box = find(page, "Raw movements")
    box.enter("jaw: {open: 12, sid: 1}")
    assert "did you mean 'side'" in wrong(page)[0]
    assert page.work.face.raw == {}
    box.enter("points: {no_such_point: [1, 2, 3]}")
    assert "no_such_point" in wrong(page)[0]
    assert page.work.face.raw == {}
    box.enter("jaw: {open: 12}")
    assert wrong(page) == []
    assert shown(page) == pytest.approx(page.rig.pose({"jaw": {"open": 12}}))
    box.enter("")
    assert page.work.face.raw == {}


def test_a_person_does_it_their_way(page):
    person = next(one for one in facegen.people() if "happiness" in facegen.load_person(one).expressions)
    find(page, "happiness").press()
    common = page.work.face.script
    find(page, "Person").enter(person)
    assert page.work.face.script != common
    assert page.work.face.units == facegen.resolve("happiness", person=person).units


def test_eyes_follow_the_point_that_is_dragged(page):
    find(page, "Eyes follow a point").enter(True)
    control = next(one for one in page.client.scene.made if one.kind == "transform_controls" and not one.removed)
    ahead = np.array(control.position) / SCALE
    assert ahead[2] > page.rig.mesh().vertices[:, 2].max()          # before the face, where one can take it
    control.__dict__["position"] = tuple((ahead + np.array([80.0, 30.0, 0.0])) * SCALE)
    control.press()
    eyes = facegen.look_at(page.rig, [page.work.face.gaze[axis] for axis in "xyz"])
    assert eyes["yaw_L"] > 5.0
    assert shown(page) == pytest.approx(page.rig.pose(facegen.Deformation(eyes=eyes)))
    find(page, "Eyes left (61)").enter(1.0)             # whatever else moves them
    assert shown(page) == pytest.approx(page.rig.pose(facegen.Deformation(eyes=eyes)))
    page.client.camera.position = (3.0, 1.0, 6.0)
    find(page, "Point").enter("look at me")
    assert [page.work.face.gaze[axis] for axis in "xyz"] == pytest.approx([300.0, 100.0, 600.0])
    find(page, "Eyes follow a point").enter(False)
    assert control.removed
    assert shown(page) == pytest.approx(page.rig.pose("61E"))


def test_chance_and_rest(page):
    find(page, "Start from").enter("by chance")
    seed = int(find(page, "Chance").value)
    assert page.work.face.units == facegen.random_expression(seed)
    find(page, "Chance").enter(7)
    assert page.work.face.units == facegen.random_expression(7)
    find(page, "Start from").enter("at rest")
    assert shown(page) == pytest.approx(page.rig.mesh().vertices)


@pytest.mark.parametrize(("text", "finds"), [
    ("joy", "happiness"), ("crying", "sadness_crying"), ("Happily Surprised", "happily_surprised"), ("smirk", "smirk"),
    ("rest", "neutral"), ("", "boredom")])
def test_search_finds_names_and_synonyms(text, finds):
    assert finds in search(vocabulary(), text)


def test_search_hides_what_it_does_not_find(page):
    find(page, "Search").enter("crying")
    assert find(page, "sadness crying").visible
    assert not find(page, "happiness").visible
    find(page, "Search").enter("xyzzy")
    assert any("Nothing is called *xyzzy*" in one.content for one in page.client.gui.made
               if one.kind == "markdown" and one.visible)


def test_thumbnails_are_drawn_once_and_show_the_expression(tmp_path):
    faults, rig = [], facegen.load_face()
    wanted = {"neutral": {}, "wide": facegen.parse("27E"), "again": facegen.parse("27E")}

    def draw():
        got = {}
        thumbnails = Thumbnails(tmp_path, faults.append)
        thumbnails.ask(rig, wanted, got.__setitem__)
        assert thumbnails.settle()
        thumbnails.close()
        return got

    first = draw()
    files = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*.jpg")}
    assert len(files) == 2                              # known by their units
    assert draw() == first
    assert {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*.jpg")} == files
    assert faults == []
    neutral, wide = (np.asarray(Image.open(io.BytesIO(base64.b64decode(first[name].partition(",")[2]))), int)
                     for name in ("neutral", "wide"))
    assert neutral.shape == (SIZE, SIZE, 3)
    upper, lower = slice(None, SIZE // 3), slice(SIZE // 2, None)
    assert np.abs(neutral - wide)[lower].mean() > 8 > np.abs(neutral - wide)[upper].mean()


def test_the_command_and_the_file_show_the_same_again(tmp_path):
    rig = facegen.load_face()
    face = FaceWork(units=facegen.parse("12C+R46D"), intensity=0.5)
    assert command(face) == "facegen render 12C+R46D --intensity 0.5 -o face.png"
    raw = FaceWork(units=facegen.parse("12C"), raw={"units": "millimetre", "jaw": {"open": 8.0}}, intensity=0.5,
                   gaze={"x": 100.0, "y": 0.0, "z": 300.0})
    assert command(raw, size="1024") == "facegen render face.yaml --size 1024 -o face.png"
    path = tmp_path / "face.yaml"
    path.write_text(movements(raw, raw.meaning(rig=rig), rig))
    assert rig.pose(str(path)) == pytest.approx(rig.pose(raw.meaning(rig=rig)), abs=1e-6)
    with pytest.raises(facegen.InputError, match="nothing moves yet"):
        movements(FaceWork(), FaceWork().meaning(), rig)


def test_the_picture_is_the_renderers():
    rig, meaning = facegen.load_face(), facegen.resolve("happiness")
    pixels = np.asarray(Image.open(io.BytesIO(picture(rig, meaning, "96x64", (20.0, 5.0)))))
    assert np.array_equal(pixels, facegen.render(rig, "happiness", size=(96, 64), view=(20.0, 5.0)))

    class Camera:
        position, look_at = (1.0, 0.0, 1.0), (0.0, 0.0, 0.0)

    assert view_of(Camera) == pytest.approx((45.0, 0.0))


def test_the_chain_tells_every_step():
    rig = facegen.load_face()
    text = chain_markdown(chain(facegen.resolve("1D+4D"), rig), {"sadness": 0.5})
    assert "50% sadness" in text
    assert "`1` 0.8 inner brows up: inner ends of the brows rise" in text
    assert "1 with 4: raised inner ends stop the brow from sinking" in text
    assert "brow_inner_L" in text

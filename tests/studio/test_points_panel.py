"""The tab of points: what is dragged lands where it is put; what is saved is read back; what cannot be is told."""

import threading
from types import SimpleNamespace

import numpy as np
import pytest
from fake_client import FakeClient

from facegen import load_face
from facegen.facs.deformation import load_deformation
from facegen.studio import raw as raws
from facegen.studio.desk import Desk
from facegen.studio.page import FACE, Page
from facegen.studio.points_panel import PointsPanel, read_raw, said
from facegen.studio.tables_panel import TablesPanel
from facegen.studio.work import FaceWork, Work

PANELS = {"Points": PointsPanel, "Tables": TablesPanel}


@pytest.fixture
def desk(tmp_path):
    return Desk(tmp_path)


@pytest.fixture
def opened(desk):
    pages = []

    def start(face=None, name="work"):
        if face is not None:
            desk.store.save(name, Work(face=face))
        page = Page(FakeClient(), name, desk, PANELS)
        pages.append(page)
        return page

    yield start
    for page in pages:
        page.close()


def place(page, point):
    assert page.stage.settle()
    return page.rig.feature_point_places(page.stage.figures[FACE].vertices)[point]


def grips(page):
    found, = (one for one in page.client.scene.made if one.label == "/points/grips" and not one.removed)
    return found


def drag(page, point, by, steps=3):
    """Drag a point by (3,), mm, as a mouse does: it takes the ball a little beside its middle."""
    names = list(page.rig.feature_points)
    figure, at = page.stage.figures[FACE], place(page, point) + np.array([0.4, 0.3, 0.2])
    for k, phase in enumerate(["start", *["update"] * steps, "end"]):
        to = at + np.array(by) * min(k / steps, 1.0)
        grips(page).press(instance_index=names.index(point), phase=phase, start_position=figure.place(at),
                          end_position=figure.place(to))


def shown(page):
    page.client.gui.find("Show feature points").enter(True)
    return page


@pytest.mark.parametrize("face", [
    FaceWork(), FaceWork(rig="akimoto-1986"),
    FaceWork(units={"12": 0.8, "26": 0.6, "51": 0.9, "55": 0.5}, intensity=0.5, raw={"head": {"pitch": 10.0}}),
    FaceWork(units={"12": 1.0}, person="mika", raw={"units": "face", "points": {"mouth_corner_L": [0.0, 0.1, 0.0]}}),
])
def test_a_point_lands_where_it_is_dragged_whatever_else_the_face_does(opened, face):
    page = shown(opened(face))
    before = place(page, "mouth_corner_L"), place(page, "mouth_corner_R")
    drag(page, "mouth_corner_L", [3.0, 2.0, 1.0])
    assert place(page, "mouth_corner_L") == pytest.approx(before[0] + [3.0, 2.0, 1.0], abs=0.01)
    assert np.linalg.norm(place(page, "mouth_corner_R") - before[1]) > 1.0
    assert page.client.gui.find("Point").value == said("mouth_corner_L", page.rig)
    assert page.client.notices == []
    units = face.raw.get("units", "face") if face.raw else "millimetre"
    assert page.work.face.raw["units"] == units
    page.undo()
    assert page.work.face.raw.get("points", {}) == face.raw.get("points", {})


def test_one_side_alone(opened):
    page = shown(opened())
    page.client.gui.find("Both sides together").enter(False)
    drag(page, "mouth_corner_L", [0.0, 4.0, 0.0])
    assert set(page.work.face.raw["points"]) == {"mouth_corner_L"}
    assert place(page, "mouth_corner_R") == pytest.approx(
        page.rig.feature_point_places(page.rig.mesh().vertices)["mouth_corner_R"], abs=1e-9)


def test_points_that_take_no_vector_say_so_and_stay(opened):
    page = shown(opened(FaceWork(rig="akimoto-1986")))
    drag(page, "chin", [0.0, -5.0, 0.0])
    assert "takes no vector" in page.client.notices[0][1]
    assert not page.work.face.raw.get("points")


def test_numbers_put_back_and_units_of_length(opened):
    page = shown(opened())
    gui, names = page.client.gui, list(page.rig.feature_points)
    grips(page).press(instance_index=names.index("chin"))
    gui.find("Moved by hand (mm)").enter((5.0, -3.0, 1.0))
    assert page.work.face.raw["points"] == {"chin": [0.0, -3.0, 1.0]}           # in the middle, both sides together
    gui.find("Jaw opens (degrees)").enter(7.5)
    gui.find("Jaw forward (mm)").enter(2.0)
    gui.find("Upper lid, left (1 = closed)").enter(0.5)
    before = place(page, "chin")
    gui.find("Measured in").enter("fractions of the face")
    assert page.work.face.raw["units"] == "face"
    assert page.work.face.raw["jaw"]["forward"] == pytest.approx(2.0 / 44.8, abs=1e-4)
    assert place(page, "chin") == pytest.approx(before, abs=0.01)
    assert gui.find("Jaw forward (mm)").value == pytest.approx(2.0, abs=0.01)
    gui.find("Put back").enter("this point")
    assert "points" not in page.work.face.raw
    assert page.work.face.raw["lids"] == {"upper_L": 0.5, "upper_R": 0.5}
    gui.find("Put back").enter("everything here")
    assert page.work.face.raw == {"units": "face"}


@pytest.mark.parametrize("rig", ["akimoto", "akimoto-1986"])
def test_what_is_downloaded_is_read_back_the_same(opened, tmp_path, rig):
    page = shown(opened(FaceWork(rig=rig, units={"12": 0.7, "1": 0.3})))
    drag(page, "mouth_corner_L", [2.0, 3.0, 0.0])
    page.client.gui.find("Jaw opens (degrees)").enter(5.0)
    files = []
    for what in ("what was moved here", "the whole pose, action units too"):
        page.client.gui.find("Save").enter(what)
        page.client.gui.find("Download deformation data").press()
        files.append(page.client.downloads["deformation.yaml"])
    for content, wanted in zip(files, (page.work.face.deformation, page.meaning()), strict=True):
        path = tmp_path / "made.yaml"
        path.write_bytes(content)
        if wanted is page.work.face.deformation:
            assert load_deformation(path) == wanted
        assert page.rig.pose(path, detail=0) == pytest.approx(page.rig.pose(wanted, detail=0), abs=1e-9)
        raw = page.work.face.raw
        page.client.gui.find("Put back").enter("everything here")
        page.client.gui.find("Open deformation data").enter(SimpleNamespace(name="made.yaml", content=content))
        assert load_deformation(path) == page.work.face.deformation
        page.change("back", face=FaceWork(rig=rig, units={"12": 0.7, "1": 0.3}, raw=raw))


@pytest.mark.parametrize(("name", "content", "words"), [
    ("a.yaml", b"points: {mouth_cornr_L: [1, 2, 3]}", "mouth_corner_L"),
    ("a.yaml", b"points: {mouth_corner_L: [1, 2]}", "three numbers"),
    ("a.yaml", b"\xff\xfe", "not UTF-8"), ("a.json", b"{", "line 1"), ("a.yaml", b"about: nothing", "no deformation"),
    ("a.yaml", b"#" * 5_000_000, "larger than 4 MB"), ("a.yaml", b"a: &x [*x]", "anchors"),
])
def test_files_that_will_not_do_are_refused_and_change_nothing(opened, name, content, words):
    page = opened()
    page.client.gui.find("Open deformation data").enter(SimpleNamespace(name=name, content=content))
    assert words in page.client.notices[0][1]
    assert page.work.face == FaceWork()


def test_names_of_the_paper_are_read():
    raw = read_raw("a.yaml", b"units: millimetre\npoints: {F8: [1, 2, 3]}")
    assert raws.with_own_names(raw, load_face("akimoto-1986"))["points"] == {"mouth_corner_L": [1.0, 2.0, 3.0]}
    assert raws.strangers({"points": {"F8": [1, 2, 3], "brow_mid_L": [1, 2, 3]}}, load_face("akimoto-1986")) == \
        ("brow_mid_L",)


def test_nothing_moved_and_nothing_chosen_are_told(opened):
    page = shown(opened())
    page.client.gui.find("Download deformation data").press()
    page.client.gui.find("Put back").enter("this point")
    page.change("weak", face=FaceWork(intensity=0.0))
    drag(page, "mouth_corner_L", [1.0, 0.0, 0.0])
    said = [text for _, text in page.client.notices]
    assert "nothing is moved here yet" in said[0]
    assert "none is chosen" in said[1]
    assert all("raise it on the tab Face" in text for text in said[2:])


def test_regions_centre_and_axis_ride_on_the_face(opened):
    page = shown(opened(FaceWork(rig="akimoto-1986")))
    gui, scene = page.client.gui, page.client.scene
    gui.find("Show centre O and the jaw's axis").enter(True)
    ball, = (one for one in scene.made if one.label == "/points/centre")
    at = np.array(ball.position)
    assert at == pytest.approx(page.stage.figures[FACE].place(page.rig.centre))
    gui.find("Head turns to the left (degrees)").enter(40.0)
    page.stage.settle()
    assert np.linalg.norm(ball.position - at) > 0.05
    gui.find("Regions").enter("tinted")
    for thread in threading.enumerate():            # the task that works out where they lie
        if thread.name.startswith("facegen studio: Where"):
            thread.join(20)
    tints = [one for one in scene.made if one.label.startswith("/points/tint") and not one.removed]
    assert len(tints) >= 3
    before = [one.vertices.copy() for one in tints]
    gui.find("Jaw opens (degrees)").enter(15.0)
    page.stage.settle()
    assert any((one.vertices != old).any() for one, old in zip(tints, before, strict=True))
    gui.find("Regions").enter("hidden")
    assert all(one.removed for one in tints)


def test_a_face_is_changed_under_the_points(opened):
    page = shown(opened())
    page.client.gui.find("Show centre O and the jaw's axis").enter(True)
    drag(page, "brow_mid_L", [0.0, 3.0, 0.0])
    page.change("1986", face=FaceWork(rig="akimoto-1986", raw=page.work.face.raw))
    assert page.stage.settle()
    assert page.client.notices == []
    assert len(grips(page).batched_positions) == 15
    told = next(one for one in page.client.gui.made if one.kind == "markdown")
    assert "2 of the moved points are not on this face and left out" in told.content

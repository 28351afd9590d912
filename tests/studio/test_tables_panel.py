"""The workshop: a new person, a recipe and a unit changed, seen on several faces, shown as a diff, saved."""

import threading
from types import SimpleNamespace

import pytest
from fake_client import FakeClient

from facegen.facs.expression_table import load_person
from facegen.facs.expressions import resolve
from facegen.studio.desk import Desk
from facegen.studio.page import FACE, Page
from facegen.studio.points_panel import PointsPanel
from facegen.studio.tables_panel import TablesPanel
from facegen.studio.work import FaceWork, TableWork, Work

PANELS = {"Points": PointsPanel, "Tables": TablesPanel}


@pytest.fixture
def page(tmp_path):
    made = Page(FakeClient(), "work", Desk(tmp_path), PANELS)
    yield made
    made.close()


def find(page, label):
    return page.client.gui.find(label)


def ada(page):
    find(page, "Name").enter("Ada")
    find(page, "New person").press()
    return page


def wait(page):
    for thread in threading.enumerate():
        if thread.name.startswith("facegen studio: The faces"):
            thread.join(20)
    assert page.stage.settle()


def save(page):
    find(page, "Save ...").press()
    asked = [one for one in page.client.gui.made if getattr(one, "label", "") == "Save this"]
    asked[-1].press()                               # in the window that opened last


def test_from_a_new_person_to_a_file_that_everything_reads(page, tmp_path):
    ada(page)
    assert page.work.table.file == "ada.yaml"
    find(page, "Expression").enter("happiness")
    find(page, "Action units").enter("6B+L12E")
    find(page, "Use this recipe").press()
    find(page, "Action unit").enter("Brow lowerer (4)")
    find(page, "How much (1 = as everybody)").enter(0.5)
    path = tmp_path / "work" / "people" / "ada.yaml"
    assert not path.exists()
    find(page, "Save ...").press()
    shown = [one.content for one in page.client.gui.made if one.kind == "markdown" and "```diff" in one.content]
    assert '+  "4": {scale: 0.5}' in shown[0]
    assert not path.exists()
    find(page, "Cancel").press()
    assert not path.exists()
    save(page)
    person = load_person(path)
    assert (person.name, person.units["L4"].scale) == ("Ada", 0.5)
    assert set(person.expressions["happiness"].units) == {"6", "L12"}
    assert page.desk.people("work")[-1] == "ada.yaml"
    page.change("person", face=FaceWork(units={"4": 1.0}, person="ada.yaml"))
    assert page.stage.settle()
    assert page.stage.figures[FACE].vertices == pytest.approx(page.rig.pose("4E", person=path))
    assert not [text for title, text in page.client.notices if title == "That did not work"]


def test_a_change_is_seen_at_once_on_several_faces_and_the_own_face_comes_back(page):
    ada(page)
    find(page, "Show several faces").enter(True)
    wait(page)
    assert [name for name in page.stage.figures if name.startswith("several/")] == \
        ["several/akimoto", "several/akimoto-1986"]
    assert all(one.visible is False for one in page.client.scene.made if str(one.label).startswith(f"/figures/{FACE}/"))
    find(page, "Expression").enter("anger")
    find(page, "Action units").enter("12E")
    find(page, "Use this recipe").press()
    find(page, "Strength").enter(0.5)
    wait(page)
    for name in ("akimoto", "akimoto-1986"):
        figure = page.stage.figures[f"several/{name}"]
        assert figure.vertices == pytest.approx(page.desk.face(name, "work").pose("12E", intensity=0.5))
    page.undo()
    wait(page)
    assert page.stage.figures["several/akimoto"].vertices == pytest.approx(page.rig.pose("anger", intensity=0.5))
    find(page, "Show several faces").enter(False)
    wait(page)
    assert list(page.stage.figures) == [FACE]
    assert all(one.visible for one in page.client.scene.made
               if str(one.label).startswith(f"/figures/{FACE}/") and not one.removed)
    assert page.stage.figures[FACE].vertices == pytest.approx(page.rig.pose())


def test_a_unit_is_laid_on_points_dragged_and_taken(page):
    ada(page)
    find(page, "Lay it on the tab Points").press()
    assert page.stage.settle()
    assert page.stage.figures[FACE].vertices == pytest.approx(page.rig.pose("12E"), abs=0.01)
    raw = page.work.face.raw
    raw = {**raw, "points": {**raw["points"], "brow_mid_L": [0.0, 5.0, 0.0], "brow_mid_R": [0.0, 5.0, 0.0]}}
    page.change("drag", face=FaceWork(raw=raw))
    find(page, "Take what the tab Points has").press()
    person = page.work.table.person
    assert set(person.units) == {"L12", "R12"}
    wanted = page.rig.pose(FaceWork(raw=raw).deformation)
    assert page.rig.pose("12E", person=person) == pytest.approx(wanted, abs=0.01)
    find(page, "Move it as everybody").press()
    assert page.work.table.person is None


def test_an_expression_of_her_own(page):
    ada(page)
    find(page, "Or a new expression").enter("Ada Maybe")
    find(page, "Action units").enter("L2D+14C")
    find(page, "Add the new expression").press()
    assert find(page, "Expression").value == "ada_maybe"
    assert resolve("ada maybe", person=page.work.table.person).units == {"L2": 0.8, "14": 0.5}
    find(page, "As everybody does it").press()
    assert find(page, "Expression").value == "happiness"
    assert page.work.table.person is None


def test_what_is_wrong_is_told_and_changes_nothing(page):
    told = page.client.notices
    find(page, "Use this recipe").press()
    assert "nobody's table is open" in told[-1][1]
    find(page, "New person").press()
    assert "expected" in told[-1][1]
    ada(page)
    table = page.work.table
    find(page, "Action units").enter("6F")
    find(page, "Use this recipe").press()
    assert "intensity is A-E" in told[-1][1]
    find(page, "Or a new expression").enter("anger")
    find(page, "Add the new expression").press()
    assert "already" in told[-1][1]
    find(page, "Take what the tab Points has").press()
    assert "nothing moves" in told[-1][1]
    find(page, "Save ...").press()
    assert "no habit in it yet" in told[-1][1]
    for name, content, words in (("x.yaml", b"about: a", "missing"), ("x.yaml", b"\xff", "UTF-8"),
                                 ("x.yaml", b"#" * 5_000_000, "larger than 4 MB")):
        find(page, "Open a table from this computer").enter(SimpleNamespace(name=name, content=content))
        assert words in told[-1][1]
    assert page.work.table == table


def test_tables_are_opened_copied_and_downloaded_with_their_comments(page, tmp_path):
    content = b"# hers\nabout: A.\nsource: s\nunits:\n  4: {scale: 0.5}   # gentle\n"
    find(page, "Open a table from this computer").enter(SimpleNamespace(name="../Eve.yaml", content=content))
    assert page.work.table.file == "eve.yaml"
    save(page)
    path = tmp_path / "work" / "people" / "eve.yaml"
    path.write_bytes(content)
    find(page, "Table of").enter("eve.yaml")
    find(page, "Action unit").enter("Lip corner puller (12)")
    find(page, "How much (1 = as everybody)").enter(1.5)
    find(page, "Download the table").press()
    assert page.client.downloads["eve.yaml"] == content + b'  "12": {scale: 1.5}\n'
    find(page, "Table of").enter("a copy of mika")
    assert page.work.table.data["name"] == "Mika"
    assert resolve("grin", person=page.work.table.person).units == resolve("grin", person="mika").units


def test_a_work_keeps_its_table_and_refuses_a_broken_one():
    table = TableWork("ada.yaml", {"name": "Ada", "about": "a", "source": "s", "units": {"12": {"scale": 0.5}}})
    work = Work(table=table)
    assert Work.read(work.plain()) == work
    from facegen.errors import TableError
    with pytest.raises(TableError, match="expected a number"):
        Work.read(Work(table=TableWork("ada.yaml", {**table.data, "units": {"12": {"scale": 50}}})).plain())


def test_a_table_that_was_broken_meanwhile_does_not_lock_out_of_the_work(page, tmp_path):
    ada(page)
    find(page, "Expression").enter("happiness")
    find(page, "Action units").enter("6B+L12E")
    find(page, "Use this recipe").press()
    save(page)
    page.close()
    (tmp_path / "work" / "people" / "ada.yaml").write_text("name: [Ada")
    again = Page(FakeClient(), "work", Desk(tmp_path), PANELS)
    assert again.work == page.work
    assert any("ada.yaml** cannot be read" in str(getattr(one, "content", "")) for one in again.client.gui.made)
    again.close()

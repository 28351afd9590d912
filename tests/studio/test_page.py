"""A page: what a person does changes the work, what the program does not; faults are told; tasks can be stopped."""

import json
import threading
import time

import pytest
from fake_client import FakeClient

from facegen.errors import InputError
from facegen.studio.desk import Desk
from facegen.studio.page import FACE, Page
from facegen.studio.task import Stopped, Task
from facegen.studio.work import FaceWork


class Script:
    """A panel of one text."""

    def __init__(self, page):
        self.page, self.closed = page, False
        self.text = page.client.gui.add_text("Script", page.work.face.script)
        self.text.on_update(page.calls(self.written))

    def written(self):
        from facegen.facs.notation import parse
        self.page.change("script", face=FaceWork(units=parse(self.text.value)))

    def refresh(self, work):
        self.text.value = work.face.script

    def close(self):
        self.closed = True


@pytest.fixture
def desk(tmp_path):
    return Desk(tmp_path)


def opened(desk, name="work-of-one"):
    return Page(FakeClient(), name, desk, {"Face": Script})


def test_what_is_entered_is_shown_saved_and_undone(desk, tmp_path):
    page = opened(desk)
    page.client.gui.find("Script").enter("R12A+R14A")
    assert page.work.face.script == "R12A+R14A"
    assert page.stage.settle()
    assert page.stage.figures[FACE].vertices == pytest.approx(page.rig.pose("R12A+R14A"))
    page.undo()
    assert page.client.gui.find("Script").value == "0"
    page.redo()
    page.close()
    saved = json.loads((tmp_path / "work-of-one" / "work.json").read_text())
    assert saved["face"]["units"] == page.work.face.units != {}
    again = opened(desk)
    assert again.work == page.work
    assert again.stage.settle()
    assert again.stage.figures[FACE].vertices == pytest.approx(page.rig.pose("R12A+R14A"))
    again.close()


def test_a_wrong_script_is_told_and_changes_nothing(desk):
    page = opened(desk)
    page.client.gui.find("Script").enter("12D")
    page.client.gui.find("Script").enter("12F")
    (_, said), = page.client.notices
    assert "intensity is A-E" in said
    assert page.work.face.script == "12D"
    page.close()


def test_a_fault_of_ours_is_told_and_logged_and_the_page_lives(desk, caplog):
    page = opened(desk)

    def broken():
        raise ZeroDivisionError("by accident")

    button = page.client.gui.add_button("Broken")
    button.on_click(page.calls(broken))
    button.press()
    assert "by accident" in page.client.notices[0][1]
    assert "by accident" in caplog.text
    page.client.gui.find("Script").enter("12D")
    assert page.work.face.script == "12D"
    page.close()


def test_what_the_program_sets_calls_nothing(desk):
    page, called = opened(desk), []
    call = page.calls(lambda: called.append(1))
    from types import SimpleNamespace
    call(SimpleNamespace(client=None))
    call(SimpleNamespace(client=page.client))
    assert called == [1]
    page.close()


def test_an_unknown_face_is_refused_and_one_that_went_away_is_replaced(desk):
    page = opened(desk)
    with pytest.raises(InputError, match="akimoto"):
        page.change("face", face=FaceWork(rig="akimot"))
    assert page.work.face.rig == "akimoto"
    page.close()
    from facegen.studio.work import Work
    desk.store.save("gone", Work(face=FaceWork(rig="mine.glb")))
    other = opened(desk, "gone")
    assert "base face is shown instead" in other.client.notices[0][1]
    assert other.rig is desk.face("akimoto", "gone")
    other.close()


def test_two_pages_keep_apart(desk):
    one, two = opened(desk, "one"), opened(desk, "two")
    one.client.gui.find("Script").enter("12D")
    assert two.work.face.script == "0"
    assert two.client.gui.find("Script").value == "0"
    assert one.rig is two.rig
    one.close()
    two.close()


def test_a_task_says_how_far_it_is_gives_its_result_and_tidies_up(desk, monkeypatch):
    monkeypatch.setattr("facegen.studio.task._LINGERS", 0.1)
    page, got = opened(desk), []
    task = Task(page, "Count", lambda report: [report(f"{k}", k / 3) for k in range(3)] and 42, got.append)
    assert task.wait(10)
    assert got == [42]
    parts = [one for one in page.client.gui.made if one.kind in ("progress_bar", "button")]
    assert not any(one.visible for one in parts)
    until = time.monotonic() + 10.0
    while not all(one.removed for one in parts) and time.monotonic() < until:
        time.sleep(0.02)
    assert all(one.removed for one in parts)
    page.close()


def test_a_task_can_be_stopped_and_its_result_is_dropped(desk):
    page, got, seen = opened(desk), [], []
    begun, pressed = threading.Event(), threading.Event()

    def job(report):
        begun.set()
        pressed.wait(10)
        try:
            report("on", 0.5)
        except Stopped:
            seen.append("stopped")
            raise
        return 1

    task = Task(page, "Endless", job, got.append)
    begun.wait(10)
    page.client.gui.find("Stop").press()
    pressed.set()
    assert task.wait(10)
    assert (got, seen) == ([], ["stopped"])
    assert page.client.notices[-1][0] == "Endless: stopped"
    page.close()


def test_a_task_that_fails_is_told(desk):
    page = opened(desk)

    def job(report):
        raise InputError("avatar: no triangles")

    assert Task(page, "Rig", job, lambda result: None).wait(10)
    assert page.client.notices == [("That did not work", "avatar: no triangles")]
    page.close()


def test_the_same_is_not_said_again_and_again(desk):
    page = opened(desk)
    for _ in range(30):
        page.client.gui.find("Script").enter("12F")
    assert len(page.client.notices) == 1
    page.client.gui.find("Script").enter("99")
    assert len(page.client.notices) == 2
    page.close()

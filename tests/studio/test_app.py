"""Windows of one work go along with each other; other works keep apart; what cannot be saved is told in its windows."""

import threading
from types import SimpleNamespace

import pytest
from fake_client import FakeClient

from facegen.errors import FileError
from facegen.studio.app import Studio
from facegen.studio.work import FaceWork


class Nothing:
    """A panel of nothing."""

    def __init__(self, page):
        pass

    def refresh(self, work):
        pass

    def close(self):
        pass


@pytest.fixture
def windows(tmp_path):
    """A studio without a server, and what opens a window of a work."""
    made = Studio(tmp_path, panels={"Nothing": Nothing})
    clients = {}
    made.server = SimpleNamespace(viser=SimpleNamespace(get_clients=lambda: clients), stop=lambda: None)

    def opened(work):
        client = FakeClient()
        client.client_id = len(clients)
        clients[client.client_id] = client
        made._came(client, work)
        return made.pages[client.client_id]

    yield made, opened
    made.stop()


def settled(studio):
    """Wait until no window has anything to take over."""
    for follower in tuple(studio._followers.values()):
        assert follower.settle()


def test_windows_of_one_work_go_along_and_others_do_not(windows):
    studio, opened = windows
    one, two, other = opened("one-work"), opened("one-work"), opened("another")
    one.change("smile", face=FaceWork(units={"12": 0.5}))
    settled(studio)
    assert two.work == one.work
    assert other.work.face.units == {}
    assert two.stage.settle()
    assert two.stage.figures["face"].vertices == pytest.approx(one.rig.pose("AU12=0.5"))
    two.undo()                                          # what came from the other window can be taken back in this one
    settled(studio)
    assert one.work.face.units == {}
    studio._went(two.client, "one-work")
    one.change("brows", face=FaceWork(units={"1": 0.5}))
    settled(studio)
    assert two.work.face.units == {}


def test_two_windows_that_change_at_once_end_alike_or_as_the_last_said_and_never_stop(windows):
    studio, opened = windows
    pages = [opened("one-work"), opened("one-work")]

    def drag(page, unit):
        for k in range(20):
            page.change("drag", thing=unit, face=FaceWork(units={unit: k / 20}))

    threads = [threading.Thread(target=drag, args=pair) for pair in zip(pages, ("1", "12"), strict=True)]
    for one in threads:
        one.start()
    for one in threads:
        one.join(30)
        assert not one.is_alive()
    settled(studio)
    pages[0].change("last", face=FaceWork(units={"4": 1.0}))
    settled(studio)
    assert pages[1].work == pages[0].work


def test_what_cannot_be_saved_is_told_in_the_windows_of_the_work(windows):
    studio, opened = windows
    one, other = opened("one-work"), opened("another")
    studio.desk.store._failed("one-work", FileError("work.json: no space left"))
    assert one.client.notices[-1][0] == "Your work cannot be saved"
    assert other.client.notices == []


def test_a_task_that_ends_after_its_page_changes_nothing(windows):
    studio, opened = windows
    old = opened("one-work")
    studio._went(old.client, "one-work")                # the page was loaded again
    new = opened("one-work")
    new.change("smile", face=FaceWork(units={"12": 0.5}))
    old.change("an upload was read", face=FaceWork(units={"4": 1.0}))
    settled(studio)
    studio.desk.store.flush()
    assert studio.desk.store.load("one-work")[0] == new.work
    assert new.work.face.units == {"12": 0.5}


def test_a_window_that_opens_while_another_changes_has_the_change(windows, monkeypatch):
    studio, opened = windows
    one = opened("one-work")
    load = studio.desk.store.load

    def late(name):
        found = load(name)
        monkeypatch.setattr(studio.desk.store, "load", load)
        one.change("meanwhile", face=FaceWork(units={"12": 0.5}))
        return found

    monkeypatch.setattr(studio.desk.store, "load", late)
    assert opened("one-work").work == one.work

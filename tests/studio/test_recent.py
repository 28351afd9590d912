"""What is kept in memory: so much of it, nothing twice, and never without what is still in use."""

import gc
import threading

import pytest
from hypothesis import given
from hypothesis import strategies as st

from facegen.studio import desk as desks
from facegen.studio.desk import FACES, Desk
from facegen.studio.recent import Recent


class Thing:
    pass


@given(st.lists(st.tuples(st.integers(0, 6), st.booleans())), st.integers(1, 4))
def test_it_keeps_the_latest_used_and_what_is_held(asked, most):
    recent, order, held, made = Recent(most), [], {}, []
    for key, holds in asked:
        known = key in held or key in order[-most:]
        found = recent.get(key, lambda key=key: made.append(key) or Thing())
        assert (made.pop() if made else None) == (None if known else key)
        order = [*(one for one in order if one != key), key]
        assert held.get(key, found) is found
        if holds:
            held[key] = found
        else:
            held.pop(key, None)
        del found
        gc.collect(0)
    assert len(recent._kept) == min(most, len(order))


def test_two_who_ask_at_once_get_one_and_others_do_not_wait():
    recent, go, made = Recent(2), threading.Event(), []

    def make():
        made.append(Thing())
        go.wait(10)
        return made[-1]

    found = []
    threads = [threading.Thread(target=lambda: found.append(recent.get("a", make))) for _ in range(3)]
    for thread in threads:
        thread.start()
    other = recent.get("b", Thing)
    assert not found
    go.set()
    for thread in threads:
        thread.join(10)
    assert found == made * 3
    assert recent.get("b", Thing) is other


def test_what_failed_is_tried_again():
    recent, one = Recent(2), Thing()
    with pytest.raises(ZeroDivisionError):
        recent.get("a", lambda: 1 / 0)
    assert recent.get("a", lambda: one) is one
    recent.forget("a")
    assert recent.get("a", Thing) is not one


def test_a_desk_drops_old_faces_but_none_that_a_page_shows(tmp_path, monkeypatch):
    loaded = []
    monkeypatch.setattr(desks, "load_face", lambda path: loaded.append(path.name) or Thing())
    desk = Desk(tmp_path)
    folder = tmp_path / "work-of-one" / FACES
    folder.mkdir(parents=True)
    names = [f"{k}.glb" for k in range(desks._FACES + 3)]
    for name in names:
        (folder / name).write_bytes(b"")
    shown = desk.face(names[0], "work-of-one")
    for name in names:
        desk.face(name, "work-of-one")
    assert loaded == names
    gc.collect()
    assert desk.face(names[0], "work-of-one") is shown, "a page shows it"
    desk.face(names[-1], "work-of-one")
    assert loaded == names
    desk.face(names[1], "work-of-one")
    assert loaded == [*names, names[1]], "nobody had it for long"
    assert len(desk._faces._kept) == desks._FACES

"""What a fork does for a process is what the process would have done itself."""

import multiprocessing
import os
import signal
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from facegen import forked
from facegen.forked import Aside, for_each, may_fork, shared_zeros
from facegen.transfer.rig import _Last, rig

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="only Linux has forks that are harmless")


@pytest.fixture
def two_processes(monkeypatch):
    """As on two cores, whatever this machine has."""
    monkeypatch.setattr(forked, "may_fork", lambda: not forked._is_fork)
    before = children()
    yield
    assert children() <= before                     # none is left behind


def children():
    """Return the numbers of this process's children, the dead that nobody asked after among them."""
    threads = Path("/proc/self/task").iterdir()
    return {number for thread in threads for number in (thread / "children").read_text().split()}


def by_the_fork(i):
    """Take so long that both processes get some of the things."""
    time.sleep(0.02)
    return i, forked._is_fork


@pytest.mark.usefixtures("two_processes")
def test_each_thing_is_done_and_both_do_some():
    done = for_each(12, by_the_fork)
    assert [i for i, _ in done] == list(range(12))
    assert {fork for _, fork in done} == {False, True}
    assert for_each(0, by_the_fork) == []
    assert for_each(1, by_the_fork) == [(0, False)]


@pytest.mark.usefixtures("two_processes")
def test_both_write_into_one_array():
    array, own = shared_zeros((10, 3)), np.zeros(10)

    def work(i):
        time.sleep(0.01)
        array[i] = own[i] = i

    for_each(10, work)
    assert np.array_equal(array, np.arange(10.0)[:, None] * np.ones(3))
    assert not own[-1], "what is not shared stays with the fork"


@pytest.mark.usefixtures("two_processes")
def test_arrays_come_back_whole_and_are_ones_own():
    numbers = np.arange(24.0).reshape(2, 3, 4)
    made = {"plain": numbers, "other way": np.asfortranarray(numbers), "every other": numbers[:, ::2],
            "none": np.ones(0), "words": np.array(["a", "b"]), "beside": [numbers.astype("<f4")[0], "text"]}
    files = len(os.listdir("/proc/self/fd"))
    with Aside(lambda: made) as later:
        found = later.result()
    for name in ("plain", "other way", "every other", "none", "words"):
        assert found[name].dtype == made[name].dtype
        assert np.array_equal(found[name], made[name])
    assert np.array_equal(found["beside"][0], made["beside"][0])
    found["plain"] += 1                             # ours to change
    with Aside(lambda: found["plain"].__iadd__(1)) as later:
        assert later.result()[0, 0, 0] == 2
    assert found["plain"][0, 0, 0] == 1
    found = None
    assert len(os.listdir("/proc/self/fd")) == files


@pytest.mark.usefixtures("two_processes")
@pytest.mark.parametrize("end", [lambda: os._exit(3), lambda: os.kill(os.getpid(), signal.SIGKILL), lambda: 1 / 0])
def test_what_a_fork_does_not_finish_is_done_here(end):
    def work(i):
        time.sleep(0.01)
        if forked._is_fork:
            end()
        return i

    assert for_each(6, work) == list(range(6))
    with Aside(lambda: work(7)) as later:
        assert later.forked
        assert later.result() == 7


@pytest.mark.usefixtures("two_processes")
def test_a_fork_that_hangs_is_not_waited_for(monkeypatch):
    monkeypatch.setattr(forked, "_AT_LEAST", 0.1)

    def work(i):
        if forked._is_fork:
            time.sleep(60)
        return i

    since = time.monotonic()
    assert for_each(4, work) == list(range(4))
    assert time.monotonic() - since < 30


@pytest.mark.usefixtures("two_processes")
def test_an_error_is_raised_wherever_it_happens():
    def work(i):
        time.sleep(0.01)
        if i == 9:
            raise ValueError("nine")
        return i

    with pytest.raises(ValueError, match="nine"):
        for_each(10, work)
    with Aside(lambda: work(9)) as later, pytest.raises(ValueError, match="nine"):
        later.result()


@pytest.mark.usefixtures("two_processes")
def test_who_listens_may_stop_it():
    told = []

    def listen(stage, share):
        told.append((stage, share))
        if len(told) == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        for_each(50, by_the_fork, progress=listen, stage="counting")
    assert [stage for stage, _ in told] == ["counting"] * 2
    assert told[0][1] < told[1][1] < 0.2


@pytest.mark.usefixtures("two_processes")
def test_an_avatar_is_the_same_bit_for_bit(tmp_path, monkeypatch):
    monkeypatch.setattr("facegen.transfer.rig._last", _Last())
    two = rig("cartoon", tmp_path / "two.glb", sets=["arkit"], cache=False)
    monkeypatch.setattr("facegen.transfer.rig._last", _Last())
    monkeypatch.setattr(forked, "may_fork", lambda: False)
    one = rig("cartoon", tmp_path / "one.glb", sets=["arkit"], cache=False)
    assert one.path.read_bytes() == two.path.read_bytes()
    assert one.found.halves
    for name, contact in one.found.contacts.items():
        assert np.array_equal(contact.after, two.found.contacts[name].after)


def test_when_a_fork_may_be(monkeypatch):
    monkeypatch.setattr(os, "sched_getaffinity", lambda pid: {0, 1})
    monkeypatch.setattr(threading, "active_count", lambda: 1)
    assert may_fork()
    with monkeypatch.context() as patch:
        patch.setattr(sys, "platform", "darwin")
        assert not may_fork()
    with monkeypatch.context() as patch:
        patch.setattr(os, "sched_getaffinity", lambda pid: {0})
        assert not may_fork()
    with monkeypatch.context() as patch:
        patch.setattr(multiprocessing, "parent_process", lambda: "a worker has one")
        assert not may_fork()
    with monkeypatch.context() as patch:
        patch.setattr(threading, "active_count", lambda: 2)
        assert not may_fork()
    asked = []
    other = threading.Thread(target=lambda: asked.append(may_fork()))
    other.start()
    other.join()
    assert asked == [False]

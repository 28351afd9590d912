"""Turns: the order of a page's handlers, against a list; pages do not wait for each other."""

from __future__ import annotations

import threading
import time
from concurrent.futures import ThreadPoolExecutor

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from facegen.studio.turns import Turns


class Hands:
    """An executor whose work is done when the test says so."""

    def __init__(self):
        self.waiting = []

    def submit(self, work, *args):
        self.waiting.append((work, args))

    def work(self):
        while self.waiting:
            work, args = self.waiting.pop(0)
            work(*args)


jobs = st.lists(st.tuples(st.sampled_from("ab"), st.sampled_from([None, "smile", "brow"])), max_size=30)


@settings(deadline=None)
@given(jobs)
def test_the_newest_of_each_value_runs_in_order_and_buttons_all(jobs):
    hands, ran = Hands(), []
    turns = Turns(hands.submit)
    for i, (page, latest) in enumerate(jobs):
        turns.submit(page, lambda i=i: ran.append(i), latest)
    hands.work()
    for page in "ab":
        own = [i for i, (one, _) in enumerate(jobs) if one == page]
        slow: list[int] = []        # the obvious way: a list in which a newer value takes the older one's place
        for i in own:
            at = len(slow)
            while at and jobs[i][1] is not None and jobs[slow[at - 1]][1] is not None:
                at -= 1
                if jobs[slow[at]][1] == jobs[i][1]:
                    slow[at] = i
                    break
            else:
                slow.append(i)
        assert [i for i in ran if jobs[i][0] == page] == slow


def test_one_at_a_time_for_a_page_and_side_by_side_for_two():
    running, most, met = [], [], threading.Barrier(2, timeout=10)
    with ThreadPoolExecutor(8) as pool:
        turns = Turns(pool.submit)

        def work(page):
            running.append(page)
            most.append(running.count(page))
            met.wait()              # both pages are in here at once, or this fails
            running.remove(page)

        found = [turns.submit(page, lambda page=page: work(page)) for _ in range(5) for page in "ab"]
        for one in found:
            one.result(10)
    assert max(most) == 1


def test_a_fault_is_the_futures_and_the_next_runs():
    hands = Hands()
    turns = Turns(hands.submit)
    bad, good = turns.submit(1, lambda: 1 / 0), turns.submit(1, lambda: 5)
    hands.work()
    with pytest.raises(ZeroDivisionError):
        bad.result(0)
    assert good.result(0) == 5


def test_too_many_waiting_are_left_out_and_a_page_that_goes_is_forgotten():
    hands, ran = Hands(), []
    turns = Turns(hands.submit, waiting=3)
    found = [turns.submit(1, lambda i=i: ran.append(i)) for i in range(5)]
    assert [one is None for one in found] == [False, False, False, True, True]
    turns.clear(1)
    turns.submit(1, lambda: ran.append("last"))
    hands.work()
    assert ran == ["last"]
    assert all(one.done() for one in found[:3])
    assert not turns._waiting


def test_a_pool_that_takes_no_more_is_no_fault():
    pool = ThreadPoolExecutor(1)
    turns = Turns(pool.submit)
    begun, go = threading.Event(), threading.Event()
    turns.submit(1, lambda: (begun.set(), go.wait(10)))
    second = turns.submit(1, lambda: 1)
    begun.wait(10)
    pool.shutdown(wait=False)
    go.set()
    end = time.monotonic() + 10
    while not second.done():
        assert time.monotonic() < end
        time.sleep(0.01)
    assert turns.submit(2, lambda: 1).done()
    assert not turns._waiting

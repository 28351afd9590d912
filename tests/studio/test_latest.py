"""What is worked out beside a page: the latest question counts, and a fault stops nothing."""

import threading

from facegen.studio.latest import Latest


def test_of_what_is_asked_meanwhile_only_the_last_is_done():
    go, begun, done = threading.Event(), threading.Event(), []

    def slow():
        begun.set()
        go.wait(10)
        done.append("slow")

    latest = Latest("test", done.append)
    latest.ask(slow)
    assert begun.wait(10)
    for number in range(5):
        latest.ask(lambda number=number: done.append(number))
    assert not latest.settle(0.01)
    go.set()
    assert latest.settle()
    assert done == ["slow", 4]
    latest.close()


def test_a_fault_is_told_and_the_next_question_answered():
    faults, done = [], []
    latest = Latest("test", faults.append)
    latest.ask(lambda: 1 / 0)
    assert latest.settle()
    latest.ask(lambda: done.append(1))
    assert latest.settle()
    assert [type(fault) for fault in faults] == [ZeroDivisionError]
    assert done == [1]
    latest.close()
    latest.ask(lambda: done.append(2))
    assert latest.settle(1.0)
    assert done == [1]

"""Playing is true to time: what is drawn is what is due, whatever the drawing takes."""

import threading
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from facegen.studio.transport import Run, Transport

seconds = st.floats(0.01, 100.0)


@given(start=st.floats(0.0, 1.0), elapsed=st.floats(0.0, 1000.0), speed=st.floats(0.1, 4.0), duration=seconds)
def test_time_runs_round_and_round_or_to_the_end(start, elapsed, speed, duration):
    start *= duration
    t, again, over = Run(start, 5.0, speed, True, duration).at(5.0 + elapsed)
    assert 0.0 <= t <= duration
    assert not over
    assert again * duration + t == pytest.approx(start + speed * elapsed, abs=1e-6)
    t, again, over = Run(start, 5.0, speed, False, duration).at(5.0 + elapsed)
    assert again == 0
    assert t == pytest.approx(min(start + speed * elapsed, duration), abs=1e-6)
    assert over == (t == duration)


class Clock:
    now = 100.0

    def __call__(self):
        return self.now


class Stage:
    """Draws when told to, as a slow machine does."""

    def __init__(self):
        self.pose, self.asked = None, 0

    def request(self, name, pose):
        self.pose, self.asked = pose, self.asked + 1

    def on_shown(self, name, call):
        return lambda: None


class Line:
    """A motion whose vertices are its time."""

    def __init__(self, duration):
        self.duration = duration

    def on(self, rig):
        if rig == "broken":
            raise ValueError("this rig shows nothing")
        return lambda t: np.array([t])


@pytest.fixture
def played():
    page, clock = SimpleNamespace(stage=Stage(), rig="any"), Clock()
    told = []
    transport = Transport(page, told=lambda: None, began=lambda t: told.append(("began", t)),
                          stopped=lambda: told.append("stopped"), clock=clock)
    yield SimpleNamespace(transport=transport, page=page, clock=clock, told=told)
    transport.close()


def drawn(played):
    return float(played.page.stage.pose()[0])


def test_a_slow_picture_shows_its_own_time_and_not_that_of_its_request(played):
    played.transport.load(Line(10.0))
    played.transport.play(speed=2.0, loop=True)
    played.transport.show()
    played.clock.now += 1.5
    assert drawn(played) == pytest.approx(3.0)
    played.clock.now += 1.0
    assert drawn(played) == pytest.approx(5.0)
    played.transport.stop()
    played.clock.now += 1.0
    assert drawn(played) == pytest.approx(5.0)
    assert played.told == [("began", 0.0), "stopped"]


def test_seeking_stops_and_stays_within_the_motion(played):
    played.transport.load(Line(2.0))
    played.transport.play(speed=1.0, loop=True)
    played.transport.seek(99.0)
    assert not played.transport.playing
    assert drawn(played) == 2.0
    played.transport.play(speed=1.0, loop=False)            # from the end it begins at the start
    assert drawn(played) == 0.0


def test_round_and_round_begins_its_sound_again(played):
    played.transport.load(Line(2.0))
    played.transport.play(speed=1.0, loop=True)
    played.clock.now += 2.5
    played.transport.show()
    drawn(played)
    assert [name for name in played.told if name != "stopped"] == [("began", 0.0), ("began", pytest.approx(0.5))]


def test_another_motion_goes_on_where_the_time_was(played):
    played.transport.load(Line(10.0))
    played.transport.play(speed=1.0, loop=True)
    played.clock.now += 4.0
    played.transport.show()
    drawn(played)
    played.transport.load(Line(8.0))
    assert played.transport.playing
    played.transport.show()
    assert drawn(played) == pytest.approx(4.0)
    played.transport.load(None)
    assert not played.transport.playing


def test_a_rig_that_cannot_show_it_is_told_once(played):
    played.page.rig = "broken"
    played.transport.load(Line(2.0))
    played.transport.play(speed=1.0, loop=True)
    played.transport.show()
    with pytest.raises(ValueError, match="shows nothing"):
        played.page.stage.pose()
    assert not played.transport.playing


def test_its_thread_ends(played):
    before = set(threading.enumerate())
    one = Transport(played.page, told=lambda: None)
    mine, = (each for each in threading.enumerate() if each not in before)
    one.close()
    mine.join(30.0)
    assert not mine.is_alive()

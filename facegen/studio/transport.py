"""Plays a motion on a page's face: true to time, the latest moment first; frames are left out, never put off."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

from facegen.animation.motion import Motion
from facegen.studio.page import FACE, Page
from facegen.studio.stage import LEAST

TOLD = 0.1
"""Seconds from word to word of where the head of time is: more would fill the wire and tell an eye no more."""

_COUNTED = 1.5          # seconds of pictures that are counted

Shown = Callable[[float], NDArray]


@dataclass(frozen=True)
class Run:
    """Time that runs: from ``start`` s of a motion on, begun at ``begun`` of a clock."""

    start: float
    begun: float
    speed: float
    loop: bool
    duration: float

    def at(self, now: float) -> tuple[float, int, bool]:
        """Return the motion's time, how often it began again, and whether it is over."""
        t = self.start + (now - self.begun) * self.speed
        if t < self.duration:
            return t, 0, False
        return (t % self.duration, int(t // self.duration), False) if self.loop else (self.duration, 0, True)


class Transport:
    """``head``: where it stands, seconds; ``playing``; ``rate``: pictures a second that were shown.

    told: called about ten times a second while it plays, from a thread of its own; began: with the motion's time when
    it starts to play or begins again, stopped: when it stops.
    """

    def __init__(self, page: Page, *, told: Callable[[], None], began: Callable[[float], None] = lambda t: None,
                 stopped: Callable[[], None] = lambda: None, clock: Callable[[], float] = time.monotonic) -> None:
        self._page, self._told, self._began, self._stopped, self._clock = page, told, began, stopped, clock
        self.motion: Motion | None = None
        self.head = 0.0
        self._run: Run | None = None
        self._pose: tuple[Any, Any, Shown] | None = None
        self._pictures: deque[float] = deque(maxlen=256)
        self._changed = threading.Condition(threading.RLock())
        self._closed = False
        self._off = page.stage.on_shown(FACE, lambda _: self._pictures.append(self._clock()))
        threading.Thread(target=self._work, name="facegen studio transport", daemon=True).start()

    @property
    def playing(self) -> bool:
        """Whether time runs."""
        return self._run is not None

    @property
    def duration(self) -> float:
        """Seconds of the motion, 0 without one."""
        return 0.0 if self.motion is None else self.motion.duration

    @property
    def rate(self) -> float:
        """Pictures a second of the last moments."""
        now = self._clock()
        recent = [each for each in tuple(self._pictures) if now - each <= _COUNTED]
        return (len(recent) - 1) / (recent[-1] - recent[0]) if len(recent) > 2 and recent[-1] > recent[0] else 0.0

    def load(self, motion: Motion | None) -> None:
        """Have another motion; time goes on where it was, as far as there is any."""
        with self._changed:
            if motion is self.motion:
                return
            run, self.motion = self._run, motion
            self.head = min(self.head, self.duration)
            if run is not None:
                self._run = None
                if motion is not None:
                    self._start(run.speed, run.loop)
                else:
                    self._stopped()

    def play(self, *, speed: float, loop: bool) -> None:
        """Let time run from the head on, from the beginning if it stands at the end. Does nothing without a motion."""
        with self._changed:
            if self.motion is None:
                return
            if self.head >= self.duration - LEAST / 2:
                self.head = 0.0
            self._pictures.clear()
            self._start(speed, loop)

    def stop(self) -> None:
        """Let time stand, and show where it stands."""
        with self._changed:
            if self._halt():
                self.show()

    def seek(self, t: float) -> None:
        """Stop, go to a time and show it."""
        with self._changed:
            self._halt()
            self.head = min(max(float(t), 0.0), self.duration)
            self.show()

    def show(self) -> None:
        """Show the moment at the head."""
        with self._changed:
            motion, rig = self.motion, self._page.rig
            if motion is not None:
                self._page.stage.request(FACE, lambda: self._moment(motion, rig))

    def close(self) -> None:
        """End its thread."""
        with self._changed:
            self._closed, self._run = True, None
            self._off()
            self._changed.notify_all()

    def _halt(self) -> bool:
        with self._changed:
            if self._run is None:
                return False
            self._now()
            self._run = None
            self._stopped()
            return True

    def _start(self, speed: float, loop: bool) -> None:
        self._run = Run(self.head, self._clock(), speed, loop, self.duration)
        self._began(self.head)
        self._changed.notify_all()

    def _moment(self, motion: Motion, rig: Any) -> NDArray:
        try:
            return self._posed(motion, rig)(self._now())
        except Exception:
            self._halt()                        # told once, not thirty times a second
            raise

    def _posed(self, motion: Motion, rig: Any) -> Shown:
        """Return what makes vertices of a motion's times on a rig; prepared once, where pictures are made."""
        kept = self._pose
        if kept is None or kept[0] is not motion or kept[1] is not rig:
            self._pose = kept = motion, rig, motion.on(rig)
        return kept[2]

    def _now(self) -> float:
        """Return the motion's time now: what is drawn is what is due when it is drawn."""
        with self._changed:
            if self._run is not None:
                t, again, _ = self._run.at(self._clock())
                self.head = t
                if again:
                    self._run = Run(t, self._clock(), self._run.speed, self._run.loop, self._run.duration)
                    self._began(t)
            return self.head

    def _work(self) -> None:
        last = 0.0
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._run is not None or self._closed)
                if self._closed:
                    return
                over = self._run.at(self._clock())[2]
                self._now()
                self.show()
                if over:
                    self.stop()
                now = self._clock()
            if over or now - last >= TOLD:
                last = now
                self._told()
            time.sleep(LEAST)

"""Undo and redo: the works before and after this one."""

from __future__ import annotations

import time
from collections.abc import Callable

from facegen.studio.work import Work

STEPS = 200
"""Changes that can be undone."""

TOGETHER = 1.0
"""Seconds in which changes of one thing, such as a slider that is dragged, are one step."""


class History:
    """The works of a page in order. One caller at a time."""

    def __init__(self, work: Work, *, clock: Callable[[], float] = time.monotonic) -> None:
        self.work = work
        self._before: list[tuple[str, Work]] = []       # what each change was called, and the work before it
        self._after: list[tuple[str, Work]] = []
        self._clock = clock
        self._last: tuple[str | None, float] = (None, 0.0)

    def change(self, label: str, work: Work, *, thing: str | None = None) -> bool:
        """Go on to another work; return whether it is another.

        label: what was done, for the undo button. thing: what was changed; changes of the same thing at once are one
        step. The first change after an undo forgets what could be redone.
        """
        if work == self.work:
            return False
        now = self._clock()
        same, when = self._last
        if not (thing is not None and thing == same and now - when <= TOGETHER and self._before):
            self._before = [*self._before[-STEPS + 1:], (label, self.work)]
        self._after = []
        self._last = (thing, now)
        self.work = work
        return True

    @property
    def undoes(self) -> str | None:
        """What `undo` would take back."""
        return self._before[-1][0] if self._before else None

    @property
    def redoes(self) -> str | None:
        """What `redo` would do again."""
        return self._after[-1][0] if self._after else None

    def undo(self) -> Work:
        """Go back one step, if there is one, and return the work."""
        return self._step(self._before, self._after)

    def redo(self) -> Work:
        """Go forward one step, if there is one, and return the work."""
        return self._step(self._after, self._before)

    def _step(self, source: list[tuple[str, Work]], target: list[tuple[str, Work]]) -> Work:
        self._last = (None, 0.0)
        if source:
            label, work = source.pop()
            target.append((label, self.work))
            self.work = work
        return self.work

"""How long work tells how far it is, and how it is stopped: a function that it calls, which may raise."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from typing import TypeVar

Progress = Callable[[str, float], None]
"""Called with what is being done, such as "closing lids and lips", and the share of all that is behind, 0 to 1, which
never falls. What it raises goes through: the work stops there."""

T = TypeVar("T")


def silent(stage: str, share: float) -> None:
    """Progress that nobody wants to see."""


def within(progress: Progress, start: float, stop: float) -> Progress:
    """Return the progress of work that is a part of other work, from one share of that to another."""
    return lambda stage, share: progress(stage, start + (stop - start) * share)


def counted(progress: Progress, stage: str, things: Collection[T]) -> Iterator[T]:
    """Yield things, and tell before each how many are done."""
    for done, thing in enumerate(things):
        progress(stage, done / len(things))
        yield thing

"""Work by this process and a fork of it: two cores do in half the time what NumPy does on one.

A fork sees all that this process has, costs milliseconds, and does the same arithmetic: results are the same bit for
bit. Where it could do harm - beside other threads, in a worker, outside Linux - this process does all of the work.
"""

from __future__ import annotations

import itertools
import mmap
import os
import pickle
import select
import signal
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from facegen.progress import Progress, silent

T = TypeVar("T")

# A fork that is so many times slower than this process hangs: what it has not done is done here. Seconds are added.
_PATIENCE, _AT_LEAST = 8.0, 5.0

_is_fork = False


def shared_zeros(shape: tuple[int, ...]) -> NDArray[np.float64]:
    """Return zeros that a fork and this process write for each other."""
    size = 8 * int(np.prod(shape))
    return np.frombuffer(mmap.mmap(-1, max(size, 1)), np.float64, size // 8).reshape(shape)


def may_fork() -> bool:
    """Return whether a fork is harmless and of use: on Linux, from the only thread of a process that is nobody's
    worker, with a second core. macOS' own libraries do not survive a fork."""
    workers = sys.modules.get("multiprocessing")
    return (not _is_fork and sys.platform == "linux" and threading.active_count() == 1
            and threading.current_thread() is threading.main_thread() and len(os.sched_getaffinity(0)) > 1
            and (workers is None or workers.parent_process() is None))


def for_each(count: int, work: Callable[[int], T], *, progress: Progress = silent, stage: str = "") -> list[T]:
    """Return work(0) to work(count - 1), each done here or in a fork.

    Results of a fork come back by pickle; large ones are better written into `shared_zeros`. What work changes
    otherwise stays in the process that did it. progress, stage: told before each that is done here. An error is raised
    as it would be without a fork.
    """
    begun = memoryview(mmap.mmap(-1, max(count, 1)))            # one byte for each, seen by both

    def some(order: range, tell: Progress = silent) -> dict[int, T]:
        done = {}
        for i in order:
            if begun[i]:
                break
            begun[i] = 1
            tell(stage, (sum(begun) - 1) / count)
            done[i] = work(i)
        return done

    # From the first on, while the fork begins with the last: nobody waits, and where they meet a thing that is done
    # twice comes out the same.
    with Aside(lambda: some(range(count - 1, -1, -1)), useful=count > 1) as others:
        done = some(range(count), progress)
        if others.forked:
            done = (others.result(otherwise=dict) or {}) | done
    return [done[i] if i in done else work(i) for i in range(count)]


class Aside(Generic[T]):
    """Work in a fork while this process does other things: ``with Aside(work) as later: ...; later.result()``.

    Where a fork may not be, or does not answer, the work is done here when its result is asked for.
    """

    def __init__(self, work: Callable[[], T], *, useful: bool = True) -> None:
        """useful: whether a fork is worth its while."""
        self._work, self._since = work, time.perf_counter()
        self._child = _fork(work) if useful and may_fork() else None

    @property
    def forked(self) -> bool:
        """Whether there is a fork at work."""
        return self._child is not None

    def result(self, otherwise: Callable[[], T] | None = None) -> T:
        """Return what came of the work. otherwise: what to do where the fork does not answer, instead of the work."""
        found: list[T] = []
        if self._child is not None:
            found = _answer(self._child, _AT_LEAST + _PATIENCE * (time.perf_counter() - self._since))
        return found[0] if found else (otherwise or self._work)()

    def __enter__(self) -> Aside[T]:
        return self

    def __exit__(self, *_: object) -> None:
        if self._child is not None:
            os.close(self._child.pipe)
            os.close(self._child.store)
            os.kill(self._child.pid, signal.SIGKILL)        # it is done, or no longer needed
            os.waitpid(self._child.pid, 0)


@dataclass(frozen=True)
class _Child:
    """A fork's process number ``pid``; what it sends the result through: a ``pipe``, and a ``store`` in memory for the
    numbers of its arrays, which are many."""

    pid: int
    pipe: int
    store: int


def _answer(child: _Child, patience: float) -> list[object]:
    """Return [what the fork sent], or nothing if it failed, or sent nothing for so many seconds."""
    parts = []
    while select.select([child.pipe], [], [], patience)[0]:
        part = os.read(child.pipe, 1 << 20)
        if not part:
            with suppress(pickle.UnpicklingError, EOFError):        # it was ended amid it
                sent, sizes = pickle.loads(b"".join(parts))         # from our own fork
                return [pickle.loads(sent, buffers=_stored(child.store, sizes))]
            break
        parts.append(part)
    return []


def _stored(store: int, sizes: list[int]) -> Iterator[memoryview]:
    """Yield the arrays' numbers, of which each process that writes there has its own."""
    held = memoryview(mmap.mmap(store, sum(sizes), mmap.MAP_PRIVATE) if any(sizes) else bytearray())
    for size, end in zip(sizes, itertools.accumulate(sizes), strict=True):
        yield held[end - size:end]


def _fork(work: Callable[[], object]) -> _Child | None:
    """Return a fork that does the work; None where the system has no room for one."""
    reads, writes = os.pipe()
    try:
        store = os.memfd_create("facegen")
    except OSError:
        os.close(reads)
        os.close(writes)
        return None
    try:
        with warnings.catch_warnings():
            # Python warns of threads that are not its own: those of BLAS, which is ready for a fork.
            warnings.simplefilter("ignore", DeprecationWarning)
            pid = os.fork()
    except OSError:
        for one in (reads, writes, store):
            os.close(one)
        return None
    if pid:
        os.close(writes)
        return _Child(pid, reads, store)
    try:
        global _is_fork
        _is_fork = True
        os.close(reads)
        arrays: list[pickle.PickleBuffer] = []
        sent = pickle.dumps(work(), protocol=5, buffer_callback=arrays.append)
        with open(store, "wb") as numbers:
            sizes = [numbers.write(one.raw()) for one in arrays]
        with open(writes, "wb") as pipe:
            pickle.dump((sent, sizes), pipe, protocol=5)
    except BaseException:               # the parent meets the same error when it does the work itself
        os._exit(1)
    os._exit(0)                         # nothing of the parent's is cleaned up, flushed or told twice

"""Who does the work: processes on this machine, or any executor."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, Executor, Future, ProcessPoolExecutor
from contextlib import contextmanager
from typing import Any, Protocol

from facegen.render.request import available_cores

_MOST_PROCESSES = 61        # Windows cannot wait for more
# Libraries that start a thread for every core: in a worker they would fight for the cores of all others.
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS",
            "NUMBA_NUM_THREADS")


class Crew(Protocol):
    """Where a run hands out its chunks.

    ``slots``: chunks that can be in work at once. ``losses``: what a future raises when its worker died.
    ``deaths_a_loss``: how many workers must have died by then. ``breaks``: whether one death ends all that is in hand,
    so that `renew` is needed. ``renewable``: whether work can go on after a loss.
    """

    slots: int
    losses: tuple[type[BaseException], ...]
    deaths_a_loss: int
    breaks: bool
    renewable: bool

    def submit(self, work: Callable[..., Any], *arguments: Any) -> Future:
        """Hand out one chunk."""

    def renew(self) -> None:
        """Replace workers that are gone."""

    def stop(self) -> None:
        """Ask the workers to stop after the task in hand."""

    def close(self) -> None:
        """Wait for the workers and let go of them."""


class GivenExecutor:
    """Any executor, which stays its owner's."""

    losses = (BrokenExecutor,)
    deaths_a_loss = 1
    breaks = renewable = False

    def __init__(self, executor: Executor, slots: int | None = None) -> None:
        self.executor = executor
        self.slots = slots or getattr(executor, "_max_workers", None) or available_cores()

    def submit(self, work: Callable[..., Any], *arguments: Any) -> Future:
        """Hand out one chunk."""
        return self.executor.submit(work, *arguments)

    def renew(self) -> None:
        """Do nothing: another executor is its owner's to give."""

    def stop(self) -> None:
        """Do nothing: the owner may have other work for it."""

    def close(self) -> None:
        """Do nothing: the owner closes it."""


class LocalProcesses:
    """Processes on this machine, started afresh ("spawn"): safe beside threads, OpenGL and compiled code."""

    losses = (BrokenExecutor,)
    deaths_a_loss = 1
    breaks = renewable = True

    def __init__(self, workers: int) -> None:
        import multiprocessing

        self.slots = min(workers, _MOST_PROCESSES)
        self._context = multiprocessing.get_context("spawn")
        self._threads = max(1, available_cores() // self.slots)
        self._pool = self._new_pool()

    def submit(self, work: Callable[..., Any], *arguments: Any) -> Future:
        """Hand out one chunk; processes are started here, as they are needed."""
        with _interrupts_held():
            return self._pool.submit(work, *arguments)

    def renew(self) -> None:
        """Replace workers that are gone."""
        self._pool.shutdown(wait=True, cancel_futures=True)
        self._pool = self._new_pool()

    def stop(self) -> None:
        """Ask the workers to stop after the task in hand."""
        self._stop.set()

    def close(self) -> None:
        """Wait for the workers and let go of them."""
        self._pool.shutdown(wait=True, cancel_futures=True)

    def _new_pool(self) -> ProcessPoolExecutor:
        # A new event each time: a process killed while it looks at the old one never gives it back.
        self._stop = self._context.Event()
        return ProcessPoolExecutor(self.slots, mp_context=self._context, initializer=_begin,
                                   initargs=(self._stop, self._threads))


# -- in a worker process ----------------------------------------------------------------------------------------
_stop: Any = None


def stopping() -> bool:
    """Return whether this worker was asked to stop."""
    return _stop is not None and _stop.is_set()


def _begin(stop: Any, threads: int) -> None:
    """Set up a worker process, before anything heavy is imported."""
    global _stop
    _stop = stop
    signal.signal(signal.SIGINT, signal.SIG_IGN)        # Ctrl-C is for the one who asks us to stop
    for name in _THREADS:
        os.environ.setdefault(name, str(threads))
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """End this process when its parent is gone, even killed: else it would wait for work for ever."""
    from multiprocessing import parent_process
    from multiprocessing.connection import wait

    parent = parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)


@contextmanager
def one_interrupt() -> Iterator[None]:
    """Let one Ctrl-C through; more of them change nothing until all is put away.

    A second one would break into the first one's clean-up, with a lock held that the workers wait for.
    """
    before = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or before is not signal.default_int_handler:
        yield               # no business of ours: somebody else answers Ctrl-C, or nobody
        return

    def once(number: int, frame: Any) -> None:
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        raise KeyboardInterrupt

    signal.signal(signal.SIGINT, once)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


@contextmanager
def _interrupts_held() -> Iterator[None]:
    """Hold Ctrl-C back while processes start: they inherit this, and a half-started one would die with a traceback."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)

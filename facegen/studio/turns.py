"""A page's handlers run one after another, and no page's handlers hold up another's."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Hashable
from concurrent.futures import Future
from dataclasses import dataclass
from typing import Any

WAITING = 100       # handlers of one page that wait: a page that presses faster than it is served gets no longer queue


@dataclass
class _Job:
    work: Callable[[], Any]
    latest: Hashable | None
    future: Future[Any]


class Turns:
    """Queues over an executor, one a page.

    viser hands every handler to a pool of threads: two of one page can run at once, in any order, and a slow one leaves
    a queue of values long past. Here the handlers of one page run in the order in which they came, and of those that
    only tell of a newer value (``latest``) the newest runs.
    """

    def __init__(self, run: Callable[..., Any], waiting: int = WAITING) -> None:
        """``run`` starts a function on another thread: the submit method of an executor."""
        self._run, self._most = run, waiting
        self._lock = threading.Lock()
        self._waiting: dict[Hashable, deque[_Job]] = {}      # of each page whose handler runs now

    def submit(self, page: Hashable, work: Callable[[], Any], latest: Hashable | None = None) -> Future[Any] | None:
        """Have ``work`` run in its turn; return its Future, or None where the page has too many waiting.

        latest: takes the place of a waiting one of the same ``latest``, unless one without any stands between: what
        was set after a button was pressed is heard of after that press.
        """
        with self._lock:
            queue = self._waiting.get(page)
            if queue is None:
                self._waiting[page] = queue = deque()
                starts = True
            else:
                starts = False
                if latest is not None:
                    for job in reversed(queue):
                        if job.latest is None:
                            break
                        if job.latest == latest:
                            job.work = work
                            return job.future
                if len(queue) >= self._most:
                    return None
            queue.append(job := _Job(work, latest, Future()))
        if starts:
            self._go(page)
        return job.future

    def clear(self, page: Hashable) -> None:
        """Forget what waits for a page that went; what runs runs on."""
        with self._lock:
            queue = self._waiting.get(page)
            dropped = list(queue or ())
            if queue:
                queue.clear()
        for job in dropped:
            job.future.set_result(None)

    def _next(self, page: Hashable) -> None:
        with self._lock:
            queue = self._waiting[page]
            if not queue:
                del self._waiting[page]
                return
            job = queue.popleft()
        try:
            job.future.set_result(job.work())
        except BaseException as error:
            job.future.set_exception(error)
        with self._lock:
            if not self._waiting[page]:
                del self._waiting[page]
                return
        self._go(page)      # to the end of the pool's own queue: other pages come in between

    def _go(self, page: Hashable) -> None:
        try:
            self._run(self._next, page)
        except RuntimeError:        # the pool takes no more: the server ends
            self.clear(page)
            with self._lock:
                self._waiting.pop(page, None)

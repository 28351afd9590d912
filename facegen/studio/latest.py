"""Something that is worked out beside the page, again and again: the latest question counts."""

from __future__ import annotations

import threading
from collections.abc import Callable


class Latest:
    """A thread that does one job at a time; of those asked for meanwhile only the last.

    fault: called with an exception that a job raised.
    """

    def __init__(self, name: str, fault: Callable[[Exception], None]) -> None:
        self._fault = fault
        self._wanted: Callable[[], None] | None = None
        self._busy = self._closed = False
        self._changed = threading.Condition()
        threading.Thread(target=self._run, name=f"facegen studio {name}", daemon=True).start()

    def ask(self, job: Callable[[], None]) -> None:
        """Have a job done soon, instead of one that waits."""
        with self._changed:
            self._wanted = job
            self._changed.notify_all()

    @property
    def busy(self) -> bool:
        """Whether something is being worked out or waits."""
        with self._changed:
            return self._busy or self._wanted is not None

    @property
    def replaced(self) -> bool:
        """Whether the job that runs is wanted no more: another waits, or all ends."""
        with self._changed:
            return self._closed or self._wanted is not None

    def settle(self, timeout: float = 10.0) -> bool:
        """Wait until nothing waits or runs; return whether that came about."""
        with self._changed:
            return self._changed.wait_for(lambda: self._closed or not (self._wanted or self._busy), timeout)

    def close(self) -> None:
        """End the thread after the job it does."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()

    def _run(self) -> None:
        while True:
            with self._changed:
                self._busy = False
                self._changed.notify_all()
                self._changed.wait_for(lambda: self._wanted or self._closed)
                if self._closed:
                    return
                job, self._wanted, self._busy = self._wanted, None, True
            try:
                job()
            except Exception as error:
                self._fault(error)

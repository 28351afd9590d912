"""Something that takes seconds: it runs beside the page, says how far it is and can be stopped."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

from facegen.studio.page import Page

# Seconds until what is hidden is removed: viser's page puts updates last in a frame, and tells of an error where one
# comes for what the same frame has removed. A frame takes a busy machine a second.
_LINGERS = 3.0


_PATIENCE = 20.0        # seconds of reading after which its bar stands at half


def while_read(report: Callable[..., None]) -> Callable[[float], None]:
    """Return what `facegen.studio.apart.ask` calls while it waits: the person sees that it goes on, and can stop it."""
    def waits(seconds: float) -> None:
        report("reading" + (f", {seconds:.0f} s" if seconds >= 2.0 else ""), seconds / (seconds + _PATIENCE))

    waits(0.0)
    return waits


class Stopped(Exception):
    """Raised inside a job whose person pressed stop."""


class Task:
    """A job with a bar and a stop button where the panel stands when it is made.

    job: ``job(report) -> result``, run in a thread of its own; it calls ``report(text, share)`` often, share 0..1 or
    None where that is not known, and lets the `Stopped` that this raises pass. done: called with the result, with the
    page's lock. ended: called after it, after a fault and after a stop. A fault is told to the person.
    """

    def __init__(self, page: Page, title: str, job: Callable[[Callable[..., None]], Any],
                 done: Callable[[Any], None], ended: Callable[[], None] = lambda: None) -> None:
        self._page, self._title, self._job, self._done, self._ended = page, title, job, done, ended
        self._stop = threading.Event()
        gui = page.client.gui
        self._bar = gui.add_progress_bar(0.0, animated=True)
        self._text = gui.add_markdown(title)
        self._button = gui.add_button("Stop")
        # No `Page.calls`: who holds the page's lock is not waited for.
        self._button.on_click(lambda _: self.stop())
        self._thread = threading.Thread(target=self._run, name=f"facegen studio: {title}", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Ask it to end; its result is dropped."""
        self._stop.set()

    def wait(self, timeout: float | None = None) -> bool:
        """Wait for its end; return whether it ended."""
        self._thread.join(timeout)
        return not self._thread.is_alive()

    def report(self, text: str, share: float | None = None) -> None:
        """Show how far the job is; Stopped if it should end."""
        if self._stop.is_set():
            raise Stopped
        self._text.content = f"{self._title}: {text}"
        if share is not None:
            self._bar.value = min(max(100.0 * share, 0.0), 100.0)

    def _run(self) -> None:
        try:
            result = self._job(self.report)
            with self._page.lock:
                if not self._stop.is_set():
                    self._done(result)
        except Stopped:
            self._page.say("", f"{self._title}: stopped")
        except Exception as error:
            self._page.fault(error)
        finally:
            parts = self._bar, self._text, self._button
            with self._page.lock:
                for part in () if self._page.closed else parts:
                    part.visible = False
                self._ended()
            later = threading.Timer(_LINGERS, lambda: [part.remove() for part in parts])
            later.daemon = True
            later.start()

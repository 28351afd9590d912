"""The studio served from beginning to end: it listens, waits to be stopped, and saves."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable, Iterable
from pathlib import Path

from facegen.studio.app import Studio
from facegen.studio.files import Shelf

PORT = 8092


def serve(work: Path, host: str, port: int | None, token: str | None, folders: Iterable[str | os.PathLike[str]],
          started: Callable[[Studio], None]) -> None:
    """Serve until a signal says stop; see `facegen.studio.run`."""
    studio = Studio(work, shelf=Shelf(folders), host=host, port=PORT if port is None else port, token=token,
                    exact=port is not None)
    stop = threading.Event()
    before = {}
    if threading.current_thread() is threading.main_thread():
        for kind in (signal.SIGINT, signal.SIGTERM):
            before[kind] = signal.signal(kind, lambda *_: stop.set())
    try:
        with studio:
            started(studio)
            while not stop.wait(0.5):       # in pieces: on Windows a wait without end is not interrupted
                pass
    finally:
        for kind, handler in before.items():
            signal.signal(kind, handler)

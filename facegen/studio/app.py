"""The studio put together: the server, what its pages share, and a `Page` for each that comes."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from typing import Any

from facegen.studio.desk import Desk
from facegen.studio.files import Shelf
from facegen.studio.latest import Latest
from facegen.studio.page import Page, Panel
from facegen.studio.server import StudioServer
from facegen.studio.stage import set_scene
from facegen.studio.work import Work


class Studio:
    """A running studio. ``server``; ``desk``; ``pages``: those open, by viser's number of the client.

    folder: where works are kept. shelf: what else pages may open. panels: title of the tab -> what makes it; the usual
    ones by default. The rest is for the `StudioServer`. A context manager.
    """

    def __init__(self, folder: str | os.PathLike[str], *, panels: dict[str, Callable[[Page], Panel]] | None = None,
                 shelf: Shelf | None = None, **options: Any) -> None:
        if panels is None:
            from facegen.studio.panels import PANELS as panels
        self.desk = Desk(folder, shelf)
        self.pages: dict[int, Page] = {}
        self._panels, self._lock = panels, threading.Lock()
        self._followers: dict[int, Latest] = {}
        self.desk.store.on_failure(self._not_saved)
        self.server = StudioServer(on_page=self._came, on_page_closed=self._went, **options)

    def start(self) -> Studio:
        """Listen, and return the studio itself. Raises as `StudioServer.start` does."""
        self.server.start()
        set_scene(self.server.viser)
        return self

    def _came(self, client: Any, work: str) -> None:
        page = Page(client, work, self.desk, self._panels, self._changed)
        with self._lock:
            self.pages[client.client_id] = page
        page.follow()                       # what another window changed while this page was made
        if client.client_id not in self.server.viser.get_clients():     # it went while it was made
            self._went(client, work)

    def _went(self, client: Any, work: str) -> None:
        with self._lock:
            page = self.pages.pop(client.client_id, None)
            follower = self._followers.pop(client.client_id, None)
        if follower is not None:
            follower.close()
        if page is not None:
            page.close()

    def _of(self, work: str) -> list[Page]:
        with self._lock:
            return [page for page in self.pages.values() if page.name == work]

    def _changed(self, page: Page, work: Work) -> None:
        """Have the other windows of a work go along: one that did not would write its own over it."""
        for other in self._of(page.name):
            if other is not page:
                number = other.client.client_id
                with self._lock:
                    # In a thread of its own: the other page's lock is not waited for with this one's held.
                    follower = self._followers.get(number) or Latest("window", other.fault)
                    self._followers[number] = follower
                follower.ask(other.follow)

    def _not_saved(self, work: str, error: Exception) -> None:
        for page in self._of(work):
            page.say(f"{error}; what you do is not kept.", "Your work cannot be saved", colour="red", closes=None)

    def stop(self) -> None:
        """Close all pages, save, and listen no more."""
        self.server.stop()
        with self._lock:
            pages, self.pages = list(self.pages.values()), {}
            followers, self._followers = list(self._followers.values()), {}
        for follower in followers:
            follower.close()
        for page in pages:
            page.close()
        self.desk.store.flush()

    def __enter__(self) -> Studio:
        return self.start()

    def __exit__(self, *_: object) -> None:
        self.stop()

"""The studio, run: a server on a free port, attackers without a browser, and headless Chromium.

Tests that need viser, Playwright or Chromium are skipped without them, unless ``FACEGEN_CI`` is set, where a missing
one is a failure.
"""

from __future__ import annotations

import importlib.util
import os
import shutil
import threading
from pathlib import Path

import pytest
from studio_page import FLAGS, SIZE, StudioPage

from facegen.studio.limits import Limits
from facegen.studio.server import StudioServer

# These need what viser brings before they are so much as collected.
collect_ignore = [] if importlib.util.find_spec("viser") or os.environ.get("FACEGEN_CI") else \
    ["test_messages.py", "test_requests.py", "test_seam.py", "test_gate.py"]


def missing(what: str) -> None:
    """Skip the test, or fail it where everything must be there."""
    if os.environ.get("FACEGEN_CI"):
        pytest.fail(f"{what}: must be installed where FACEGEN_CI is set")
    pytest.skip(what)


@pytest.fixture(scope="session")
def viser():
    """viser itself."""
    try:
        import viser
    except ImportError:
        missing("viser is not installed: pip install facegen[studio]")
    return viser


@pytest.fixture
def read_here(monkeypatch):
    """What strangers sent is read in this process: test_reading.py has the other, that takes a second each."""
    from facegen.studio import reading

    monkeypatch.setattr(reading, "ask", lambda job, path, limits, wish, waits=None: reading.JOBS[job](path, wish))


@pytest.fixture
def serve(viser, tmp_path, monkeypatch):
    """A function that starts a server on a free port, in a folder of its own, and stops it after the test.

    Its arguments are those of `StudioServer`; ``server.pages`` gathers (client, work id) of each page that came, and
    ``server.gone`` of each that went.
    """
    monkeypatch.chdir(tmp_path)
    running: list[StudioServer] = []

    def start(on_page=None, **options) -> StudioServer:
        pages, gone = [], []

        def came(client, work):
            if on_page is not None:
                on_page(client, work)
            pages.append((client, work))

        options = {"host": "127.0.0.1", "port": 0, "limits": Limits(), **options}
        server = StudioServer(on_page=came, on_page_closed=lambda client, work: gone.append((client, work)), **options)
        running.append(server.start())
        server.pages, server.gone = pages, gone
        return server

    yield start
    for server in running:
        server.stop()


@pytest.fixture
def studio_server(serve) -> StudioServer:
    """A running server whose pages are empty."""
    return serve()


def wait_for_jobs() -> None:
    """Let jobs of the studio end: what one tells a page that is gone is a warning, which fails a test."""
    for thread in threading.enumerate():
        if thread.name.startswith("facegen studio: "):
            thread.join(5.0)


@pytest.fixture
def raw():
    """A function that opens a websocket of viser's protocol: ``raw(server, work, **options)``; see RawPage."""
    from studio_raw import RawPage

    opened: list[RawPage] = []

    def start(server: StudioServer, work: str = "a" * 20, **options) -> RawPage:
        opened.append(RawPage(server.port, work, **options))
        return opened[-1]

    yield start
    wait_for_jobs()
    for page in opened:
        page.close()


@pytest.fixture(scope="package")
def chromium():
    """Headless Chromium, one for all tests."""
    command = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    if command is None:
        missing("Chromium is not installed")
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        missing("Playwright is not installed")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=command, args=list(FLAGS))
        yield browser
        browser.close()


@pytest.fixture
def browser_page(chromium):
    """A function that opens the studio as a person has it: ``browser_page(server)`` -> StudioPage, drawn.

    Each call is a browser of its own, without cookies. A test fails when the console told of an error, or when anything
    was asked of another place; ``page.errors.clear()`` where that is what is tested.
    """
    opened: list[StudioPage] = []
    contexts = []

    def start(server: StudioServer, url: str | None = None, *, context=None) -> StudioPage:
        if context is None:
            context = chromium.new_context(viewport=SIZE, accept_downloads=True)
            contexts.append(context)
        page = StudioPage(context.new_page(), server.url)
        opened.append(page)
        return page.open(url)

    yield start
    said = [error for page in opened for error in page.errors]
    for context in contexts:
        context.close()
    assert not said, said


@pytest.fixture(scope="package")
def shots(tmp_path_factory) -> Path:
    """Where screenshots go: the folder that FACEGEN_SHOTS names, or one that is forgotten."""
    named = os.environ.get("FACEGEN_SHOTS")
    folder = Path(named) if named else tmp_path_factory.mktemp("shots")
    folder.mkdir(parents=True, exist_ok=True)
    return folder


@pytest.fixture(scope="session")
def thumbnails(tmp_path_factory) -> Path:
    """Where the pictures of expressions are kept: drawn once, not by each test beside what it looks at."""
    return tmp_path_factory.mktemp("thumbnails")


@pytest.fixture
def studio(viser, tmp_path, thumbnails):
    """A function that runs the whole studio on a free port, its works in a folder of its own: ``studio() -> Studio``.

    ``browser_page(studio().server)`` opens it.
    """
    running = []

    def start(**options):
        from facegen.studio.app import Studio
        from facegen.studio.palette import KEPT

        works = tmp_path / "works"
        works.mkdir(exist_ok=True)
        if not (works / KEPT).exists():
            (works / KEPT).symlink_to(thumbnails)
        made = Studio(works, **{"port": 0, **options})
        running.append(made)
        made.start()
        return made

    yield start
    wait_for_jobs()
    for one in running:
        one.stop()



"""``facegen studio``: the page in a browser."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from facegen.studio.app import Studio

Host = Annotated[str, typer.Option(
    "--host", metavar="ADDRESS", help="Where it listens; for any address but this machine's own a token is asked for.")]
Port = Annotated[int | None, typer.Option(
    "--port", metavar="N", help="0 takes any that is free. [default: 8092, or the next that is free]")]
Token = Annotated[str | None, typer.Option(
    "--token", metavar="TOKEN", envvar="FACEGEN_STUDIO_TOKEN",
    help="What a visitor must bring, in the address; 'new' makes one.")]
WorkFolder = Annotated[Path | None, typer.Option(
    "--work", metavar="FOLDER", help="Where works are kept. [default: below your own data]")]
OpenFolder = Annotated[list[Path] | None, typer.Option(
    "--open-folder", metavar="FOLDER", help="Pages may open avatars from here and below; repeatable. [default: none]")]
NoBrowser = Annotated[bool, typer.Option("--no-browser", help="Do not open a browser.")]


def studio(host: Host = "127.0.0.1", port: Port = None, token: Token = None, work: WorkFolder = None,
           open_folder: OpenFolder = None, no_browser: NoBrowser = False) -> None:
    """Shape a face and rig an avatar in the browser; Ctrl-C ends.

    For example: facegen studio
    """
    import secrets

    from facegen.studio import run
    from facegen.studio.needs import import_viser

    import_viser()      # the clear error before anything else
    _tell_on_stderr()
    run(work, host=host, port=port, token=secrets.token_urlsafe(24) if token == "new" else token,
        folders=open_folder or [], started=lambda found: _started(found, browser=not no_browser))
    print("stopped; every work is saved", file=sys.stderr)


def _started(found: Studio, *, browser: bool) -> None:
    """Say where it is, and show it."""
    from facegen.studio.listening import EVERYWHERE

    server = found.server
    print(f"facegen studio: {server.url}", flush=True)
    here = server.url_at("127.0.0.1") if server.host in EVERYWHERE else server.url
    if here != server.url:
        print(f"on this machine: {here}", flush=True)
    print(f"works are kept in {found.desk.store.folder}; Ctrl-C ends", file=sys.stderr, flush=True)
    if browser:
        import webbrowser

        webbrowser.open(here)


def _tell_on_stderr() -> None:
    """Have what was refused or failed told in a line each."""
    import logging

    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(logging.Formatter("facegen studio: %(message)s"))
    log = logging.getLogger("facegen.studio")
    log.handlers[:] = [handler]
    log.setLevel(logging.WARNING)
    log.propagate = False

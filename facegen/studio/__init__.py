"""The studio: a page on this machine where a face is shaped and an avatar is rigged.

Needs ``pip install "facegen[studio]"``. Nothing else of facegen imports it, but the command that starts it.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from facegen.studio.app import Studio


def run(work: str | os.PathLike[str] | None = None, *, host: str = "127.0.0.1", port: int | None = None,
        token: str | None = None, folders: Iterable[str | os.PathLike[str]] = (),
        started: Callable[[Studio], None] = lambda studio: None) -> None:
    """Serve the studio until Ctrl-C or an end that the system asks for; all works are saved then.

    work: the folder where works are kept, by default `works_folder`. port: 8092 by default, or the next that is free.
    token: what a visitor must bring; one is made where others could come. folders: those from which pages may open
    files. started: called once it listens. Raises InputError or FileError for an argument, FacegenError without viser.
    """
    from facegen.studio.running import serve

    serve(works_folder() if work is None else Path(work), host, port, token, folders, started)


def works_folder() -> Path:
    """Return where works are kept unless somewhere else is asked for: below the user's own data."""
    if os.name == "nt":
        told, usual = os.environ.get("LOCALAPPDATA"), Path("AppData", "Local")
    else:
        told, usual = os.environ.get("XDG_DATA_HOME"), Path(".local", "share")
    base = Path(told) if told and os.path.isabs(told) else Path.home() / usual
    return base / "facegen" / "studio"

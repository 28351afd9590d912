"""Files that appear whole or not at all."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from facegen.errors import FileError


@contextmanager
def whole_file(path: Path, what: str = "") -> Iterator[Path]:
    """Yield a draft beside ``path`` to be written, then rename it; FileError if that fails.

    An existing file is replaced whole or stays as it was. ``what`` goes before "cannot be written".
    """
    # A name of its own: threads, and machines that share the folder, may write the same file at once.
    draft = path.with_name(f".{path.name}.{os.urandom(4).hex()}.part")
    try:
        try:
            yield draft
            os.replace(draft, path)
        finally:
            draft.unlink(missing_ok=True)
    except OSError as error:
        raise FileError(f"{path}: {what}cannot be written: {error.strerror or error}") from error


def remove_drafts(paths: Iterable[Path]) -> None:
    """Remove what a killed process left beside ``paths``: drafts that were never renamed."""
    folders: dict[Path, set[str]] = {}
    for path in paths:
        folders.setdefault(path.parent, set()).add(path.name)
    for folder, names in folders.items():
        for draft in folder.glob(".*.part"):
            if draft.name[1:].rsplit(".", 2)[0] in names:
                with suppress(OSError):
                    draft.unlink()


def save_text(text: str, path: str | os.PathLike[str]) -> Path:
    """Write a text as UTF-8 with Unix line ends, whole, and return its path; FileError if it cannot be."""
    path = Path(path)
    with whole_file(path) as draft:
        draft.write_text(text, encoding="utf-8", newline="\n")
    return path


def make_folder(path: str | os.PathLike[str]) -> Path:
    """Return a folder that exists, made if need be; FileError if it cannot be."""
    path = Path(path)
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileError(f"{path}: the folder cannot be made: {error.strerror or error}") from error
    return path

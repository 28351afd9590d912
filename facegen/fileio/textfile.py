"""Files that appear whole or not at all."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from facegen.errors import FileError, nearest


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


def check_place(path: str | os.PathLike[str], suffixes: Iterable[str]) -> Path:
    """Return a path that a file of one of the suffixes can be written to, or raise FileError: ask before long work."""
    path = Path(path)
    suffix, suffixes = path.suffix.lower(), list(suffixes)
    if suffix not in suffixes:
        raise FileError(f"{path}: expected a name that ends in {', '.join(suffixes)}, "
                        f"got {suffix or 'no suffix'}{nearest(suffix, suffixes) if suffix else ''}")
    if not path.parent.is_dir():
        raise FileError(f"{path}: the folder {path.parent} does not exist; make it first")
    if path.is_dir():
        raise FileError(f"{path}: is a folder, expected a file")
    return path


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

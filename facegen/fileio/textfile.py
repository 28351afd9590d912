"""Text files that appear whole or not at all."""

from __future__ import annotations

import os
from pathlib import Path

from facegen.errors import FileError


def save_text(text: str, path: str | os.PathLike[str]) -> Path:
    """Write a text as UTF-8 with Unix line ends and return its path; FileError if it cannot be written.

    It is written beside its place and renamed, so an existing file is replaced whole or stays as it was.
    """
    path = Path(path)
    draft = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        try:
            draft.write_text(text, encoding="utf-8", newline="\n")
            os.replace(draft, path)
        finally:
            draft.unlink(missing_ok=True)
    except OSError as error:
        raise FileError(f"{path}: cannot be written: {error.strerror or error}") from error
    return path


def make_folder(path: str | os.PathLike[str]) -> Path:
    """Return a folder that exists, made if need be; FileError if it cannot be."""
    path = Path(path)
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileError(f"{path}: the folder cannot be made: {error.strerror or error}") from error
    return path

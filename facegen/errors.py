"""Every error facegen raises on purpose.

::

    FacegenError
    ├── InputError (also a ValueError)      something the caller gave is wrong
    │   ├── NotationError                   a FACS script; knows the position
    │   ├── TableError                      a YAML table or data file; knows file and key path
    │   └── FileError                       a file that cannot be read or written
    └── JobError                            workers that die, a cluster that goes away

A message says which argument is wrong, what was expected, what came, and how to mend it.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable


class FacegenError(Exception):
    """Base of all errors that facegen raises on purpose."""


class InputError(FacegenError, ValueError):
    """An argument is wrong: the message says which, what was expected and what came."""


class NotationError(InputError):
    """A FACS script cannot be read. ``position`` is the 0-based index of the offending character."""

    def __init__(self, message: str, *, text: str = "", position: int = 0) -> None:
        super().__init__(message)
        self.text = text
        self.position = position


class TableError(InputError):
    """A table or data file is wrong: the message names the file and the path of keys."""


class FileError(InputError):
    """A file cannot be read or written."""


class JobError(FacegenError):
    """Work could not be finished though the input is right: workers died, or a cluster went away."""


def nearest(name: str, valid: Iterable[str]) -> str:
    """Return ``"; did you mean 'x'?"`` for the nearest valid name, or an empty string."""
    names = [str(v) for v in valid]
    folded = {v.casefold(): v for v in names}
    close = difflib.get_close_matches(str(name).casefold(), folded, n=1, cutoff=0.55)
    return f"; did you mean '{folded[close[0]]}'?" if close else ""

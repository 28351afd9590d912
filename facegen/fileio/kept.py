"""Arrays that took long to compute, kept in the user's cache folder under a digest of what they were made of.

A help, never a condition: a file that is damaged, truncated or somebody else's counts as none, and where nothing can be
written nothing is kept.
"""

from __future__ import annotations

import hashlib
import os
import re
import sys
import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from facegen.errors import FileError
from facegen.fileio.textfile import whole_file

VARIABLE = "FACEGEN_CACHE"
"""The environment variable that names another folder."""

# Before the numbers: what the file is, then the SHA-256 of the numbers.
_MARK = b"facegen array 1\n"
_NAME = re.compile(r"[0-9a-f]{64}\.array")
_DRAFT = re.compile(r"\.[0-9a-f]{64}\.array\..*\.part")
# Because a registration of 100,000 triangles has one megabyte: some hundred avatars are remembered.
_MOST_BYTES = 128 << 20
# Seconds after which a draft is one that a killed process left.
_STALE = 3600.0


@dataclass(frozen=True)
class Kept:
    """Arrays of float64 in a folder, which need not exist; of more than ``most`` bytes the longest unused go."""

    folder: Path
    most: int = _MOST_BYTES

    def find(self, key: str, shape: tuple[int, ...]) -> NDArray[np.float64] | None:
        """Return the array of a key (64 hexadecimal digits), or None if there is none of this shape, whole."""
        path = self.folder / f"{key}.array"
        size = 8 * int(np.prod(shape))
        try:
            if path.stat().st_size != len(_MARK) + 32 + size:
                return None
            data = path.read_bytes()
        except (OSError, ValueError):
            return None
        numbers = data[len(_MARK) + 32:]
        if data[:-size or None] != _MARK + hashlib.sha256(numbers).digest():
            return None
        with suppress(OSError):                     # it was used now; a folder that is read only does not matter
            os.utime(path)
        return np.frombuffer(numbers, "<f8").reshape(shape).astype(np.float64)

    def keep(self, key: str, array: NDArray) -> None:
        """Keep an array under a key, whole or not at all; without a word where that cannot be."""
        numbers = np.ascontiguousarray(array, "<f8").tobytes()
        with suppress(OSError, ValueError, FileError):
            self.folder.mkdir(parents=True, exist_ok=True)
            with whole_file(self.folder / f"{key}.array") as draft:
                draft.write_bytes(_MARK + hashlib.sha256(numbers).digest() + numbers)
            self._tidy()

    def _tidy(self) -> None:
        """Remove what is too much, the longest unused first, and drafts of killed processes. Other files stay."""
        kept, size = [], 0
        for entry in os.scandir(self.folder):
            with suppress(OSError):                 # another process may tidy too
                about = entry.stat(follow_symlinks=False)
                if _NAME.fullmatch(entry.name):
                    kept.append((about.st_mtime, entry.path, about.st_size))
                    size += about.st_size
                elif _DRAFT.fullmatch(entry.name) and about.st_mtime < time.time() - _STALE:
                    os.unlink(entry.path)
        for _, path, own in sorted(kept)[:-1]:      # the newest stays, whatever its size
            if size <= self.most:
                break
            with suppress(OSError):
                os.unlink(path)
            size -= own


def kept_in(name: str) -> Kept | None:
    """Return the user's arrays of a name: in the folder that FACEGEN_CACHE names, else where this system keeps what
    can be made again. None where neither can be told."""
    told = os.environ.get(VARIABLE)
    try:
        return Kept((Path(told) if told else _system_folder()) / name)
    except RuntimeError:                            # a user without a home
        return None


def _system_folder() -> Path:
    if sys.platform == "win32":
        told, usual = os.environ.get("LOCALAPPDATA"), ("AppData", "Local")
    elif sys.platform == "darwin":
        told, usual = None, ("Library", "Caches")
    else:
        told, usual = os.environ.get("XDG_CACHE_HOME"), (".cache",)
    if told and not os.path.isabs(told):            # freedesktop.org: a relative path counts as none
        told = None
    return (Path(told) if told else Path.home().joinpath(*usual)) / "facegen"


def content_key(*parts: str | NDArray) -> str:
    """Return the SHA-256 of texts and arrays in their order; arrays of other types or shapes have other digests."""
    digest = hashlib.sha256()
    for part in parts:
        if isinstance(part, str):
            head, data = "text", part.encode()
        else:
            array = np.ascontiguousarray(part)
            array = array.astype(array.dtype.newbyteorder("<"), copy=False)
            head, data = f"{array.dtype.str}{array.shape}", array.tobytes()
        digest.update(f"{head} {len(data)}\n".encode() + data)
    return digest.hexdigest()

"""Read a file that somebody else wrote: whole, of bounded size, and only if it is a file."""

from __future__ import annotations

from pathlib import Path

from facegen.errors import FileError

# Because a file is held in memory together with what is made of it; avatars have a hundredth of this.
MOST_BYTES = 1 << 30


def read_bytes(path: Path, *, what: str, kind: str) -> bytes:
    """Return the bytes of a file. ``what`` opens the message of a FileError, ``kind`` says what was expected."""
    try:
        if path.exists() and not path.is_file():    # reading a pipe or a device might never end
            found = "it is a folder" if path.is_dir() else "it is no regular file"
            raise FileError(f"{what}: cannot read {path} as {kind} ({found})")
        size = path.stat().st_size
        if size > MOST_BYTES:
            raise FileError(f"{what}: {path} has {size:,} bytes; facegen reads files of at most {MOST_BYTES:,}")
        return path.read_bytes()
    except FileNotFoundError:
        raise FileError(f"{what}: cannot read {path} as {kind} (there is no such file)") from None
    except (OSError, ValueError) as error:          # ValueError: a NUL in the path
        if isinstance(error, FileError):
            raise
        raise FileError(f"{what}: cannot read {path} as {kind} ({error})") from None

"""Recordings that a person opened: kept in the folder of the work, so a reload finds them, read with limits."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from facegen.animation.performance import Performance
from facegen.animation.streams.files import FORMATS
from facegen.errors import FileError, InputError
from facegen.fileio.textfile import make_folder
from facegen.studio import avatar_file
from facegen.studio.apart import Waits, patient
from facegen.studio.limits import LIMITS, MEBIBYTE
from facegen.studio.reading import STREAM, cleaned, read_recording_safely
from facegen.studio.recent import Recent

if TYPE_CHECKING:
    from facegen.studio.work import ClipWork

FOLDER = "recording"
"""Folder of a work that holds what was opened there."""

TAKEN = (*dict.fromkeys(end for one in FORMATS.values() if one.read is not None for end in one.suffixes), STREAM)
"""What the names of recordings end in."""

_QUICK = 5000           # frames that are smoothed in half a second
# Performances in memory: those of a few steps of undo.
_recent: Recent[Performance] = Recent(4)


def safe_name(name: str) -> str:
    """Return a recording's name without what could lead out of a folder; InputError for a kind that is not read."""
    return avatar_file.safe_name(name, TAKEN, "a recording")


def keep(folder: Path, name: str, content: bytes, work: ClipWork, waits: Waits = patient) -> tuple[str, Performance]:
    """Keep a file that came from a browser in a work's folder; return its name there and what it holds.

    It is read before it is kept, as ``work`` says, by a process of its own: what cannot be read leaves what was there.
    waits: see `facegen.studio.apart.ask`. InputError, FileError.
    """
    name = safe_name(name)
    if len(content) > LIMITS.file_bytes:
        raise InputError(f"file: '{name}' has {len(content) / MEBIBYTE:.0f} MB, the studio takes up to "
                         f"{LIMITS.file_bytes / MEBIBYTE:.0f}; cut it, or use the command facegen play")
    place = make_folder(folder / FOLDER)
    kept, plain = avatar_file.keep_read(place, name, content, lambda path: _read(path, work, waits), "the recording ")
    _recent.put(_key(place / kept, work), plain)
    return kept, _finished(place / kept, plain, work, waits)


def load(folder: Path, work: ClipWork, waits: Waits = patient) -> Performance:
    """Return the recording of a work, calibrated and smoothed as it says; read as by `keep`. InputError, FileError."""
    path = folder / FOLDER / safe_name(str(work.recording))
    if not path.is_file():
        raise FileError(f"recording: '{work.recording}' is no longer in the folder of this work; open it again")
    with avatar_file.called(path, path.name):
        plain = _recent.get(_key(path, work), lambda: _read(path, work, waits))
        return _finished(path, plain, work, waits)


def _key(path: Path, work: ClipWork) -> tuple[Any, ...]:
    return path, path.stat().st_mtime_ns, work.recorded_fps, work.face_id


def _read(path: Path, work: ClipWork, waits: Waits, **clean: Any) -> Performance:
    return read_recording_safely(path, LIMITS, fps=work.recorded_fps or None, person=work.face_id or None, waits=waits,
                                 **clean)


def _finished(path: Path, plain: Performance, work: ClipWork, waits: Waits) -> Performance:
    """Return a recording cleaned up as a work says: a long one by the other process, which can be stopped."""
    how = {"calibrate": work.calibrate, "calibrate_head": work.calibrate_head, "smooth": work.smooth}
    if len(plain) <= _QUICK:
        return cleaned(plain, **how)
    if not (work.calibrate or work.smooth):
        return plain
    return _recent.get((*_key(path, work), *how.values()), lambda: _read(path, work, waits, **how))


def about(one: Performance) -> dict[str, Any]:
    """Return what a person is told of a recording."""
    return {"format": one.about.get("format", "?"), "seconds": one.duration, "frames": len(one),
            "found": int(one.found.sum()), "shapes": len(one.names)}

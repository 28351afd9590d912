"""Recordings that a person opened: kept in the folder of the work, so a reload finds them, read with limits."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from facegen.animation.performance import Performance
from facegen.animation.streams.calibrate import calibrated, parse_calibration
from facegen.animation.streams.files import FORMATS
from facegen.animation.streams.smooth import OneEuro, smoothed
from facegen.errors import FileError, InputError
from facegen.fileio.textfile import make_folder
from facegen.studio import avatar_file
from facegen.studio.apart import Waits, patient
from facegen.studio.limits import MEBIBYTE, Limits
from facegen.studio.reading import STREAM, read_recording_safely
from facegen.studio.recent import Recent

if TYPE_CHECKING:
    from facegen.studio.work import ClipWork

FOLDER = "recording"
"""Folder of a work that holds what was opened there."""

TAKEN = (*dict.fromkeys(end for one in FORMATS.values() if one.read is not None for end in one.suffixes), STREAM)
"""What the names of recordings end in."""

LIMITS = Limits()

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
    return kept, _finished(plain, work)


def load(folder: Path, work: ClipWork, waits: Waits = patient) -> Performance:
    """Return the recording of a work, calibrated and smoothed as it says; read as by `keep`. InputError, FileError."""
    path = folder / FOLDER / safe_name(str(work.recording))
    if not path.is_file():
        raise FileError(f"recording: '{work.recording}' is no longer in the folder of this work; open it again")
    with avatar_file.called(path, path.name):
        return _finished(_recent.get(_key(path, work), lambda: _read(path, work, waits)), work)


def _key(path: Path, work: ClipWork) -> tuple[Any, ...]:
    return path, path.stat().st_mtime_ns, work.recorded_fps, work.face_id


def _read(path: Path, work: ClipWork, waits: Waits) -> Performance:
    return read_recording_safely(path, LIMITS, fps=work.recorded_fps or None, person=work.face_id or None, waits=waits)


def _finished(plain: Performance, work: ClipWork) -> Performance:
    if work.calibrate:
        plain = calibrated(plain, parse_calibration(work.calibrate, head=work.calibrate_head))
    euro = OneEuro.of(work.smooth or None)
    return plain if euro is None else smoothed(plain, euro)


def about(one: Performance) -> dict[str, Any]:
    """Return what a person is told of a recording."""
    return {"format": one.about.get("format", "?"), "seconds": one.duration, "frames": len(one),
            "found": int(one.found.sum()), "shapes": len(one.names)}

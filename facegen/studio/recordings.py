"""Recordings that a person opened: kept in the folder of the work, so a reload finds them, read with limits."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from facegen.animation.performance import Performance
from facegen.animation.streams import load_performance
from facegen.animation.streams.calibrate import calibrated, parse_calibration
from facegen.animation.streams.files import FORMATS
from facegen.animation.streams.smooth import OneEuro, smoothed
from facegen.codec.decoder import Decoder
from facegen.codec.link import read_stream
from facegen.codec.recording import performance_of
from facegen.errors import FileError, InputError
from facegen.fileio.textfile import make_folder
from facegen.studio import avatar_file
from facegen.studio.limits import MEBIBYTE, Limits

if TYPE_CHECKING:
    from facegen.studio.work import ClipWork

FOLDER = "recording"
"""Folder of a work that holds what was opened there."""

STREAM = ".fgp"
TAKEN = (*dict.fromkeys(end for one in FORMATS.values() if one.read is not None for end in one.suffixes), STREAM)
"""What the names of recordings end in."""

LIMITS = Limits()
LONGEST = 6 * 3600.0
"""Seconds of a recording that the timeline takes."""

_KEPT = 4               # performances in memory: those of a few steps of undo
_WAIT = 16              # packets that a missing one is waited for, as the command does


def safe_name(name: str) -> str:
    """Return a recording's name without what could lead out of a folder; InputError for a kind that is not read."""
    return avatar_file.safe_name(name, TAKEN, "a recording")


def keep(folder: Path, name: str, content: bytes, work: ClipWork, *,
         read: Callable[[Path, ClipWork], Performance] | None = None) -> tuple[str, Performance]:
    """Keep a file that came from a browser in a work's folder; return its name there and what it holds.

    It is read before it is kept, as ``work`` says: what cannot be read leaves what was there. InputError, FileError.
    """
    name = safe_name(name)
    if len(content) > LIMITS.file_bytes:
        raise InputError(f"file: '{name}' has {len(content) / MEBIBYTE:.0f} MB, the studio takes up to "
                         f"{LIMITS.file_bytes / MEBIBYTE:.0f}; cut it, or use the command facegen play")
    return avatar_file.keep_read(make_folder(folder / FOLDER), name, content,
                                 lambda path: (read or read_as)(path, work), "the recording ")


def load(folder: Path, work: ClipWork) -> Performance:
    """Return the recording of a work, calibrated and smoothed as it says; InputError, FileError."""
    path = folder / FOLDER / safe_name(str(work.recording))
    if not path.is_file():
        raise FileError(f"recording: '{work.recording}' is no longer in the folder of this work; open it again")
    with avatar_file.called(path, path.name):
        return _finished(_read(path, path.stat().st_mtime_ns, work.recorded_fps or None, work.face_id or None), work)


def read_as(path: Path, work: ClipWork) -> Performance:
    """Return what a file holds, as a work says."""
    return _finished(_plain(path, work.recorded_fps or None, work.face_id or None), work)


def _finished(plain: Performance, work: ClipWork) -> Performance:
    if work.calibrate:
        plain = calibrated(plain, parse_calibration(work.calibrate, head=work.calibrate_head))
    euro = OneEuro.of(work.smooth or None)
    return plain if euro is None else smoothed(plain, euro)


@lru_cache(maxsize=_KEPT)
def _read(path: Path, changed: int, fps: float | None, person: str | None) -> Performance:
    return _plain(path, fps, person)


def _plain(path: Path, fps: float | None, person: str | None) -> Performance:
    if path.suffix.lower() == STREAM:
        decoder = Decoder(wait=_WAIT)
        with open(path, "rb") as file:
            found = performance_of(decoder, list(read_stream(decoder, file)))
    else:
        found = load_performance(path, fps=fps, person=person)
    if found.duration > LONGEST:
        raise InputError(f"{path}: lasts {found.duration / 3600:.1f} hours, the timeline takes up to "
                         f"{LONGEST / 3600:.0f}; cut it, or use the command facegen play")
    return found


def about(one: Performance) -> dict[str, Any]:
    """Return what a person is told of a recording."""
    return {"format": one.about.get("format", "?"), "seconds": one.duration, "frames": len(one),
            "found": int(one.found.sum()), "shapes": len(one.names)}

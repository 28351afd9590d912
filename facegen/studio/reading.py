"""What is done with strangers' files in a process of its own (`facegen.studio.apart`): avatars and recordings are read,
faces on avatars are looked for.

The readers of facegen.fileio and facegen.animation.streams check what they read. This is for what they might not know:
a file that makes them slow or hungry ends its own process, and no page. Looking for a face takes so long that other
pages would notice.
"""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from facegen.animation.performance import Performance
from facegen.errors import FileError, InputError
from facegen.fileio.avatar import READABLE, AvatarFile, load_avatar
from facegen.studio.apart import Waits, Wish, ask, patient
from facegen.studio.limits import LIMITS, Limits

if TYPE_CHECKING:
    from facegen.landmarking.propose import Searched

STREAM = ".fgp"
"""What the name of a recording in facegen's few bits ends in."""

_WAIT = 16              # packets that a missing one is waited for, as the command does


def read_avatar_safely(path: str | os.PathLike[str], limits: Limits = LIMITS, waits: Waits = patient
                       ) -> AvatarFile:
    """Return what `facegen.load_avatar` returns, read by another process with bounds on its time and memory.

    waits: see `facegen.studio.apart.ask`. Raises FileError for a file that is wrong, has more triangles than
    ``limits.triangles``, takes too long or too much.
    """
    path = Path(path)
    if path.suffix.lower() not in READABLE:
        return load_avatar(path)        # which says what it reads
    return ask("avatar", path, limits, {"triangles": limits.triangles}, waits)


def read_recording_safely(path: Path, limits: Limits, *, fps: float | None = None, person: str | None = None,
                          calibrate: str = "", calibrate_head: bool = False, smooth: str = "",
                          waits: Waits = patient) -> Performance:
    """Return what `facegen.load_performance` returns, or a stream's performance, read by another process.

    calibrate, calibrate_head, smooth: see `cleaned`. waits: see `facegen.studio.apart.ask`. Raises FileError or
    InputError for a file that is wrong, lasts longer or holds more than ``limits`` say, takes too long or too much.
    """
    wish = {"fps": fps, "person": person, "seconds": limits.recorded_seconds, "frames": limits.frames,
            "numbers": limits.numbers,
            "clean": {"calibrate": calibrate, "calibrate_head": calibrate_head, "smooth": smooth}}
    return ask("recording", path, limits, wish, waits)


def search_safely(path: Path, limits: Limits = LIMITS, waits: Waits = patient) -> Searched:
    """Return what `facegen.Proposer.search` finds on the avatar of a file, looked for by another process.

    waits: see `facegen.studio.apart.ask`. Raises FileError for what takes longer than ``limits.search_seconds``.
    """
    return ask("search", path, replace(limits, read_seconds=limits.search_seconds), {}, waits)


def cleaned(plain: Performance, *, calibrate: str = "", calibrate_head: bool = False, smooth: str = "") -> Performance:
    """Return a recording less its resting face and smoothed, as `facegen.studio.work.ClipWork` says; "" for not.

    InputError.
    """
    from facegen.animation.streams.calibrate import calibrated, parse_calibration
    from facegen.animation.streams.smooth import OneEuro, smoothed

    if calibrate:
        plain = calibrated(plain, parse_calibration(calibrate, head=calibrate_head))
    euro = OneEuro.of(smooth or None)
    return plain if euro is None else smoothed(plain, euro)


# In the other process

def _avatar(path: Path, wish: Wish) -> AvatarFile:
    from facegen.studio.counting import triangles

    count, most = triangles(path), wish["triangles"]
    if count is not None and count > most:
        raise _too_many(path, count, most)
    found = load_avatar(path)
    if len(found.mesh.faces) > most:
        raise _too_many(path, len(found.mesh.faces), most)
    return found


def _too_many(path: Path, count: int, most: int) -> FileError:
    return FileError(f"{path}: has {count:,} triangles, the studio takes up to {most:,}; make fewer of them first (in "
                     "Blender: the Decimate modifier), or use the command facegen rig")


def _recording(path: Path, wish: Wish) -> Performance:
    found = _performance(path, wish["fps"], wish["person"])
    columns = [found.weights, *(one for one in (found.head, found.place, found.gaze) if one is not None),
               *found.extra.values()]
    for said, has, most in (
            (f"lasts {found.duration / 3600:.1f} hours, the timeline takes up to {wish['seconds'] / 3600:.0f}",
             found.duration, wish["seconds"]),
            (f"has {len(found):,} frames, the timeline takes up to {wish['frames']:,}", len(found), wish["frames"]),
            (f"holds {sum(one.size for one in columns):,} numbers, the studio takes up to {wish['numbers']:,}",
             sum(one.size for one in columns), wish["numbers"])):
        if has > most:
            raise InputError(f"{path}: {said}; cut it, or use the command facegen play")
    return cleaned(found, **wish["clean"])


def _performance(path: Path, fps: float | None, person: str | None) -> Performance:
    if path.suffix.lower() != STREAM:
        from facegen.animation.streams import load_performance

        return load_performance(path, fps=fps, person=person)
    from facegen.codec.decoder import Decoder
    from facegen.codec.link import read_stream
    from facegen.codec.recording import performance_of

    decoder = Decoder(wait=_WAIT)
    with open(path, "rb") as file:
        return performance_of(decoder, list(read_stream(decoder, file)))


def _search(path: Path, wish: Wish) -> Any:
    from facegen.landmarking.propose import Proposer

    return Proposer(load_avatar(path).mesh).search()


JOBS = {"avatar": _avatar, "recording": _recording, "search": _search}
"""What the other process can be asked for."""

"""The door to recordings: read any, write any."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

from facegen.animation.performance import Performance
from facegen.animation.streams.calibrate import Calibration, calibrated
from facegen.animation.streams.formats import FORMATS, Sample, Wish, detect, for_output, format_of, register
from facegen.animation.streams.gltf import GLTF
from facegen.animation.streams.libreface import LIBREFACE
from facegen.animation.streams.livelink import LIVELINK
from facegen.animation.streams.mediapipe import MEDIAPIPE, MEDIAPIPE_CSV
from facegen.animation.streams.openface import OPENFACE
from facegen.animation.streams.own import OWN
from facegen.animation.streams.pyfeat import PYFEAT
from facegen.animation.streams.sides import without_sides
from facegen.animation.streams.smooth import OneEuro, smoothed
from facegen.animation.streams.times import check_fps
from facegen.animation.streams.translate import translated
from facegen.errors import InputError
from facegen.fileio.table import head_of
from facegen.fileio.textfile import check_place

for _format in (GLTF, LIVELINK, OPENFACE, LIBREFACE, PYFEAT, MEDIAPIPE, MEDIAPIPE_CSV, OWN):
    register(_format)


def load_performance(path: str | os.PathLike[str], *, format: str | None = None, fps: float | None = None,
                     person: str | int | None = None, presence: float | None = None,
                     calibrate: Calibration | str | None = None, smooth: OneEuro | str | bool | None = None
                     ) -> Performance:
    """Return the performance of a recording's file.

    format: a name in `FORMATS`; by default the one that the content is of. fps: frames a second, for files that have
    no times; it goes before a file's own times, and of a timecode it is what it counts in. person: which face, where
    there are several, by default the one that is there most often; of a glTF file, which animation. presence: the
    weight 0..1 of a unit that the file only calls present; by default it is left out. calibrate, smooth: done after
    reading, in this order; as text, see `facegen.animation.streams.calibrate.parse_calibration` and
    `facegen.animation.streams.smooth.parse_smooth`.

    What was odd stands in ``warnings``, with its lines. Raises FileError or InputError. ::

        load_performance("face.csv", smooth=True, calibrate="0-2").frame(0)
    """
    if not isinstance(path, (str, os.PathLike)):
        raise InputError(f"path: expected the path of a recording, got {type(path).__name__}")
    path = Path(path)
    wish = Wish(check_fps(fps), None if person is None else str(person), _presence(presence))
    calibration, euro = Calibration.of(calibrate), OneEuro.of(smooth)
    one = format_of(format) if format is not None else None
    if one is not None and one.read is None:
        raise InputError(f"format: {format} can be written, but not read")
    sample = Sample(path, head_of(path))
    performance = (one or detect(sample)).read(path, wish)
    if calibration is not None:
        performance = calibrated(performance, calibration)
    return smoothed(performance, euro) if euro is not None else performance


def save_performance(performance: Performance, path: str | os.PathLike[str], format: str | None = None) -> Performance:
    """Write a performance, whole or not at all, and return what was written.

    format: a name in `FORMATS`; by default by the suffix, of several the one that it was read from. A performance of
    another vocabulary is converted first; what that loses stands in the result's ``warnings`` and
    ``about["residual"]``. Raises FileError or InputError.
    """
    if not isinstance(performance, Performance):
        raise InputError(f"performance: expected a Performance, got {type(performance).__name__}")
    one = for_output(Path(path), format, performance.about.get("format"))
    place = check_place(path, one.suffixes)
    if one.vocabulary is not None:
        performance = translated(performance, one.vocabulary)
    if not one.sides:
        performance = without_sides(performance)
    lost = [part for part in ("head", "place", "gaze") if getattr(performance, part) is not None
            and part not in one.parts]
    if lost:
        said = f"{one.name} has no place for {' and '.join(lost)}; not written"
        performance = replace(performance, warnings=(*performance.warnings, said))
    one.write(performance, place)
    return performance


def _presence(value: float | None) -> float | None:
    if value is None:
        return None
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0.0 <= value <= 1.0:
        raise InputError(f"presence: expected a weight in 0..1, got {value!r}")
    return float(value)


__all__ = ["FORMATS", "load_performance", "save_performance"]

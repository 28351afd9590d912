"""Recordings as files: a stand-in until the readers of recordings are here."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from facegen.animation.performance import Performance
from facegen.errors import FileError
from facegen.fileio.textfile import check_place, whole_file

_PARTS = {"head": ("head_yaw", "head_pitch", "head_roll"), "place": ("place_x", "place_y", "place_z"),
          "gaze": ("gaze_yaw_L", "gaze_pitch_L", "gaze_yaw_R", "gaze_pitch_R")}


def load(path: Path) -> Performance:
    try:
        rows = list(csv.reader(path.open()))
    except OSError as error:
        raise FileError(f"{path}: cannot be read: {error.strerror or error}") from error
    header, data = rows[0], np.array([[float(x or "nan") for x in row] for row in rows[1:]])
    parts = {p: data[:, [header.index(c) for c in cols]] for p, cols in _PARTS.items() if cols[0] in header}
    used = {"time", *(c for cols in _PARTS.values() for c in cols)}
    names = [c for c in header if c not in used]
    return Performance(data[:, 0], names, data[:, [header.index(n) for n in names]],
                       "arkit" if "jawOpen" in names else "units", **parts)


def check(path: Path) -> None:
    check_place(path, [".csv"])


def save(p: Performance, path: Path) -> None:
    parts = [x for x in _PARTS if getattr(p, x) is not None]
    with whole_file(path) as draft, draft.open("w", newline="") as file:
        w = csv.writer(file)
        w.writerow(["time", *p.names, *(c for x in parts for c in _PARTS[x])])
        for k in range(len(p)):
            w.writerow([f"{v:.6g}" for v in (p.times[k], *p.weights[k], *(v for x in parts for v in getattr(p, x)[k]))])

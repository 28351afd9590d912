"""How long recordings take, beside the plain way: python benchmarks/recordings.py [MINUTES]

A synthetic recording in OpenFace's form, with all its landmarks, is read, converted, smoothed and written; each step
beside the same by plain means, in one process and one run. CPU seconds; pandas is asked if it is installed.
"""

from __future__ import annotations

import csv
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from facegen.animation.streams import load_performance, save_performance, smoothed, translated
from facegen.animation.streams.openface import UNITS
from facegen.face.convert import convert

FPS = 30
# Frames that the slow way converts; the rest is reckoned.
ALONE = 60


def recording(path: Path, frames: int) -> None:
    """Write a recording of 431 columns as wide as OpenFace's with its 2D and 3D landmarks."""
    rng = np.random.default_rng(0)
    marks = [f"{axis}_{k}" for axis in "xyXYZ" for k in range(68)]
    names = ["frame", "timestamp", "confidence", "success", *(f"pose_{kind}{axis}" for kind in "TR" for axis in "xyz"),
             *marks, *(f"AU{int(unit):02d}_r" for unit in UNITS)]
    slow = np.clip(np.cumsum(rng.normal(size=(frames, len(UNITS))), axis=0) * 0.05 + 1.0, 0.0, 5.0)
    with path.open("w") as file:
        file.write(", ".join(names) + "\n")
        for k in range(frames):
            values = [k + 1, k / FPS, 0.98, 1, *rng.normal(size=6) * 0.1, *rng.normal(size=len(marks)) * 100, *slow[k]]
            file.write(", ".join(f"{value:.3f}" for value in values) + "\n")


def plain(path: Path) -> dict[str, np.ndarray]:
    """Read a table as anyone would."""
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file, skipinitialspace=True))
    return {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}


def timed(what: Callable[[], object]) -> tuple[float, object]:
    """Return CPU seconds and the result."""
    since = time.process_time()
    result = what()
    return time.process_time() - since, result


def main() -> None:
    """Measure and print."""
    minutes = float(sys.argv[1]) if len(sys.argv) > 1 else 2.0
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "openface.csv"
        recording(path, int(60 * minutes * FPS))
        convert({"12": 0.5, "23": 0.5}, "units", "arkit")         # what is made once is made
        translated(load_performance(path), "arkit")
        reading, one = timed(lambda: load_performance(path))
        rows = [("read", reading, {"csv.DictReader and float": timed(lambda: plain(path))[0]})]
        try:
            import pandas
        except ImportError:
            pass
        else:
            rows[0][2]["pandas.read_csv"] = timed(lambda: pandas.read_csv(path, skipinitialspace=True))[0]
        some = [one.frame(k) for k in np.linspace(0, len(one) - 1, ALONE).astype(int)]
        alone = timed(lambda: [convert(frame, "units", "arkit") for frame in some])[0] * len(one) / ALONE
        moving, there = timed(lambda: translated(one, "arkit"))
        rows.append(("units to ARKit", moving, {"facegen.convert, frame by frame": alone}))
        some = [there.frame(k) for k in np.linspace(0, len(one) - 1, ALONE).astype(int)]
        alone = timed(lambda: [convert(frame, "arkit", "units") for frame in some])[0] * len(one) / ALONE
        rows.append(("ARKit to units", timed(lambda: translated(there, "units"))[0],
                     {"facegen.convert, frame by frame": alone}))
        rows.append(("smooth", timed(lambda: smoothed(one))[0], {}))
        rows.append(("write", timed(lambda: save_performance(one, Path(folder) / "again.csv"))[0], {}))
        print(f"{minutes:g} minutes at {FPS} frames a second, {path.stat().st_size / 1e6:.0f} MB, {len(one)} frames")
        for name, seconds, others in rows:
            beside = "".join(f"; {way}: {value:.2f} s ({value / seconds:.1f} times)" for way, value in others.items())
            print(f"{name}: {seconds:.2f} s ({60 * minutes / seconds:.0f} times as fast as it was recorded){beside}")


if __name__ == "__main__":
    main()

"""Measure facegen's renderers beside others: python benchmarks/renderers.py [--quick] [-o docs].

Writes benchmarks.md and images/benchmarks.svg in the folder. Each renderer has a process of its own, and one frame
after the other is drawn by one process at a time, so that all see the same machine. A renderer that is not
installed, or does not start, is named as missing.
"""

from __future__ import annotations

import argparse
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import heads
import poses
import report
from contestants import Missing
from worker import PEERS, facegen_names, workers

from facegen.render import RENDERERS

RACE = (1_000, 10_000, 40_000, 85_000)
CURVE = (1_000, 2_000, 5_000, 10_000, 20_000, 40_000, 85_000, 200_000)
SIZES = (256, 512, 1024, 2048)
SIZE, CURVE_TRIANGLES = 512, 10_000
WHOLE = (2, 3)
# Frames a turn. The first is not counted: it finds the caches full of another process's data.
TURN = 4


def race(head: Path, names: list[str], *, frames: int, seconds: float) -> dict[str, report.Result]:
    """Let the contestants draw one head in turn.

    frames: how many are timed. seconds: a contestant that has used so much is out, though not before its second turn.
    """
    results: dict[str, report.Result] = {}
    with workers(names, head) as field:
        for name, worker in field.items():
            try:
                picture, info = worker.ready()
                alpha = picture[..., 3] / 255
                results[name] = report.Result(cover=float(alpha.mean()), info=info,
                                              edges=float(((alpha > 0) & (alpha < 1)).mean()))
            except Missing as why:
                results[name] = report.Result(missing=str(why))
        running = [name for name in field if not results[name].missing]
        turns = -(-frames // (TURN - 1))
        for turn in range(turns):
            for name in running:
                result = results[name]
                if turn < 2 or sum(wall for _, wall in result.times) < seconds:
                    result.times.extend(field[name].draw(turn * TURN, TURN)[1:])
    return results


def start_up(head: Path, name: str, rounds: int) -> tuple[float, float] | None:
    """Return wall seconds from a new process to its first picture: with empty caches, then the median of some more."""
    with tempfile.TemporaryDirectory() as caches:
        environment = os.environ | dict.fromkeys(
            ("NUMBA_CACHE_DIR", "MESA_SHADER_CACHE_DIR", "MESA_GLSL_CACHE_DIR"), caches)
        times = []
        for _ in range(1 + rounds):
            start = time.perf_counter()
            done = subprocess.run([sys.executable, str(Path(__file__).with_name("worker.py")), name, str(head)],
                                  env=environment, capture_output=True)
            if done.returncode:
                return None
            times.append(time.perf_counter() - start)
    return times[0], statistics.median(times[1:])


def measure(folder: Path, *, quick: bool) -> report.Measured:
    """Return all that is measured; heads are kept in a folder meanwhile."""
    names = facegen_names(RENDERERS[1:]) + list(PEERS)
    few = {"frames": 9, "seconds": 1.0} if quick else {"frames": 30, "seconds": 6.0}
    many = few if quick else {"frames": 45, "seconds": 15.0}
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else float("nan")
    out = report.Measured(quick=quick, load=load)
    for triangles in RACE if quick else CURVE:
        _say(f"{triangles} triangles")
        how = many if triangles in RACE else few
        out.triangles[triangles] = race(heads.save(folder, triangles, SIZE), names, **how)
    for detail in WHOLE[:1] if quick else WHOLE:
        _say(f"the whole face, detail {detail}")
        out.whole[detail] = race(heads.save_whole(folder, detail, SIZE), names, **many)
    for size in SIZES[:-1] if quick else SIZES:
        _say(f"{size} x {size} pixels")
        out.pixels[size] = (out.triangles[CURVE_TRIANGLES] if size == SIZE else
                            race(heads.save(folder, CURVE_TRIANGLES, size), names, **few))
    head = heads.save(folder, CURVE_TRIANGLES, SIZE)
    for name, result in out.triangles[CURVE_TRIANGLES].items():
        if result.times and (name in PEERS or name.endswith("/neutral/0")):
            _say(f"start-up of {name}")
            out.start[name] = start_up(head, name, 1 if quick else 5)
    _say("poses")
    out.poses = poses.pose_costs()
    for name in ("soft", "fast"):
        if not out.triangles[CURVE_TRIANGLES][f"{name}/neutral/0"].times:
            continue
        for detail in out.whole:
            for occlusion in ("neutral", "posed"):
                out.frames[name, detail, occlusion] = poses.frame_costs(name, detail, occlusion, 5 if quick else 20)
    return out


def _say(text: str) -> None:
    spent = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime + time.process_time()
    print(f"{spent:7.0f} s of CPU  {text}", file=sys.stderr, flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="few frames and meshes: to see that it works")
    parser.add_argument("-o", "--output", type=Path, default=Path("docs"), help="folder to write to")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        measured = measure(Path(folder), quick=options.quick)
    for path in report.write(measured, options.output):
        print(path)


if __name__ == "__main__":
    main()

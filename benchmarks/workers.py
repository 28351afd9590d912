"""Frames a second against workers: the same batch in one process, in two, and on a dask cluster of two.

``python benchmarks/workers.py [--pictures 100] [--size 256] [--renderer auto]``. The first column counts all, from the
start of the processes; the second what goes on once they are warm: the time from the first tenth of the pictures to
the last.
"""

from __future__ import annotations

import argparse
import logging
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path

from facegen.jobs.batch import run_batch
from facegen.render.request import available_cores


def measure(jobs: dict, **how) -> tuple[float, float]:
    """Return frames a second, with and without the start."""
    ticks: list[float] = []
    with tempfile.TemporaryDirectory() as folder:
        start = time.perf_counter()
        run_batch(jobs, Path(folder) / "set", step=lambda: ticks.append(time.perf_counter()), **how)
        end = time.perf_counter()
    first = max(1, len(ticks) // 10)
    return len(ticks) / (end - start), (len(ticks) - first) / (ticks[-1] - ticks[first - 1])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pictures", type=int, default=100)
    parser.add_argument("--size", type=int, default=256)
    parser.add_argument("--renderer", default="auto")
    parser.add_argument("--masks", action="store_true")
    asked = parser.parse_args()
    jobs = {"poses": [{"12": (i + 1) / asked.pictures} for i in range(asked.pictures)], "sizes": asked.size,
            "renderer": asked.renderer, "masks": asked.masks}
    print(f"{asked.pictures} pictures of {asked.size} pixels, {available_cores()} cores")
    print(f"{'workers':<10} {'all':>12} {'warm':>12}")
    ways: list[tuple[str, dict]] = [("1", {"workers": 1}), ("2", {"workers": 2})]
    if available_cores() > 2:
        ways.append((str(available_cores()), {"workers": available_cores()}))
    with ExitStack() as stack:
        try:
            from distributed import LocalCluster
        except ImportError:
            print('dask 2: distributed is not installed (pip install "facegen[cluster]")')
        else:
            cluster = stack.enter_context(LocalCluster(
                n_workers=2, threads_per_worker=1, dashboard_address=None, silence_logs=logging.CRITICAL))
            ways.append(("dask 2", {"scheduler": cluster.scheduler_address}))
        for name, how in ways:
            whole, warm = measure(jobs, **how)
            print(f"{name:<10} {whole:>8.1f} f/s {warm:>8.1f} f/s")


if __name__ == "__main__":
    main()

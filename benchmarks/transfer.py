"""How long an avatar takes, and how much memory, beside public tools for the same steps.

    python benchmarks/transfer.py -o docs/transfer-speed.md

The avatar is the shipped human, subdivided and decimated to several sizes. Every figure is of a process of its own;
facegen's are the least of some rounds, in which the solvers take turns. A peer that is not installed is named, one that
takes longer than ``--bound`` seconds of CPU is ended.
"""

from __future__ import annotations

import argparse
import datetime
import json
import os
import platform
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import report
import transfer_parts as parts
from avatars import decimated_human

SIZES, QUICK = (6_000, 25_000, 50_000, 100_000), (6_000, 25_000)
MADE = parts.SETS, ",".join(parts.shapes())
SOLVERS = ("scipy", "qdldl")
# What the tool is held to on two cores: seconds by the clock of the whole, of registration and of shapes, and MiB, at
# 25,000 triangles; seconds of the whole at 100,000.
GOALS = {25_000: (6.0, 2.0, 3.0, 600), 100_000: (30.0, None, None, None)}
_PACKAGES = ("numpy", "scipy", "qdldl", "trimesh")


def run(arguments: list[str], bound: float, folder: Path) -> dict[str, object] | str:
    """Return what a part of `transfer_parts` prints, with "wall" (s) of its process, or why there is nothing. bound:
    CPU seconds that it may take. folder: for compiled modules, as an installed package has them."""
    environment = {**os.environ, "PYTHONPYCACHEPREFIX": str(folder / "compiled")}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    start = time.perf_counter()
    done = subprocess.run([sys.executable, parts.__file__, str(int(bound)), *arguments], capture_output=True, text=True,
                          env=environment)
    wall = time.perf_counter() - start
    if done.returncode == -signal.SIGXCPU:
        return f"more than {bound:.0f} s"
    if done.returncode:
        return (done.stderr.strip().splitlines() or [f"code {done.returncode}"])[-1][:80]
    return {"wall": wall, **json.loads(done.stdout.splitlines()[-1])}


def ours(avatar: Path, folder: Path, rounds: int) -> dict[tuple[str, str], list[dict]]:
    """Return the rounds of "anew" and "again" (a kept registration) with each solver."""
    found: dict[tuple[str, str], list[dict]] = {}
    for turn in range(rounds):
        for solver in SOLVERS:
            for how in ("anew", "again"):
                cache = folder / f"cache-{avatar.stem}-{solver}-{turn}"
                one = run(["facegen", str(avatar), str(folder / "out.glb"), solver, *MADE, str(cache)], 600.0, folder)
                if isinstance(one, str):
                    print(f"{avatar.stem} {solver} {how}: {one}", file=sys.stderr)
                else:
                    found.setdefault((solver, how), []).append(one)
    return found


def least(rounds: list[dict], name: str) -> float:
    """Return the least of a figure over the rounds."""
    return min(one[name] for one in rounds)


def seconds(rounds: list[dict], name: str) -> str:
    """Return CPU and wall seconds as a cell."""
    cpu = "cpu" if name == "whole" else f"{name}_cpu"
    return f"{least(rounds, cpu):.1f} ({least(rounds, 'wall' if name == 'whole' else name):.1f})"


def our_table(measured: dict[int, dict]) -> str:
    """Return the table of facegen's figures."""
    rows = []
    for size, found in measured.items():
        for (solver, how), rounds in found.items():
            what = f"{size:,}, {solver}" + (", registration kept" if how == "again" else "")
            rows.append((what, seconds(rounds, "load"), seconds(rounds, "registration"), seconds(rounds, "shapes"),
                         seconds(rounds, "save"), seconds(rounds, "whole"), f"{least(rounds, 'peak'):.0f}"))
    return report.markdown(("triangles, solver", "load", "registration", "shapes", "save", "whole",
                            "peak, MiB"), rows)


def verdicts(measured: dict[int, dict]) -> list[str]:
    """Return what was asked for and whether it was reached, a line each."""
    lines = []
    for size, (whole, registration, shapes, peak) in GOALS.items():
        for solver in SOLVERS:
            rounds = measured.get(size, {}).get((solver, "anew"))
            for name, goal, unit in (("whole", whole, "s"), ("registration", registration, "s"),
                                     ("shapes", shapes, "s"), ("peak", peak, "MiB")):
                if rounds and goal is not None:
                    value = least(rounds, "wall" if name == "whole" else name)
                    said = f"{value:.1f} s by the clock" if unit == "s" else f"{value:.0f} MiB"
                    lines.append(f"- {size:,} triangles, {solver}: {name} {said} (goal {goal:g}: "
                                 f"{'met' if value <= goal else 'NOT met'}).")
    return lines


def peer_table(measured: dict[int, dict], peers: dict[int, dict]) -> str:
    """Return the table of other tools for the same steps."""
    rows = []
    for size, found in peers.items():
        rounds = measured[size].get(("scipy", "anew"), [])
        for name, one in found.items():
            own, step = ("registration", "registration") if name in parts.REGISTRATIONS else ("shapes", "shapes")
            if isinstance(one, str):
                rows.append((f"{size:,}", name, step, one, "", ""))
                continue
            times = one["cpu_step"] / least(rounds, f"{own}_cpu") if rounds else float("nan")
            rows.append((f"{size:,}", name, step, f"{one['cpu_step']:.1f} ({one['step']:.1f})", f"{times:.0f}",
                         f"{one['peak']:.0f}"))
    return report.markdown(("triangles", "tool", "step", "CPU s (wall s)", "times facegen's CPU, SciPy alone",
                            "peak, MiB"), rows)


def page(measured: dict[int, dict], peers: dict[int, dict], command: str, load: float, rounds: int) -> str:
    """Return the page in Markdown."""
    return "\n\n".join([
        "# How long an avatar takes",
        f"`{command}`, {datetime.date.today().isoformat()}, on {report.processor()}, {len(report.cores())} cores, "
        f"{platform.system()}, Python {platform.python_version()}; {', '.join(report.versions(_PACKAGES))}. "
        f"Load of the machine before the run: {load:.1f}.",
        f"`facegen rig` gives the shipped human, subdivided and decimated, {parts.COUNT} shapes (the first of `--set "
        f"{parts.SETS}`) in a GLB with normals. CPU seconds of all threads and forks, in brackets wall seconds, which "
        "other work on the machine prolongs. *Load* is everything before the transfer: imports, reading, checking "
        "landmarks, the template. *Shapes* is everything after the registration: solve, lids, lips, pieces. *Whole* is "
        f"the command, from the start of Python to the end of the process. The least of {rounds} rounds.",
        our_table(measured), *(["\n".join(lines)] if (lines := verdicts(measured)) else []),
        "## Beside public tools",
        "Registration: trimesh's two (the same skin, template and landmarks, default settings). Shapes: no public tool "
        "that installs from PyPI makes them, so *Sumner, a solve for each shape* is a plain re-implementation of what "
        "public scripts do - the normal equations of Sumner and Popović (2004) with a fourth vertex for each triangle, "
        f"given to `scipy.sparse.linalg.spsolve` anew for each shape - of which {parts.SOLVED} shapes were timed and "
        f"{parts.COUNT} extrapolated. It moves the skin alone.",
        peer_table(measured, peers)]) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="small sizes, one round")
    parser.add_argument("--rounds", type=int, default=3, help="of facegen's own figures")
    parser.add_argument("--bound", type=float, default=100.0, help="CPU seconds after which a peer is ended")
    parser.add_argument("-o", "--output", type=Path, help="page to write; printed without")
    options = parser.parse_args()
    sizes, rounds = (QUICK, 1) if options.quick else (SIZES, options.rounds)
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else float("nan")
    command = "python benchmarks/transfer.py" + (" --quick" if options.quick else f" --rounds {rounds}")
    measured: dict[int, dict] = {}
    peers: dict[int, dict] = {}

    def write() -> str:
        text = page(measured, peers, command, load, rounds)
        if options.output:                          # after every step: a run may be stopped
            options.output.write_text(text, encoding="utf-8")
        return text

    with tempfile.TemporaryDirectory() as folder:
        avatars = {size: decimated_human(Path(folder), size) for size in sizes}
        run(["facegen", str(avatars[sizes[0]]), f"{folder}/x.glb", "scipy", *MADE, f"{folder}/x"], 600.0, Path(folder))
        for size, avatar in avatars.items():
            print(f"{size} triangles", file=sys.stderr, flush=True)
            measured[size] = ours(avatar, Path(folder), rounds)
            write()
        for size in QUICK:
            for name in parts.PEERS:
                print(f"{size} triangles, {name}", file=sys.stderr, flush=True)
                peers.setdefault(size, {})[name] = run([name, str(avatars[size])], options.bound, Path(folder))
                write()
    if not options.output:
        print(write())


if __name__ == "__main__":
    main()

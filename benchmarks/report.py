"""From what was measured to a page of tables, what they say, and a plot."""

from __future__ import annotations

import datetime
import os
import platform
import statistics
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from importlib.metadata import PackageNotFoundError, version
from operator import attrgetter
from pathlib import Path

from worker import PEERS

# Ours in the comparison: one thread against all of the peers' threads, in CPU time.
OURS = "fast/neutral/1"
_PACKAGES = ("numpy", "numba", "moderngl", "vtk", "pyrender", "PyOpenGL")
_TARGETS = {1_000: 1.0, 10_000: 3.0, 40_000: 3.0, 85_000: 1.0}


@dataclass
class Result:
    """What one renderer did with one head. ``times``: (CPU, wall) seconds of the frames. ``cover``: the share of the
    picture that the head covers. ``edges``: the share of pixels it covers in part. ``info``: driver."""

    times: list[tuple[float, float]] = field(default_factory=list)
    cover: float = 0.0
    edges: float = 0.0
    info: str = ""
    missing: str = ""

    @property
    def cpu(self) -> float:
        """Median CPU milliseconds."""
        return 1e3 * statistics.median(cpu for cpu, _ in self.times)

    @property
    def least(self) -> float:
        """Least CPU milliseconds."""
        return 1e3 * min(cpu for cpu, _ in self.times)

    @property
    def wall(self) -> float:
        """Median wall milliseconds."""
        return 1e3 * statistics.median(wall for _, wall in self.times)


Field = dict[str, Result]


@dataclass
class Measured:
    """All figures of a run.

    ``load``: how many other processes wanted to run before it. Fields by triangles, by detail of the whole face and by
    pixels; start-up in seconds (empty caches, later); seconds a pose; seconds of a frame's two halves by renderer,
    detail and occlusion.
    """

    quick: bool
    load: float
    triangles: dict[int, Field] = field(default_factory=dict)
    whole: dict[int, Field] = field(default_factory=dict)
    pixels: dict[int, Field] = field(default_factory=dict)
    start: dict[str, tuple[float, float] | None] = field(default_factory=dict)
    poses: list[tuple[str, float]] = field(default_factory=list)
    frames: dict[tuple[str, int, str], tuple[float, float]] = field(default_factory=dict)


def write(measured: Measured, folder: Path) -> list[Path]:
    """Write the page and, where matplotlib is installed, the plot; return what was written."""
    (folder / "images").mkdir(parents=True, exist_ok=True)
    page, plot = folder / "benchmarks.md", folder / "images" / "benchmarks.svg"
    written = [page]
    try:
        draw_plot(measured, plot)
        written.append(plot)
    except ImportError:
        print('no plot: it needs matplotlib, pip install "facegen[bench]"')
    page.write_text(text(measured, plotted=plot in written), encoding="utf-8")
    return written


def text(measured: Measured, *, plotted: bool) -> str:
    """Return the page in Markdown."""
    race = {count: row for count, row in measured.triangles.items() if count in _TARGETS}
    whole = {detail: f"detail {detail}" for detail in measured.whole}
    parts = [
        "# Benchmarks", "Of the renderers. How long avatars take, `python benchmarks/transfer.py`: "
        "[transfer speed](transfer-speed.md).", _opening(measured), "## What it says", _reading(race, measured),
        "## A frame", "CPU milliseconds, median (least), of one picture of 512 x 512 pixels. CPU time is that of "
        "all threads of the process; the skin of the face is cut into as many triangles as said.",
        _table(race, lambda n: f"{n:,}", lambda r: f"{r.cpu:.1f} ({r.least:.1f})"),
        "The same in wall milliseconds, median:",
        _table(race, lambda n: f"{n:,}", lambda r: f"{r.wall:.1f}", attrgetter("wall")),
        "The whole face, with hair, eyes, teeth and tongue (detail 2 is what a picture of 512 pixels shows), CPU "
        "milliseconds:",
        _table(measured.whole, lambda d: whole[d], lambda r: f"{r.cpu:.1f} ({r.least:.1f})"),
        "## Start-up", "Wall seconds from a new Python process to its first picture of 10,000 triangles. Empty "
        "caches: the compiled code of numba, or the driver's shaders, are made and kept for later.",
        _start_table(measured),
        "## The main job", "One frame of an animation of the whole face: controls to vertices (deform, subdivide), "
        "then normals and picture at 512 x 512; one thread, CPU milliseconds, median. Frames a second are for one "
        "core; cores multiply them, because frames do not depend on each other.",
        _frames_table(measured),
        "Poses without pictures:", _poses_table(measured),
        "## Cost against triangles and pixels",
        *(["![CPU time against triangles and against pixels](images/benchmarks.svg)"] if plotted else []),
        "CPU milliseconds at 512 x 512 against triangles:",
        _table(measured.triangles, lambda n: f"{n:,}", lambda r: f"{r.cpu:.1f}"),
        "With 10,000 triangles against the picture's side in pixels:",
        _table(measured.pixels, str, lambda r: f"{r.cpu:.1f}"),
        "## How it is measured", _method(measured)]
    return "\n\n".join(parts) + "\n"


def label(name: str) -> str:
    """Return what a reader calls a contestant."""
    if name in PEERS:
        return name
    renderer, occlusion, threads = name.split("/")
    of = ", occlusion of each pose" if occlusion == "posed" else ""
    with_ = {"1": ", 1 thread", "0": ", all cores"}[threads] if renderer == "fast" else ""
    return f"**facegen {renderer}**{with_}{of}"


def draw_plot(measured: Measured, path: Path) -> None:
    """Draw CPU time against triangles and pixels."""
    import matplotlib
    matplotlib.use("Agg")
    matplotlib.rcParams["svg.hashsalt"] = "facegen"
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(1, 2, figsize=(11, 4.5), sharey=True)
    for axis, rows, title in ((axes[0], measured.triangles, "triangles, 512 x 512 pixels"),
                              (axes[1], {size**2: row for size, row in measured.pixels.items()},
                               "pixels, 10,000 triangles")):
        for name in _names(rows):
            if "/posed/" in name or name == "fast/neutral/0":
                continue
            points = sorted((x, row[name].cpu) for x, row in rows.items() if row[name].times)
            if points:
                axis.plot(*zip(*points, strict=True), marker="o", markersize=3.5, label=label(name).replace("**", ""),
                          linestyle="--" if name in PEERS else "-", linewidth=2.4 if name == OURS else 1.4)
        axis.set(xscale="log", yscale="log", xlabel=title)
        axis.grid(which="both", alpha=0.25)
    axes[0].set_ylabel("CPU milliseconds a frame")
    axes[0].legend(fontsize=8)
    figure.tight_layout()
    figure.savefig(path, metadata={"Date": None})
    pyplot.close(figure)


# -- parts of the page --------------------------------------------------------------------------------------------

def _opening(measured: Measured) -> str:
    command = "python benchmarks/renderers.py" + (" --quick" if measured.quick else "")
    lines = [f"`{command}`, {datetime.date.today().isoformat()}, on {processor()}, {len(cores())} cores, "
             f"{platform.system()}, Python {platform.python_version()}; {', '.join(versions())}; "
             f"OpenGL: {_driver(measured)}. Load of the machine before the run: {measured.load:.1f}."]
    if measured.quick:
        lines.append("**A quick run with few frames: its figures are rough.**")
    return "\n".join(lines)


def _reading(race: dict[int, Field], measured: Measured) -> str:
    lines = []
    for count, row in race.items():
        rival = _fastest_peer(row)
        if rival and _ran(row, OURS):
            ratio = row[rival].cpu / row[OURS].cpu
            verdict = "met" if ratio >= _TARGETS[count] else "NOT met"
            lines.append(f"- {count:,} triangles: facegen fast on one thread takes {row[OURS].cpu:.1f} ms, the fastest "
                         f"peer ({rival}) {row[rival].cpu:.1f} ms of CPU: **{ratio:.1f} times** less (target "
                         f"{_TARGETS[count]:g}: {verdict}).")
    fields = [*measured.triangles.values(), *measured.whole.values(), *measured.pixels.values()]
    for name in _names(race):
        shares = [row[name].cpu / row[rival].cpu for row in fields
                  if name not in PEERS and _ran(row, name) and (rival := _fastest_peer(row))]
        if shares:
            behind = sum(share > 1 for share in shares)
            where = f"behind it in {behind} of {len(shares)}" if behind else "ahead of it in all"
            lines.append(f"- {label(name)} takes {min(shares):.2f} to {max(shares):.2f} times the CPU time of the "
                         f"fastest peer over all heads and sizes below; {where}.")
    if _fastest_peer(next(iter(race.values()))) is None:
        lines.append("- No peer is installed here, so nothing is compared.")
    lines.append("- The pictures are not equal work. facegen shades skin that light creeps through, four lights with "
                 "soft shadow from an occlusion table, an ambient sky, eyes that mirror a window and the sRGB curve, "
                 "and computes its own normals; the peers do a Blinn-Phong (pyrender: metallic-roughness) picture with "
                 "three lights and get normals for nothing. pyrender also reads the depth back, which cannot be turned "
                 "off.")
    lines.append("- The peers run on a software OpenGL here where the driver's name is llvmpipe. On a graphics card "
                 "they, and facegen gl, are far faster than any processor; then only the way to the card and "
                 "back counts.")
    lines.append("- Occlusion of each pose is right for mouths that open wide; that of the neutral face is computed "
                 "once.")
    return "\n".join(lines)


def _method(measured: Measured) -> str:
    row = next(iter(measured.triangles.values()))
    some = [result for result in row.values() if result.times]
    counts = [len(result.times) for field_ in measured.triangles.values() for result in field_.values() if result.times]
    cover, edges = zip(*((result.cover, result.edges) for result in some), strict=True)
    absent = [f"- {label(name)} is missing: {result.missing}" for name, result in row.items() if result.missing]
    return "\n".join([
        "- Each renderer has one process that stays; in turns one of them draws four frames (the first is not "
        f"counted) while the others wait. {min(counts)} to {max(counts)} frames are timed, fewer for slow renderers.",
        "- The head smiles and relaxes: all positions change each frame, and each picture comes back as an array of "
        "8-bit RGBA. Peers get positions and normals as float32, ready to upload; buffers are written in place.",
        f"- All antialias with four samples a pixel. In the first frame the head covers {100 * min(cover):.2f} to "
        f"{100 * max(cover):.2f} % of the picture, and {100 * min(edges):.2f} to {100 * max(edges):.2f} % of the "
        "pixels are covered in part: one silhouette, and antialiasing is on wherever the latter is not zero.",
        *absent])


def _table(rows: dict[int, Field], head: Callable[[int], str], cell: Callable[[Result], str],
           measure: Callable[[Result], float] = attrgetter("cpu")) -> str:
    lines = [(label(name), *(cell(row[name]) if _ran(row, name) else "missing" for row in rows.values()))
             for name in _names(rows)]
    ratios = ["" if (rival := _fastest_peer(row, measure)) is None or not _ran(row, OURS)
              else f"{measure(row[rival]) / measure(row[OURS]):.1f} ({rival})" for row in rows.values()]
    return markdown(("renderer", *map(head, rows)), [*lines, ("*fastest peer / fast, 1 thread*", *ratios)])


def _start_table(measured: Measured) -> str:
    return markdown(("renderer", "empty caches", "later"),
                     [(label(name), *(("failed", "") if times is None else (f"{t:.2f}" for t in times)))
                      for name, times in measured.start.items()])


def _frames_table(measured: Measured) -> str:
    return markdown(("renderer", "detail", "occlusion", "pose", "normals and picture", "frame", "frames a second"),
                     [(f"facegen {name}", str(detail), occlusion, f"{1e3 * pose:.1f}", f"{1e3 * picture:.1f}",
                       f"{1e3 * (pose + picture):.1f}", f"{1 / (pose + picture):.0f}")
                      for (name, detail, occlusion), (pose, picture) in measured.frames.items()])


def _poses_table(measured: Measured) -> str:
    return markdown(("what", "microseconds a pose", "poses a second"),
                     [(what, f"{1e6 * s:.0f}", f"{1 / s:,.0f}") for what, s in measured.poses])


def markdown(head: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """Return a table: the first column to the left, figures to the right."""
    head = list(head)
    body = [f"| {' | '.join(row)} |" for row in [head, ["---", *["---:"] * (len(head) - 1)], *map(list, rows)]]
    return "\n".join(body)


# -- what there is ------------------------------------------------------------------------------------------------

def _ran(row: Field, name: str) -> bool:
    return name in row and bool(row[name].times)


def _names(rows: dict[int, Field]) -> list[str]:
    return list(next(iter(rows.values())))


def _fastest_peer(row: Field, measure: Callable[[Result], float] = attrgetter("cpu")) -> str | None:
    return min((name for name in PEERS if _ran(row, name)), key=lambda name: measure(row[name]), default=None)


def versions(packages: Iterable[str] = _PACKAGES) -> list[str]:
    """Return which versions are installed."""
    found = []
    for package in packages:
        try:
            found.append(f"{package} {version(package)}")
        except PackageNotFoundError:
            found.append(f"no {package}")
    return found


def _driver(measured: Measured) -> str:
    return next((result.info for name in PEERS for row in measured.triangles.values() for result in [row[name]]
                 if result.info), "none")


def processor() -> str:
    """Return what the processor is called."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        return next(line.split(":", 1)[1].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        return platform.processor() or platform.machine()


def cores() -> set[int]:
    """Return the cores that this process may use."""
    return os.sched_getaffinity(0) if hasattr(os, "sched_getaffinity") else set(range(os.cpu_count() or 1))

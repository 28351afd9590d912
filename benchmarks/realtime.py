"""Measure how fast a face follows frames of weights: python benchmarks/realtime.py [--quick] [-o docs].

Writes realtime.md in the folder. Every way of showing a frame is shown the same frames, in turns of a few, so that all
see the same machine; a frame is timed from its weights to the array that comes back.
"""

from __future__ import annotations

import argparse
import datetime
import os
import platform
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from report import cores, markdown, processor, versions

import facegen
from facegen.blendshapes.recipes import shape_set

NAMES = tuple(shape_set("arkit"))
SIZE = 512
TURN = 5                    # frames a turn; the first is not counted: it finds the caches full of others' data
SECONDS = 4.0               # a way that has used so much has been measured


@dataclass
class Way:
    """One way from weights to an array. ``before``: the way that it is compared with, by name."""

    name: str
    show: Callable[[dict[str, float]], np.ndarray]
    before: str | None = None
    times: list[float] = field(default_factory=list)

    @property
    def median(self) -> float:
        return 1e3 * float(np.median(self.times))

    @property
    def slowest(self) -> float:
        return 1e3 * float(np.percentile(self.times, 95))


def frames(count: int) -> list[dict[str, float]]:
    """Return frames of a talking, blinking face: smooth, most shapes at work a little, as trackers report them."""
    rng = np.random.default_rng(0)
    t = np.arange(count)[:, None] / 30
    speed, phase, much = rng.uniform(0.2, 2.0, 52), rng.uniform(0, 7, 52), rng.uniform(0.0, 0.5, 52)
    weights = np.maximum(0.0, much * np.sin(2 * np.pi * speed * t + phase))
    return [dict(zip(NAMES, row, strict=True)) for row in weights.tolist()]


def race(ways: list[Way], shown: list[dict[str, float]], count: int) -> None:
    """Let the ways show the frames in turns."""
    for start in range(0, count, TURN - 1):
        for way in ways:
            if sum(way.times) > SECONDS:
                continue
            for k in range(TURN):
                frame = shown[(start + k) % len(shown)]
                begin = time.perf_counter()
                way.show(frame)
                if k:
                    way.times.append(time.perf_counter() - begin)


def converted(frame: dict[str, float]) -> dict[str, float]:
    return dict(facegen.convert({name: weight for name, weight in frame.items() if weight}, "arkit", "units").weights)


def ways_of(face: object, renderer: str) -> tuple[list[Way], list[Way]]:
    """Return the ways to vertices and those to pictures."""
    live = facegen.Live(face, "arkit", size=SIZE, renderer=renderer)
    detail = live._renderer.detail
    kept = facegen.Renderer(face, size=SIZE, renderer=renderer)
    vertices = [Way("Live.vertices", live.vertices, "convert, face.pose"),
                Way("convert, face.pose", lambda frame: face.pose(converted(frame), detail=detail))]
    if hasattr(face, "pose_shapes"):
        vertices.append(Way("face.pose_shapes", face.pose_shapes))
    fine = facegen.Live(face, "arkit", size=SIZE, renderer=renderer, occlusion="posed")
    pictures = [Way("Live.draw", live.draw, "convert, Renderer.draw"),
                Way('Live.draw, occlusion="posed"', fine.draw, "convert, Renderer.draw"),
                Way("convert, Renderer.draw", lambda frame: kept.draw(converted(frame))),
                Way("convert, facegen.render", lambda frame: facegen.render(
                    face, converted(frame), size=SIZE, renderer=renderer))]
    return vertices, pictures


def table(ways: list[Way]) -> str:
    by_name = {way.name: way for way in ways}
    rows = [(f"**{way.name}**" if way.before else way.name, f"{way.median:.2f}", f"{way.slowest:.2f}",
             f"{1e3 / way.median:.0f}", f"{by_name[way.before].median / way.median:.1f} times" if way.before else "")
            for way in ways]
    return markdown(("way", "median ms", "95 % below, ms", "frames a second", "faster than the way before"), rows)


def page(found: dict[str, tuple[list[Way], list[Way], int, int]], renderer: str, load: float, quick: bool) -> str:
    command = "python benchmarks/realtime.py" + (" --quick" if quick else "")
    parts = ["# Realtime", "From one frame of 52 ARKit weights to vertices, or to a picture of "
             f"{SIZE} x {SIZE} pixels (renderer `{renderer}`): what [`facegen.Live`](play.md#live) prepares once, "
             "beside calling the same functions anew.",
             f"`{command}`, {datetime.date.today().isoformat()}, on {processor()}, {len(cores())} cores, "
             f"{platform.system()}, Python {platform.python_version()}; {', '.join(versions())}. Load of the machine "
             f"before the run: {load:.1f}."]
    if load > len(cores()):
        parts.append("The machine was busy with other work: times are longer than on a quiet one; the ways suffered "
                     "alike.")
    if quick:
        parts.append("**A quick run with few frames: its figures are rough.**")
    for what, (vertices, pictures, count, shapes) in found.items():
        parts += [f"## {what}", f"{count:,} vertices" + (f", {shapes} shapes." if shapes else "."), "Vertices:",
                  table(vertices), "Pictures:", table(pictures)]
    counts = [len(way.times) for vertices, pictures, _, _ in found.values() for way in (*vertices, *pictures)]
    parts += ["## How it is measured", "- Latency is wall time: from the mapping of weights to the array. The renderer "
              "may use all cores.\n- `convert` finds units for the weights, which face.pose takes; "
              "`face.pose_shapes` takes an avatar's own weights, without the head. `Live` needs no conversion: an "
              "avatar's own shapes take the weights as they are, and the parametric face adds movements that were made "
              f"ready.\n- The ways take turns of {TURN - 1} frames; {min(counts)} to {max(counts)} frames are timed, "
              "fewer for slow ways.\n- `Live.draw` works out once, for the neutral, how far each vertex sees out; "
              "the others do for every frame, which is right for mouths that open wide."]
    return "\n\n".join(parts) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="few frames, for a try")
    parser.add_argument("-o", "--output", type=Path, default=Path(__file__).parents[1] / "docs")
    options = parser.parse_args()
    load, count = os.getloadavg()[0], 40 if options.quick else 400
    shown = frames(300)
    with tempfile.TemporaryDirectory() as folder:
        avatar = facegen.rig("human", Path(folder) / "human.glb", sets=["arkit"]).path
        faces = {"The parametric face (akimoto)": facegen.load_face(),
                 "A rigged avatar (human, ARKit's shapes)": facegen.load_face(avatar)}
        renderer = facegen.Renderer(next(iter(faces.values())), size=64).renderer
        found = {}
        for what, face in faces.items():
            vertices, pictures = ways_of(face, renderer)
            race(vertices, shown, count)
            race(pictures, shown, count)
            found[what] = vertices, pictures, len(face.mesh().vertices), len(getattr(face, "shapes", ()))
    text = page(found, renderer, load, options.quick)
    (options.output / "realtime.md").write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()

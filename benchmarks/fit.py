"""How fast and how exact weights are fitted: python benchmarks/fit.py [--frames 300]

The shipped human with ARKit's 52 shapes performs (twelve shapes at a time, the head turning), a camera of 40 degrees at
0.7 m sees it in 1280 x 720 pixels. The peer is the plain way: scipy.optimize.least_squares over pose and weights in
their bounds, begun where the last frame ended, on the same frames in the same process.
"""

from __future__ import annotations

import argparse
import os
import platform
import tempfile
import time
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import scipy
from scipy.optimize import least_squares

import facegen
from facegen.fitting.fit import fit_landmarks, fit_markers, fit_meshes, landmark_tracker, layout_points
from facegen.fitting.head_pose import rotation
from facegen.fitting.rigs import wanted

RATE = 30.0
CAMERA = facegen.Pinhole.of_view(40.0, (1280, 720))
COUNTS = {"ibug68": 68, "mediapipe478": 478}
STILL = ("eyeLook", "tongueOut", "cheekPuff")       # what landmarks on the skin hardly see
PEER_FRAMES = 12


def performance(face, frames: int, seed: int = 1) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return weights (n, 52), vertices in the camera's frame (n, v, 3) and angles (n, 3)."""
    rng, names = np.random.default_rng(seed), wanted(face).names
    time_of, weights = np.arange(frames) / RATE, np.zeros((frames, len(names)))
    able = [k for k, name in enumerate(names) if not name.startswith(STILL)]
    for k in rng.choice(able, 12, replace=False):
        weights[:, k] = np.clip(0.6 * np.sin(time_of * rng.uniform(2, 8) + rng.uniform(0, 6)) + 0.2, 0.0, 1.0)
    jaw, close = names.index("jawOpen"), names.index("mouthClose")
    weights[:, close] = np.minimum(weights[:, close], weights[:, jaw])
    turns = np.column_stack([20 * np.sin(time_of), 8 * np.cos(1.3 * time_of), 5 * np.sin(0.7 * time_of)])
    columns = wanted(face).columns
    posed = [face.pose_shapes(dict(zip(columns, row.tolist(), strict=True))) for row in weights]
    seen = np.array([one @ rotation(*turn).T + (20, 10, -700) for one, turn in zip(posed, turns, strict=True)])
    return weights, seen, turns


def pictured(face, seen: np.ndarray, layout: str) -> np.ndarray:
    rows, _, indices = layout_points(face, layout, None)
    points = np.full((len(seen), COUNTS[layout], 2), np.nan)
    for k, vertices in enumerate(seen):
        points[k, indices] = CAMERA.project(rows @ vertices)
    return points


def rate(work, frames) -> tuple[float, float]:
    """Return frames a second by the clock and by the processor's time."""
    wall, cpu = time.perf_counter(), time.process_time()
    for frame in frames:
        work(frame)
    return len(frames) / (time.perf_counter() - wall), len(frames) / (time.process_time() - cpu)


def peer(tracker, share):
    """Return a function that fits a frame with SciPy's least squares, begun at the last."""
    points, view, k = tracker.points, tracker.view, len(tracker.points.names)
    root, last = np.sqrt(share)[:, None], [np.concatenate([[0, 0, 0, 20, 10, -700.0], np.zeros(k)])]

    def off(p, goal):
        return (root * (view.project(points.places(p[6:]) @ rotation(*p[:3]).T + p[3:6], 1.0) - goal)).ravel()

    def work(goal):
        low, high = np.concatenate([np.full(6, -np.inf), np.zeros(k)]), np.concatenate([np.full(6, np.inf), np.ones(k)])
        begin = np.clip(last[0], low + 1e-9, high - 1e-9)
        last[0] = least_squares(off, begin, bounds=(low, high), args=(goal,), x_scale="jac", ftol=1e-4, xtol=1e-4).x

    return work


def speeds(face, frames: int) -> None:
    _, seen, _ = performance(face, frames)
    rng = np.random.default_rng(0)
    print("| rig, measurements | frames a second | by processor time |\n| --- | ---: | ---: |")
    rates = {}
    for layout in COUNTS:
        points = pictured(face, seen, layout)
        points += rng.normal(0, 1.0, points.shape)
        for name, camera in (("a camera", CAMERA), ("weak perspective", None)):
            tracker, used = landmark_tracker(face, layout, camera=camera)
            tracker.step(points[0][used])
            rates[layout, name] = rate(lambda goal, t=tracker: t.step(goal, 1 / RATE), points[:, used])
            print(f"| 52 shapes, {layout}, {name} | {rates[layout, name][0]:.0f} | {rates[layout, name][1]:.0f} |")
    points = pictured(face, seen, "ibug68") + rng.normal(0, 1.0, (frames, 68, 2))
    tracker, used = landmark_tracker(face, "ibug68", camera=CAMERA)
    plain = rate(peer(tracker, tracker.share), points[:PEER_FRAMES, used])
    print(f"| the same with scipy's least_squares, ibug68, a camera | {plain[0]:.2f} | {plain[1]:.2f} |")
    few = seen[:: max(1, frames // 20)]
    clock = time.process_time()
    fit_meshes(face, few)
    spent = time.process_time() - clock
    print(f"| 52 shapes, {len(face.mesh().vertices):,} vertices of a mesh, start included | | {len(few) / spent:.0f} |")
    base = facegen.load_face()
    rows, _, _ = layout_points(base, "ibug68", None)
    posed = [base.pose({"12": max(0.0, np.sin(k / 8)), "27": 0.4 * abs(np.sin(k / 5)), "1": 0.3}) for k in range(60)]
    goals = np.array([CAMERA.project(rows @ vertices + (0, 0, -700)) for vertices in posed])
    tracker, _ = landmark_tracker(base, "ibug68", camera=CAMERA)
    tracker.step(goals[0])
    found = rate(lambda goal: tracker.step(goal, 1 / RATE), goals)
    print(f"| the parametric face, {len(tracker.points.names)} units, ibug68, a camera | {found[0]:.0f} | "
          f"{found[1]:.0f} |")
    print(f"\nAgainst scipy's least_squares: {rates['ibug68', 'a camera'][1] / plain[1]:.0f} times as fast "
          "(by processor time).")


def errors(face, frames: int) -> None:
    weights, seen, turns = performance(face, frames)
    names, rng = wanted(face).names, np.random.default_rng(3)
    print("\n| measured | noise | missing | weights, RMS | of those at work | head, degrees | residual |\n"
          "| --- | ---: | ---: | ---: | ---: | ---: | ---: |")

    def row(name, noise, unit, gone, fitted):
        got = np.column_stack([fitted.performance.column(one) if one in fitted.performance.names else np.zeros(frames)
                               for one in names])
        off, active = got - weights, weights.any(axis=0)
        turn = np.sqrt(np.nanmean((fitted.performance.head - turns) ** 2))
        print(f"| {name} | {noise:g} {unit} | {100 * gone:.0f} % | {np.sqrt(np.nanmean(off**2)):.3f} | "
              f"{np.sqrt(np.nanmean(off[:, active] ** 2)):.3f} | {turn:.2f} | {fitted.residual:.2f} {unit} |")

    for layout in COUNTS:
        clean = pictured(face, seen, layout)
        for noise, gone in ((0.0, 0.0), (0.5, 0.0), (1.0, 0.0), (1.0, 0.2), (1.0, 0.5), (2.0, 0.0)):
            points = clean + rng.normal(0, noise, clean.shape)
            points[rng.random(clean.shape[:2]) < gone] = np.nan
            row(layout, noise, "px", gone, fit_landmarks(face, points, layout, camera=CAMERA, noise=max(noise, 0.1),
                                                         fps=RATE))
    marks = [name for name in face.landmarks if not name.startswith("eye_center")]
    rows = face.landmark_weights()[[face.landmarks.index(name) for name in marks]]
    clean = np.array([rows @ vertices for vertices in seen])
    for noise, gone in ((0.0, 0.0), (0.5, 0.0), (0.5, 0.2), (1.0, 0.0)):
        points = clean + rng.normal(0, noise, clean.shape)
        points[rng.random(clean.shape[:2]) < gone] = np.nan
        fitted = fit_markers(face, points, marks, noise=max(noise, 0.1), fps=RATE)
        row(f"{len(marks)} markers", noise, "mm", gone, fitted)
    some = slice(None, None, max(1, frames // 10))
    for noise in (0.0, 0.5):
        fitted = fit_meshes(face, seen[some] + rng.normal(0, noise, seen[some].shape), noise=max(noise, 0.1), fps=RATE)
        got = np.column_stack([fitted.performance.column(one) if one in fitted.performance.names else
                               np.zeros(len(fitted.performance)) for one in names])
        off = got - weights[some]
        print(f"| {len(face.mesh().vertices):,} vertices | {noise:g} mm | 0 % | {np.sqrt(np.mean(off**2)):.4f} | "
              f"{np.sqrt(np.mean(off[:, weights.any(axis=0)] ** 2)):.4f} | "
              f"{np.sqrt(np.mean((fitted.performance.head - turns[some]) ** 2)):.3f} | {fitted.residual:.2f} mm |")


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    asked.add_argument("--frames", type=int, default=300)
    frames = asked.parse_args().frames
    print(f"numpy {np.__version__}, scipy {scipy.__version__}, {platform.machine()}, one thread; load of the machine: "
          f"{os.getloadavg()[0]:.1f}\n")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "human.glb"
        facegen.rig("human", path, sets=["arkit"])
        face = facegen.load_face(path)
        speeds(face, frames)
        errors(face, min(frames, 100))


if __name__ == "__main__":
    main()

"""How far proposed landmarks lie from those that people set: the table of docs/landmarks.md.

    python benchmarks/landmarks.py [HEAD.obj:LANDMARKS.yaml ...] [--copies 3]

Heads of your own, each with a landmark file, are measured besides the shipped avatars and the base face. Errors are in
distances between the outer corners of the eyes, over the required landmarks: median, nine in ten, worst.
"""

from __future__ import annotations

import argparse
import time
from itertools import pairwise
from pathlib import Path

import numpy as np

from facegen.face.face import load_face
from facegen.face.landmarks import REQUIRED
from facegen.fileio.avatar import load_avatar
from facegen.geometry.mesh import Mesh
from facegen.landmarking.propose import Proposer
from facegen.transfer.landmarks import load_landmarks
from facegen.transfer.rig import avatar_files, avatar_names

SIX = ("eye_outer_L", "eye_outer_R", "nose_tip", "mouth_corner_L", "mouth_corner_R", "chin")
BINS = (0.0, 0.2, 0.4, 0.6, 0.8, 1.01)
NEAR = 0.05


def errors(found, true):
    """Return (confidence, error) (k, 2) of the required places that were proposed."""
    unit = np.linalg.norm(true["eye_outer_L"] - true["eye_outer_R"])
    return np.array([(found[name].confidence, np.linalg.norm(found[name].xyz - true[name]) / unit)
                     for name in REQUIRED if name in found and not found[name].given])


def turned(mesh: Mesh, true, seed: int):
    """Return a copy turned, scaled and moved at random, and its landmarks."""
    random = np.random.default_rng(seed)
    q = np.linalg.qr(random.normal(size=(3, 3)))[0]
    q = q * np.sign(np.linalg.det(q))
    scale, offset = 10 ** random.uniform(-2, 2), random.normal(size=3)

    def move(at):
        return scale * (np.asarray(at) @ q.T) + offset * scale * 100
    return mesh.with_vertices(move(mesh.vertices)), {name: move(at) for name, at in true.items()}


def remeshed(mesh: Mesh, share: float) -> Mesh:
    """Return a mesh of other triangles, ``share`` times as many."""
    from fast_simplification import simplify

    size = np.ptp(mesh.vertices, axis=0).max()
    points = (mesh.vertices / size).astype(np.float32)
    vertices, faces = simplify(points, np.array(mesh.faces), target_reduction=1 - share)
    return Mesh.of(vertices.astype(float) * size, faces)


def heads(extra):
    """Yield (name, mesh, landmarks: name -> place)."""
    face = load_face()
    mesh = face.mesh(2)
    yield "base face", mesh, face.landmark_points(mesh.vertices, detail=2)
    for name in avatar_names():
        path, marks = avatar_files(name, None)
        mesh = load_avatar(path).mesh
        yield name, mesh, load_landmarks(marks, mesh).points(mesh.vertices)
    for one in extra:
        path, marks = one.split(":")
        mesh = load_avatar(path).mesh
        yield Path(path).stem, mesh, load_landmarks(marks, mesh).points(mesh.vertices)


def row(text, *columns):
    print(f"| {text} | " + " | ".join(columns) + " |", flush=True)


def shown(e):
    return " / ".join(f"{100 * q:.1f}" for q in (np.median(e), np.quantile(e, 0.9), e.max()))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("heads", nargs="*", help="HEAD.obj:LANDMARKS.yaml")
    parser.add_argument("--copies", type=int, default=1, help="turned copies of the shipped human")
    args = parser.parse_args()
    print("| head | recognised | from none, % | the same places as from six, % | from six, % | first call, s "
          "| first click, s |")
    print("|---|---|---|---|---|---|---|")
    every = {"none": [], "six": []}
    every_head = []
    for name, mesh, true in heads(args.heads):
        every_head.append((name, mesh, true))
        if name == "human":
            every_head += [(f"human turned {k + 1}", *turned(mesh, true, k)) for k in range(args.copies)]
            every_head.append(("human, 0.4 of the triangles", remeshed(mesh, 0.4), true))
    for name, mesh, true in every_head:
        start = time.perf_counter()
        proposer = Proposer(mesh)
        none = proposer.propose({})
        first = time.perf_counter() - start
        start = time.perf_counter()
        six = proposer.propose({one: true[one] for one in SIX})
        click = time.perf_counter() - start
        rest = {one: place for one, place in true.items() if one not in SIX}
        found = {"none": errors(none, true), "six": errors(six, true)}
        same = errors({one: none[one] for one in rest if one in none}, true)
        for key, one in found.items():
            every[key].append(one)
        row(name, f"{none.face:.2f}", shown(found["none"][:, 1]), shown(same[:, 1]), shown(found["six"][:, 1]),
            f"{first:.1f}", f"{click:.2f}")
    from scipy.stats import spearmanr

    both = np.concatenate([*every["none"], *every["six"]])
    print(f"\nrank correlation of confidence and nearness: {spearmanr(both[:, 0], -both[:, 1])[0]:.2f}")
    print("\n| confidence | places | within 5 % | median error, % | nine in ten, % |\n|---|---|---|---|---|")
    for low, high in pairwise(BINS):
        e = both[(both[:, 0] >= low) & (both[:, 0] < high), 1]
        if len(e):
            row(f"{low:.1f} to {min(high, 1.0):.1f}", f"{len(e)}", f"{(e < NEAR).mean():.0%}",
                f"{100 * np.median(e):.1f}", f"{100 * np.quantile(e, 0.9):.1f}")


if __name__ == "__main__":
    main()

"""What a pose costs, alone, in batch and as part of a frame: python benchmarks/poses.py prints it.

A pose is random but plausible: a mix of three to six action units. The cage is the triangles that the feature
points move (level 0, without the parts); a surface has all parts.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

import facegen

ROUNDS = 7
_BATCHES = {0: 512, 1: 256, 2: 64, 3: 16}


def best(action: Callable[[], object]) -> float:
    """Return the seconds of the fastest of some rounds: what the machine can do when nothing else runs."""
    action()
    times = []
    for _ in range(ROUNDS):
        start = time.perf_counter()
        action()
        times.append(time.perf_counter() - start)
    return min(times)


def random_controls(face: facegen.Face, count: int, *, seed: int = 1986) -> facegen.Controls:
    """Return a batch of controls, each a mix of units."""
    draw = np.random.default_rng(seed)
    catalogue = facegen.load_units().catalogue
    atoms = [atom for unit in catalogue.units.values() if unit.region != "head" for atom in unit.atoms]
    poses = []
    for _ in range(count):
        chosen = draw.choice(len(atoms), size=draw.integers(3, 7), replace=False)
        weights = {atoms[i]: float(draw.uniform(0.2, 1.0)) for i in chosen}
        poses.append(face.controls(facegen.resolve(weights).deformation))
    return facegen.Controls(**{name: np.stack([getattr(pose, name) for pose in poses])
                               for name in vars(poses[0])})


def pick(controls: facegen.Controls, rows: slice | int) -> facegen.Controls:
    """Return some of a batch of controls."""
    return facegen.Controls(**{name: value[rows] for name, value in vars(controls).items()})


def pose_costs() -> list[tuple[str, float]]:
    """Return what a pose of each kind costs: what it is, seconds."""
    face = facegen.load_face()
    controls = random_controls(face, max(_BATCHES.values()))
    deform, count = face.deformer.deform, len(controls.vectors)
    still = np.zeros_like(controls.jaw), np.zeros_like(controls.lids)
    one = pick(controls, slice(0, 1))
    costs = [(f"cage, {len(face.deformer.neutral)} vertices, batch of {count}",
              best(lambda: deform(controls.vectors, controls.jaw, controls.lids)) / count),
             ("of that, feature points only", best(lambda: deform(controls.vectors, *still)) / count),
             ("cage, one pose alone", best(lambda: deform(one.vectors, one.jaw, one.lids)))]
    for detail, size in _BATCHES.items():
        some = pick(controls, slice(0, size))
        seconds = best(lambda some=some, detail=detail: face.pose_controls(some, detail=detail)) / size
        vertices = len(face.mesh(detail).vertices)
        costs.append((f"surface of level {detail}, {vertices} vertices, batch of {size}", seconds))
    costs.append(("surface of level 2, one pose alone", best(lambda: face.pose_controls(one))))
    costs.append(("name to vertices: face.pose('happiness')", best(lambda: face.pose("happiness"))))
    return costs


def frame_costs(renderer: str, detail: int, occlusion: str, count: int) -> tuple[float, float]:
    """Return the median seconds of a frame's two halves: controls to vertices; normals and picture. One thread."""
    face = facegen.load_face()
    controls = random_controls(face, count + 1)
    painter = facegen.Renderer(face, detail=detail, renderer=renderer, occlusion=occlusion, threads=1)
    times = []
    for k in range(count + 1):
        start = time.process_time()
        vertices = face.pose_controls(pick(controls, k), detail=detail)
        posed = time.process_time()
        painter.draw(vertices)
        times.append((posed - start, time.process_time() - posed))
    pose, picture = np.median(times[1:], axis=0)            # the first one compiles and fills the caches
    return float(pose), float(picture)


if __name__ == "__main__":
    for label, seconds in pose_costs():
        print(f"{label:58s} {seconds * 1e6:10.1f} us")

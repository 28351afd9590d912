"""How long a pose and a picture take: python benchmarks/deform.py. Prints; never fails on time.

A pose is random but plausible: a mix of three to six action units. The cage is the triangles that the feature
points move (level 0, without the parts); the surface is what a picture of 512 pixels shows (level 2, all
parts).
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

import facegen

BATCH, ROUNDS = 512, 7


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


def pick(controls: facegen.Controls, rows: slice) -> facegen.Controls:
    return facegen.Controls(**{name: value[rows] for name, value in vars(controls).items()})


def main() -> None:
    face = facegen.load_face()
    controls = random_controls(face, BATCH)
    deform = face.deformer.deform
    rows = []
    seconds = best(lambda: deform(controls.vectors, controls.jaw, controls.lids))
    rows.append((f"cage, {len(face.deformer.neutral)} vertices, batch of {BATCH}", seconds / BATCH))
    jaw_less = np.zeros_like(controls.jaw), np.zeros_like(controls.lids)
    seconds = best(lambda: deform(controls.vectors, *jaw_less))
    rows.append(("  of that, feature points only", seconds / BATCH))
    one = pick(controls, slice(0, 1))
    rows.append(("cage, one pose alone", best(lambda: deform(one.vectors, one.jaw, one.lids))))
    for detail in range(4):
        count = {0: 512, 1: 256, 2: 64, 3: 16}[detail]
        some = pick(controls, slice(0, count))
        seconds = best(lambda some=some, detail=detail: face.pose_controls(some, detail=detail))
        vertices = len(face.mesh(detail).vertices)
        rows.append((f"surface of level {detail}, {vertices} vertices, batch of {count}", seconds / count))
    rows.append(("surface of level 2, one pose alone", best(lambda: face.pose_controls(one))))
    rows.append(("name to vertices: face.pose('happiness')", best(lambda: face.pose("happiness"))))
    vertices = face.pose("happiness")
    rows.append(("picture 512x512, occlusion of the neutral",
                 best(lambda: facegen.render(face, vertices, occlusion="neutral"))))
    for label, seconds in rows:
        print(f"{label:58s} {seconds * 1e6:10.1f} us")


if __name__ == "__main__":
    main()

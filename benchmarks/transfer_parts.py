"""One step with one tool, in a process of its own: python benchmarks/transfer_parts.py SECONDS TOOL AVATAR ...

It is ended after so many CPU seconds. The last line printed is JSON: seconds and CPU seconds of steps, and the process'
peak of memory in MiB.
"""

from __future__ import annotations

import json
import os
import resource
import sys
import time
from collections.abc import Callable
from contextlib import contextmanager
from pathlib import Path

import numpy as np

# The shapes that are made: the first so many of these sets.
SETS, COUNT = "units,visemes,vrm", 100
# Shapes that the plain reference solves; the others are extrapolated.
SOLVED = 2
REGISTRATIONS = ("trimesh nricp_sumner", "trimesh nricp_amberg")
PEERS = (*REGISTRATIONS, "Sumner, a solve for each shape")


def cpu() -> float:
    """Return CPU seconds of this process and of its forks so far."""
    about = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(one.ru_utime + one.ru_stime for one in about)


class Clock:
    """Seconds of named steps, wall and CPU, summed over their calls."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    @contextmanager
    def __call__(self, name: str):
        wall, begun = time.perf_counter(), cpu()
        try:
            yield
        finally:
            for key, since, now in ((name, wall, time.perf_counter()), (f"{name}_cpu", begun, cpu())):
                self.seconds[key] = self.seconds.get(key, 0.0) + now - since

    def on(self, module, name: str, step: str) -> None:
        """Time every call of a module's function."""
        function = getattr(module, name)

        def timed(*args, **how):
            with self(step):
                return function(*args, **how)

        setattr(module, name, timed)


def used() -> dict[str, float]:
    """Return CPU seconds and the peak of memory, MiB, of this process so far."""
    about = resource.getrusage(resource.RUSAGE_SELF)
    peak = about.ru_maxrss / (2**20 if sys.platform == "darwin" else 2**10)
    return {"cpu": cpu(), "peak": peak}


def facegen(avatar: str, output: str, solver: str, sets: str, names: str, cache: str) -> dict[str, float]:
    """Give an avatar some shapes by the command, its steps timed."""
    if solver == "scipy":
        sys.modules["qdldl"] = None             # as if it were not installed
    os.environ["FACEGEN_CACHE"] = cache
    clock = Clock()
    with clock("load"):
        from facegen.cli.app import run
        from facegen.transfer import rig, transfer

        clock.on(transfer, "lay_skin", "registration")
        clock.on(transfer.Binding, "shapes", "shapes")
        clock.on(rig, "save_avatar", "save")
        if run(["rig", avatar, "-o", output, "--landmarks", str(Path(avatar).with_suffix(".yaml")), "--set", sets,
                "--shapes", names]):
            raise SystemExit("facegen rig: failed")
    found = clock.seconds
    for unit in ("", "_cpu"):
        found[f"load{unit}"] -= sum(found[f"{step}{unit}"] for step in ("registration", "shapes", "save"))
    return found


def laid(avatar: str):
    """Return the skin of an avatar laid on the template of all units; their own registration is not timed."""
    from facegen.transfer.rig import rig

    return rig(avatar, Path(avatar).with_suffix(".npz"), landmarks=Path(avatar).with_suffix(".yaml"), sets=["units"],
               cache=False).found.skin


def peer(name: str, avatar: str) -> dict[str, float]:
    """Let another tool do its step."""
    step = prepared(name, laid(avatar))
    clock = Clock()
    with clock("step"):
        step()
    factor = len(shapes()) / SOLVED if name not in REGISTRATIONS else 1.0
    return {"step": factor * clock.seconds["step"], "cpu_step": factor * clock.seconds["step_cpu"]}


def shapes() -> list[str]:
    """Return the names of the shapes that are made."""
    from facegen.blendshapes.recipes import shape_sets

    return list(shape_sets(SETS.split(",")))[:COUNT]


def prepared(name: str, skin) -> Callable[[], object]:
    """Return the step of a peer on a skin, ready to start."""
    if name == "Sumner, a solve for each shape":
        return lambda: sumner(skin)
    template, surface = skin.template.surface, skin.surface
    marks = [mark for mark in skin.places if mark in skin.template.landmarks]
    at = np.array([skin.places[mark][0][np.argmax(skin.places[mark][1])] for mark in marks])
    goals = np.array([skin.template.landmarks[mark] for mark in marks])
    import trimesh
    from trimesh import registration

    source, target = (trimesh.Trimesh(one.vertices, one.faces, process=False) for one in (surface, template))
    function = getattr(registration, name.split()[1])
    return lambda: function(source, target, source_landmarks=at, target_positions=goals)


def sumner(skin) -> None:
    """Deformation transfer as public scripts do it: every shape's normal equations solved from the start."""
    from scipy import sparse
    from scipy.sparse.linalg import spsolve

    from facegen.geometry.operators import Surface
    from facegen.transfer.gradients import deformation_gradients, edge_frames, triangle_pairs

    template, surface = skin.template.surface, skin.surface
    n, m = len(surface.vertices), len(surface.faces)
    pairs = triangle_pairs(template, Surface(skin.registered, surface.faces))
    inverse = np.linalg.inv(edge_frames(surface.vertices, surface.faces, root=True))[pairs[:, 1]]
    corners = np.column_stack([surface.faces, n + np.arange(m)])[pairs[:, 1]]         # the fourth is the triangle's own
    values = np.concatenate([-inverse.sum(axis=1, keepdims=True), inverse], axis=1)   # (p, 4 corners, 3)
    rows = np.broadcast_to(3 * np.arange(len(pairs))[:, None, None] + np.arange(3), values.shape)
    columns = np.broadcast_to(corners[:, :, None], values.shape)
    a = sparse.csc_matrix((values.ravel(), (rows.ravel(), columns.ravel())), shape=(3 * len(pairs), n + m))
    held = sparse.csc_matrix(([1.0], ([0], [0])), shape=(n + m, n + m))
    for motion in skin.template.motion[:SOLVED]:
        wanted = deformation_gradients(template.vertices, template.vertices + motion, template.faces, root=True)
        right = a.T @ np.swapaxes(wanted[pairs[:, 0]], 1, 2).reshape(-1, 3)
        right[0] += surface.vertices[0]
        spsolve(sparse.csc_matrix(a.T @ a + held), right)


if __name__ == "__main__":
    bound, tool, *rest = sys.argv[1:]
    resource.setrlimit(resource.RLIMIT_CPU, (int(bound), int(bound) + 5))
    figures = facegen(*rest) if tool == "facegen" else peer(tool, *rest)
    print(json.dumps({**used(), **figures}))

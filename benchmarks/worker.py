"""One renderer in a process of its own: OpenGL contexts do not get on, and its threads' CPU time is to be its own.

`python benchmarks/worker.py NAME HEAD.npz` draws one picture and ends: that is what start-up measures.
"""

from __future__ import annotations

import multiprocessing as mp
import os
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from multiprocessing.connection import Connection
from pathlib import Path

import contestants
import numpy as np
from numpy.typing import NDArray

PEERS = {"moderngl": contestants.ModernGL, "vtk": contestants.Vtk, "pyrender": contestants.Pyrender}


def facegen_names(renderers: tuple[str, ...]) -> list[str]:
    """Return what to measure of facegen's renderers: "renderer/occlusion/threads", threads 0 being one a core."""
    counts = {name: (1, 0) if name == "fast" else (0,) for name in renderers}
    return [f"{name}/{occlusion}/{count}" for name in renderers for occlusion in ("neutral", "posed")
            for count in counts[name]]


def make(name: str, head: Path) -> contestants.Contestant:
    """Return a contestant that is ready to draw a saved head; contestants.Missing says why it cannot be had."""
    with np.load(head) as file:
        arrays = dict(file)
    if name in PEERS:
        return PEERS[name](arrays)
    renderer, occlusion, threads = name.split("/")
    return contestants.Facegen(arrays, renderer=renderer, occlusion=occlusion, threads=int(threads) or None)


class Worker:
    """A process with one contestant, told over a pipe when to draw."""

    def __init__(self, name: str, head: Path) -> None:
        context = mp.get_context("spawn")
        self._pipe, there = context.Pipe()
        self._process = context.Process(target=_serve, args=(there, name, str(head)), daemon=True)
        self._process.start()
        there.close()

    def ready(self) -> tuple[NDArray[np.uint8], str]:
        """Return the picture of frame 0 and what the renderer says about itself; raises contestants.Missing."""
        return self._answer()

    def draw(self, first: int, count: int) -> list[tuple[float, float]]:
        """Return (CPU, wall) seconds of each of some frames, CPU being that of all threads of the process."""
        self._pipe.send((first, count))
        return self._answer()

    def close(self) -> None:
        self._pipe.close()
        self._process.join(20)
        if self._process.is_alive():
            self._process.kill()

    def _answer(self):
        try:
            answer = self._pipe.recv()
        except EOFError:
            self._process.join()
            raise contestants.Missing(f"its process ended with code {self._process.exitcode}") from None
        if isinstance(answer, Exception):
            raise answer
        return answer


@contextmanager
def workers(names: list[str], head: Path) -> Iterator[dict[str, Worker]]:
    """Start a process for each contestant and end them all afterwards."""
    started = {name: Worker(name, head) for name in names}
    try:
        yield started
    finally:
        for worker in started.values():
            worker.close()


def timed(action) -> tuple[float, float]:
    """Return (CPU, wall) seconds of an action, the CPU time of all threads of this process."""
    cpu, wall = time.process_time(), time.perf_counter()
    action()
    return time.process_time() - cpu, time.perf_counter() - wall


def _serve(pipe: Connection, name: str, head: str) -> None:
    try:
        contestant = make(name, Path(head))
        pipe.send((np.array(contestant.draw(0)), str(getattr(contestant, "info", ""))))
    except contestants.Missing as missing:
        pipe.send(missing)
        return
    except Exception as error:                      # one that fails is named in the table; the others go on
        pipe.send(contestants.Missing(f"{type(error).__name__}: {error}"))
        return
    frames = len(contestant._poses)
    while True:
        try:
            first, count = pipe.recv()
        except EOFError:
            break
        pipe.send([timed(partial(contestant.draw, (first + k) % frames)) for k in range(count)])
    # Some drivers crash when they are torn down by the interpreter's end, in whatever order that comes.
    os._exit(0)


if __name__ == "__main__":
    try:
        make(sys.argv[1], Path(sys.argv[2])).draw(0)
    except contestants.Missing as why:
        sys.exit(str(why))
    sys.stdout.flush()
    os._exit(0)

"""How quickly the studio answers a slider: pictures of a face sent to one page a second, and how long each takes.

A page without a browser drags a slider sixty times a second, as a hand does, and takes what comes. Beside it the same
server sends vertices of the same size with nothing to work out: what viser alone can do on this machine. Run::

    python benchmarks/studio.py
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import threading
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "studio"))

from studio_raw import RawPage

from facegen.studio.app import Studio

RATE = 60.0             # a browser's events a second
SLIDER = "Jaw dropped (26)"


class Wire:
    """A page's end of the line: when vertices came."""

    def __init__(self, port: int, work: str) -> None:
        self.page = RawPage(port, work).begin()
        self.came: list[tuple[float, int]] = []         # when, bytes of vertices
        self.sliders: dict[str, str] = {}
        self._end = threading.Event()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        while not self._end.is_set():
            for message in self.page.receive(0.2):
                props = message.get("props")
                if message["type"] == "GuiSliderMessage":
                    self.sliders[props["label"]] = message["uuid"]
                updates = message.get("updates") or {}
                if message["type"] == "SceneNodeUpdateMessage" and "vertices" in updates:
                    self.came.append((time.perf_counter(), len(updates["vertices"])))

    def quiet(self, seconds: float) -> None:
        """Wait until nothing has come for so long."""
        while True:
            seen = len(self.came)
            time.sleep(seconds)
            if len(self.came) == seen:
                return

    def close(self) -> None:
        self._end.set()
        self._reader.join()
        self.page.close()


def pictures(came: list[tuple[float, int]]) -> list[float]:
    """Return when each picture came: meshes of one picture come at once."""
    times = sorted(when for when, _ in came)
    return [when for i, when in enumerate(times) if i == 0 or when - times[i - 1] > 0.004]


def drag(wire: Wire, uuid: str, seconds: float) -> tuple[float, list[float], float]:
    """Drag a slider; return pictures a second, latencies (ms) of single moves, and ms until it rests afterwards."""
    wire.came.clear()
    begun = time.perf_counter()
    for k in range(int(seconds * RATE)):
        value = round(0.5 - 0.5 * np.cos(k / RATE * 2.0), 2)
        wire.page.send({"type": "GuiUpdateMessage", "uuid": uuid, "updates": {"value": float(value)}})
        time.sleep(max(begun + (k + 1) / RATE - time.perf_counter(), 0.0))
    stopped = time.perf_counter()
    rate = len(pictures([one for one in wire.came if one[0] < stopped])) / (stopped - begun)
    wire.quiet(0.5)
    rest = max((when for when, _ in wire.came), default=stopped) - stopped
    single = []
    for k in range(20):
        wire.came.clear()
        sent = time.perf_counter()
        wire.page.send({"type": "GuiUpdateMessage", "uuid": uuid, "updates": {"value": 0.31 + 0.02 * k}})
        while not wire.came and time.perf_counter() - sent < 5.0:
            time.sleep(0.001)
        single.append(1000.0 * (wire.came[0][0] - sent))
        wire.quiet(0.15)
    return rate, single, 1000.0 * max(rest, 0.0)


def bare(studio: Studio, wire: Wire, seconds: float) -> float:
    """Return how many times a second viser sends the same vertices, nothing worked out."""
    page, = studio.pages.values()
    handles = [handle for handle, _ in page.stage.figures["face"]._handles]
    both = [(handle.vertices.copy(), handle.vertices + np.float32(0.01)) for handle in handles]
    wire.came.clear()
    begun, k = time.perf_counter(), 0
    while time.perf_counter() - begun < seconds:
        with page.client.atomic():
            for handle, one in zip(handles, both, strict=True):
                handle.vertices = one[k % 2]
        page.client.flush()
        k += 1
        time.sleep(max(begun + k / 30 - time.perf_counter(), 0.0))
    return len(pictures(wire.came)) / (time.perf_counter() - begun)


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--seconds", type=float, default=6.0)
    seconds = options.parse_args().seconds
    with tempfile.TemporaryDirectory() as folder, Studio(folder, port=0) as studio:
        wire = Wire(studio.server.port, "b" * 32)
        begun = time.perf_counter()
        while SLIDER not in wire.sliders:
            time.sleep(0.01)
        print(f"panel there after {time.perf_counter() - begun:.1f} s")
        wire.quiet(1.0)
        while not studio.pages:
            time.sleep(0.05)
        page, = studio.pages.values()
        print(f"vertices: {len(page.rig.mesh().vertices)}")
        rate, single, rest = drag(wire, wire.sliders[SLIDER], seconds)
        alone = bare(studio, wire, seconds)
        print(f"drag: {rate:.1f} pictures a second; viser alone, at most 30: {alone:.1f}; ratio {rate / alone:.2f}")
        print(f"one move: {np.median(single):.0f} ms to the new picture (slowest of 20: {max(single):.0f} ms)")
        print(f"after a drag of {int(seconds * RATE)} moves the last picture came {rest:.0f} ms after the last move")
        wire.close()


if __name__ == "__main__":
    main()

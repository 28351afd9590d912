"""The studio in headless Chromium, as a person has it: find by label, drag, click, open and take files away."""

from __future__ import annotations

import base64
import io
import json
import os
import re
import shutil
import subprocess
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from PIL import Image

# The software renderer, and nothing that asks the network.
FLAGS = ("--headless=new", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
         "--disable-background-networking", "--disable-component-update", "--disable-sync", "--use-gl=angle",
         "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
SIZE = {"width": 900, "height": 600}
VALIDATE = Path(__file__).parents[1] / "judges" / "validate.cjs"
SECONDS = 60.0          # long: a shared machine, and pixels drawn without a GPU
# viser's sorter of Gaussian splats, of which the studio shows none, compiles text, and our policy lets no page do that.
_NO_SPLATS = "Evaluating a string as JavaScript violates"
# Said by viser's page whenever an object is dragged; nothing comes of it.
_PASSIVE = "Unable to preventDefault inside passive event listener invocation."
# A busy machine may draw less than a frame a second: frames are counted, not only time.
_FRAMES = """() => new Promise(done => {
    let left = 4
    const next = () => --left ? requestAnimationFrame(next) : done()
    requestAnimationFrame(next)
})"""
# What is drawn, in the size in which it is seen: a screenshot without the panel would lay out all of the panel anew.
_PIXELS = """canvas => {
    const copy = document.createElement("canvas"), box = canvas.getBoundingClientRect()
    copy.width = Math.round(box.width)
    copy.height = Math.round(box.height)
    const draw = copy.getContext("2d")
    draw.drawImage(canvas, 0, 0, copy.width, copy.height)
    return copy.toDataURL()
}"""


def difference(one: np.ndarray, other: np.ndarray) -> float:
    """Return the share of the picture that differs clearly.

    In blocks of 4 x 4 pixels: viser draws fewer where a machine is slow, and edges are then other ones.
    """
    rows, columns = (4 * (size // 4) for size in one.shape[:2])
    apart = one[:rows, :columns].astype(float) - other[:rows, :columns]
    blocks = np.abs(apart.reshape(rows // 4, 4, columns // 4, 4, 3).mean(axis=(1, 3)))
    return float((blocks.max(axis=2) > 24).mean())


def judged(path: Path) -> None:
    """Have Khronos' validator look at a file, if it is there; see tests/judges."""
    folder = os.environ.get("FACEGEN_JUDGES")
    if not folder or shutil.which("node") is None:
        assert not os.environ.get("FACEGEN_CI"), "FACEGEN_JUDGES names no folder with gltf-validator"
        return
    done = subprocess.run(["node", str(VALIDATE), folder, str(path)], capture_output=True, text=True, timeout=60,
                          check=True)
    report = json.loads(done.stdout)
    assert [one for one in report["issues"]["messages"] if one["severity"] < 2] == []
    assert report["info"]["hasMorphTargets"]


class StudioPage:
    """One page of the studio. ``page`` is Playwright's own, for what is not here.

    Pixels are (column, row) of the canvas, from its left upper corner. ``errors`` gathers what the console says is
    wrong and every request that failed or went elsewhere: the fixture fails a test that leaves any there.
    """

    def __init__(self, page, url: str) -> None:
        self.page, self.url = page, url
        self.errors: list[str] = []
        origin = re.match(r"https?://[^/]+", url)[0]
        page.set_default_timeout(SECONDS * 1000)
        page.on("console", lambda said: self.errors.append(f"console: {said.text}")
                if said.type == "error" and said.text != _PASSIVE else None)
        page.on("pageerror", lambda error: None if _NO_SPLATS in str(error) else self.errors.append(f"page: {error}"))
        page.on("requestfailed", lambda request: self.errors.append(f"failed: {request.url[:200]}"))
        page.on("request", lambda request: None if request.url.startswith((origin, f"blob:{origin}", "data:"))
                else self.errors.append(f"elsewhere: {request.url[:200]}"))
        page.on("websocket", lambda socket: None if socket.url.startswith(origin.replace("http", "ws", 1))
                else self.errors.append(f"elsewhere: {socket.url}"))

    def open(self, url: str | None = None) -> StudioPage:
        """Go to the studio (a new work) or to the page of a work, and wait until it is drawn."""
        self.page.goto(url or self.url)
        return self.drawn()

    def reload(self) -> StudioPage:
        """Load the same page again."""
        self.page.reload()
        return self.drawn()

    def close(self) -> None:
        """Go away: a page that is open draws all the time, and others wait for it."""
        self.page.close()

    @property
    def work(self) -> str:
        """The id of the page's work."""
        return self.page.url.rpartition("/")[2]

    def drawn(self) -> StudioPage:
        """Wait until the page is connected and its panel is there."""
        self.canvas.wait_for(state="visible")
        self.page.get_by_test_id("floating-panel-handle").first.wait_for(state="visible")
        self.until(lambda: int(self.canvas.get_attribute("width") or 0) > 0)
        return self

    @property
    def canvas(self):
        """The canvas on which the scene is drawn."""
        return self.page.locator("canvas[data-engine]")

    def pixels(self) -> np.ndarray:
        """The canvas as it is now, without the panel: (rows, columns, 3) uint8."""
        shot = self.canvas.evaluate(_PIXELS).partition(",")[2]
        return np.asarray(Image.open(io.BytesIO(base64.b64decode(shot))).convert("RGB"))

    def still(self, seconds: float = SECONDS) -> np.ndarray:
        """The canvas once two looks at it, a while and some drawn frames apart, are the same."""
        end, before = time.monotonic() + seconds, self.pixels()
        while time.monotonic() < end:
            self.page.wait_for_timeout(250)
            self.page.evaluate(_FRAMES)
            now = self.pixels()
            if np.array_equal(now, before):
                return now
            before = now
        raise AssertionError(f"the picture did not come to rest within {seconds:.0f} s")

    def face(self) -> np.ndarray:
        """The canvas once a face stands in it, and rests: the page is there before what stands in it."""
        def stands() -> bool:
            picture = self.pixels().astype(int)
            return (np.abs(picture - picture[0, 0]).max(axis=2) > 24).mean() > 0.05

        self.until(stands)
        return self.still()

    def until(self, true: Callable[[], object], seconds: float = SECONDS) -> object:
        """Wait until a function returns something true, and return that; the page goes on meanwhile."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            found = true()
            if found:
                return found
            self.page.wait_for_timeout(50)
        raise AssertionError(f"waited {seconds:.0f} s in vain")

    def changed(self, before: np.ndarray, least: int = 20, seconds: float = SECONDS) -> np.ndarray:
        """Wait until at least so many pixels differ from a picture, and return the new one at rest."""
        self.until(lambda: (self.pixels() != before).any(axis=2).sum() >= least, seconds)
        return self.still()

    def row(self, label: str):
        """The line of the panel that a label begins: slider, number, text, choice, check box."""
        named = self.page.locator("label", has_text=re.compile(rf"^{re.escape(label)}$")).locator("visible=true")
        return named.first.locator("xpath=ancestor::div[.//input or .//textarea][1]")

    def input(self, label: str):
        """The box of a labelled line in which one types."""
        return self.row(label).locator("input:not([type=hidden]), textarea").last

    def slider(self, label: str):
        """The thumb of a slider."""
        return self.row(label).get_by_role("slider").first

    def value(self, label: str) -> float:
        """What a slider stands at."""
        return float(self.slider(label).get_attribute("aria-valuenow"))

    def drag_slider(self, label: str, to: float, steps: int = 3) -> None:
        """Drag a slider's thumb to a fraction 0..1 of its way, as a hand does."""
        thumb = self.slider(label)
        thumb.scroll_into_view_if_needed()
        way = thumb.locator("xpath=..").bounding_box()
        box = thumb.bounding_box()
        x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
        self.page.mouse.move(x, y)
        self.page.mouse.down()
        beyond = 20 * (to >= 1) - 20 * (to <= 0)        # no thumb stops short of its end
        self.page.mouse.move(way["x"] + to * way["width"] + beyond, y, steps=steps)
        self.page.mouse.up()

    def set(self, label: str, value: object) -> None:
        """Type into a labelled box and press Enter."""
        box = self.input(label)
        box.fill(str(value))
        box.press("Enter")

    def choose(self, label: str, option: str) -> None:
        """Choose from a labelled list."""
        self.input(label).click()
        self.page.get_by_role("option", name=option, exact=True).click()

    def check(self, label: str, on: bool = True) -> None:
        """Tick a check box, or take the tick away."""
        self.row(label).get_by_role("checkbox").set_checked(on)

    def button(self, label: str):
        """A button by what stands on it."""
        return self.page.get_by_role("button", name=label, exact=True).locator("visible=true").first

    def press(self, label: str) -> None:
        """Press a button."""
        self.button(label).click()

    def tab(self, label: str) -> None:
        """Turn to a tab."""
        self.page.get_by_role("tab", name=label, exact=True).click()

    def click(self, pixel: tuple[float, float], button: str = "left") -> None:
        """Click on a pixel of the canvas."""
        box = self.canvas.bounding_box()
        self.page.mouse.click(box["x"] + pixel[0], box["y"] + pixel[1], button=button)

    def drag(self, start: tuple[float, float], end: tuple[float, float], steps: int = 8) -> None:
        """Drag over the canvas."""
        box = self.canvas.bounding_box()
        self.page.mouse.move(box["x"] + start[0], box["y"] + start[1])
        self.page.mouse.down()
        self.page.mouse.move(box["x"] + end[0], box["y"] + end[1], steps=steps)
        self.page.mouse.up()

    def upload(self, label: str, path: Path) -> None:
        """Open a file with an upload button."""
        with self.page.expect_file_chooser() as chosen:
            self.button(label).click()
        chosen.value.set_files(path)

    def download(self, folder: Path, act: Callable[[], object]) -> Path:
        """Do what makes the page save a file (``send_file_download(..., save_immediately=True)``); return its path."""
        with self.page.expect_download() as coming:
            act()
        path = folder / coming.value.suggested_filename
        coming.value.save_as(path)
        return path

    def says(self, text: str) -> None:
        """Wait until a text stands somewhere on the page: a notification, a label."""
        self.page.get_by_text(text).first.wait_for(state="visible")

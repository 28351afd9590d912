"""The Face tab as a person has it: pictures are clicked, sliders dragged, a script is pasted, files are taken away."""

from __future__ import annotations

import io
import re

import numpy as np
import pytest
from PIL import Image
from studio_page import difference

import facegen
from facegen.studio.face_panel import FacePanel


@pytest.fixture
def opened(studio, browser_page):
    """The page as the browser has it, the server's side of it, and its picture at rest."""
    running = studio(panels={"Face": FacePanel})
    page = browser_page(running.server)
    page.until(lambda: len(running.pages) == 1)
    one, = running.pages.values()
    return page, one, page.face()


def test_expressions_are_chosen_by_picture_mixed_and_undone(opened):
    page, one, neutral = opened
    thumb = page.page.locator("button:has(img)", has_text=re.compile("^happiness$"))
    page.until(lambda: "image/jpeg" in thumb.locator("img").get_attribute("src"))
    thumb.click()
    page.until(lambda: one.work.face.script == "6D+12E+25D")
    happy = page.changed(neutral)
    assert difference(happy, neutral) > 0.004
    page.set("Search", "astonished")
    page.until(lambda: not thumb.is_visible())
    page.check("Click adds to the mixture")
    page.page.locator("button:has(img)", has_text=re.compile("^surprise open$")).click()
    page.until(lambda: set(one.work.face.blend) == {"happiness", "surprise_open"})
    both = page.changed(happy)
    page.set("Happiness", 0)
    page.until(lambda: one.work.face.blend["happiness"] == 0.0)
    assert difference(page.changed(both), both) > 0.002
    page.canvas.click(position={"x": 5, "y": 5})        # out of the text box, where Ctrl+Z is the box's own
    page.page.keyboard.press("Control+z")
    page.until(lambda: one.work.face.blend == {"happiness": 1.0, "surprise_open": 0.5})
    page.press("Undo")
    page.until(lambda: one.work.face.blend == {"happiness": 1.0})
    page.until(lambda: difference(page.pixels(), happy) < 0.002)


def test_a_script_is_pasted_mended_and_taken_away(opened, tmp_path):
    page, one, neutral = opened
    page.input("Script").fill("R12E+R14")
    page.until(lambda: one.work.face.script == "R12E+R14D")
    assert page.input("Script").input_value() == "R12E+R14"         # what is written stays as it was written
    crooked = page.changed(neutral)
    middle = neutral.shape[1] // 2
    # The subject's right is the picture's left.
    assert difference(crooked[:, :middle], neutral[:, :middle]) > 2 * difference(crooked[:, middle:],
                                                                                  neutral[:, middle:])
    page.input("Script").fill("R12E+R14+")
    page.says("Not shown yet")
    page.says("a unit is missing after the last separator")
    assert one.work.face.script == "R12E+R14D"
    page.input("Script").fill("R12E+R14D")
    page.page.get_by_text("Take away", exact=True).click()
    page.choose("Size", "256")
    page.choose("Seen", "from the front")
    got = page.download(tmp_path, lambda: page.press("Picture (PNG)"))
    assert np.array_equal(np.asarray(Image.open(io.BytesIO(got.read_bytes()))),
                          facegen.render(facegen.load_face(), "R12E+R14D", size=256))
    file = page.download(tmp_path, lambda: page.press("Movements (YAML)"))
    face = facegen.load_face()
    assert face.pose(str(file)) == pytest.approx(face.pose("R12E+R14D"), abs=1e-6)
    assert page.input("Command").input_value() == "facegen render R12E+R14D --size 256 -o face.png"


def test_a_slider_is_dragged_and_the_eyes_follow_a_point(opened):
    page, one, neutral = opened
    page.drag_slider("Inner brows up (1)", 1.0)
    page.until(lambda: one.work.face.script == "1E")
    raised = page.changed(neutral)
    upper = neutral.shape[0] // 2
    assert difference(raised[:upper], neutral[:upper]) > difference(raised[upper:], neutral[upper:])
    page.check("Left and right apart")
    page.drag_slider("Inner brows up, left (L1)", 0.0)
    page.until(lambda: one.work.face.script == "R1E")
    page.check("Eyes follow a point")
    page.until(lambda: one.work.face.gaze)
    before = page.still()
    handle = one.client.camera                                      # the point lies before the eyes: drag it aside
    assert handle.position[2] > 0
    column, row = _pixel(one, before)
    page.drag((column, row), (column + 60, row))
    page.until(lambda: one.work.face.gaze["x"] > 10.0)
    eyes = facegen.look_at(one.rig, [one.work.face.gaze[axis] for axis in "xyz"])
    assert min(eyes["yaw_L"], eyes["yaw_R"]) > -5.0
    assert eyes["yaw_L"] != pytest.approx(-eyes["yaw_R"])


def _pixel(one, picture: np.ndarray) -> tuple[float, float]:
    """Return where the blue handle of the point's plane is in the picture."""
    blue = (picture[..., 2].astype(int) - picture[..., 0] > 80) & (picture[..., 2] > 170)
    rows, columns = np.nonzero(blue)
    assert len(rows) > 20
    return float(np.median(columns)), float(np.median(rows))

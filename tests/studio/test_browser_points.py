"""Points and tables in a browser: a point goes where the mouse takes it, a table is saved after its diff was seen."""

from __future__ import annotations

import numpy as np
import pytest
import yaml

from facegen.facs.deformation import load_deformation
from facegen.studio.figure import SCALE
from facegen.studio.page import FACE
from facegen.studio.points_panel import PointsPanel
from facegen.studio.tables_panel import TablesPanel


def pixel(page, browser, at):
    """Return the pixel of the canvas on which a place (3,), mm, is seen."""
    camera, box = page.client.camera, browser.canvas.bounding_box()
    position, look_at, up = (np.array(getattr(camera, name)) for name in ("position", "look_at", "up_direction"))
    ahead = (look_at - position) / np.linalg.norm(look_at - position)
    right = np.cross(ahead, up) / np.linalg.norm(np.cross(ahead, up))
    way = np.array(at) * SCALE - position
    scale = box["height"] / 2 / np.tan(camera.fov / 2) / (way @ ahead)
    return box["width"] / 2 + scale * (way @ right), box["height"] / 2 - scale * (way @ np.cross(right, ahead))


def place(page, point):
    assert page.stage.settle()
    return page.rig.feature_point_places(page.stage.figures[FACE].vertices)[point]


def test_a_point_goes_where_the_mouse_takes_it_and_is_saved(studio, browser_page, tmp_path, shots):
    one = studio(panels={"Points": PointsPanel})
    browser = browser_page(one.server)
    browser.until(lambda: len(one.pages) == 1)
    page, = one.pages.values()
    before = browser.pixels()
    browser.check("Show feature points")
    browser.until(lambda: (browser.pixels() != before).any(axis=2).sum() > 200)
    start = pixel(page, browser, place(page, "mouth_corner_L"))
    end = start[0] + 14.0, start[1] - 18.0
    browser.drag(start, end)
    browser.until(lambda: "mouth_corner_L" in page.work.face.raw.get("points", {}))
    browser.says("Mouth corner, left (F8) lies")
    assert pixel(page, browser, place(page, "mouth_corner_L")) == pytest.approx(end, abs=3.0)
    assert place(page, "mouth_corner_R") == pytest.approx(place(page, "mouth_corner_L") * [-1, 1, 1], abs=1e-3)
    browser.page.get_by_text("As a file").click()
    path = browser.download(tmp_path, lambda: browser.press("Download deformation data"))
    assert load_deformation(path) == page.work.face.deformation
    assert page.rig.pose(path) == pytest.approx(page.stage.figures[FACE].vertices, abs=1e-9)
    browser.page.screenshot(path=shots / "points.png")


def test_a_table_is_saved_after_its_difference_was_seen(studio, browser_page, shots):
    one = studio(panels={"Tables": TablesPanel})
    browser = browser_page(one.server)
    browser.until(lambda: len(one.pages) == 1)
    page, = one.pages.values()
    browser.set("Name", "Ada")
    browser.press("New person")
    browser.until(lambda: page.work.table.file == "ada.yaml")
    browser.check("Show several faces")
    browser.until(lambda: len(page.stage.figures) == 3)
    browser.set("Action units", "L12E+26D")
    browser.press("Use this recipe")
    browser.until(lambda: page.work.table.person is not None)
    browser.press("Save ...")
    browser.says('happiness: {units: "L12E+26D"')
    browser.page.screenshot(path=shots / "tables.png")
    file = page.desk.person_file("ada.yaml", page.name)
    assert not file.exists()
    browser.press("Save this")
    browser.until(file.exists)
    assert yaml.safe_load(file.read_text())["overrides"]["happiness"]["units"] == "L12E+26D"
    browser.says("is saved as it is here")
    browser.check("Show several faces", False)
    browser.until(lambda: list(page.stage.figures) == [FACE])

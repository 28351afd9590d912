"""Take every picture of docs/studio.md anew, in headless Chromium: python docs/make_screenshots.py (some minutes)."""

import sys
import tempfile
from dataclasses import replace
from pathlib import Path

from PIL import Image
from playwright.sync_api import sync_playwright

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent / "tests" / "studio"))
from studio_page import FLAGS, StudioPage  # noqa: E402

from facegen.facs.notation import parse  # noqa: E402
from facegen.studio.app import Studio  # noqa: E402
from facegen.studio.picking import as_places  # noqa: E402
from facegen.transfer.landmarks import load_landmarks  # noqa: E402
from facegen.transfer.rig import avatar_files  # noqa: E402

IMAGES = HERE / "images"
SIZE = {"width": 1180, "height": 800}


def shoot(browser: StudioPage, name: str) -> None:
    """Save what is seen, once it rests."""
    browser.page.wait_for_timeout(1500)
    browser.still()
    path = IMAGES / f"{name}.webp"
    with tempfile.NamedTemporaryFile(suffix=".png") as file:
        browser.page.screenshot(path=file.name)
        Image.open(file.name).convert("RGB").save(path, quality=88, method=6)
    print(path)


def main() -> None:
    """Go through the tabs as docs/studio.md does."""
    with tempfile.TemporaryDirectory() as folder, Studio(folder, port=0) as studio, sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path="/usr/bin/chromium", args=list(FLAGS))
        browser = StudioPage(chromium.new_context(viewport=SIZE).new_page(), studio.server.url).open()
        browser.until(lambda: studio.pages)
        page, = studio.pages.values()
        browser.page.wait_for_timeout(1500)
        for close in browser.page.locator(".mantine-Notification-closeButton").all():
            close.click()                                       # of the notice that there is no GPU
        face = page.work.face
        page.change("smile", face=replace(face, units=parse("6D+12E+25D")))
        shoot(browser, "studio")
        page.change("contempt", face=replace(face, units=parse("R12C+R14D+4A")))
        shoot(browser, "studio-face")

        browser.tab("Points")
        browser.check("Show feature points")
        browser.choose("Regions", "tinted")
        page.change("moved", face=replace(face, units=parse("1C"), raw={
            "units": "millimetre", "points": {"mouth_corner_L": [4, 7, 0], "mouth_corner_R": [-2, 0, 0]}}))
        shoot(browser, "studio-points")
        browser.check("Show feature points", False)
        browser.choose("Regions", "hidden")

        browser.tab("Timeline")
        for t, script in ((0.0, "0"), (0.8, "1D+2D+5C+26C"), (1.6, "6D+12E+25D"), (3.0, "6B+12C")):
            page.change("face", face=replace(face, units=parse(script)))
            browser.set("Time (s)", t)
            browser.press("Key the face as it is now")
        browser.set("Time (s)", 1.6)
        shoot(browser, "studio-timeline")

        browser.tab("Tables")
        browser.set("Name", "Ada")
        browser.press("New person")
        browser.check("Show several faces")
        browser.page.wait_for_timeout(20_000)                   # an avatar may get its blendshapes
        shoot(browser, "studio-tables")
        browser.check("Show several faces", False)

        browser.tab("Avatar")
        browser.choose("Or try one", "cartoon")
        panel = next(one for one in page._panels if hasattr(one, "rigging"))
        browser.until(lambda: panel.scene.figure is not None)
        browser.check("Place points by clicking")
        marks = as_places(load_landmarks(avatar_files("cartoon", None)[1], panel.scene.mesh))
        few = ("eye_inner_L", "eye_outer_L", "eye_inner_R", "eye_outer_R", "mouth_corner_L", "mouth_corner_R", "chin")
        page.change("landmarks", avatar=replace(page.work.avatar, landmarks={name: marks[name] for name in few}))
        browser.page.wait_for_timeout(8000)
        shoot(browser, "studio-landmarks")
        page.change("landmarks", avatar=replace(page.work.avatar, landmarks=marks, sets="units"))
        browser.check("Place points by clicking", False)
        browser.press("Make blendshapes")
        browser.until(lambda: panel.rigging.compares, 180)
        page.change("smile", face=replace(face, units=parse("6D+12E+25D+1B+2B")))
        shoot(browser, "studio-compare")
        chromium.close()


if __name__ == "__main__":
    main()

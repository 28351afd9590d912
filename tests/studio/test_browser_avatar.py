"""The Avatar tab in a browser: landmarks are clicked on pixels, and an avatar gets blendshapes and is taken away."""

from __future__ import annotations

import shutil
from dataclasses import replace

import numpy as np
import pytest
from studio_page import difference, judged

from facegen.face.face import load_face
from facegen.studio.avatar_panel import AvatarPanel
from facegen.studio.clip_panel import ClipPanel
from facegen.studio.figure import SCALE
from facegen.studio.landmark_words import partner
from facegen.studio.picking import as_places, point
from facegen.studio.work import ClipWork
from facegen.transfer.landmarks import load_landmarks
from facegen.transfer.rig import avatar_files


@pytest.fixture
def opened(studio, browser_page):
    """The studio with its tabs Avatar and Timeline, in a browser; the page and the first panel beside it."""
    running = studio(panels={"Avatar": AvatarPanel, "Timeline": ClipPanel})
    browser = browser_page(running.server)
    browser.until(lambda: len(running.pages) == 1)
    page, = running.pages.values()
    return browser, page, page._panels[0]


def pixel(browser, page, place):
    """Return where on the canvas a place of the scene is seen, by the camera that the browser told of."""
    camera = page.client.camera
    size = browser.canvas.bounding_box()
    ahead = np.asarray(camera.look_at) - np.asarray(camera.position)
    ahead = ahead / np.linalg.norm(ahead)
    right = np.cross(ahead, camera.up_direction)
    right = right / np.linalg.norm(right)
    away = np.asarray(place, float) - np.asarray(camera.position)
    scale = size["height"] / 2 / np.tan(camera.fov / 2) / (away @ ahead)
    return size["width"] / 2 + scale * (away @ right), size["height"] / 2 - scale * (away @ np.cross(right, ahead))


def test_landmarks_are_placed_by_clicking_on_pixels(opened, shots):
    browser, page, panel = opened
    browser.choose("Or try one", "cartoon")
    browser.until(lambda: panel.scene.figure is not None)
    scene, picker = panel.scene, panel.picker
    true = load_landmarks(avatar_files("cartoon", None)[1], scene.mesh).points(scene.mesh.vertices)
    for count in (1, 2):
        name = picker.wanted(page.work.avatar)
        browser.still()                                     # the picture has turned to it
        browser.click(pixel(browser, page, scene.figure.place(scene.placement.apply(true[name]))))
        browser.until(lambda: len(page.work.avatar.landmarks) == count)     # noqa: B023
        at = point(scene.mesh, page.work.avatar.landmarks[name])
        off = np.linalg.norm(scene.placement.apply(at) - scene.placement.apply(true[name]))
        assert off < 2.0, f"{name} was placed {off:.1f} mm beside the pixel's place"
        browser.until(lambda: partner(name) in picker.markers.marks)        # noqa: B023
        away = picker.markers.marks[partner(name)].at - scene.figure.place(scene.placement.apply(true[partner(name)]))
        assert np.linalg.norm(away) / SCALE < 3.0, "its partner is proposed on the other side"
    placed = page.work.avatar.landmarks
    browser.until(lambda: picker.proposals.advised, 180.0)      # the face was looked for meanwhile
    browser.page.screenshot(path=shots / "avatar-landmarks.png")
    browser.press(picker._all.label)
    browser.until(lambda: len(page.work.avatar.landmarks) > len(placed))
    assert placed.items() <= page.work.avatar.landmarks.items()
    assert {partner(name) for name in placed} <= set(page.work.avatar.landmarks)
    browser.press("Undo")
    browser.until(lambda: page.work.avatar.landmarks == placed)


def test_an_avatar_is_opened_rigged_and_taken_away(opened, tmp_path, shots):
    browser, page, panel = opened
    source = shutil.copy(avatar_files("cartoon", None)[0], tmp_path / "my cartoon.obj")
    bad = tmp_path / "bad.glb"
    bad.write_bytes(b"glTF" + bytes(40))
    browser.upload("Open an avatar", bad)
    browser.says("That did not work")
    browser.upload("Open an avatar", source)
    browser.until(lambda: panel.scene.figure is not None)
    assert page.work.avatar.file == "my_cartoon.obj"
    marks = load_landmarks(avatar_files("cartoon", None)[1], panel.scene.mesh)
    page.change("landmarks", avatar=replace(page.work.avatar, landmarks=as_places(marks), sets="units"))
    browser.press("Make blendshapes")
    browser.until(lambda: panel.rigging.compares, 120)
    neutral = browser.still()
    page.change("smile", face=replace(page.work.face, units={"12": 1.0, "26": 0.8}))
    smiling = browser.changed(neutral)
    both = np.abs(smiling.astype(int) - neutral).max(axis=2) > 24
    middle = both.shape[1] // 2
    assert both[:, :middle].sum() > 50, "the base face"
    assert both[:, middle:].sum() > 50, "and the avatar, both by the same expression"
    browser.page.screenshot(path=shots / "avatar-compare.png")
    path = browser.download(tmp_path, lambda: browser.press("Download the avatar"))
    assert path.name == "my_cartoon.glb"
    face = load_face(path)
    assert np.abs(face.pose("happiness") - face.pose("neutral")).max() > 3.0
    judged(path)
    browser.press("Use this face")
    browser.until(lambda: page.work.face.rig == "my_cartoon.glb")
    browser.until(lambda: page.rig.mesh().vertices.shape == face.mesh().vertices.shape)
    browser.tab("Timeline")
    script = {"keyframes": [{"t": 0, "pose": "0"}, {"t": 0.6, "pose": "27E"}, {"t": 1.2, "pose": "0"}]}
    page.change("a clip", clip=ClipWork(script=script))
    browser.drag_slider("Time (s)", 0.0)
    begin = browser.still()
    browser.press("Play")
    browser.until(lambda: difference(browser.pixels(), begin) > 0.003)
    browser.press("Pause")

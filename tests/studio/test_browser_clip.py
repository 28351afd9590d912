"""The timeline in a browser: two faces are keyed and lie between, it plays, files come and go."""

from __future__ import annotations

import av
import numpy as np
from PIL import Image, ImageSequence
from studio_page import difference, judged

import facegen
from facegen.studio.clip_panel import ClipPanel
from facegen.studio.work import FaceWork


def timeline(studio, browser_page):
    """A page with the Timeline tab, and the program's side of it."""
    made = studio(panels={"Timeline": ClipPanel})
    page = browser_page(made.server)
    page.until(lambda: made.pages)
    one, = made.pages.values()
    return page, one


def test_two_faces_are_keyed_scrubbed_played_and_taken_away(studio, browser_page, tmp_path):
    page, one = timeline(studio, browser_page)
    neutral = page.face()
    page.drag_slider("Time (s)", 0.0)
    page.press("Key the face as it is now")
    page.until(lambda: one.work.clip.script)
    one.change("a face", face=FaceWork(units={"26": 1.0, "27": 0.6, "1": 1.0, "2": 1.0}))
    page.drag_slider("Time (s)", 1.0)
    page.press("Key the face as it is now")
    page.until(lambda: len(one.work.clip.script["keyframes"]) == 2)
    wide = page.changed(neutral)
    assert difference(wide, neutral) > 0.01
    page.drag_slider("Time (s)", 0.5)
    half = page.changed(wide)
    assert difference(half, wide) > 0.002
    assert difference(half, neutral) > 0.002
    page.drag_slider("Time (s)", 0.0)
    # The browser shades a mesh that has moved a little otherwise than one that never did.
    rest = 0.5 * difference(half, neutral)
    page.until(lambda: difference(page.pixels(), neutral) < rest)
    page.press("Play")
    page.until(lambda: difference(page.pixels(), neutral) > rest)
    page.until(lambda: page.value("Time (s)") > 0.5)
    page.press("Pause")
    page.page.get_by_text("Save as").click()
    page.choose("What", "Recording: facegen's own (.csv)")
    found = facegen.load_performance(page.download(tmp_path, lambda: page.press("Save")))
    assert 0.999 < found.weights[-1].max() < 1.0    # the last frame is a moment before the key
    assert found.weights[0].max() == 0.0
    assert len(found) == 100                        # 4 s, 25 a second
    page.set("Pictures a second", 2)

    def saved(form):
        page.choose("What", form)
        return page.download(tmp_path, lambda: page.press("Save"))

    page.choose("What", "Moving picture (.gif)")
    page.choose("Size (pixels)", "256")
    with Image.open(saved("Moving picture (.gif)")) as film:
        moves([np.asarray(each.convert("RGB")) for each in ImageSequence.Iterator(film)])
    with av.open(str(saved("Film (.mp4)"))) as film:
        moves([frame.to_ndarray(format="rgb24") for frame in film.decode(video=0)])
    path = saved("Animated head (.glb)")
    head = facegen.load_performance(path)
    assert len(head) == 8
    assert (np.diff(head.column("AU27")) > 0.0).all()
    assert head.column("AU27")[0] == 0.0
    assert 0.4 < head.column("AU27")[-1] < 0.6
    judged(path)


def moves(frames):
    """Check the frames of a film of 4 s: a face at rest opens its mouth, wider and wider."""
    assert len(frames) == 8
    assert {frame.shape for frame in frames} == {(256, 256, 3)}
    away = [difference(frame, frames[0]) for frame in frames]
    assert away[-1] > max(1.2 * away[4], 0.01)
    assert away[4] > 0.002


def test_a_recording_is_opened_plays_on_any_face_and_is_there_after_a_reload(studio, browser_page, tmp_path):
    page, one = timeline(studio, browser_page)
    neutral = page.face()
    take = tmp_path / "take.csv"
    take.write_text("time,jawOpen,browInnerUp\n0,0,0\n1,1,1\n2,1,1\n")
    page.page.get_by_text("Recording", exact=True).click()
    page.upload("Open a recording", take)
    page.until(lambda: one.work.clip.recording == "take.csv")
    page.drag_slider("Time (s)", 1.0)
    opened = page.changed(neutral)
    assert difference(opened, neutral) > 0.005
    page.reload()
    page.page.get_by_text("Recording", exact=True).click()
    page.says("take.csv")
    page.until(lambda: not page.button("Play").is_disabled())
    page.drag_slider("Time (s)", 1.0)
    page.until(lambda: difference(page.pixels(), opened) < 0.002)

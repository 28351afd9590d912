"""The Timeline tab with a client that is no browser: what a person does there is in the work and in the picture."""

import time
from dataclasses import replace

import numpy as np
import pytest
from fake_client import FakeClient

import facegen
from facegen.animation.clip import Clip
from facegen.animation.playback import Playback
from facegen.studio.clip_panel import ClipPanel
from facegen.studio.desk import Desk
from facegen.studio.page import FACE, Page
from facegen.studio.work import FaceWork

pytestmark = pytest.mark.usefixtures("read_here")

NAME = "work-of-one"
CSV = "time,jawOpen,mouthSmileLeft\n0,0,0\n0.5,1,0.2\n1,0.5,0.4\n"


class Opened:
    """A page with a Timeline tab."""

    def __init__(self, folder):
        self.page = Page(FakeClient(), NAME, Desk(folder), {"Timeline": ClipPanel})
        self.gui, self.client = self.page.client.gui, self.page.client
        self.panel, = self.page._panels

    def at(self, t):
        self.gui.find("Time (s)").enter(t)
        return self

    def face(self, **units):
        self.page.change("by hand", face=FaceWork(rig=self.page.work.face.rig, units=units))
        return self

    def key(self):
        self.gui.find("Key the face as it is now").press()
        return self

    @property
    def script(self):
        return self.page.work.clip.script

    def seen(self):
        assert self.page.stage.settle(60.0)
        return self.page.stage.figures[FACE].vertices

    def shows(self, what):
        return self.seen() == pytest.approx(self.page.rig.pose(what), abs=1e-6)

    def wait(self, true):
        end = time.monotonic() + 60.0
        while not true():
            assert time.monotonic() < end
            time.sleep(0.01)
        with self.page.lock:                    # what made it true is done
            return


@pytest.fixture
def opened(tmp_path):
    one = Opened(tmp_path)
    yield one
    one.page.close()


@pytest.fixture
def smiling(opened):
    """At rest at 0 s, a smile at 2 s."""
    return opened.face().at(0.0).key().face(**{"12": 1.0}).at(2.0).key()


def test_two_faces_are_keyed_and_lie_between(smiling):
    assert smiling.script == {"duration": 4.0, "keyframes": [{"t": 0.0, "pose": "0"}, {"t": 2.0, "pose": "12E"}]}
    assert smiling.at(0.0).shows("neutral")
    assert smiling.at(1.0).shows({"12": 0.5})
    assert smiling.at(3.0).shows("12E")
    assert smiling.client.notices == []


def test_each_edit_is_one_step_back(smiling):
    smiling.page.undo()
    assert [key["t"] for key in smiling.script["keyframes"]] == [0.0]
    smiling.page.redo()
    assert smiling.at(2.0).shows("12E")


def test_raw_movements_and_a_gaze_are_keyed_as_they_look(opened):
    face = FaceWork(units={"12": 1.0}, raw={"jaw": {"open": 8.0}}, intensity=0.5)
    opened.page.change("raw", face=face)
    opened.at(1.0).key()
    assert opened.seen() == pytest.approx(opened.page.rig.pose(face.meaning()), abs=1e-3)
    opened.page.change("gaze", face=replace(face, gaze={"x": 300.0, "y": 0.0, "z": 600.0}))
    wanted = opened.page.rig.pose(opened.page.meaning())
    opened.at(2.0).key()
    assert opened.seen() == pytest.approx(wanted, abs=1e-2)


def test_a_hand_on_the_face_stops_the_clip(smiling):
    smiling.gui.find("Play").press()
    assert smiling.panel.transport.playing
    smiling.face(**{"4": 1.0})
    assert not smiling.panel.transport.playing
    assert smiling.shows("4E")


def test_it_plays_on_and_says_so(smiling):
    smiling.at(0.5).gui.find("Play").press()
    smiling.wait(lambda: smiling.panel.transport.head > 0.8)
    assert smiling.gui.find("Pause")
    smiling.gui.find("Pause").press()
    t = smiling.panel.transport.head
    assert smiling.seen() == pytest.approx(smiling.page.rig.pose(smiling.panel.clip.at(t)), abs=1e-6)


def test_another_face_shows_the_same_moment(smiling):
    smiling.at(2.0)
    smiling.page.change("face", face=replace(smiling.page.work.face, rig="akimoto-1986"))
    assert smiling.shows("12E")


def test_a_key_is_chosen_changed_copied_and_deleted(smiling):
    keys = smiling.gui.find("Key")
    assert len(keys.options) == 3
    keys.enter(keys.options[2])
    smiling.gui.find("Shows").enter("anger")
    assert smiling.script["keyframes"][1]["pose"] == "anger"
    smiling.gui.find("Shows").enter("angr")
    assert smiling.script["keyframes"][1]["pose"] == "anger"
    assert any("unknown expression 'angr'" in str(getattr(one, "content", "")) for one in smiling.gui.made)
    smiling.gui.find("Gets there").enter("with a jump")
    smiling.gui.find("Strength").enter(0.5)
    assert smiling.script["keyframes"][1] == {"t": 2.0, "pose": "anger", "ease": "step", "intensity": 0.5}
    smiling.at(3.0)
    act, = (one for one in smiling.gui.made if one.kind == "button_group" and "Delete" in one.options)
    act.enter("Copy to this time")
    assert [key["t"] for key in smiling.script["keyframes"]] == [0.0, 2.0, 3.0]
    act.enter("Delete")
    assert [key["t"] for key in smiling.script["keyframes"]] == [0.0, 2.0]


def test_a_key_goes_to_the_face_tab_and_back(smiling):
    keys = smiling.gui.find("Key")
    keys.enter(keys.options[2])
    smiling.face(**{"4": 1.0})
    smiling.gui.find("Change it in the Face tab").press()
    assert smiling.page.work.face.units == {"12": 1.0}
    assert smiling.shows("12E")


def test_a_blink_is_added_with_its_own_times(smiling):
    smiling.at(1.0).gui.find("Add it at this time").press()
    assert smiling.script["events"] == [{"at": 1.0, "kind": "blink"}]
    smiling.gui.find("Stays (s)").enter(0.5)
    assert smiling.script["events"] == [{"at": 1.0, "kind": "blink", "apex": 0.5}]
    assert smiling.panel.clip.units_at(1.3)["45"] == pytest.approx(1.0)


def test_a_wrong_text_stays_for_mending(smiling):
    box = smiling.gui.find("Clip")
    assert "pose: 12E" in box.value
    before = smiling.script
    box.enter("keyframes:\n  - {t: 1, pose: hapiness}\n")
    assert smiling.script == before
    assert box.value.endswith("hapiness}\n")
    said, = (one.content for one in smiling.gui.made if "Not shown yet" in str(getattr(one, "content", "")))
    assert "did you mean 'happiness'" in said
    box.enter("keyframes:\n  - {t: 1, pose: happiness}\n")
    assert smiling.at(1.0).shows("happiness")


def test_what_a_person_wrote_is_text_in_the_picture(opened):
    opened.gui.find("Clip").enter("tracks:\n  - name: <img src=x onerror=alert(1)>\n    keyframes:\n"
                                  "      - {t: 1, pose: happiness}\n")
    assert opened.script
    svg = opened.panel._picture.content
    assert svg.startswith("<svg")
    assert "<img" not in svg
    assert "&lt;img" in svg


def test_sounds_are_said(opened):
    opened.gui.find("Says").enter("Sounds")
    opened.gui.find("Words").enter("HH AH0 L OW1")
    opened.gui.find("Say it").press()
    assert opened.script == {"speech": {"phonemes": "HH AH0 L OW1"}}
    assert isinstance(opened.panel.clip, Clip)
    opened.gui.find("Say nothing").press()
    assert opened.script == {}


def test_a_recording_comes_plays_and_is_found_again(opened, tmp_path):
    opened.gui.find("Open a recording").enter(type("File", (), {"name": "my take.csv", "content": CSV.encode()})())
    opened.wait(lambda: opened.page.work.clip.recording == "my_take.csv" and not opened.panel.recording._at_work)
    assert opened.page.work.clip.shown == "recording"
    path = tmp_path / "take.csv"
    path.write_text(CSV)
    wanted = Playback(facegen.load_performance(path)).on(opened.page.rig)(0.5)
    assert np.abs(wanted - opened.page.rig.pose("neutral")).max() > 5.0
    assert opened.at(0.5).seen() == pytest.approx(wanted)
    opened.gui.find("Subtract the resting face").enter("by what it mostly is")
    opened.wait(lambda: opened.panel.recording.playback is not None)
    assert opened.page.work.clip.calibrate == "5%"
    opened.page.close()
    again = Opened(tmp_path)
    again.wait(lambda: again.panel.motion is not None)
    assert again.panel.motion.performance.names == ("jawOpen", "mouthSmileLeft")
    again.gui.find("Plays").enter("My clip")
    assert again.panel.motion is None
    again.page.close()


def test_a_file_that_is_no_recording_is_told(opened):
    opened.gui.find("Open a recording").enter(type("File", (), {"name": "take.csv", "content": b"\0\1\2"})())
    opened.wait(lambda: opened.client.notices)
    assert "take.csv" in opened.client.notices[0][1]
    assert opened.page.work.clip.recording is None


def test_a_clip_is_saved_and_a_stopped_one_leaves_nothing(smiling, tmp_path):
    smiling.page.change("face", face=replace(smiling.page.work.face, rig="akimoto-1986"))
    form, = (one for one in smiling.gui.made if "Film (.mp4)" in getattr(one, "options", ()))
    form.enter("Recording: facegen's own (.csv)")
    smiling.gui.find("Save").press()
    smiling.wait(lambda: smiling.client.downloads)
    path = tmp_path / "clip.csv"
    path.write_bytes(smiling.client.downloads["clip.csv"])
    found = facegen.load_performance(path)
    assert np.nanmax(found.weights) == pytest.approx(1.0)
    smiling.wait(lambda: smiling.panel.export._task is None)
    form.enter("Moving picture (.gif)")
    smiling.gui.find("Save").press()
    task = smiling.panel.export._task
    smiling.gui.find("Stop").press()
    assert task.wait(60.0)
    assert list(smiling.client.downloads) == ["clip.csv"]
    assert "stopped" in smiling.client.notices[-1][0]

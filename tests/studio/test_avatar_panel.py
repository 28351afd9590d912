"""The Avatar tab with a client that is no browser: clicks are rays, and what they make is in the work."""

import json
from dataclasses import replace
from typing import ClassVar

import numpy as np
import pytest
from fake_client import FakeClient

from facegen.face.landmarks import REQUIRED
from facegen.landmarking.doubts import odd_places
from facegen.landmarking.propose import Proposal, Proposals
from facegen.studio import picking, proposing
from facegen.studio.avatar_panel import AvatarPanel
from facegen.studio.avatar_scene import AVATAR
from facegen.studio.desk import Desk
from facegen.studio.landmark_words import ORDER, WORDS
from facegen.studio.markers import BLUE, GREEN, ORANGE
from facegen.studio.page import Page
from facegen.studio.picking import as_places, point
from facegen.transfer.landmarks import load_landmarks
from facegen.transfer.rig import avatar_files

pytestmark = pytest.mark.usefixtures("read_here")

NAME = "work-of-one"


class Opened:
    """A page with an Avatar tab on which a shipped avatar was opened."""

    def __init__(self, folder, avatar="cat"):
        self.page = Page(FakeClient(), NAME, Desk(folder), {"Avatar": AvatarPanel})
        self.client, self.gui = self.page.client, self.page.client.gui
        self.panel, = self.page._panels
        if avatar:
            self.gui.find("Or try one").enter(avatar)
            self.marks = load_landmarks(avatar_files(avatar, None)[1], self.mesh)
            self.true = self.marks.points(self.mesh.vertices)

    @property
    def mesh(self):
        return self.panel.scene.mesh

    @property
    def work(self):
        return self.page.work.avatar

    def ray(self, name, shift=(0.0, 0.0, 0.0)):
        """Where a ray from before the face starts that meets a landmark's true place, moved by mm."""
        figure = self.panel.scene.figure
        at = self.panel.scene.placement.apply(self.true[name]) + shift
        return figure.place(at + np.array([0.0, 0.0, 500.0])), (0.0, 0.0, -1.0)

    def click(self, name, shift=(0.0, 0.0, 0.0)):
        self.client.scene.click(*self.ray(name, shift))

    def off(self, name, other=None):
        """How far a point is from its true place, or another's, seen from before, mm."""
        placement = self.panel.scene.placement
        away = placement.apply(point(self.mesh, self.work.landmarks[name])) - placement.apply(self.true[other or name])
        return float(np.linalg.norm(away[:2]))

    def place_all(self):
        """Have all true landmarks placed."""
        self.page.change("all", avatar=replace(self.work, landmarks=as_places(self.marks)))


class Blind:
    """Proposes what `found` says, and mirrors nothing: a face is not looked for, which takes seconds."""

    found: ClassVar = {}

    def __init__(self, mesh, searched=None):
        self.mesh = mesh

    def propose(self, known):
        places = {name: Proposal(name, one["face"], np.array(one["barycentric"]), point(self.mesh, one), sure, "laid")
                  for name, (one, sure) in self.found.items() if name not in known}
        given = {name: Proposal(name, face, np.array(weights), None, 1.0, "given")
                 for name, (face, weights) in known.items()}
        errors, odd = odd_places(given, self.mesh, None)
        return Proposals(places, 0.0, (*errors, *odd), None, None, self.mesh, errors)


@pytest.fixture(autouse=True)
def blind(monkeypatch):
    """No test here looks for faces."""
    monkeypatch.setattr(proposing, "Proposer", Blind)
    monkeypatch.setattr(proposing, "search_safely", lambda path, waits: None)
    monkeypatch.setattr(Blind, "found", {})
    proposing.adviser_of.cache_clear()
    yield Blind
    proposing.adviser_of.cache_clear()


@pytest.fixture
def opened(tmp_path):
    made = Opened(tmp_path)
    yield made
    assert made.panel.picker.settle()
    assert made.panel.rigging.settle()
    made.page.close()


def test_points_are_placed_by_clicks_one_after_another(opened):
    opened.page.undo()
    assert (opened.work.file, AVATAR in opened.page.stage.figures) == (None, False)
    opened.page.redo()
    assert opened.panel.scene.figure is opened.page.stage.figures[AVATAR]
    for count in range(4):
        name = opened.panel.picker.wanted(opened.work)
        assert WORDS[name].label in opened.panel.picker._ask.content
        assert WORDS[name].where in opened.panel.picker._ask.content
        opened.click(name)
        assert opened.panel.picker.settle()
        assert len(opened.work.landmarks) == count + 1
        assert opened.off(name) < 0.5
    opened.page.undo()
    assert len(opened.work.landmarks) == 3
    assert opened.client.notices == []


def test_a_click_beside_the_avatar_places_nothing_and_none_is_heard_when_nobody_picks(opened):
    opened.client.scene.click((50.0, 0.0, 9.0), (0.0, 0.0, -1.0))
    assert opened.work.landmarks == {}
    assert len(opened.client.scene.clicks) == 1
    opened.gui.find("Place points by clicking").enter(False)
    assert opened.client.scene.clicks == []
    opened.gui.find("Place points by clicking").enter(True)
    opened.click(ORDER[0])
    assert len(opened.work.landmarks) == 1


def test_a_ball_that_is_clicked_on_is_chosen_and_moved_by_the_next_click(opened):
    opened.click(ORDER[0])
    opened.click(ORDER[0])
    assert set(opened.work.landmarks) == {ORDER[0]}, "the second click chose the ball"
    assert opened.panel.picker.chosen == ORDER[0]
    opened.click("nose_tip")
    assert opened.off(ORDER[0], "nose_tip") < 0.5
    assert opened.panel.picker.chosen is None


def test_what_is_dragged_goes_over_the_surface_and_takes_its_partner_along(opened):
    opened.place_all()
    opened.client.camera.position = tuple(opened.ray("eye_outer_L")[0])
    ball = next(one for one in opened.client.scene.made if one.label == "/landmarks/eye_outer_L" and not one.removed)
    before = opened.work.landmarks
    for phase, shift in (("start", 0.0), ("update", 2.0), ("end", 4.0)):
        true = opened.panel.scene.placement.apply(opened.true["eye_outer_L"])
        at = opened.panel.scene.figure.place(true + np.array([shift, 0.0, 0.0]))
        ball.press(phase=phase, end_position=tuple(at))
        assert (opened.work.landmarks == before) == (phase != "end")
    assert opened.off("eye_outer_L") == pytest.approx(4.0, abs=1.5)
    assert opened.off("eye_outer_R") == pytest.approx(opened.off("eye_outer_L"), abs=0.7)
    opened.page.undo()
    assert opened.work.landmarks == before
    opened.gui.find("Move both sides together").enter(False)
    ball.press(phase="end", end_position=tuple(at))
    assert opened.off("eye_outer_L") > 2.0
    assert opened.off("eye_outer_R") < 0.1


def test_proposals_are_shown_by_sureness_and_taken(opened, blind):
    true = as_places(opened.marks)
    blind.found = {"nose_tip": (true["nose_tip"], 0.9), "mouth_top": (true["mouth_top"], 0.2),
                   "chin": (true["chin"], 0.001)}
    opened.click("eye_inner_L")
    assert opened.panel.picker.settle()
    marks = opened.panel.picker.markers.marks
    assert set(marks) == {"eye_inner_L", "nose_tip", "mouth_top"}, "who knows nothing says nothing"
    assert marks["eye_inner_L"].colour == GREEN
    assert marks["mouth_top"].colour == BLUE
    assert marks["mouth_top"].opacity < marks["nose_tip"].opacity < 1.0
    opened.gui.find("Point").enter(WORDS["mouth_top"].label)
    assert opened.panel.picker.markers.marks["mouth_top"].colour == ORANGE
    opened.gui.find("Take this proposal").press()
    assert opened.work.landmarks["mouth_top"] == true["mouth_top"]
    opened.gui.find("Take all proposals (1)").press()
    assert opened.work.landmarks["nose_tip"] == true["nose_tip"]
    assert opened.panel.picker.settle()
    assert not opened.panel.picker._all.visible


def test_a_partner_is_proposed_while_the_face_is_looked_for(opened):
    adviser = proposing.Adviser(opened.mesh, opened.panel.scene.opened.path)
    work = picking.placed(opened.work, "eye_outer_L", as_places(opened.marks)["eye_outer_L"])
    mirrored = adviser.first(work).places["eye_outer_R"]
    placement = opened.panel.scene.placement
    assert placement.apply(point(opened.mesh, mirrored)) == pytest.approx(
        placement.apply(opened.true["eye_outer_R"]), abs=0.5)


def test_optional_points_can_be_skipped_and_any_point_be_placed_anew(opened):
    opened.place_all()
    label = WORDS["eye_outer_L"].label
    opened.gui.find("Point").enter(label)
    opened.gui.find("Remove this point").press()
    assert set(opened.true) - set(opened.work.landmarks) == {"eye_outer_L"}
    assert opened.gui.find("Make blendshapes").disabled
    opened.click("eye_outer_L")
    assert opened.off("eye_outer_L") < 0.5
    for name in ("jaw_L", "jaw_R"):
        opened.gui.find("Point").enter(WORDS[name].label)
        opened.gui.find("Remove this point").press()
    opened.gui.find("Point").enter("the next one")
    assert opened.panel.picker.wanted(opened.work) == "jaw_L"
    opened.gui.find("Skip this point").press()
    assert opened.work.skipped == {"jaw_L": True}
    opened.gui.find("Skip the optional points").press()
    assert opened.panel.picker.wanted(opened.work) is None
    assert wait(lambda: not opened.gui.find("Make blendshapes").disabled)


def test_points_that_are_wrong_are_said_in_words(opened):
    opened.place_all()
    swapped = {**opened.work.landmarks, "eye_inner_L": opened.work.landmarks["eye_outer_L"],
               "eye_outer_L": opened.work.landmarks["eye_inner_L"]}
    opened.page.change("swap", avatar=replace(opened.work, landmarks=swapped))
    assert opened.panel.picker.settle()
    said = opened.panel.picker._faults
    assert said.visible
    assert "**Inner corner, left eye** and **Outer corner, left eye** are swapped" in said.content
    opened.gui.find("Make blendshapes").press()
    assert wait(lambda: opened.client.notices)
    assert wait(lambda: opened.panel.rigging.task is None)
    (title, text), = opened.client.notices
    assert title == "That did not work"
    assert text.startswith("Landmarks: **Inner corner, left eye** and")
    assert wait(lambda: not opened.gui.find("Make blendshapes").disabled)
    opened.page.undo()
    assert opened.panel.picker.settle()
    assert "swapped" not in said.content


def test_swapped_points_are_told_while_most_are_still_missing(opened):
    true = as_places(opened.marks)
    few = {name: true[name] for name in ("eye_inner_L", "eye_outer_L", "nose_tip", "mouth_corner_L", "chin",
                                         "eye_inner_R", "eye_outer_R", "mouth_corner_R")}
    for swapped in ({}, {"mouth_corner_L": few["mouth_corner_R"], "mouth_corner_R": few["mouth_corner_L"]}):
        opened.page.change("few", avatar=replace(opened.work, landmarks={**few, **swapped}))
        assert opened.panel.picker.settle()
        said = opened.panel.picker._faults
        assert said.visible == bool(swapped)
    assert "**Corner of the mouth, left** and **Corner of the mouth, right** are swapped" in said.content


def test_landmarks_of_another_mesh_are_told_and_the_page_lives(opened):
    far = {"chin": picking.place(10**6, (1.0, 0.0, 0.0))}
    opened.page.change("tampered", avatar=replace(opened.work, landmarks=far))
    assert "another mesh" in opened.client.notices[-1][1]
    assert opened.panel.scene.figure is None
    opened.page.undo()
    assert opened.panel.scene.figure is not None


def test_landmarks_go_to_a_file_and_come_back(opened):
    opened.place_all()
    kept = opened.work.landmarks
    opened.gui.find("Save landmarks").press()
    (name, content), = opened.client.downloads.items()
    assert name == "cat.yaml"
    opened.gui.find("Remove all points").press()
    assert opened.work.landmarks == {}
    load = opened.gui.find("Load landmarks")
    load.enter(Upload("mine.yaml", content))
    assert set(opened.work.landmarks) == set(kept)
    for one in REQUIRED:
        assert opened.off(one) < 1e-4
    opened.client.notices.clear()
    opened.gui.find("Or try one").enter("human")
    load.enter(Upload("mine.yaml", content))
    (_, said), = opened.client.notices
    assert "the landmarks are of a mesh with the hash" in said
    assert opened.work.landmarks == {}
    opened.gui.find("Or try one").enter("cat")
    few = b"landmarks:\n  chin: " + json.dumps(kept["chin"]).encode()
    load.enter(Upload("few.yaml", few))
    assert opened.work.landmarks.keys() == {"chin"}, "what was begun can be gone on with"
    assert opened.client.notices[-1] == ("Landmarks loaded", "1 point; 24 needed ones are missing.")
    opened.page.undo()
    for hostile in (b"", b"\xff\xfe", b"landmarks: [", b"a: &a [*a]", b"landmarks: {chin: 99999999}"):
        opened.client.notices.clear()
        load.enter(Upload("x.yaml", hostile))
        assert len(opened.client.notices) == 1, hostile
        assert opened.client.notices[0][0] == "That did not work", hostile
        assert "/" not in opened.client.notices[0][1].split(":")[0], "the file is called as its owner calls it"
    assert opened.work.landmarks == {}


def test_an_upload_is_kept_with_the_work_and_found_after_a_reload(tmp_path):
    first = Opened(tmp_path, avatar=None)
    content = avatar_files("cat", None)[0].read_bytes()
    first.gui.find("Open an avatar").enter(Upload("../my cat.obj", content))
    assert wait(lambda: first.work.file)
    assert first.work.file == "my_cat.obj"
    first.gui.find("Open an avatar").enter(Upload("bad.glb", b"glTF"))
    assert wait(lambda: [title for title, _ in first.client.notices if title == "That did not work"])
    assert first.work.file == "my_cat.obj"
    assert ("Colours are missing", "They are in cat.mtl: open that file too.") in first.client.notices
    plain = first.panel.scene.figure
    colours = avatar_files("cat", None)[0].with_suffix(".mtl").read_bytes()
    first.gui.find("Open an avatar").enter(Upload("cat.mtl", colours))
    assert first.panel.scene.opened.avatar.colours
    assert first.panel.scene.figure is not plain, "it is painted"
    first.page.close()
    again = Opened(tmp_path, avatar=None)
    assert again.work.file == "my_cat.obj"
    assert again.panel.scene.figure is not None
    assert len(again.mesh.faces) == len(first.mesh.faces)
    again.page.close()


def test_an_avatar_that_lies_down_is_stood_up(opened):
    low, high = opened.panel.scene.figure.vertices.min(axis=0), opened.panel.scene.figure.vertices.max(axis=0)
    opened.gui.find("It looks to").enter("-z")
    turned = opened.panel.scene.figure.vertices
    assert turned[:, 0].max() == pytest.approx(-low[0], abs=1e-6)
    assert turned[:, 1].max() == pytest.approx(high[1], abs=1e-6)
    opened.gui.find("It looks to").enter("+y")
    assert "at right angles" in opened.client.notices[-1][1]
    assert opened.gui.find("It looks to").value == "-z", "what is shown is what is"


def test_what_cannot_be_chosen_is_shown_as_it_was(opened):
    for label in ("Expressions of all kinds", "ARKit's 52", "Visemes"):
        opened.gui.find(label).enter(False)
    assert opened.work.sets == "visemes"
    assert "one or more" in opened.client.notices[-1][1]
    assert opened.gui.find("Visemes").value
    opened.gui.find("Landmarks").enter(40.0)
    assert opened.work.weights == {"landmarks": 40.0}
    opened.gui.find("Back to ours").press()
    assert (opened.work.weights, opened.gui.find("Landmarks").value) == ({}, 20.0)
    opened.gui.find("Mouth opens").enter(1.3)
    opened.gui.find("Lids close").enter(0.4)
    assert (opened.work.opening, opened.work.lid_closure) == (1.3, 0.4)
    opened.page.undo()
    assert (opened.gui.find("Lids close").value, opened.work.opening) == (1.0, 1.3)


class Upload:
    """What viser gives of a file."""

    def __init__(self, name, content):
        self.name, self.content = name, content


def wait(true, seconds=20.0):
    """Return whether something becomes true in time."""
    import time
    end = time.monotonic() + seconds
    while not true() and time.monotonic() < end:
        time.sleep(0.02)
    return true()

"""An avatar laid on the template once, its shapes made again only where a choice changes them."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from facegen import forked
from facegen.errors import InputError
from facegen.fileio.avatar import load_avatar
from facegen.transfer import registration, skin
from facegen.transfer.landmarks import Landmarks, load_landmarks
from facegen.transfer.margins import LIDS, facing_margins
from facegen.transfer.rig import Rigging, avatar_files, rig

BLINKS = {"eyeBlinkLeft", "eyeBlinkRight"}


@pytest.fixture(scope="module")
def cartoon():
    """The avatar, and its shapes with our choices."""
    rigging = Rigging("cartoon", sets=["arkit"], cache=False)
    return rigging, rigging.shapes()


def same(one, other):
    """The rounding of a solver that takes several shapes at a time is all that may differ."""
    assert one.keys() == other.keys()
    for name in one:
        assert np.abs(one[name] - other[name]).max() < 1e-12, name


def lid_gaps(found, name):
    """Mean distance of each eye's lids at rest, and in a shape, mm."""
    moved, rest = found.frame.apply_vectors(found.shapes[name])[skin_rows(found)], found.skin.surface.vertices
    for slit in LIDS:
        margins = facing_margins(found.skin, slit)[1]
        yield [np.linalg.norm(margins.gap(at), axis=1).mean() for at in (rest, rest + moved)]


def skin_rows(found):
    mesh = load_avatar(avatar_files("cartoon", None)[0]).mesh
    return cKDTree(found.frame.apply(mesh.vertices)).query(found.skin.surface.vertices)[1]


def test_what_it_makes_is_what_rig_makes(cartoon, tmp_path):
    rigging, found = cartoon
    once = rig("cartoon", tmp_path / "once.glb", sets=["arkit"], cache=False)
    assert found.fresh == rigging.names == tuple(once.found.shapes)
    same(found.shapes, once.found.shapes)
    same(found.halves, once.found.halves)
    saved = rigging.save(tmp_path / "steps.glb")
    assert not saved.found.fresh
    assert saved.path.read_bytes() == once.path.read_bytes()


def test_nothing_is_registered_or_solved_twice(cartoon, monkeypatch):
    """Whatever is tuned; and what comes back is what a rigging that starts with the choice gives."""
    rigging, found = cartoon
    monkeypatch.setattr(skin, "register", None)
    monkeypatch.setattr(registration, "register", None)
    opened = rigging.shapes(opening=1.3)
    assert set(opened.fresh) == {name for name in rigging.names if name.startswith(("jaw", "mouthClose", "tongue"))}
    closed = rigging.shapes(lid_closure=0.5)
    assert set(opened.fresh) | BLINKS < set(closed.fresh), "what was opened, and what narrows the eyes"
    assert not {"mouthPucker", "mouthShrugLower", "mouthRollUpper"} & set(closed.fresh)
    monkeypatch.setattr(skin, "Transfer", None)
    again = rigging.shapes()
    same(again.shapes, found.shapes)
    same(again.halves, found.halves)
    monkeypatch.undo()
    other = Rigging("cartoon", sets=["arkit"], cache=False)
    same(other.shapes(opening=1.3).shapes, opened.shapes)
    same(other.shapes(lid_closure=0.5).shapes, closed.shapes)


def test_other_weights_change_every_shape(cartoon):
    rigging, found = cartoon
    firm = rigging.shapes(weights="landmarks=60")
    assert firm.fresh == rigging.names
    assert np.abs(firm.shapes["mouthSmileLeft"] - found.shapes["mouthSmileLeft"]).max() > 0
    same(rigging.shapes().shapes, found.shapes)


def test_only_some(cartoon):
    _, found = cartoon
    rigging = Rigging("cartoon", sets=["arkit"], cache=False)
    some = rigging.shapes(["mouthClose", "eyeBlinkLeft"])
    same(some.shapes, {name: found.shapes[name] for name in ("eyeBlinkLeft", "mouthClose")})
    assert set(some.fresh) == {"mouthClose", "eyeBlinkLeft", "jawOpen"}, "which mouthClose corrects"
    assert {len(one.after) for one in some.contacts.values()} == {2}
    with pytest.raises(InputError, match=r"only: 'jawOpn' is none .* did you mean 'jawOpen'"):
        rigging.shapes(["jawOpn"])
    with pytest.raises(InputError, match="AU12_L"):
        rigging.shapes(["AU12_L"])


def test_an_avatar_and_landmarks_that_are_read_already(cartoon):
    _, found = cartoon
    path, marks = avatar_files("cartoon", None)
    avatar = load_avatar(path)
    places = load_landmarks(marks, avatar.mesh)
    for one, other in ((avatar, places), (avatar, marks), ("cartoon", places)):
        made = Rigging(one, landmarks=other, sets=["arkit"]).shapes(["jawOpen"])
        same(made.shapes, {"jawOpen": found.shapes["jawOpen"]})
    with pytest.raises(InputError, match="landmarks: expected the file"):
        Rigging(avatar)
    short = Landmarks(places.names[1:], places.faces[1:], places.corners[1:], places.barycentric[1:])
    with pytest.raises(InputError, match=f"'{places.names[0]}' missing"):
        Rigging(avatar, landmarks=short)


def test_a_stop_leaves_it_as_good_as_before(cartoon, monkeypatch):
    monkeypatch.setattr(forked, "may_fork", lambda: False)      # which of two is faster decides what is told here
    rigging, found = cartoon

    class Stop(Exception):
        pass

    def listen(stage, share):
        if share > 0.6:
            raise Stop

    with pytest.raises(Stop):
        rigging.shapes(weights="anchor=0.1", progress=listen)
    same(rigging.shapes().shapes, found.shapes)


@pytest.mark.parametrize("closure", [0.0, 0.3, 0.7, 1.0, 2.0])
def test_lids_close_as_far_as_told(cartoon, closure):
    """A blink leaves what is told of the gap, and twice as far is shut too: lids do not cross."""
    rigging, _ = cartoon
    found = rigging.shapes(sorted(BLINKS), lid_closure=closure)
    for side, name in enumerate(("eyeBlinkLeft", "eyeBlinkRight")):
        rest, now = list(lid_gaps(found, name))[side]
        assert now / rest == pytest.approx(max(1.0 - closure, 0.0), abs=0.06)


def test_a_squint_closes_farther_too(cartoon):
    rigging, _ = cartoon
    squints = [rigging.shapes(["eyeSquintLeft"], lid_closure=closure) for closure in (0.5, 1.0, 1.5)]
    gaps = [next(lid_gaps(found, "eyeSquintLeft"))[1] for found in squints]
    assert gaps[0] > gaps[1] > gaps[2]


@pytest.mark.parametrize("lid_closure", [-0.1, 2.1, float("nan"), "1"])
def test_a_closure_that_cannot_be(cartoon, lid_closure):
    with pytest.raises(InputError, match=r"lid_closure: expected a factor of 0\.0 to 2\.0, got"):
        cartoon[0].shapes(lid_closure=lid_closure)


@pytest.mark.parametrize("choice", [{"lid_closure": 0.9}, {"opening": 1.1}, {"weights": "anchor=1"}])
def test_published_methods_have_nothing_to_choose(cartoon, choice):
    with pytest.raises(InputError, match=f"{next(iter(choice))}: the method 'sumner' has none to choose"):
        cartoon[0].shapes(method="sumner", **choice)


def test_methods_side_by_side(cartoon):
    rigging, found = cartoon
    cloned = rigging.shapes(method="cloning")
    assert cloned.fresh == rigging.names
    assert not cloned.contacts
    assert not cloned.halves
    again = rigging.shapes()
    same(again.shapes, found.shapes)
    assert again.contacts

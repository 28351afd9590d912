"""Placing landmarks, step by step, without a picture."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from facegen.errors import InputError, TableError
from facegen.face.landmarks import NAMES, OPTIONAL, REQUIRED
from facegen.fileio.avatar import load_avatar
from facegen.fileio.textfile import save_text
from facegen.studio import picking
from facegen.studio.landmark_words import ORDER, VIEWS, WORDS, partner
from facegen.studio.picking import CONFIRMED, OPEN, PROPOSED, SKIPPED, place, state, wanted
from facegen.studio.work import AvatarWork, Work
from facegen.transfer.landmarks import load_landmarks
from facegen.transfer.rig import avatar_files

HERE, THERE = place(3, (0.2, 0.3, 0.5)), place(4, (1.0, 0.0, 0.0))


@pytest.fixture(scope="module")
def cartoon():
    """The avatar, and its landmarks as places."""
    path, marks = avatar_files("cartoon", None)
    avatar = load_avatar(path)
    return avatar, picking.as_places(load_landmarks(marks, avatar.mesh))


def test_every_landmark_has_words_and_is_asked_for_once():
    assert sorted(ORDER) == sorted(NAMES)
    assert {WORDS[name].part for name in NAMES} == set(VIEWS)
    assert len({WORDS[name].label for name in NAMES}) == len(NAMES)
    for name in NAMES:
        words, pair = WORDS[name], partner(name)
        assert words.label
        assert words.where.endswith(".")
        if pair is not None:
            assert partner(pair) == name
            assert WORDS[pair].where.replace("right", "left") == words.where.replace("right", "left")


def test_all_required_points_are_asked_for_before_any_optional_one():
    work, asked = AvatarWork(file="cat"), []
    while (name := wanted(work)) is not None:
        asked.append(name)
        work = picking.placed(work, name, HERE)
    assert sorted(asked) == sorted(NAMES)
    assert set(asked[:len(REQUIRED)]) == set(REQUIRED)
    lone = [name for name in asked[:len(REQUIRED)] if not name.endswith("_R")]
    assert lone == asked[:len(lone)] == [name for name in ORDER if name in lone], "what mirroring tells comes last"
    assert not picking.missing(work)


def test_who_chooses_goes_first_then_advice_then_the_order():
    work = AvatarWork(file="cat")
    assert wanted(work) == ORDER[0]
    assert wanted(work, advised="chin") == "chin"
    assert wanted(work, advised="jaw_L") == ORDER[0], "an optional point has time"
    assert wanted(work, chosen="jaw_L", advised="chin") == "jaw_L"
    work = picking.placed(work, "chin", HERE)
    assert wanted(work, advised="chin") == ORDER[0], "advice that is old"
    assert wanted(picking.placed(work, "nose_wing_L", HERE), advised="nose_wing_R") == ORDER[0], "mirroring tells it"
    assert wanted(work, chosen="chin") == "chin", "a point that is placed can be placed anew"


def test_a_required_point_cannot_be_skipped_and_an_optional_one_is_asked_for_no_more():
    work = AvatarWork(file="cat")
    with pytest.raises(InputError, match="Chin: this point is needed"):
        picking.skipped(work, "chin")
    work = picking.skipped(work, "jaw_L")
    assert state(work, "jaw_L", ["jaw_L"]) == SKIPPED
    assert picking.taken(work, {"jaw_L": HERE}).landmarks == {}
    work = picking.placed(work, "jaw_L", HERE)
    assert (state(work, "jaw_L"), work.skipped) == (CONFIRMED, {})
    rest = picking.skipped_rest(work)
    assert set(rest.skipped) == set(OPTIONAL) - {"jaw_L"}
    for name in REQUIRED:
        rest = picking.placed(rest, name, HERE)
    assert wanted(rest) is None


def test_a_partner_goes_along_if_it_was_confirmed_and_both_sides_move_together():
    work = picking.placed(AvatarWork(), "eye_inner_L", HERE, THERE)
    assert set(work.landmarks) == {"eye_inner_L"}, "a partner is proposed, not set"
    work = picking.placed(work, "eye_inner_R", HERE, THERE)
    assert work.landmarks["eye_inner_L"] == THERE
    apart = picking.placed(AvatarWork(symmetric=False, landmarks=work.landmarks), "eye_inner_R", THERE, HERE)
    assert apart.landmarks == {"eye_inner_L": THERE, "eye_inner_R": THERE}


def test_proposals_are_taken_but_nothing_that_was_placed_is_overwritten():
    work = picking.placed(AvatarWork(), "chin", HERE)
    proposals = {"chin": THERE, "nose_tip": THERE, "mouth_top": THERE}
    assert state(work, "nose_tip", proposals) == PROPOSED
    assert state(work, "nose_tip") == OPEN
    one = picking.taken(work, proposals, ["nose_tip"])
    assert one.landmarks == {"nose_tip": THERE, "chin": HERE}
    assert picking.taken(work, proposals).landmarks == {"nose_tip": THERE, "mouth_top": THERE, "chin": HERE}
    assert picking.removed(one, "nose_tip") == work


def test_only_what_touches_may_be_meant_by_one_click():
    assert picking.may_meet("mouth_inner_top", "mouth_inner_bottom")
    assert picking.may_meet("eye_upper_L", "eye_lower_L")
    assert not picking.may_meet("eye_upper_L", "eye_lower_R")
    assert not picking.may_meet("eye_inner_L", "eye_lower_L")
    assert not picking.may_meet("nose_tip", "nose_base")


@given(st.lists(st.tuples(st.sampled_from(["place", "take", "remove", "skip", "rest"]), st.sampled_from(NAMES)),
                max_size=40))
@settings(max_examples=30, deadline=None)
def test_whatever_is_done_the_work_is_one_that_can_be_saved(steps):
    work = AvatarWork(file="cat")
    for what, name in steps:
        before = work
        if what == "place":
            work = picking.placed(work, name, HERE, THERE)
            assert work.landmarks[name] == HERE
        elif what == "take":
            work = picking.taken(work, {name: THERE})
            assert before.landmarks.items() <= work.landmarks.items()
        elif what == "remove":
            work = picking.removed(work, name)
            assert state(work, name) == OPEN
        elif what == "rest":
            work = picking.skipped_rest(work)
        elif name in OPTIONAL:
            work = picking.skipped(work, name)
        assert not set(work.landmarks) & set(work.skipped)
        assert (wanted(work) is None) == (not [each for each in NAMES if state(work, each) == OPEN])
    assert Work.read(Work(avatar=work.checked()).plain()).avatar == work


@given(st.lists(st.floats(-1e-9, 1.0), min_size=3, max_size=3).filter(lambda w: sum(w) > 0.1))
@settings(deadline=None)
def test_a_place_that_was_clicked_has_weights_that_a_file_may_have(weights):
    work = AvatarWork(file="cat", landmarks={"chin": place(0, weights)})
    assert work.checked() is work


def test_the_file_says_what_the_work_says(cartoon, tmp_path):
    avatar, places = cartoon
    work = AvatarWork(file="cartoon", landmarks=places)
    path = save_text(picking.file_text(work, avatar.digest), tmp_path / "marks.yaml")
    found = load_landmarks(path, avatar.mesh, digest=avatar.digest)
    points = picking.as_landmarks(avatar.mesh, places).points(avatar.mesh.vertices)
    for name, at in found.points(avatar.mesh.vertices).items():
        assert at == pytest.approx(points[name], abs=1e-7)
        assert at == pytest.approx(picking.point(avatar.mesh, places[name]), abs=1e-7)
    with pytest.raises(TableError, match="this one has"):
        load_landmarks(path, avatar.mesh, digest="0" * 64)


def test_messages_say_the_words_of_the_studio():
    said = picking.words_for("'eye_upper_L' lies below 'eye_lower_L'; swap them")
    assert said == "**Upper lid, left eye** lies below **Lower lid, left eye**; swap them"
    assert picking.words_for("'eye_upper_inner_L' is odd").startswith("**Upper lid, inner half, left**")
    assert picking.words_for("set 2 more, best nose_tip, jaw_L; the chin too") == (
        "Set 2 more, best **Tip of the nose**, **Joint of the jaw, left**; the chin too")


@pytest.mark.parametrize(("change", "said"), [
    ({"up": "y", "front": "-y"}, "at right angles"),
    ({"up": "w"}, "at right angles"),
    ({"landmarks": {"nose": HERE}}, "unknown landmark 'nose'"),
    ({"landmarks": {"chin": {"face": -1, "barycentric": [1, 0, 0]}}}, "a triangle"),
    ({"landmarks": {"chin": {"face": 0, "barycentric": [1, 1, 0]}}}, "sum to one"),
    ({"landmarks": {"chin": {"face": 0, "barycentric": [2.0, -1.0, 0.0]}}}, "barycentric"),
    ({"skipped": {"chin": True}}, "unknown optional landmark"),
    ({"sets": "unit"}, "unit"),
    ({"sets": ""}, "one or more"),
    ({"opening": 9.0}, "opening"),
    ({"lid_closure": float("nan")}, "lid_closure"),
    ({"weights": {"gradient": 1.0}}, "gradient"),
    ({"weights": {"gradients": -1.0}}, "gradients"),
    ({"pieces": {"3": "hat"}}, "unknown kind"),
])
def test_what_cannot_be_is_refused(change, said):
    with pytest.raises(InputError, match=said):
        AvatarWork(**change).checked()


def test_a_place_is_of_a_mesh_that_has_its_triangle(cartoon):
    mesh = cartoon[0].mesh
    assert picking.fits(mesh, cartoon[1])
    assert not picking.fits(mesh, {"chin": place(len(mesh.faces), (1, 0, 0))})
    assert np.isfinite(picking.point(mesh, HERE)).all()

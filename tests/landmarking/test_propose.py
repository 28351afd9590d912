"""Proposed landmarks: laws that hold on any head, and what is refused."""

import pickle

import numpy as np
import pytest

from facegen.errors import InputError
from facegen.face.landmarks import REQUIRED
from facegen.geometry.mesh import Mesh
from facegen.landmarking.propose import Proposer, Searched, propose_landmarks

SIX = ("eye_outer_L", "eye_outer_R", "nose_tip", "mouth_corner_L", "mouth_corner_R", "chin")


def share(found, true, names=REQUIRED):
    """Return how far proposals are from the true places, in distances between the outer corners of the eyes."""
    unit = np.linalg.norm(true["eye_outer_L"] - true["eye_outer_R"])
    return np.array([np.linalg.norm(found[name].xyz - true[name]) / unit for name in names])


def other_side(name):
    return name if name[-2:] not in ("_L", "_R") else f"{name[:-1]}{'R' if name[-1] == 'L' else 'L'}"


def test_every_required_place_of_a_human_is_proposed_from_none(human):
    proposer, true = human
    found = proposer.propose({})
    assert set(REQUIRED) <= set(found)
    assert np.median(share(found, true)) < 0.04
    assert share(found, true).max() < 0.15
    assert found.ask == "eye_outer_L"
    assert found.face == 1.0
    assert not found.warnings


def test_what_was_searched_for_in_another_process_is_as_good_as_ones_own(human):
    """Through bytes, as it comes from there; nothing is looked for again."""
    proposer, true = human
    other = Proposer(proposer.mesh, pickle.loads(pickle.dumps(proposer.search())))
    for known in ({}, {"nose_tip": true["nose_tip"]}, {name: true[name] for name in SIX}):
        here, there = proposer.propose(known), other.propose(known)
        assert (there.face, there.ask, there.warnings) == (here.face, here.ask, here.warnings)
        assert list(there) == list(here)
        for name in here:
            assert there[name].face == here[name].face
            assert there[name].confidence == here[name].confidence
            np.testing.assert_array_equal(there[name].barycentric, here[name].barycentric)


def test_where_no_face_was_found_known_places_still_propose(human):
    proposer, true = human
    blind = Proposer(proposer.mesh, Searched())
    assert not blind.propose({}).places
    found = blind.propose({name: true[name] for name in SIX})
    assert np.median(share(found, true)) < 0.1


def test_a_place_lies_on_its_triangle_and_has_a_confidence(human):
    found = human[0].propose({})
    mesh = human[0].mesh
    for one in found.values():
        assert one.barycentric.min() > -1e-9
        assert np.isclose(one.barycentric.sum(), 1.0)
        assert np.allclose(one.barycentric @ mesh.vertices[mesh.faces[one.face]], one.xyz)
        assert 0.0 <= one.confidence <= 1.0
        assert not one.given
    assert found.landmarks().names == tuple(found)


def test_a_turned_scaled_moved_and_mirrored_copy_gets_the_same_places(human):
    proposer, _ = human
    mesh = proposer.mesh
    turn = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0]
    turn = turn * -np.sign(np.linalg.det(turn))                             # a mirror, too

    def copied(at):
        return 0.037 * at @ turn.T + [3.0, -20.0, 7.0]

    copy = Mesh(copied(mesh.vertices), mesh.faces[:, ::-1], mesh.materials, mesh.face_materials, mesh.parts,
                mesh.face_parts)
    there, here = Proposer(copy).propose({}), proposer.propose({})
    goal = {name: copied(here[other_side(name)].xyz) for name in REQUIRED}
    off = share(there, goal)
    assert np.median(off) < 0.01
    assert off.max() < 0.05


def test_known_places_stay_bit_for_bit_and_their_order_does_not_matter(human):
    proposer, true = human
    known = {name: true[name] for name in SIX}
    found, other = proposer.propose(known), proposer.propose(dict(reversed(known.items())))
    for name in SIX:
        assert found[name].given
        assert np.array_equal(found[name].xyz, true[name])
    for name in found:
        assert np.array_equal(found[name].xyz, other[name].xyz)
    assert np.median(share(found, true)) < 0.06
    assert not found.warnings


def test_a_known_place_on_a_triangle_stays_there(human):
    proposer, _ = human
    one = proposer.propose({})["nose_tip"]
    found = proposer.propose({"nose_tip": (one.face, one.barycentric)})["nose_tip"]
    assert found.given
    assert (found.face, found.confidence) == (one.face, 1.0)
    assert np.array_equal(found.barycentric, one.barycentric)


def test_a_places_partner_is_proposed_after_one_click(human):
    proposer, true = human
    found = proposer.propose({"eye_outer_L": true["eye_outer_L"]})
    assert found["eye_outer_R"].why == "mirrored"
    assert share(found, true, ["eye_outer_R"])[0] < 0.05
    assert found.ask == "eye_outer_R"


@pytest.mark.parametrize(("click", "at", "said"), [
    ("eye_outer_L", "eye_outer_R", "on the side of 'eye_outer_R'"), ("chin", "nose_tip", "'nose_tip' seems to be"),
    ("nose_tip", "head_back", "'head_back' seems to be"), ("nose_tip", "neck", "'neck' seems to be")])
def test_a_misplaced_click_is_told_at_once(human, click, at, said):
    proposer, true = human
    assert any(said in one for one in proposer.propose({click: true[at]}).warnings)


def test_a_click_far_from_all_landmarks_is_told(human):
    proposer, true = human
    places = proposer.mesh.vertices
    nearest = np.linalg.norm(places[:, None] - np.array(list(true.values())), axis=2).min(axis=1)
    found = proposer.propose({"nose_tip": places[nearest.argmax()]})
    assert any("far from where it seems to be" in one for one in found.warnings)


def test_six_places_are_asked_for_where_no_face_is():
    turns, heights = np.meshgrid(np.linspace(0, 2 * np.pi, 24, endpoint=False), np.linspace(-1.2, 1.2, 12))
    r = np.cos(heights)
    ball = np.stack([r * np.cos(turns), 1.3 * np.sin(heights), r * np.sin(turns)], axis=-1).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(11), np.arange(24), indexing="ij")
    a, b, c, d = (24 * i + j, 24 * i + (j + 1) % 24, 24 * (i + 1) + j, 24 * (i + 1) + (j + 1) % 24)
    faces = np.concatenate([np.stack([a, c, b], -1).reshape(-1, 3), np.stack([b, c, d], -1).reshape(-1, 3)])
    found = propose_landmarks(Mesh.of(ball, faces))
    assert found.face < 0.5
    assert "set 6 more" in found.warnings[0]
    assert max(one.confidence for one in found.values()) < 0.5
    assert set(found.below(0.5)) == set(REQUIRED)


@pytest.mark.parametrize(("known", "said"), [
    ({"nose_tipp": [0, 0, 0]}, "nose_tip"), ({"nose_tip": [0, np.nan, 0]}, "three finite numbers"),
    ({"nose_tip": "here"}, "three finite numbers"), ({"nose_tip": (10**9, [1, 0, 0])}, "triangle"),
    ({"nose_tip": (0, [1, 1, 0])}, "sum to one")])
def test_bad_known_places_are_refused(human, known, said):
    with pytest.raises(InputError, match=said):
        human[0].propose(known)


@pytest.mark.parametrize(("vertices", "faces", "said"), [
    (np.zeros((3, 3)), np.zeros((0, 3), int), "at least one triangle"), (np.zeros((3, 3)), [[0, 1, 2]], "spans 0"),
    ([[0, 0, 0], [1, 1, 1], [2, 2, 2]], [[0, 1, 2]], "area"),
    ([[0, 0, 0], [1, np.nan, 0], [0, 1, 0]], [[0, 1, 2]], "finite"), (1e200 * np.eye(3), [[0, 1, 2]], "spans 1e\\+200"),
    (np.eye(3) + 1e9, [[0, 1, 2]], "from the origin")])
def test_a_mesh_that_carries_no_landmarks_is_refused(vertices, faces, said):
    with pytest.raises(InputError, match=said):
        Proposer(Mesh.of(vertices, faces))

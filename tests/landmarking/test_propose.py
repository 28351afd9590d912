"""Proposed landmarks: laws that hold on any head, and what is refused."""

import numpy as np
import pytest

from facegen.errors import InputError
from facegen.face.landmarks import REQUIRED
from facegen.fileio.avatar import load_avatar
from facegen.geometry.mesh import Mesh
from facegen.landmarking.propose import Proposer, propose_landmarks
from facegen.transfer.landmarks import load_landmarks
from facegen.transfer.rig import avatar_files

SIX = ("eye_outer_L", "eye_outer_R", "nose_tip", "mouth_corner_L", "mouth_corner_R", "chin")


@pytest.fixture(scope="session")
def human():
    path, marks = avatar_files("human", None)
    mesh = load_avatar(path).mesh
    return Proposer(mesh), load_landmarks(marks, mesh).points(mesh.vertices)


def share(found, true, names=REQUIRED):
    """Return how far proposals are from the true places, in distances between the outer corners of the eyes."""
    unit = np.linalg.norm(true["eye_outer_L"] - true["eye_outer_R"])
    return np.array([np.linalg.norm(found[name].xyz - true[name]) / unit for name in names])


def test_every_required_place_of_a_human_is_proposed_from_none(human):
    proposer, true = human
    found = proposer.propose({})
    assert set(REQUIRED) <= set(found)
    assert np.median(share(found, true)) < 0.06
    assert share(found, true).max() < 0.2
    assert found.ask == "eye_outer_L"


def test_known_places_stay_bit_for_bit_and_their_order_does_not_matter(human):
    proposer, true = human
    known = {name: true[name] for name in SIX}
    found = proposer.propose(known)
    other = proposer.propose(dict(reversed(known.items())))
    for name in SIX:
        assert found[name].given
        assert np.array_equal(found[name].xyz, true[name])
    for name in found:
        assert np.array_equal(found[name].xyz, other[name].xyz)
    assert np.median(share(found, true)) < 0.06


def test_a_places_partner_is_proposed_after_one_click(human):
    proposer, true = human
    found = proposer.propose({"eye_outer_L": true["eye_outer_L"]})
    assert found["eye_outer_R"].why == "mirrored"
    assert share(found, true, ["eye_outer_R"])[0] < 0.05


@pytest.mark.parametrize(("known", "said"), [
    ({"nose_tipp": [0, 0, 0]}, "nose_tip"), ({"nose_tip": [0, np.nan, 0]}, "three finite numbers"),
    ({"nose_tip": "here"}, "three finite numbers"), ({"nose_tip": (10**9, [1, 0, 0])}, "triangle"),
    ({"nose_tip": (0, [1, 1, 0])}, "sum to one")])
def test_bad_known_places_are_refused(human, known, said):
    with pytest.raises(InputError, match=said):
        human[0].propose(known)


def test_a_mesh_without_triangles_is_refused():
    with pytest.raises(InputError, match="triangle"):
        propose_landmarks(Mesh.of(np.zeros((3, 3)), np.zeros((0, 3), int)))
    with pytest.raises(InputError, match="area"):
        propose_landmarks(Mesh.of(np.zeros((3, 3)), [[0, 1, 2]]))

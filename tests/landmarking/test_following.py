"""Places that follow from known ones: against the conditional mean written out, and laws."""

import numpy as np
import pytest

from facegen.landmarking.following import CLICK, follow_kinds, follow_laid, partner
from facegen.landmarking.model import face_model

SIX = ("eye_outer_L", "eye_outer_R", "nose_tip", "mouth_corner_L", "mouth_corner_R", "chin")


@pytest.fixture(scope="module")
def rest():
    return face_model().rest


def test_a_face_like_the_base_face_stays_it(rest):
    moved, _ = follow_kinds(rest, {name: (rest[name], CLICK) for name in SIX})
    for name, place in rest.items():
        assert np.allclose(moved[name], place)


def test_what_is_stretched_is_stretched_everywhere(rest):
    stretch = np.array([1.3, 0.8, 1.1])
    known = {name: (rest[name] * stretch, 0.01) for name in rest if not name.startswith(("jaw", "head", "temple"))}
    moved, _ = follow_kinds(rest, {name: one for name, one in known.items() if not name.startswith("brow")})
    for name in known:
        assert np.linalg.norm(moved[name] - rest[name] * stretch) < 2.0


def test_known_places_are_kept_as_nearly_as_they_are_known(rest):
    random = np.random.default_rng(3)
    known = {name: (rest[name] + random.normal(size=3) * 8, CLICK) for name in SIX}
    moved, off = follow_kinds(rest, known)
    for name in SIX:
        assert np.linalg.norm(moved[name] - known[name][0]) < 2 * CLICK
        assert off[name] < CLICK


def test_more_known_places_leave_no_place_less_sure(rest):
    names = list(rest)
    before = follow_kinds(rest, {name: (rest[name], CLICK) for name in names[:3]})[1]
    for count in range(4, len(names)):
        after = follow_kinds(rest, {name: (rest[name], CLICK) for name in names[:count]})[1]
        assert all(after[name] <= before[name] + 1e-9 for name in names)
        before = after


def test_the_order_of_known_places_does_not_matter(rest):
    known = {name: (rest[name] + [i, -i, 2.0], CLICK) for i, name in enumerate(SIX)}
    one, other = (follow_kinds(rest, dict(items))[0] for items in (known.items(), reversed(known.items())))
    for name in rest:
        assert np.allclose(one[name], other[name], atol=1e-9)


def test_mirrored_places_follow_mirrored_clicks(rest):
    flip = np.array([-1.0, 1.0, 1.0])
    even = {name: (rest[name] + flip * rest[partner(name)]) / 2 for name in rest}
    known = {name: (even[name] + [3.0 * i, i, -i], CLICK) for i, name in enumerate(SIX)}
    other = {partner(name): (flip * place, off) for name, (place, off) in known.items()}
    one, two = follow_kinds(even, known)[0], follow_kinds(even, other)[0]
    for name in rest:
        assert np.allclose(flip * one[name], two[partner(name)], atol=1e-6)


def test_beside_a_click_only_what_is_near_moves_and_its_mirror_image(rest):
    laid = {name: rest[name] for name in face_model().names}
    moved = follow_laid(laid, rest, (), {"mouth_corner_L": rest["mouth_corner_L"] + [4.0, 0.0, 0.0]})
    way = {name: moved[name] - laid[name] for name in laid}
    assert 3.0 < way["mouth_corner_L"][0] < 4.0
    assert -3.0 < way["mouth_corner_R"][0] < -1.0
    assert np.linalg.norm(way["mouth_upper_L"]) < 2.0
    for name in ("eye_outer_L", "brow_mid_R", "nose_tip", "chin"):
        assert np.linalg.norm(way[name]) < 0.1


def test_what_was_seen_moves_less_than_what_was_laid(rest):
    laid = {name: rest[name] for name in face_model().names}
    known = {"mouth_top": rest["mouth_top"] + [0.0, 4.0, 0.0]}
    free = follow_laid(laid, rest, (), known)["mouth_inner_top"] - rest["mouth_inner_top"]
    held = follow_laid(laid, rest, ("mouth_inner_top",), known)["mouth_inner_top"] - rest["mouth_inner_top"]
    assert 0.0 < held[1] < free[1]

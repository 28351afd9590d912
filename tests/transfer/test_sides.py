"""Which side of a slit a place lies on."""

import numpy as np

from facegen.transfer.sides import settled, side_fields


def test_landmarks_hold_their_own_side(template):
    sides = side_fields(template.surface, template.places)
    at = {name: weights @ sides[rows] for name, (rows, weights) in template.places.items()}
    assert at["mouth_top"][0] > 0.9
    assert at["mouth_bottom"][0] < -0.9
    for slit, side in ((1, "L"), (2, "R")):
        assert at[f"eye_upper_{side}"][slit] > 0.9
        assert at[f"eye_lower_{side}"][slit] < -0.9
    assert abs(at["mouth_corner_L"][0]) < 0.1


def test_lips_that_touch_lie_on_either_side_and_a_cheek_on_none(template):
    sides = side_fields(template.surface, template.places)
    top, bottom = (template.places[name] for name in ("mouth_inner_top", "mouth_inner_bottom"))
    assert np.allclose(template.landmarks["mouth_inner_top"], template.landmarks["mouth_inner_bottom"], atol=0.1)
    assert top[1] @ sides[top[0], 0] > 0.15
    assert bottom[1] @ sides[bottom[0], 0] < -0.15
    far = np.abs(template.surface.vertices[:, 0]) > 65
    assert np.abs(sides[far, 0]).max() < 0.05


def test_a_point_on_the_wrong_lip_is_settled_and_a_right_one_stays(template):
    sides = side_fields(template.surface, template.places)
    wrong = {**template.places, "mouth_inner_bottom": template.places["mouth_inner_top"]}
    rows, weights = settled(template.surface, wrong, sides)["mouth_inner_bottom"]
    assert weights @ sides[rows, 0] < 0
    assert settled(template.surface, template.places, sides) == template.places

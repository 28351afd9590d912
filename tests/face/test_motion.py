"""Named shapes on the base face."""

from __future__ import annotations

import numpy as np
import pytest

from facegen.blendshapes.recipes import shape_set
from facegen.errors import InputError
from facegen.face.motion import shape_motion

DETAIL = 2


@pytest.fixture(scope="module")
def arkit(face):
    shapes = shape_set("arkit")
    return dict(zip(shapes, shape_motion(face, shapes, detail=DETAIL), strict=True))


def points(face, moves):
    return face.landmark_points(face.mesh(DETAIL).vertices + moves, detail=DETAIL)


def gap(face, moves):
    at = points(face, moves)
    return float(np.linalg.norm(at["mouth_inner_top"] - at["mouth_inner_bottom"]))


def test_closed_lips_over_an_open_jaw(face, arkit):
    """mouthClose as Apple means it: the lips touch, the jaw is down."""
    opened, both = arkit["jawOpen"], arkit["jawOpen"] + arkit["mouthClose"]
    rest = gap(face, 0)
    assert gap(face, opened) > rest + 20
    assert gap(face, both) < rest + 0.5
    chin = [points(face, moves)["chin"] for moves in (0, opened, both)]
    assert chin[0][1] - chin[2][1] > 20
    np.testing.assert_allclose(chin[1], chin[2], atol=1.5)
    teeth = face.mesh(DETAIL).part_vertices("teeth_lower")
    np.testing.assert_allclose(arkit["mouthClose"][teeth], 0, atol=1e-9)


def test_half_way_they_meet_too(face, arkit):
    assert gap(face, 0.5 * (arkit["jawOpen"] + arkit["mouthClose"])) < gap(face, 0) + 0.5


@pytest.mark.parametrize("left", [name for name in shape_set("arkit") if name.endswith("Left")])
def test_left_is_left_and_right_is_its_mirror_image(face, arkit, left):
    right = arkit[left.removesuffix("Left") + "Right"]
    at, image = points(face, arkit[left]), points(face, right)
    rest = points(face, 0)
    for name, place in at.items():
        other = name[:-1] + {"L": "R", "R": "L"}.get(name[-1], name[-1]) if name[-2:] in ("_L", "_R") else name
        np.testing.assert_allclose((place - rest[name]) * [-1, 1, 1], image[other] - rest[other], atol=0.35,
                                   err_msg=name)
    if left.startswith(("eye", "brow", "cheek")):
        across = face.mesh(DETAIL).vertices[:, 0]
        size = np.linalg.norm(arkit[left], axis=1)
        assert size[across < -12].max() < 0.1 * size.max()
        assert size[across > 5].max() == size.max()


def test_directions(face, arkit):
    def way(shape, mark):
        return points(face, arkit[shape])[mark] - points(face, 0)[mark]

    assert way("mouthLeft", "mouth_top")[0] > 5
    assert way("mouthRight", "mouth_bottom")[0] < -5
    assert way("jawLeft", "chin")[0] > 3
    assert way("jawForward", "chin")[2] > 3
    assert way("mouthSmileLeft", "mouth_corner_L")[1] > 4
    assert way("mouthFrownLeft", "mouth_corner_L")[1] < -2
    assert way("mouthShrugUpper", "mouth_top")[2] > 1
    assert way("mouthPucker", "mouth_corner_L")[0] < -2
    assert way("mouthStretchLeft", "mouth_corner_L")[0] > 3
    assert way("browInnerUp", "brow_inner_R")[1] > 3
    tongue = face.mesh(DETAIL).part_vertices("tongue")
    assert arkit["tongueOut"][tongue, 2].max() > 25
    eye = face.mesh(DETAIL).part_vertices("eye_R")
    assert not arkit["eyeLookInLeft"][eye].any()
    assert arkit["eyeLookInRight"][eye, 0].max() > 3        # the right eye turns to the subject's left


def test_jaws_of_speech_are_small(face):
    shapes = shape_set("visemes")
    moves = dict(zip(shapes, shape_motion(face, shapes, detail=1), strict=True))
    rest = face.landmark_points(face.mesh(1).vertices, detail=1)["chin"][1]
    drop = {name: rest - face.landmark_points(face.mesh(1).vertices + move, detail=1)["chin"][1]
            for name, move in moves.items()}
    assert drop["viseme_aa"] == max(drop.values()) < 20
    assert not moves["viseme_sil"].any()
    assert drop["viseme_PP"] < 1
    order = ["viseme_SS", "viseme_I", "viseme_E", "viseme_aa"]
    assert [drop[name] for name in order] == sorted(drop[name] for name in order)


def test_a_sum_of_units_is_the_pose_where_it_is_linear(face):
    units = shape_set("units")
    moves = dict(zip(units, shape_motion(face, units, detail=1), strict=True))
    posed = face.pose({"L12": 0.5, "20": 0.3}, detail=1)
    from facegen.blendshapes.names import shape_of
    from facegen.facs.tables import load_units

    made = sum(value * moves[shape_of(member)]
               for member, value in load_units().coefficients({"L12": 0.5, "20": 0.3}).items())
    np.testing.assert_allclose(face.mesh(1).vertices + made, posed, atol=0.02)


def test_the_neutral_does_not_move(face):
    for name, still in (("vrm", "neutral"), ("visemes", "viseme_sil")):
        shapes = shape_set(name)
        assert not shape_motion(face, shapes, detail=0)[list(shapes).index(still)].any()


def test_a_corrective_needs_its_shape(face):
    alone = {"mouthClose": shape_set("arkit")["mouthClose"]}
    with pytest.raises(InputError, match="'mouthClose' corrects 'jawOpen', which is not among them"):
        shape_motion(face, alone)
    assert shape_motion(face, {}, detail=0).shape == (0, *face.mesh(0).vertices.shape)


def test_a_face_of_fifteen_points_takes_what_it_can(paper_face):
    shapes = shape_set("arkit")
    moves = shape_motion(paper_face, shapes, detail=0)
    assert np.isfinite(moves).all()
    assert moves[list(shapes).index("jawOpen")].any()

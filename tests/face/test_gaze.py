"""Eyes that look at a point: the line of sight of each eye meets it."""

import numpy as np
import pytest

import facegen
from facegen.face.gaze import DOWN, SIDEWAYS, UP
from facegen.face.head import turn_head
from facegen.facs.deformation import Deformation

FACE = facegen.load_face()


def sight(eyes, head=(0.0, 0.0, 0.0, 0.0)):
    """Return where each eye turns and the direction (3,) in which it looks, from the posed eyeballs themselves."""
    pose = Deformation(eyes=eyes, head=dict(zip(("yaw", "pitch", "roll"), head[:3], strict=True)))
    rest, posed = FACE.mesh().vertices, FACE.pose(pose)
    centres = turn_head(FACE.eye_centres, np.array(head), FACE.neck, np.ones((2, 1)))
    for part, before, after in zip(("eye_L", "eye_R"), FACE.eye_centres, centres, strict=True):
        ball = FACE.mesh().part_vertices(part)
        front = ball[(rest[ball] - before)[:, 2].argmax()]             # the pole of the cornea
        offset = rest[front] - before
        assert abs(offset[:2]).max() < 0.2 * offset[2]
        # The rotation of the whole ball, found from all of its vertices, turns straight ahead into the line of sight.
        u, _, vt = np.linalg.svd((posed[ball] - after).T @ (rest[ball] - before))
        turn = u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt
        yield after, turn @ [0.0, 0.0, 1.0]


@pytest.mark.parametrize("target", [(0, 0, 150), (60, 20, 300), (-100, -80, 400), (30, 0, 5000)])
@pytest.mark.parametrize("head", [(0, 0, 0, 0), (15, -10, 5, 0)])
def test_both_lines_of_sight_meet_the_target(target, head):
    target = np.array(target, float)
    for centre, way in sight(facegen.look_at(FACE, target, head=head), head):
        away = target - centre
        assert np.degrees(np.arccos(np.clip(way @ away / np.linalg.norm(away), -1, 1))) < 0.1


def test_eyes_converge_on_what_is_near_and_are_parallel_far_away():
    near, far = facegen.look_at(FACE, [0, 0, 150]), facegen.look_at(FACE, [0, 0, 1e9])
    assert near["yaw_L"] == pytest.approx(-near["yaw_R"])
    assert near["yaw_L"] < -5.0                             # the left eye turns to the subject's right
    assert far["yaw_L"] == pytest.approx(0.0, abs=1e-5)


@pytest.mark.parametrize("target", [(1000, 0, 10), (0, 1000, 10), (0, -1000, 10), (5, 5, -400), (0, 0, 0)])
def test_no_eye_goes_farther_than_eyes_go(target):
    eyes = facegen.look_at(FACE, target)
    for side in "LR":
        assert abs(eyes[f"yaw_{side}"]) <= SIDEWAYS
        assert -DOWN <= eyes[f"pitch_{side}"] <= UP


@pytest.mark.parametrize("target", [(0, 0), (0, 0, np.nan), ((0, 0, 1), (0, 0, 2)), (np.inf, 0, 0)])
def test_a_target_is_a_point(target):
    with pytest.raises(facegen.InputError, match="target: expected three finite numbers"):
        facegen.look_at(FACE, target)


def test_a_face_whose_eyes_nobody_knows_is_refused():
    class Blind:
        name, eye_centres, neck = "mask", None, np.zeros(3)

    with pytest.raises(facegen.InputError, match=r"where the eyes of mask are is not known; facegen rig notes it"):
        facegen.look_at(Blind(), [0, 0, 100])

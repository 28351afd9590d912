"""Driving rigs by weights: each kind beside the slow and obvious way."""

from __future__ import annotations

import numpy as np
import pytest

from facegen.animation.driver import LOOKS, Driver, limits
from facegen.blendshapes.recipes import shape_set
from facegen.errors import InputError
from facegen.face.avatar import AvatarFace
from facegen.face.convert import convert
from facegen.face.face import load_face
from facegen.facs.deformation import weighted_sum

ARKIT = tuple(shape_set("arkit"))
UNITS = ("1", "2", "L4", "R12", "L12", "25", "26", "45", "53")


@pytest.fixture(scope="module")
def face():
    return load_face()


@pytest.fixture(scope="module")
def arkit(rig_of):
    return AvatarFace(rig_of("arkit"))


@pytest.fixture(scope="module")
def units(rig_of):
    return AvatarFace(rig_of("units"))


def some(count, seed, share=0.3):
    rng = np.random.default_rng(seed)
    return rng.uniform(0, 1, count) * (rng.uniform(size=count) < share)


def off(one, other, rest):
    """Return how far two poses lie apart, as a share of the movement of the second."""
    return np.linalg.norm(one - other) / np.linalg.norm(other - rest)


@pytest.mark.parametrize("seed", range(4))
def test_units_on_the_parametric_face_are_its_own_pose(face, seed):
    weights = some(len(UNITS), seed, 0.6)
    expected = face.pose(dict(zip(UNITS, weights, strict=True)), detail=1)
    np.testing.assert_allclose(Driver(face, "units", UNITS, detail=1).vertices(weights), expected, atol=1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_shapes_on_the_parametric_face_are_the_sum_of_their_recipes(face, seed):
    weights, recipes = some(len(ARKIT), seed), shape_set("arkit")
    mixed = dict(zip(ARKIT, weights, strict=True))
    mixed["mouthClose"] = min(mixed["mouthClose"], mixed["jawOpen"])
    terms = {}
    for name, weight in mixed.items():
        minus = recipes[recipes[name].minus].deformation if recipes[name].minus else ()
        for sign, several in ((1, recipes[name].deformation), (-1, minus)):
            for one in several:
                terms.setdefault(one.units if one.has_lengths else "face", []).append((sign * weight, one))
    expected = face.pose_controls(face.controls(*map(weighted_sum, terms.values()), strict=False), detail=0)
    np.testing.assert_allclose(Driver(face, "arkit", ARKIT, detail=0).vertices(weights), expected, atol=1e-9)


def test_an_avatars_own_shapes_take_the_weights_as_they_are(arkit):
    driver = Driver(arkit, "arkit", ARKIT[::-1])
    weights = some(len(ARKIT), 3) * 1.5 - 0.1
    expected = arkit.pose_shapes(dict(zip(ARKIT[::-1], weights, strict=True)))
    np.testing.assert_array_equal(driver.vertices(weights), expected)
    assert driver.direct.all()
    assert driver.check() == ()


def test_other_peoples_spelling(rig_of):
    avatar = AvatarFace(rig_of("arkit", rename=lambda name: name.replace("Left", "_L").replace("Right", "_R")))
    weights = some(len(ARKIT), 5)
    shapes, turn = Driver(avatar, "arkit", ARKIT).shape_weights(weights)
    np.testing.assert_array_equal(shapes, weights)
    assert not turn.any()


@pytest.mark.parametrize("seed", range(3))
def test_conversion_loses_about_what_a_fit_of_each_frame_does(arkit, units, seed):
    weights = some(len(ARKIT), seed, 0.2)
    rest, expected = units.mesh().vertices, arkit.pose_shapes(dict(zip(ARKIT, weights, strict=True)))
    made = Driver(units, "arkit", ARKIT).vertices(weights)
    fitted = convert({name: weight for name, weight in zip(ARKIT, weights, strict=True) if weight}, "arkit", "units")
    assert off(made, expected, rest) < off(units.pose(fitted.weights), expected, rest) + 0.1


def test_little_changes_change_little(units):
    driver = Driver(units, "arkit", ARKIT)
    weights, step = some(len(ARKIT), 1, 0.5), some(len(ARKIT), 2, 1.0) * 1e-4
    moved = np.abs(driver.vertices(weights + step) - driver.vertices(weights)).max()
    whole = np.abs(driver.vertices(weights) - units.mesh().vertices).max()
    assert moved < 1e-3 * whole


def test_both_eyes_on_a_rig_that_turns_them_together(units):
    driver = Driver(units, "arkit", LOOKS)
    down = np.array([name.startswith("eyeLookDown") for name in LOOKS], float)
    shapes = dict(zip(units.shapes, driver.shape_weights(down)[0], strict=True))
    assert {name: weight for name, weight in shapes.items() if weight} == {"AU64": 1.0}


def test_a_shape_that_the_avatar_has_not_is_made_of_others(rig_of):
    avatar = AvatarFace(rig_of("arkit", rename=lambda name: "odd" if name == "mouthFunnel" else name))
    driver = Driver(avatar, "arkit", ARKIT)
    assert ARKIT[np.flatnonzero(~driver.direct)[0]] == "mouthFunnel"
    shapes, _ = driver.shape_weights((np.array(ARKIT) == "mouthFunnel").astype(float))
    assert 0 < shapes.max() <= 1.0


def test_a_pucker_does_not_press_a_shape_beyond_one(rig_of):
    avatar = AvatarFace(rig_of("units"))
    driver = Driver(avatar, "arkit", ("mouthPucker", "mouthFunnel", "jawOpen", "eyeBlinkLeft", "eyeSquintLeft"))
    shapes, _ = driver.shape_weights(np.ones(5))
    assert shapes.max() <= 1.0
    assert shapes.min() >= 0.0


@pytest.mark.parametrize("angles", [(20.0, 5.0, -3.0), (0.0, -20.0, 0.0)])
def test_the_head_turns_alike_on_every_rig(face, units, angles):
    head, rest = np.array(angles), np.zeros(1)
    base = Driver(face, "arkit", ["jawOpen"], detail=1).vertices(rest, head)
    np.testing.assert_allclose(Driver(units, "arkit", ["jawOpen"]).vertices(rest, head), base, atol=1e-6)
    expected = face.pose({"head": dict(zip(("yaw", "pitch", "roll"), angles, strict=True))}, detail=1)
    np.testing.assert_allclose(base, expected, atol=1e-9)


@pytest.mark.parametrize("gaze", [(20, 0, 20, 0), (10, 8, -10, 8), (0, -15, 0, -15)])
def test_the_gaze_turns_the_eyes_of_every_rig(face, arkit, gaze):
    gaze = np.array(gaze, float)
    on_face = Driver(face, "arkit", ["jawOpen"], detail=1)
    expected = face.pose({"eyes": dict(zip(("yaw_L", "pitch_L", "yaw_R", "pitch_R"), gaze, strict=True))}, detail=1)
    np.testing.assert_allclose(on_face.vertices(np.zeros(1), None, gaze), expected, atol=1e-9)
    eyes = np.concatenate([face.mesh(1).part_vertices(f"eye_{side}") for side in "LR"])
    made = Driver(arkit, "arkit", ["jawOpen"]).vertices(np.zeros(1), None, gaze)
    # Shapes go straight where eyes turn: half way between two of them the ball is a little smaller.
    assert off(made[eyes], expected[eyes], face.mesh(1).vertices[eyes]) < 0.2


def test_angles_go_before_shapes(face, arkit):
    names = ("eyeLookUpLeft", "eyeLookUpRight", "jawOpen")
    for rig in (face, arkit):
        driver = Driver(rig, "arkit", names, detail=1)
        gaze = np.array([10.0, -5.0, 10.0, -5.0])
        np.testing.assert_array_equal(driver.vertices(np.array([1.0, 1.0, 0.3]), None, gaze),
                                      driver.vertices(np.array([0.0, 0.0, 0.3]), None, gaze))
    turning = Driver(face, "units", ("51", "12"))
    np.testing.assert_array_equal(turning.vertices(np.ones(2), np.zeros(3)), turning.vertices(np.array([0.0, 1.0])))


def test_angles_beyond_reach_are_clipped(face):
    driver, (_, most) = Driver(face, "arkit", ["jawOpen"], detail=0), limits("head")
    np.testing.assert_array_equal(driver.vertices(np.zeros(1), most * 3), driver.vertices(np.zeros(1), most))
    low, _ = limits("eyes")
    np.testing.assert_array_equal(driver.vertices(np.zeros(1), None, low * 3),
                                  driver.vertices(np.zeros(1), None, low))


def test_what_cannot_be_shown(face, rig_of):
    odd = AvatarFace(rig_of("arkit", notes=False, rename=lambda name: f"q{hash(name) % 9973}x"))
    with pytest.raises(InputError, match="can show none of the 2 shapes: happyish, foo"):
        Driver(face, "shapes", ["happyish", "foo"])
    with pytest.raises(InputError, match="none of the 52 blendshapes"):
        Driver(odd, "arkit", ["jawOpen"])
    with pytest.raises(InputError, match=r"vocabulary: expected .* did you mean 'arkit'"):
        Driver(face, "arkitt", ["jawOpen"])
    with pytest.raises(InputError, match="unit L12 is given twice, by 12 and by L12"):
        Driver(face, "units", ["12", "L12"])
    assert "foo: no shapes of akimoto" in Driver(face, "arkit", ["jawOpen", "foo"]).check()[0]
    own = Driver(odd, "shapes", [odd.shapes[0], "jawOpen2"])
    assert own.check(["jawOpen2"]) == ("jawOpen2: no shapes of rig.glb, and not understood, so left out",)
    assert ["head does not turn" in one or "so the gaze is not shown" in one
            for one in own.check([], head=True, gaze=True)] == [True, True]
    few = AvatarFace(rig_of("vrm"))
    said, = Driver(few, "arkit", ["jawOpen", "tongueOut"]).check()
    assert "has no shapes for more than 20 % of their movement" in said

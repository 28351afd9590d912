"""A feature point taken by hand lies where it was put, whatever else the face does."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from facegen import load_face
from facegen.errors import InputError
from facegen.face.head import rotation
from facegen.face.reach import Grip, movable_points
from facegen.facs.deformation import Deformation, mirror_name
from facegen.facs.expressions import resolve

FACES = {name: load_face(name) for name in ("akimoto", "akimoto-1986")}
BUSY = resolve("1C+L2D+6D+12E+26D+R46C+51D+55C+63B").deformation


@pytest.mark.parametrize("name", FACES)
@pytest.mark.parametrize("mirrored", [False, True])
def test_every_point_reaches_a_place_near_it_on_a_busy_face(name, mirrored):
    face = FACES[name]
    controls = face.controls(BUSY, strict=False)
    before = face.feature_point_places(face.pose_controls(controls, detail=1), detail=1)
    lids = ("lid_", "eye_")
    for k, point in enumerate(movable_points(face)):
        grip = Grip(face, point, mirrored=mirrored, detail=1)
        middle = mirrored and mirror_name(point) == point
        turn = np.array([0.0 if middle else 0.8, 0.9, 0.5])
        target = before[point] + rotation(controls.head) @ turn         # of a point in the middle: within its plane
        found = grip.reach(controls, target)
        if point.startswith(lids):              # lids rest on the eyeball: no place inside is reached
            assert found.missed <= np.linalg.norm(turn) + 1e-6, point
        else:
            assert found.missed < (0.2 if middle else 0.02), (point, found)     # the neck turns less than the head
        if k % 20:
            continue
        moved = Deformation(points={point: tuple(found.vector)}, units="millimetre")
        if mirrored and not middle:
            moved += Deformation(points={mirror_name(point): tuple(found.vector * [-1, 1, 1])}, units="millimetre")
        whole = face.pose_controls(face.controls(BUSY, moved, strict=False), detail=1)
        assert face.feature_point_places(whole, detail=1)[point] == pytest.approx(found.place, abs=1e-9)


@settings(max_examples=40, deadline=None)
@given(st.sampled_from(movable_points(FACES["akimoto"])), st.tuples(*[st.floats(-4, 4)] * 3), st.booleans())
def test_it_finds_the_vector_that_made_a_place(point, vector, mirrored):
    face = FACES["akimoto"]
    controls = face.controls(resolve("12C+26B").deformation)
    grip = Grip(face, point, mirrored=mirrored, detail=0)
    vector = np.array(vector) * ([0, 1, 1] if mirrored and mirror_name(point) == point else [1, 1, 1])
    place = grip.places(controls, vector)[0]
    found = grip.reach(controls, place)
    lid = point.startswith(("lid_", "eye_"))        # rests on the eyeball, where the slope has a step
    assert found.missed < (0.5 if lid else 1e-3)
    assert np.linalg.norm(found.place - place) == pytest.approx(found.missed, abs=1e-9)


def test_what_cannot_be_reached_is_come_near_to():
    face = FACES["akimoto"]
    controls = face.controls(Deformation())
    target = face.feature_points["chin"] + [0.0, 0.0, 5000.0]
    found = Grip(face, "chin").reach(controls, target)
    assert np.isfinite(found.vector).all()
    assert found.missed > 1000.0


def test_points_that_are_none_or_take_no_vector_are_refused():
    with pytest.raises(InputError, match="did you mean 'chin'"):
        Grip(FACES["akimoto"], "chinn")
    with pytest.raises(InputError, match="turns with the jaw"):
        Grip(FACES["akimoto-1986"], "chin")


@pytest.mark.parametrize("name", FACES)
@pytest.mark.parametrize("units", ["face", "millimetre", "paper"])
def test_a_sum_in_any_unit_of_length_is_the_same_movement(name, units):
    face = FACES[name]
    own = Deformation(points={movable_points(face)[0]: (1.0, 2.0, 3.0)}, jaw={"side": 2.0, "open": 3.0},
                      head={"forward": 4.0}, units="millimetre")
    other = Deformation(points={movable_points(face)[-1]: (0.1, 0.2, 0.3)}, jaw={"forward": 0.1})
    total = face.total(own, other, units=units)
    assert total.units == units
    one, two = face.controls(own, other), face.controls(total)
    for part in vars(one):
        assert getattr(two, part) == pytest.approx(getattr(one, part), abs=1e-12)
    with pytest.raises(InputError, match="did you mean 'millimetre'"):
        face.total(own, units="millimeter")


def test_names_of_the_paper():
    assert sorted(FACES["akimoto-1986"].paper_names.values(), key=lambda name: int(name[1:])) == \
        [f"F{k}" for k in range(1, 16)]

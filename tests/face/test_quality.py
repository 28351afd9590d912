"""What a picture must not show: open closed eyes, eyeballs through lids, teeth through lips, lips that leak."""

import numpy as np
import pytest

from facegen.facs.tables import load_expressions, load_units

CATALOGUE = load_units().catalogue
UNITS = [f"L{n}" if u.sides == "direction" else n for n, u in CATALOGUE.units.items()]
ON_HEAD = [n for n in UNITS if not n.lstrip("LR").startswith("5") or len(n.lstrip("LR")) == 1]
SHUT = ["43E", "45E", "L46E+R46E", "43E+5E", "43E+63E", "43E+64E", "43E+61E", "43E+6E+7E+4E", "43E+1E+2E", "43E+12E",
        "43E+9E", "43E+65E"]
EXPRESSIONS = list(load_expressions().expressions)


@pytest.mark.parametrize("script", SHUT)
def test_closed_eyes_are_closed(face, measure, script):
    opening = measure.lid_opening(face.pose(script))
    assert max(opening) <= 0.03 * max(measure.neutral_opening)


def test_the_gap_is_measured(face, measure):
    assert min(measure.neutral_opening) > 7.0
    half = measure.lid_opening(face.pose({"43": 0.5}))
    assert 0.35 < half[0] / measure.neutral_opening[0] < 0.65


@pytest.mark.parametrize("script", [*(f"{u}E" for u in ON_HEAD), *(f"{u}C" for u in ON_HEAD)])
def test_no_eyeball_through_a_lid_no_tooth_through_a_lip(face, measure, script):
    vertices = face.pose(script)
    for turn in (0, 30, -30):
        assert measure.shows_through(vertices, ["eye_L", "eye_R"], measure.eye_rings, turn=turn) == 0
        assert measure.shows_through(vertices, ["teeth_upper", "teeth_lower"], [measure.mouth_ring], turn=turn) == 0


@pytest.mark.parametrize("name", EXPRESSIONS)
def test_expressions_hide_what_they_should(face, measure, name):
    units = {k: w for k, w in face.resolve(name).units.items() if k.lstrip("LR") not in
             {str(n) for n in range(51, 59)}}               # the head's turn only turns the view
    for amount in (0.5, 1.0):
        vertices = face.pose({k: w * amount for k, w in units.items()})
        assert measure.shows_through(vertices, ["eye_L", "eye_R"], measure.eye_rings) == 0
        assert measure.shows_through(vertices, ["teeth_upper", "teeth_lower"], [measure.mouth_ring]) == 0


def test_the_check_sees_an_eyeball_and_a_tooth(face, measure):
    vertices = face.pose("43E").copy()
    eye = measure.mesh.part_vertices("eye_L")
    vertices[eye] += [0, 0, 3.0]
    assert measure.shows_through(vertices, ["eye_L"], measure.eye_rings) > 5
    teeth = measure.mesh.part_vertices("teeth_upper")
    vertices[teeth] += [0, 0, 20.0]
    assert measure.shows_through(vertices, ["teeth_upper"], [measure.mouth_ring]) > 20


def keeps_lips_sealed(weights):
    number = lambda code: code.lstrip("LRTB")  # noqa: E731
    return not any(w and CATALOGUE.units[number(code)].parts_lips for code, w in weights.items())


@pytest.mark.parametrize("unit", UNITS)
def test_lips_stay_sealed_unless_a_unit_parts_them(face, measure, unit):
    gap = measure.lip_opening(face.pose(f"{unit}E"))
    if keeps_lips_sealed({unit: 1.0}):
        assert gap < 0.45
    elif unit != "32":                                       # the bitten lip covers the opening
        assert gap > 1.0


@pytest.mark.parametrize("name", EXPRESSIONS)
def test_sealed_expressions_stay_sealed(face, measure, name):
    found = face.resolve(name)
    if keeps_lips_sealed(found.units):
        assert measure.lip_opening(face.pose(name)) < 0.6


def test_a_lid_rests_on_the_eyeball(face, measure):
    """The margins of open and closed lids stay within a few millimetres of the ball, never inside it."""
    from facegen.face.eye import eyeball_radius

    for script in ("0", "43C", "43E", "5E", "7E"):
        vertices = face.pose(script)
        for (upper, lower), centre in zip(measure.margins, face._data.eye_centres, strict=True):
            for margin in (upper, lower):
                d = vertices[margin[2:-2]] - centre
                distance = np.linalg.norm(d, axis=1)
                clearance = distance - eyeball_radius(d[:, 2] / distance)
                assert clearance.min() > 0.2
                assert clearance.max() < 3.5

"""What the mesh tells by itself, on shapes whose lids and lips are known exactly."""

from itertools import pairwise

import numpy as np
import pytest

from facegen.geometry.operators import Surface
from facegen.landmarking.eyeballs import Ball, ball_of_eye, balls_of, seen_eye
from facegen.landmarking.profile import lips_in_profile
from facegen.landmarking.symmetry import Plane

# The opening of the test's eye: half as wide and half as high.
WIDE, HIGH, RADIUS = 8.0, 4.0, 12.0


def ball(turns=48, rings=24):
    """Return a sphere about the origin: vertices and triangles."""
    around, up = np.meshgrid(np.linspace(0, 2 * np.pi, turns, endpoint=False), np.linspace(-1.5, 1.5, rings))
    at = np.stack([np.cos(up) * np.cos(around), np.sin(up), np.cos(up) * np.sin(around)], -1).reshape(-1, 3) * RADIUS
    return at, grid(rings, turns, closed=True)


def lid(turns=96, rings=12):
    """Return a shell round the ball with an opening of WIDE by HIGH to the front."""
    around = np.linspace(0, 2 * np.pi, turns, endpoint=False)
    edge = np.stack([WIDE * np.cos(around), HIGH * np.sin(around)], -1)
    away = np.linspace(1.0, 2.5, rings)[:, None, None]
    flat = edge * away
    depth = np.sqrt(np.maximum((RADIUS + 1.0) ** 2 - (flat**2).sum(axis=-1), 1.0))
    return np.concatenate([flat, depth[..., None]], -1).reshape(-1, 3), grid(rings, turns, closed=True)


def grid(rows, columns, closed):
    """Return triangles over vertices in rows and columns."""
    i, j = np.meshgrid(np.arange(rows - 1), np.arange(columns if closed else columns - 1), indexing="ij")
    a, b = columns * i + j, columns * i + (j + 1) % columns
    c, d = a + columns, b + columns
    return np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([b, d, c], -1).reshape(-1, 3)])


def eye(turn):
    """Return a turned eye with its lids as a surface, and the piece of each vertex."""
    (p, f), (q, g) = ball(), lid()
    surface = Surface(np.concatenate([p, q]) @ turn.T, np.concatenate([f, g + len(p)]))
    return surface, surface.components()[1]


def about_y(degrees):
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


@pytest.mark.parametrize("degrees", [0.0, 25.0, 80.0])
def test_lids_are_seen_whichever_way_the_eye_looks(degrees):
    turn = about_y(degrees)
    surface, label = eye(turn)
    true = {"eye_inner_L": [-WIDE, 0.0], "eye_outer_L": [WIDE, 0.0], "eye_upper_L": [0.0, HIGH],
            "eye_lower_L": [0.0, -HIGH]}
    true = {name: turn @ [x, y, np.sqrt((RADIUS + 1) ** 2 - x * x - y * y)] for name, (x, y) in true.items()}
    expected = {name: 0.85 * place + turn @ [2.5, -1.5, 1.0] for name, place in true.items()}
    one = ball_of_eye(balls_of(surface, label), expected, "L", {})
    assert np.linalg.norm(one.middle) < 0.1 * RADIUS
    assert one.radius == pytest.approx(RADIUS, rel=0.05)
    found = seen_eye(surface, label, one, expected, "L", {}, np.zeros(len(surface.faces), bool))
    for name, place in true.items():
        assert np.linalg.norm(found[name] - place) < 0.08 * RADIUS
    middle = turn @ [0.0, 0.0, RADIUS]
    assert np.linalg.norm(found["eye_center_L"] - middle) < 0.1 * RADIUS


def test_a_pupil_that_names_tell_is_the_middle_of_the_eye():
    surface, label = eye(np.eye(3))
    to = np.array([0.25, 0.1, 0.95]) / np.linalg.norm([0.25, 0.1, 0.95])
    pupil = (surface.corners.mean(axis=1) @ to > 0.97 * RADIUS) & (label[surface.faces[:, 0]] == label[0])
    lids = {"eye_inner_L": [-WIDE, 0.0, 10.0], "eye_outer_L": [WIDE, 0.0, 10.0], "eye_upper_L": [0.0, HIGH, 12.0],
            "eye_lower_L": [0.0, -HIGH, 12.0]}
    lids = {name: np.array(place) for name, place in lids.items()}
    found = seen_eye(surface, label, Ball(np.zeros(3), RADIUS), lids, "L", {}, pupil)
    assert np.linalg.norm(found["eye_center_L"] - RADIUS * to) < 0.1 * RADIUS


def test_no_ball_is_an_eye_that_is_far_from_a_lid_that_was_set():
    surface, label = eye(np.eye(3))
    lids = {"eye_inner_L": [-WIDE, 0.0, 10.0], "eye_outer_L": [WIDE, 0.0, 10.0], "eye_upper_L": [0.0, HIGH, 12.0],
            "eye_lower_L": [0.0, -HIGH, 12.0]}
    lids = {name: np.array(place) for name, place in lids.items()}
    balls = balls_of(surface, label)
    assert ball_of_eye(balls, lids, "L", {"eye_outer_L": lids["eye_outer_L"]}) is not None
    assert ball_of_eye(balls, lids, "L", {"eye_outer_L": lids["eye_outer_L"] + [20.0, 0.0, 0.0]}) is None


def drawn_out(curve, half=20.0, steps=9):
    """Return a curve (k, 2) of (y, z) drawn out aside."""
    x = np.linspace(-half, half, steps)
    at = np.concatenate([np.column_stack([np.full(len(curve), one), curve]) for one in x])
    return Surface(at, grid(steps, len(curve), closed=False))


def a_face(open_by, pocket=18.0):
    """Return a profile from the nose's tip to the chin with a mouth, the places of its lips, and both ends."""
    nose, top, bottom, chin = (0.0, 20.0), (-20.0, 8.0), (-20.0 - open_by, 8.0), (-50.0, 4.0)
    corners = [nose, (-8.0, 8.0), top, (top[0], top[1] - pocket), (bottom[0] - 0.2, bottom[1] - pocket), bottom,
               (-34.0, 5.0), chin]
    curve = np.concatenate([np.linspace(a, b, 12)[:-1] for a, b in pairwise(corners)] + [[chin]])
    return curve, *(np.array([0.0, *one]) for one in (top, bottom, nose, chin))


@pytest.mark.parametrize("open_by", [0.05, 1.0, 4.0])
def test_lips_are_where_the_profile_turns_in(open_by):
    curve, top, bottom, nose, chin = a_face(open_by)
    found = lips_in_profile(drawn_out(curve), Plane(np.array([1.0, 0.0, 0.0]), 0.3, 0.0), nose, chin)
    for one, other in zip(found, (top, bottom), strict=True):
        assert np.linalg.norm((one - other)[1:]) < 1.7              # a step of the curve
    assert found[0][1] > found[1][1]


def test_lips_of_a_mouth_that_is_open_at_its_back():
    curve, top, bottom, nose, chin = a_face(1.0)
    surface = drawn_out(curve)
    behind = surface.corners[..., 2].min(axis=1) < -9.0
    surface = Surface(surface.vertices, surface.faces[~behind])
    found = lips_in_profile(surface, Plane(np.array([1.0, 0.0, 0.0]), 0.3, 0.0), nose, chin)
    assert found[0][1] > found[1][1]
    for one, other in zip(found, (top, bottom), strict=True):
        assert abs(one[1] - other[1]) < 0.5


def test_a_profile_without_a_mouth_has_no_lips():
    curve = np.linspace([0.0, 20.0], [-50.0, 4.0], 40)
    plane = Plane(np.array([1.0, 0.0, 0.0]), 0.3, 0.0)
    assert lips_in_profile(drawn_out(curve), plane, np.array([0.0, 0.0, 20.0]), np.array([0.0, -50.0, 4.0])) is None
    assert lips_in_profile(drawn_out(curve), plane, np.array([0.0, 0.0, 90.0]), np.array([0.0, -50.0, 90.0])) is None

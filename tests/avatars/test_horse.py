"""The horse that ships: its files are what its script writes; its lids, its lips and its long jaw are well made."""

import numpy as np
import pytest
from authored import AVATARS, check_mirrored, check_script, crossings, edges, marked_places, part
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from facegen.fileio.obj import load_obj

HERE = AVATARS / "horse"


@pytest.fixture(scope="module")
def mesh():
    return load_obj(HERE / "horse.obj")


@pytest.fixture(scope="module")
def points(mesh):
    return marked_places("horse", mesh, also=("jaw_L", "jaw_R", "nose_base", "eye_center_L", "eye_center_R"))


def test_the_script_writes_what_ships(tmp_path):
    check_script("horse", tmp_path, last_decimal=2e-2)


def test_it_has_separate_parts_and_a_colour_for_each_material(mesh):
    assert 5000 <= len(mesh.faces) <= 11000
    assert len(np.unique(mesh.faces)) == len(mesh.vertices), "every vertex is used"
    assert {"skin", "eye_L", "eye_R", "teeth_upper", "teeth_lower", "tongue", "mane", "forelock"} == set(mesh.parts)
    colours = {line.split()[1] for line in (HERE / "horse.mtl").read_text().splitlines() if line.startswith("newmtl")}
    assert set(mesh.materials) == colours


def test_the_skin_is_one_oriented_manifold_with_two_eyes_and_a_neck(mesh):
    skin = part(mesh, "skin")
    count = edges(skin)
    assert max(count.values()) == 1, "two triangles run along a side in one direction"
    border = np.array([edge for edge in count if edge[::-1] not in count])
    n = len(mesh.vertices)
    rims = connected_components(sparse.coo_array((np.ones(len(border)), border.T), shape=(n, n)), directed=False)[1]
    assert len(np.unique(rims[border])) == 3
    # Euler: a sphere with three holes, so no handle and one component.
    sides = {tuple(sorted(edge)) for edge in count}
    assert len(np.unique(skin)) - len(sides) + len(skin) == -1
    corners = mesh.vertices[skin]
    assert (corners[:, 0] * np.cross(corners[:, 1], corners[:, 2])).sum() > 0, "it faces outwards"


def test_no_triangle_of_the_skin_is_a_sliver_and_none_cuts_another_or_an_eye(mesh):
    skin = part(mesh, "skin")
    corners = mesh.vertices[skin]
    doubled = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    assert (doubled / longest).min() > 0.3, "heights of triangles, millimetres on a head of half a metre"
    assert crossings(mesh.vertices, skin, skin) == []
    for name in ("eye_L", "eye_R"):
        eye = part(mesh, name)
        assert crossings(mesh.vertices, skin, eye) + crossings(mesh.vertices, eye, skin) == []


@pytest.mark.parametrize("side", ["L", "R"])
def test_the_lid_margin_lies_close_before_the_eyeball(mesh, points, side):
    ball = mesh.vertices[np.unique(part(mesh, f"eye_{side}"))]
    centre = (ball.min(axis=0) + ball.max(axis=0)) / 2
    radius = np.linalg.norm(points[f"eye_center_{side}"] - centre)
    margin = np.array([points[f"eye_{name}_{side}"] for name in ("inner", "outer", "upper", "lower", "upper_inner",
                                                                 "upper_outer", "lower_inner", "lower_outer")])
    gaps = np.linalg.norm(margin - centre, axis=1) / radius
    assert gaps.min() > 1.0
    assert gaps.max() < 1.1


def test_the_lips_nearly_touch_and_their_teeth_lie_behind_them(mesh, points):
    gap = np.linalg.norm(points["mouth_inner_top"] - points["mouth_inner_bottom"])
    assert 0.2 < gap < 2.0
    ahead = points["mouth_inner_top"] - (points["jaw_L"] + points["jaw_R"]) / 2
    ahead /= np.linalg.norm(ahead)
    for name in ("teeth_upper", "teeth_lower"):
        teeth = mesh.vertices[np.unique(part(mesh, name))]
        behind = (points["mouth_inner_top"] - teeth) @ ahead
        assert behind.min() > 5.0
        assert np.ptp(behind) > 200.0, "cheek teeth lie far behind the front ones"


def test_the_sides_mirror_each_other(points):
    check_mirrored(points, atol=1e-2)

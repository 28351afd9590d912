"""The cat that ships: its files are what its script writes, its lids and its mouth can close and open."""

import numpy as np
import pytest
from authored import AVATARS, check_mirrored, check_script, edges, marked_places, part

from facegen.fileio.obj import load_obj


@pytest.fixture(scope="module")
def mesh():
    return load_obj(AVATARS / "cat" / "cat.obj")


@pytest.fixture(scope="module")
def points(mesh):
    return marked_places("cat", mesh)


def test_the_script_writes_what_ships(tmp_path):
    check_script("cat", tmp_path, last_decimal=2e-3)


def test_no_side_of_the_skin_has_more_than_two_triangles(mesh):
    skin = part(mesh, "skin")
    assert max(edges(skin).values()) == 1, "two triangles run along a side in one direction"
    corners = mesh.vertices[skin]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    assert areas.min() > 0


@pytest.mark.parametrize("side", ["L", "R"])
def test_the_lid_margin_lies_close_before_the_eyeball(mesh, points, side):
    ball = mesh.vertices[np.unique(part(mesh, f"eye_{side}"))]
    centre = (ball.min(axis=0) + ball.max(axis=0)) / 2
    radius = np.linalg.norm(points[f"eye_center_{side}"] - centre)
    margin = np.array([points[f"eye_{name}_{side}"] for name in ("inner", "outer", "upper", "lower")])
    gaps = np.linalg.norm(margin - centre, axis=1) / radius
    assert gaps.min() > 0.9
    assert gaps.max() < 1.3


def test_the_sides_mirror_each_other(points):
    check_mirrored(points, atol=1e-3)

"""Regions on the surface: each place belongs to the region that it projects on, borders lie between."""

import numpy as np
import pytest

from facegen import load_face
from facegen.face.region_map import TINTS, region_map

FACES = {name: load_face(name) for name in ("akimoto", "akimoto-1986")}


@pytest.fixture(scope="module", params=FACES)
def mapped(request):
    face = FACES[request.param]
    return face, region_map(face, detail=1)


def corners_of(face):
    points = face.feature_points
    return np.array([[points[name] for name in region] for region in face.regions])


def test_the_middle_of_a_triangle_projects_into_its_region(mapped):
    face, found = mapped
    mesh = face.mesh(1)
    rows = np.flatnonzero(found.regions >= 0)
    assert len(rows) > 500
    middles = mesh.vertices[mesh.faces[rows]].mean(axis=1) - face.centre
    corners = corners_of(face)[found.regions[rows]] - face.centre
    shares = np.linalg.solve(np.swapaxes(corners, 1, 2), middles[..., None])[..., 0]
    assert shares.min() >= -1e-6 * np.abs(shares).max()
    assert (shares.sum(axis=1) > 0).all()


def test_parts_and_the_lining_of_the_mouth_have_no_region(mapped):
    face, found = mapped
    mesh = face.mesh(1)
    assert (found.regions[mesh.face_parts != mesh.parts.index("skin")] == -1).all()


def test_borders_lie_in_the_plane_of_the_centre_and_two_points_of_a_region(mapped):
    face, found = mapped
    vertices = face.mesh(1).vertices
    ends = found.borders(vertices).reshape(-1, 3) - face.centre
    corners = corners_of(face) - face.centre
    normals = np.concatenate([np.cross(corners[:, a], corners[:, b]) for a, b in ((0, 1), (1, 2), (2, 0))])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    assert np.abs(ends @ normals.T).min(axis=1).max() < 1e-6


def test_borders_ride_on_the_pose(mapped):
    face, found = mapped
    open_mouth = face.pose("26E+51D", detail=1)
    moved = np.abs(found.borders(open_mouth) - found.borders(face.mesh(1).vertices)).max()
    assert moved > 5.0
    turned = open_mouth @ np.diag([-1.0, 1.0, 1.0])
    assert found.borders(turned) == pytest.approx(found.borders(open_mouth) * [-1.0, 1.0, 1.0])


def test_neighbours_have_other_tints(mapped):
    face, found = mapped
    assert found.tints.max() < TINTS
    regions = [set(region) for region in face.regions]
    for a, one in enumerate(regions):
        for b in range(a):
            if len(one & regions[b]) == 2:
                assert found.tints[a] != found.tints[b]

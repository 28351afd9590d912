"""The cartoon that ships: its files are what its script writes; lids, lips and what lies behind them are well made."""

import numpy as np
import pytest
from authored import AVATARS, check_script, crossings, edges, part
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from facegen.face.landmarks import NAMES
from facegen.fileio.obj import load_obj
from facegen.transfer.landmarks import check_places, load_landmarks

HERE = AVATARS / "cartoon"
HEIGHT = 2.0


@pytest.fixture(scope="module")
def mesh():
    return load_obj(HERE / "cartoon.obj")


@pytest.fixture(scope="module")
def marks(mesh):
    return load_landmarks(HERE / "landmarks.yaml", mesh, mesh_name="cartoon.obj")


def rims(faces):
    """Return the closed chains of edges with a triangle on one side only."""
    count = edges(faces)
    after = {a: b for a, b in count if (b, a) not in count}
    chains = []
    while after:
        chain = [next(iter(after))]
        while chain[-1] in after:
            chain.append(after.pop(chain[-1]))
        chains.append(chain[:-1])
    return chains


def test_the_script_writes_what_ships(tmp_path):
    check_script("cartoon", tmp_path, last_decimal=2e-5)


def test_it_has_few_polygons_and_separate_parts(mesh):
    assert 700 <= len(np.unique(part(mesh, "skin"))) <= 1600
    assert len(mesh.vertices) <= 4000
    assert len(np.unique(mesh.faces)) == len(mesh.vertices), "every vertex is used"
    assert {"eye_L", "eye_R", "teeth_upper", "teeth_lower", "tongue", "cap", "moustache"} < set(mesh.parts)
    colours = {line.split()[1] for line in (HERE / "cartoon.mtl").read_text().splitlines() if line.startswith("newmtl")}
    assert set(mesh.materials) == colours


def test_all_landmarks_are_set_and_none_is_suspicious(mesh, marks):
    assert set(marks.names) == set(NAMES)
    assert check_places(marks, mesh) == []


def test_the_skin_is_one_oriented_manifold_with_two_eyes_and_a_neck(mesh):
    skin = part(mesh, "skin")
    count = edges(skin)
    assert max(count.values()) == 1
    assert sorted(len(rim) for rim in rims(skin)) == [30, 40, 40]
    # Euler: a sphere with three holes, so no handle, no vertex that two sheets share, and one component.
    sides = {tuple(sorted(edge)) for edge in count}
    assert len(np.unique(skin)) - len(sides) + len(skin) == -1
    corners = mesh.vertices[skin]
    assert (corners[:, 0] * np.cross(corners[:, 1], corners[:, 2])).sum() > 0, "it faces outwards"


def test_no_triangle_is_degenerate_and_none_cuts_another(mesh):
    skin = part(mesh, "skin")
    corners = mesh.vertices[skin]
    doubled = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    assert (doubled / longest).min() > 1e-3 * HEIGHT, "heights of triangles"
    assert crossings(mesh.vertices, skin, skin) == []


@pytest.mark.parametrize("name", ["eye_L", "eye_R", "teeth_upper", "teeth_lower", "tongue", "cap", "collar"])
def test_what_lies_in_or_on_the_skin_does_not_cut_it(mesh, name):
    skin, other = part(mesh, "skin"), part(mesh, name)
    assert crossings(mesh.vertices, skin, other) + crossings(mesh.vertices, other, skin) == []


def test_the_skin_is_its_own_mirror_image(mesh):
    skin = mesh.vertices[np.unique(part(mesh, "skin"))]
    assert {tuple(p) for p in skin.tolist()} == {tuple(p) for p in (skin * (-1.0, 1.0, 1.0) + 0.0).tolist()}


@pytest.mark.parametrize("side", ["L", "R"])
def test_the_lid_margin_lies_close_before_the_eyeball(mesh, marks, side):
    points = marks.points(mesh.vertices)
    ball = mesh.vertices[np.unique(part(mesh, f"eye_{side}"))]
    centre = (ball.min(axis=0) + ball.max(axis=0)) / 2
    radius = np.linalg.norm(points[f"eye_center_{side}"] - centre)
    margin = [points[f"eye_{name}_{side}"]
              for name in ("inner", "outer", "upper", "lower", "upper_inner", "upper_outer", "lower_inner",
                           "lower_outer")]
    gaps = np.linalg.norm(np.array(margin) - centre, axis=1) - radius
    assert gaps.min() > 0
    assert gaps.max() < 0.02 * HEIGHT


def test_the_lips_are_apart_but_nearly_touch(mesh, marks):
    points = marks.points(mesh.vertices)
    gap = points["mouth_inner_top"] - points["mouth_inner_bottom"]
    assert 2e-4 * HEIGHT < gap[1] < 5e-3 * HEIGHT
    # They are two pieces but for their corners.
    lips = mesh.faces[mesh.face_materials == mesh.materials.index("lips")]
    corner = points["mouth_corner_L"][0]
    middle = lips[(np.abs(mesh.vertices[lips, 0]) < 0.9 * corner).all(axis=1)]
    joined = sparse.coo_array((np.ones(2 * len(middle)), (middle[:, :2].ravel(), middle[:, 1:].ravel())),
                              shape=(len(mesh.vertices),) * 2)
    labels = connected_components(joined, directed=False)[1]
    at = [marks.names.index(name) for name in ("mouth_top", "mouth_bottom")]
    upper, lower = labels[marks.corners[at, marks.barycentric[at].argmax(axis=1)]]
    assert upper != lower
    assert set(labels[np.unique(middle)]) == {upper, lower}

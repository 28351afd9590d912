"""Landmark files of avatars: every way of giving a place, and every mistake told in words."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from landmark_sets import average, cat, horse, hung, person

from facegen.errors import FileError, InputError, TableError
from facegen.face.face import load_face
from facegen.face.landmarks import NAMES, REQUIRED
from facegen.facs.deformation import mirror_name
from facegen.geometry.mesh import Mesh, merge
from facegen.transfer.landmarks import Landmarks, check_places, load_landmarks, snap


@pytest.fixture(scope="module")
def mesh():
    return load_face().mesh(1)


@pytest.fixture(scope="module")
def points(mesh):
    return load_face().landmark_points(mesh.vertices, detail=1)


@pytest.fixture(scope="module")
def numbers(mesh, points):
    """Landmarks as vertices: the lips' and lids' are taken from the right side of the slit."""
    marks = snap(points, mesh)
    return {name: int(corners[np.argmax(weights)])
            for name, corners, weights in zip(marks.names, marks.corners, marks.barycentric, strict=True)
            if name in REQUIRED}


@pytest.fixture
def write(tmp_path):
    def written(places, **more):
        path = tmp_path / "marks.json"
        path.write_text(json.dumps({"landmarks": {
            name: place.tolist() if hasattr(place, "tolist") else place for name, place in places.items()}, **more}))
        return path
    return written


def required(points):
    return {name: points[name] for name in REQUIRED}


# -- reading -------------------------------------------------------------------------------------------------------
def test_points_are_snapped_to_where_they_were(mesh, points, write):
    found = load_landmarks(write(points), mesh)
    assert found.names == tuple(name for name in NAMES if name in points)
    for name, place in found.points(mesh.vertices).items():
        np.testing.assert_allclose(place, points[name], atol=1e-9 if name[:4] != "brow" else 3.0, err_msg=name)


def test_vertices_and_places_on_triangles(mesh, points, write):
    places = {name: place.tolist() for name, place in required(points).items()}
    places["nose_tip"] = int(np.argmin(np.linalg.norm(mesh.vertices - points["nose_tip"], axis=1)))
    row = int(np.argmin(np.linalg.norm(mesh.vertices[mesh.faces].mean(axis=1) - points["chin"], axis=1)))
    places["chin"] = {"face": row, "barycentric": [0.2, 0.5, 0.3]}
    places["brow_mid_L"] = {"part": "brows", "at": points["brow_mid_L"].tolist()}
    found = load_landmarks(write(places), mesh).points(mesh.vertices)
    np.testing.assert_array_equal(found["nose_tip"], mesh.vertices[places["nose_tip"]])
    np.testing.assert_allclose(found["chin"], [0.2, 0.5, 0.3] @ mesh.vertices[mesh.faces[row]])
    np.testing.assert_allclose(found["brow_mid_L"], points["brow_mid_L"], atol=1e-9)


def test_they_move_with_the_vertices(mesh, points):
    marks = snap(points, mesh)
    moved = marks.points(2.0 * mesh.vertices + [1.0, 2.0, 3.0])
    for name, place in marks.points(mesh.vertices).items():
        np.testing.assert_allclose(moved[name], 2.0 * place + [1.0, 2.0, 3.0])


def test_lips_that_touch_keep_their_own_side(mesh, points):
    marks = dict(zip(snap(points, mesh).names, snap(points, mesh).faces, strict=True))
    middles = mesh.vertices[mesh.faces].mean(axis=1)
    assert np.linalg.norm(points["mouth_inner_top"] - points["mouth_inner_bottom"]) < 0.5
    assert middles[marks["mouth_inner_top"], 1] > points["mouth_inner_top"][1]
    assert middles[marks["mouth_inner_bottom"], 1] < points["mouth_inner_bottom"][1]


def test_skin_goes_before_the_eye_it_covers(mesh, points):
    lid = points["eye_upper_L"] + [0.0, 0.3, -0.7]              # under the lid, on the ball
    row = snap({**points, "eye_upper_L": lid}, mesh)
    face = row.faces[row.names.index("eye_upper_L")]
    assert mesh.parts[mesh.face_parts[face]] == "skin"


def test_the_base_face_s_own_landmarks_pass(mesh, points):
    assert check_places(snap(points, mesh), mesh) == []
    assert check_places(snap(required(points), mesh), mesh) == []


@pytest.mark.parametrize("make", [person, cat, horse])
def test_people_and_animals_pass(make):
    assert check_places(*hung(make())) == []


@pytest.mark.parametrize("mesh_key", ["cat.obj", "models/cat.obj", 4321, "ab" * 32, "sha256:" + "ab" * 32, "abababab"])
def test_the_mesh_it_names(mesh, points, write, mesh_key):
    mesh_key = len(mesh.vertices) if mesh_key == 4321 else mesh_key
    path = write(points, mesh=mesh_key)
    load_landmarks(path, mesh, mesh_name="/tmp/cat.obj", digest="ab" * 32)
    load_landmarks(path, mesh)          # nothing known of the mesh: nothing to compare


# -- mistakes in the file ------------------------------------------------------------------------------------------
@pytest.mark.parametrize(("mesh_key", "words"), [
    ("dog.obj", "of the mesh 'dog.obj', this one is 'cat.obj'"), (17, "of a mesh of 17 vertices, this one has"),
    ("12" * 32, "of a mesh with the hash 1212"), (-3, "expected a number"), ([1], "expected a text"),
    (True, "expected a text"), (None, "expected a text")])
def test_a_file_for_another_mesh(mesh, points, write, mesh_key, words):
    with pytest.raises(TableError, match=rf"marks\.json: mesh: .*{words}"):
        load_landmarks(write(points, mesh=mesh_key), mesh, mesh_name="cat.obj", digest="ab" * 32)


def test_all_missing_ones_are_named_at_once(mesh, points, write):
    some = {name: place for name, place in points.items() if name not in ("chin", "nose_tip", "eye_inner_L")}
    with pytest.raises(TableError, match="the landmarks 'eye_inner_L', 'nose_tip', 'chin' are missing"):
        load_landmarks(write(some), mesh)


@pytest.mark.parametrize(("name", "place", "words"), [
    ("chin", 10**9, r"landmarks\.chin: expected a vertex, 0\.\.\d+, got 1000000000"), ("chin", -1, "expected a vertex"),
    ("chin", 2.5, "expected a vertex"), ("chin", "here", "expected a number"), ("chin", None, "got nothing"),
    ("chin", True, "expected a number"), ("chin", [1, 2], "three numbers"), ("chin", [1, 2, "x"], "a number"),
    ("chin", [1, 2, 3, 4], "three numbers"), ("chin", [0, 0, 1e300], "a number in"),
    ("chin", [0, float("nan"), 0], "finite"), ("chin", float("inf"), "finite"), ("chin", {"face": 1}, "barycentric"),
    ("chin", {"face": 10**7, "barycentric": [1, 0, 0]}, "a triangle"), ("chin", {}, "missing"),
    ("chin", {"face": 1, "barycentric": [1, 1, 1]}, "sum to one"),
    ("chin", {"face": 1, "barycentric": [2, -1, 0]}, "number in"),
    ("chin", {"part": "brow", "at": [0, 0, 0]}, "unknown part 'brow'; did you mean 'brows'"),
    ("chinn", [0, 0, 0], "unknown landmark 'chinn'; did you mean 'chin'"),
])
def test_places_that_make_no_sense(mesh, points, write, name, place, words):
    with pytest.raises(TableError, match=words):
        load_landmarks(write({**points, name: place}), mesh)


@pytest.mark.parametrize("text", ["", "[]", "3", "landmarks: 3", "landmarks: [1]", "{}", "\x00", "landmarks: {a: 1}"])
def test_files_that_are_none(mesh, tmp_path, text):
    path = tmp_path / "marks.yaml"
    path.write_text(text)
    with pytest.raises(InputError, match=r"marks\.yaml"):
        load_landmarks(path, mesh)


def test_no_file(mesh, tmp_path):
    with pytest.raises(FileError, match="there is no such file"):
        load_landmarks(tmp_path / "gone.yaml", mesh)


def test_a_vertex_no_triangle_uses(points, write, mesh):
    more = Mesh(np.concatenate([mesh.vertices, [[0, 0, 0]]]), mesh.faces, mesh.materials, mesh.face_materials,
                mesh.parts, mesh.face_parts)
    with pytest.raises(TableError, match="no triangle uses the vertex"):
        load_landmarks(write({**points, "chin": len(mesh.vertices)}), more)


# -- mistakes on the mesh ------------------------------------------------------------------------------------------
def test_points_that_miss_the_surface(mesh, points, write):
    with pytest.raises(TableError, match=r"'nose_tip' \(\d+.* away\) misses the surface: farther than .*set them on"):
        load_landmarks(write({**points, "nose_tip": points["nose_tip"] + [0, 0, 30.0]}), mesh)


def test_points_in_other_units(mesh, points, write):
    metres = {name: place / 1000 for name, place in points.items()}
    with pytest.raises(TableError, match=r"miss the surface.* span .* in the mesh's own units"):
        load_landmarks(write(metres), mesh)


@pytest.mark.parametrize("make", [person, cat, horse])
def test_all_of_left_and_right_swapped(make):
    marks, mesh = hung(make())
    names = tuple(mirror_name(name) for name in marks.names)
    with pytest.raises(InputError, match="left and right are swapped in all landmarks"):
        check_places(replace(marks, names=names), mesh)


@pytest.mark.parametrize("make", [person, cat, horse])
@pytest.mark.parametrize("name", ["eye_inner", "eye_upper", "brow_mid", "nose_wing", "mouth_corner"])
def test_one_pair_swapped(make, name):
    points = make()
    points[f"{name}_L"], points[f"{name}_R"] = points[f"{name}_R"], points[f"{name}_L"]
    with pytest.raises(InputError, match=f"landmarks: '{name}_L' and '{name}_R' are swapped"):
        check_places(*hung(points))


@pytest.mark.parametrize("make", [person, cat, horse])
@pytest.mark.parametrize(("a", "b", "words"), [
    ("eye_upper_L", "eye_lower_L", "'eye_upper_L' lies below 'eye_lower_L'"),
    ("eye_inner_R", "eye_outer_R", "'eye_inner_R' and 'eye_outer_R' are swapped"),
    ("mouth_top", "mouth_bottom", "'mouth_top' lies under 'mouth_bottom'"),
    ("brow_mid_R", "eye_lower_R", "eye_upper_R|brow_.*_R"),
    ("nose_tip", "nose_bridge", "'nose_tip' lies farther|nose_tip"),
    ("chin", "nose_tip", "nose_tip|mouth_top|chin"),
    ("mouth_corner_L", "eye_inner_L", "mouth_corner_L|eye_inner_L|nose_wing_L"),
])
def test_two_places_swapped(make, a, b, words):
    points = make()
    points[a], points[b] = points[b], points[a]
    with pytest.raises(InputError, match=words):
        check_places(*hung(points))


@pytest.mark.parametrize(("name", "to", "words"), [
    ("brow_mid_L", "eye_lower_outer_L", "'brow_mid_L' lies below 'eye_upper_L'"),
    ("chin", "nose_bridge", "'nose_bridge' and 'chin' lie on one place"),
    ("eye_outer_L", "jaw_L", "'eye_outer_L' is on the wrong part"), ("nose_tip", "head_back", "'nose_tip' lies behind"),
    ("mouth_corner_R", "jaw_R", "'mouth_corner_R' is on the wrong part"),
    ("nose_bridge", "eye_upper_L", "'eye_upper_L' and 'nose_bridge' lie on one place"),
    ("mouth_inner_top", "chin", "'mouth_inner_top' and 'chin' lie on one place"),
])
def test_a_place_on_the_wrong_part(mesh, points, name, to, words):
    with pytest.raises(InputError, match=words):
        check_places(snap({**required(points), name: points[to]}, mesh), mesh)


def test_brow_ends_and_eye_corners_and_chin(mesh, points):
    places = required(points)
    for a, b, words in (("brow_inner_L", "brow_outer_L", "'brow_inner_L' and 'brow_outer_L' are swapped"),
                        ("chin", "mouth_bottom", "'chin' lies above 'mouth_bottom'"),
                        ("nose_wing_L", "mouth_corner_L", "'nose_wing_L' lies below 'mouth_corner_L'")):
        with pytest.raises(InputError, match=words):
            check_places(snap({**places, a: places[b], b: places[a]}, mesh), mesh)
    both = {**places, "eye_upper_L": places["eye_lower_L"], "eye_lower_L": places["eye_upper_L"],
            "eye_inner_L": places["eye_outer_L"], "eye_outer_L": places["eye_inner_L"]}
    with pytest.raises(InputError, match="'eye_inner_L' and 'eye_outer_L', and 'eye_upper_L' and 'eye_lower_L'"):
        check_places(snap(both, mesh), mesh)


def test_inner_lips_swapped_though_they_touch(mesh, numbers, write):
    load_landmarks(write(numbers), mesh)
    swapped = {**numbers, "mouth_inner_top": numbers["mouth_inner_bottom"],
               "mouth_inner_bottom": numbers["mouth_inner_top"]}
    with pytest.raises(TableError, match="'mouth_inner_top' and 'mouth_inner_bottom' are swapped"):
        load_landmarks(write(swapped), mesh)


def test_a_place_beside_the_middle(mesh, points):
    off = points["chin"] + [15.0, 2, -2]
    with pytest.raises(InputError, match="'chin' is on the wrong part of the face: it belongs between left and right"):
        check_places(snap({**required(points), "chin": points["mouth_corner_L"] + [14.0, -14, -9]}, mesh), mesh)
    assert any("'chin' is beside the middle" in one
               for one in check_places(snap({**required(points), "chin": off}, mesh), mesh))


def test_suspicious_places_are_only_warned_of():
    points = person()
    points["brow_outer_L"] = points["brow_outer_L"] + [14, 18, -10]
    warned = check_places(*hung(points))
    assert any("'brow_outer_L' is far from the mirror image of 'brow_outer_R'" in one for one in warned)


def test_numbers_of_another_mesh(mesh):
    rng = np.random.default_rng(0)
    corners = rng.integers(0, 1400, size=(len(REQUIRED), 1)).repeat(3, axis=1)
    marks = Landmarks(REQUIRED, np.zeros(len(REQUIRED), int), corners, np.tile([1.0, 0, 0], (len(REQUIRED), 1)))
    with pytest.raises(InputError, match="do not form a face"):
        check_places(marks, mesh)
    with pytest.raises(InputError, match=r"use vertex 99999, the mesh has .* another mesh"):
        check_places(replace(marks, corners=corners + 99999 - corners.max()), mesh)


def test_lids_and_lips_set_on_what_lies_behind(mesh, points):
    on_ball = mesh.vertices[mesh.part_vertices("eye_L")]
    marks = snap(points, mesh)
    rows = list(marks.names)
    corners = marks.corners.copy()
    ball = mesh.part_vertices("eye_L")[np.argmin(np.linalg.norm(on_ball - points["eye_upper_L"], axis=1))]
    teeth = mesh.part_vertices("teeth_upper")
    tooth = teeth[np.argmin(np.linalg.norm(mesh.vertices[teeth] - points["mouth_top"], axis=1))]
    weights = marks.barycentric.copy()
    for name, vertex in (("eye_upper_L", ball), ("mouth_inner_top", tooth)):
        corners[rows.index(name)], weights[rows.index(name)] = vertex, [1, 0, 0]
    with pytest.raises(InputError, match=r"'eye_upper_L' lies on 'eye_L'; set it on the skin.*'mouth_inner_top' lies"):
        check_places(Landmarks(marks.names, marks.faces, corners, weights), mesh)


def test_a_relief_is_allowed_and_told_what_it_cannot_do(numbers, mesh):
    for pair, words in ((("mouth_inner_bottom", "mouth_inner_top"), "cannot open"),
                        (("eye_lower_L", "eye_upper_L"), "cannot open or close"),
                        (("mouth_inner_top", "mouth_top"), "no edge of its own")):
        same = {**numbers, pair[0]: numbers[pair[1]]}
        corners = np.array(list(same.values()))[:, None].repeat(3, axis=1)
        weights = np.tile([1.0, 0.0, 0.0], (len(same), 1))
        warned = check_places(Landmarks(tuple(same), np.zeros(len(same), int), corners, weights), mesh)
        assert len(warned) == 1, warned
        assert words in warned[0]
        assert all(f"'{name}'" in warned[0] for name in pair)


def test_meshes_that_are_none(points):
    empty = Mesh.of(np.zeros((3, 3)), np.zeros((0, 3), int))
    with pytest.raises(InputError, match="mesh: expected at least one triangle and finite vertices"):
        snap(points, empty)
    broken = Mesh.of(np.full((3, 3), np.nan), [[0, 1, 2]])
    with pytest.raises(InputError, match="mesh: expected at least one triangle and finite vertices"):
        snap(points, broken)
    k = len(REQUIRED)
    marks = Landmarks(REQUIRED, np.zeros(k, int), np.zeros((k, 3), int), np.full((k, 3), 1 / 3))
    with pytest.raises(InputError, match="mesh: expected finite vertices"):
        check_places(marks, broken)
    with pytest.raises(InputError, match="expected three corners"):
        check_places(replace(marks, corners=np.zeros((k, 2), int)), broken)
    with pytest.raises(InputError, match=r"landmarks: 'brow_inner_L', .* and 16 more missing"):
        check_places(Landmarks(("chin",), np.zeros(1, int), np.zeros((1, 3), int), np.ones((1, 3))), broken)


@pytest.mark.parametrize(("points", "words"), [({}, "at least one landmark"), ({"chin": [0, 0]}, "for 'chin'|for chin"),
                                               ({"chin": [0, np.nan, 1]}, "three finite numbers")])
def test_points_that_are_none(mesh, points, words):
    with pytest.raises(InputError, match=words):
        snap(points, mesh)


def test_a_head_on_a_body(mesh, points):
    body = Mesh.of(np.array([[-300, -1700, 0], [300, -1700, 0], [0, -200, 0.0]]), [[0, 1, 2]], part="body")
    whole = merge([mesh, body])
    assert check_places(snap(points, whole), whole) == []


def test_average_is_the_base_face_s(points):
    assert set(average()) == set(REQUIRED)
    for name in REQUIRED:
        assert np.linalg.norm(average()[name] - points[name]) < 2.0

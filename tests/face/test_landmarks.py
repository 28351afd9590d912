"""Landmarks: complete, mirrored, on the surface at every level, and moving with the pose."""

from __future__ import annotations

import itertools
import shutil

import numpy as np
import pytest

from facegen.data import meshes_dir
from facegen.errors import InputError, TableError
from facegen.face.face import load_face
from facegen.face.landmarks import NAMES, OPTIONAL, REQUIRED
from facegen.facs.deformation import mirror_name


def test_the_list():
    assert len(REQUIRED) == 25
    assert len(set(NAMES)) == len(REQUIRED) + len(OPTIONAL)
    assert {mirror_name(name) for name in NAMES} == set(NAMES)


def test_every_name_is_there(face, paper_face):
    assert set(face.landmarks) == set(NAMES)
    assert paper_face.landmarks == face.landmarks       # one cage, one file


@pytest.mark.parametrize("detail", range(4))
def test_pairs_mirror_at_every_level(face, detail):
    points = face.landmark_points(face.mesh(detail).vertices, detail=detail)
    for name, place in points.items():
        np.testing.assert_allclose(points[mirror_name(name)], place * [-1, 1, 1], atol=0.02, err_msg=name)
        assert place[0] > 5 if name.endswith("_L") else True, name
        assert abs(place[0]) < 0.05 if mirror_name(name) == name else True, name


@pytest.mark.parametrize("pose", ["neutral", "happiness"])
def test_a_finer_level_moves_them_little(face, pose):
    fine = face.landmark_points(face.pose(pose, detail=3), detail=3)
    for detail, limit in ((0, 1.6), (1, 0.6), (2, 0.2)):
        coarse = face.landmark_points(face.pose(pose, detail=detail), detail=detail)
        assert max(np.linalg.norm(coarse[name] - fine[name]) for name in NAMES) < limit


def test_order_of_the_places(face):
    """Coarse anatomy: up and down, in and out, front and back."""
    p = face.landmark_points(face.pose("neutral"))
    x, y, z = ({name: place[i] for name, place in p.items()} for i in range(3))
    down = ("head_top", "brow_mid_L", "eye_upper_L", "eye_center_L", "eye_lower_L", "nose_bridge", "nose_tip",
            "nose_base", "mouth_top", "mouth_inner_top", "mouth_inner_bottom", "mouth_bottom", "chin", "neck")
    assert all(y[a] >= y[b] for a, b in itertools.pairwise(down))
    for inner, outer in (("brow_inner_L", "brow_mid_L"), ("brow_mid_L", "brow_outer_L"), ("eye_inner_L", "eye_outer_L"),
                         ("eye_inner_L", "eye_upper_inner_L"), ("eye_upper_inner_L", "eye_upper_L"),
                         ("eye_upper_L", "eye_upper_outer_L"), ("eye_upper_outer_L", "eye_outer_L"),
                         ("eye_lower_inner_L", "eye_lower_L"), ("eye_lower_L", "eye_lower_outer_L"),
                         ("nose_wing_L", "mouth_corner_L"), ("mouth_lower_L", "mouth_corner_L")):
        assert x[inner] < x[outer], (inner, outer)
    assert max(z, key=z.get) == "nose_tip"
    assert min(z, key=z.get) == "head_back"


def test_brow_landmarks_lie_on_the_hair(face):
    mesh = face.mesh(3)
    hair = mesh.vertices[mesh.part_vertices("brows")]
    points = face.landmark_points(mesh.vertices, detail=3)
    for name in ("brow_inner", "brow_mid", "brow_outer"):
        for side in "LR":
            assert np.linalg.norm(hair - points[f"{name}_{side}"], axis=1).min() < 2.5


def moved(face, what):
    rest, posed = (face.landmark_points(face.pose(pose)) for pose in ("neutral", what))
    return {name: posed[name] - rest[name] for name in rest}


def test_they_go_with_the_pose(face):
    smile = moved(face, "12E")
    assert smile["mouth_corner_L"][1] > 4
    assert smile["mouth_corner_L"][0] > 3
    np.testing.assert_allclose(smile["mouth_corner_R"], smile["mouth_corner_L"] * [-1, 1, 1], atol=0.05)
    assert np.abs(smile["head_top"]).max() < 1e-9
    one_sided = moved(face, "L12E")
    assert one_sided["mouth_corner_L"][1] > 4 > 8 * one_sided["mouth_corner_R"][1]
    assert moved(face, "1E")["brow_inner_L"][1] > 3
    assert moved(face, "27E")["chin"][1] < -15
    assert moved(face, "61E")["eye_center_L"][0] > 2        # the pupil goes with the gaze, to the subject's left


def test_lids_meet_and_lips_part(face):
    def gaps(what, *pairs):
        p = face.landmark_points(face.pose(what))
        return [p[a][1] - p[b][1] for a, b in pairs]

    lids = [(f"eye_upper{part}_{s}", f"eye_lower{part}_{s}") for part in ("", "_inner", "_outer") for s in "LR"]
    assert min(gaps("neutral", *lids)) > 3
    assert max(map(abs, gaps("43E", *lids))) < 0.7
    lips = ("mouth_inner_top", "mouth_inner_bottom")
    assert abs(gaps("neutral", lips)[0]) < 0.5
    assert gaps("25E+26E", lips)[0] > 5


def test_wrong_vertices(face):
    with pytest.raises(InputError, match=r"vertices: expected shape .* at detail 2, got \(3, 3\)"):
        face.landmark_points(np.zeros((3, 3)))


@pytest.fixture
def folder(tmp_path):
    shutil.copytree(meshes_dir() / "akimoto", tmp_path / "own")
    return tmp_path / "own"


def test_a_face_without_the_file_has_none(folder):
    (folder / "landmarks.yaml").unlink()
    face = load_face(folder)
    assert face.landmarks == ()
    assert face.landmark_points(face.pose("happiness")) == {}


def test_a_face_may_name_another_file(folder):
    (folder / "landmarks.yaml").rename(folder / "marks.yaml")
    page = folder / "face.yaml"
    text = page.read_text()
    page.write_text(text + "landmarks: marks.yaml\n")
    assert set(load_face(folder).landmarks) == set(NAMES)


@pytest.mark.parametrize("value", ["gone.yaml", "3", "[a]", "."])
def test_a_file_of_landmarks_that_is_not_there(folder, value):
    page = folder / "face.yaml"
    page.write_text(page.read_text() + f"landmarks: {value}\n")
    with pytest.raises(TableError, match=r"face\.yaml: landmarks: expected"):
        load_face(folder)


def test_a_place_as_a_point_is_snapped_to_the_skin(folder):
    page = folder / "landmarks.yaml"
    page.write_text(page.read_text().replace("  nose_tip: 64\n", "  nose_tip: [0, -36, 60]\n"))
    face = load_face(folder)
    for detail in range(3):
        vertices = face.pose("27E", detail=detail)
        place = face.landmark_points(vertices, detail=detail)["nose_tip"]
        assert np.linalg.norm(vertices - place, axis=1).min() < 4
        assert 38 < place[2] < 43


@pytest.mark.parametrize(("old", "new", "words"), [
    ("  chin: 113", "  chinn: 113", r"landmarks\.chinn: unknown landmark 'chinn'; did you mean 'chin'"),
    ("  chin: 113\n", "", "the landmark 'chin' is missing"),
    ("  chin: 113", "  chin: 99999", r"landmarks\.chin: expected a vertex, 0\.\.365, got 99999"),
    ("  chin: 113", "  chin: 1.5", r"landmarks\.chin: expected a vertex"),
    ("  chin: 113", "  chin: low", r"landmarks\.chin: expected a number"),
    ("  chin: 113", "  chin: [1, 2]", r"landmarks\.chin: expected three numbers"),
    ("  chin: 113", "  chin: {face: 9999, barycentric: [1, 0, 0]}", r"chin\.face: expected a triangle"),
    ("  chin: 113", "  chin: {face: 9, barycentric: [1, 1, 0]}", r"chin\.barycentric: expected three weights"),
    ("  chin: 113", "  chin: {face: 9, barycentric: [1, -1, 1]}", r"chin\.barycentric: expected three weights"),
    ("  chin: 113", "  chin: {face: 9}", "the key 'barycentric' is missing"),
    ("part: eye_L", "part: eye_l", "eye_center_L.part: unknown part 'eye_l'; did you mean 'eye_L'"),
    ("mesh: cage.obj", "mesh: cat.obj", "mesh: the landmarks are of the mesh 'cat.obj', the face uses 'cage.obj'"),
    ("landmarks:", "landmrks:", "unknown key 'landmrks'; did you mean 'landmarks'"),
])
def test_wrong_files_are_refused(folder, old, new, words):
    page = folder / "landmarks.yaml"
    assert old in page.read_text()
    page.write_text(page.read_text().replace(old, new))
    with pytest.raises(TableError, match=words):
        load_face(folder)

"""A face as a rig: levels, poses, entries at every level of abstraction, errors at the door."""

import numpy as np
import pytest

from facegen.errors import InputError
from facegen.face.face import load_face
from facegen.facs.deformation import Deformation


@pytest.mark.parametrize("detail", [0, 1, 2, 3])
@pytest.mark.parametrize("what", ["neutral", "0", {}, Deformation(), {"12": 0.0}])
def test_nothing_is_the_neutral_bit_for_bit(face, detail, what):
    assert np.array_equal(face.pose(what, detail=detail), face.mesh(detail).vertices)


@pytest.mark.parametrize("name", ["akimoto", "akimoto-1986"])
def test_a_pose_at_zero_intensity_is_the_neutral(name):
    face = load_face(name)
    assert np.array_equal(face.pose("happiness", intensity=0.0), face.mesh().vertices)


def test_the_cage_is_about_650_triangles(face):
    assert 600 <= len(face._data.faces) <= 700
    assert len(face.feature_points) >= 98


@pytest.mark.parametrize("detail", [0, 1, 2])
def test_coarse_levels_sample_the_finest_surface(face, detail):
    coarse, fine = face.mesh(detail), face.mesh(3)
    skin = coarse.part_vertices("skin")
    assert np.allclose(coarse.vertices[skin], fine.vertices[: len(skin)], atol=1e-9)


def test_the_neutral_is_symmetric(face):
    from scipy.spatial import cKDTree

    for part in face.mesh().parts:
        v = face.mesh().vertices[face.mesh().part_vertices(part)]
        other = face.mesh().vertices[face.mesh().part_vertices(part[:-1] + {"L": "R", "R": "L"}[part[-1]]
                                                              if part.startswith("eye") else part)]
        if part == "hair":      # cut along a curve, so triangle by triangle; the shape is symmetric all the same
            assert cKDTree(other).query(v * [-1, 1, 1])[0].mean() < 0.3
            continue
        assert cKDTree(other).query(v * [-1, 1, 1])[0].max() < 0.02, part


@pytest.mark.parametrize(("left", "right"), [
    ("L12E", "R12E"), ("L2E+L4C", "R2E+R4C"), ("L46E", "R46E"), ("L30E", "R30E"), ("61E", "62E"),
    ("L14C+R12A", "R14C+L12A")])
def test_mirrored_units_mirror_the_face(face, left, right):
    from scipy.spatial import cKDTree

    skin = face.mesh().part_vertices("skin")
    a, b = face.pose(left)[skin] * [-1, 1, 1], face.pose(right)[skin]
    assert cKDTree(b).query(a)[0].max() < 0.02


def test_left_is_the_subjects_left(face):
    mesh = face.mesh()
    moved = np.linalg.norm(face.pose("L12E") - mesh.vertices, axis=1)
    assert mesh.vertices[moved.argmax(), 0] > 10                    # +x
    gaze = face.pose("61E") - mesh.vertices
    eye = mesh.part_vertices("eye_L")
    front = eye[mesh.vertices[eye, 2].argmax()]
    assert gaze[front, 0] > 4
    nose = mesh.vertices[:, 2].argmax()
    assert (face.pose("51E") - mesh.vertices)[nose, 0] > 20


def test_the_head_turns_rigidly_and_the_neck_stays(face):
    mesh = face.mesh()
    v = face.pose("51D+53C+55B")
    up = np.flatnonzero(mesh.vertices[:, 1] > -60)[::37]
    assert np.allclose(np.linalg.norm(v[up][1:] - v[up][:-1], axis=1),
                       np.linalg.norm(mesh.vertices[up][1:] - mesh.vertices[up][:-1], axis=1), atol=1e-6)
    base = mesh.vertices[:, 1].argmin()
    assert np.allclose(v[base], mesh.vertices[base], atol=0.5)


def test_head_movement_commutes_with_the_expression(face):
    """The head's turn comes last: an expression on a turned head is the turned expression."""
    d = face.resolve("12E").deformation
    still = face.pose_controls(face.controls(d))
    turned = face.pose_controls(face.controls(d + Deformation(head={"yaw": 30.0})))
    top = np.flatnonzero(still[:, 1] > -60)
    a, b = still[top] - still[top].mean(0), turned[top] - turned[top].mean(0)
    u, _, vt = np.linalg.svd(a.T @ b)
    assert np.allclose(a @ (u @ vt), b, atol=1e-6)


def test_lower_teeth_go_with_the_jaw_and_upper_teeth_stay(face):
    mesh, v = face.mesh(), face.pose("27E")
    upper, lower = mesh.part_vertices("teeth_upper"), mesh.part_vertices("teeth_lower")
    assert np.array_equal(v[upper], mesh.vertices[upper])
    a, b = mesh.vertices[lower], v[lower]
    assert np.allclose(np.linalg.norm(a[1:] - a[:-1], axis=1), np.linalg.norm(b[1:] - b[:-1], axis=1))
    assert (b - a)[a[:, 2] > 10, 1].mean() < -20


def test_eyes_turn_about_their_centres(face):
    mesh = face.mesh()
    for script in ("61E", "63E", "64E", "66E", "61C+63C"):
        v = face.pose(script)
        for part, centre in zip(("eye_L", "eye_R"), face._data.eye_centres, strict=True):
            rows = mesh.part_vertices(part)
            assert np.allclose(np.linalg.norm(v[rows] - centre, axis=1),
                               np.linalg.norm(mesh.vertices[rows] - centre, axis=1))


def test_lids_follow_the_gaze(face, measure):
    assert measure.lid_opening(face.pose("64E"))[0] < 0.75 * measure.neutral_opening[0]
    down = face.pose(Deformation(eyes={"pitch_L": -25.0, "pitch_R": -25.0}))
    assert measure.lid_opening(down)[0] < 0.75 * measure.neutral_opening[0]


def test_brows_ride_on_the_skin(face):
    mesh = face.mesh()
    brows = mesh.part_vertices("brows")
    lift = (face.pose("1E+2E") - mesh.vertices)[brows, 1]
    assert lift.min() > 0.3
    assert lift.max() > 3


def test_folds_deepen_and_saturate(face):
    mesh = face.mesh()
    one = face.pose(Deformation(folds={"nasolabial_L": 1.0})) - mesh.vertices
    assert 1.0 < np.linalg.norm(one, axis=1).max() < 2.5
    many = face.pose(Deformation(folds={"nasolabial_L": 5.0})) - mesh.vertices
    assert np.allclose(many, 1.25 * one)


def test_raw_data_in_millimetres_and_of_the_paper(face):
    mesh = face.mesh(0)
    corner = face.feature_points["mouth_corner_L"]
    near = np.linalg.norm(mesh.vertices - corner, axis=1).argmin()
    mm = face.pose(Deformation(points={"mouth_corner_L": (3.0, 4.0, -1.0)}, units="millimetre"), detail=0)
    assert np.linalg.norm((mm - mesh.vertices)[near]) > 3
    paper = face.pose(Deformation(points={"F8": (0.04, 0.04, 0.04)}, units="paper"), detail=0)
    moved = (paper - mesh.vertices)[near]
    assert moved[0] > 0
    assert moved[1] > 0
    assert moved[2] < 0                                             # the paper's z runs backward


def test_batches_of_controls(face):
    controls = [face.controls(face.resolve(n).deformation) for n in ("happiness", "fear")]
    from facegen.face.face import Controls

    batch = Controls(*(np.stack([getattr(c, k) for c in controls])
                       for k in ("vectors", "jaw", "lids", "eyes", "head", "folds")))
    both = face.pose_controls(batch, detail=1)
    assert np.allclose(both[0], face.pose("happiness", detail=1))
    assert np.allclose(both[1], face.pose("fear", detail=1))


@pytest.mark.parametrize("figure", ["akimoto-1986-figure-7", "akimoto-1986-figure-8", "akimoto-1986-figure-9"])
def test_the_papers_figures(paper_face, figure):
    mesh = paper_face.mesh(0)
    moved = paper_face.pose(figure, detail=0) - mesh.vertices
    assert np.linalg.norm(moved, axis=1).max() > 2
    assert np.abs(moved[mesh.vertices[:, 1] > 5]).max() < 0.2      # the figures say nothing of the upper face


def test_paper_points_that_take_no_vector(paper_face):
    with pytest.raises(InputError, match=r"'F4'.*takes no vector"):
        paper_face.pose(Deformation(points={"F4": (0.1, 0, 0)}, units="paper"))


def test_an_unknown_point_names_the_nearest(face):
    with pytest.raises(InputError, match="mouth_corner_L"):
        face.pose(Deformation(points={"mouth_cornr_L": (0.1, 0, 0)}))
    with pytest.raises(InputError, match="nasolabial_L"):
        face.pose(Deformation(folds={"nasolabal_L": 1.0}))


@pytest.mark.parametrize("detail", [-1, 4, 1.5, "2", True, None])
def test_detail_is_checked(face, detail):
    with pytest.raises(InputError, match="detail"):
        face.mesh(detail)


def test_unknown_faces_are_named():
    with pytest.raises(InputError, match="akimoto"):
        load_face("akimotto")


@pytest.mark.parametrize("face", [None, 3, ["akimoto"]])
def test_a_face_is_a_name_or_a_path(face):
    with pytest.raises(InputError, match="face: expected a name or a path"):
        load_face(face)


@pytest.mark.parametrize("name", ["akimoto", "akimoto-1986"])
def test_the_weights_of_every_vertex_sum_to_one(name):
    weights = load_face(name).deformer.weights
    assert np.allclose(weights.sum(axis=1), 1.0)
    assert weights.min() >= 0


def test_people_differ(face):
    assert not np.allclose(face.pose("happiness"), face.pose("happiness", person="mika"))

"""A head becomes a face of its own: the laws that it must keep."""

from __future__ import annotations

import numpy as np
import pytest
from heads import head_of
from scipy.spatial import cKDTree

from facegen.adoption.adopt import make_face
from facegen.adoption.base import base_face
from facegen.fileio.avatar import load_avatar
from facegen.geometry.ahead import ahead
from facegen.transfer.landmarks import load_landmarks

POSES = ("happiness", "anger", "surprise", "sadness", "43E", "27E", "L12E")
# Set by eye on wide smooth places, so that the registration does not hold them.
VAGUE = ("jaw", "temple", "head", "neck")


def skin(face, what="neutral", detail=3):
    mesh = face.mesh(detail)
    return face.pose(what, detail=detail)[:mesh.faces[mesh.face_parts == 0].max() + 1]


def test_nothing_asked_is_the_neutral_bit_for_bit(man):
    _, face = man
    for detail in range(4):
        assert np.array_equal(face.pose(detail=detail), face.mesh(detail).vertices)


def test_it_has_the_head_s_shape(man):
    """Every vertex of the face, but for the rims that turn inward: with a search of its own, on a dense cloud of the
    head's points."""
    made, face = man
    head = load_avatar_of("human")
    corners = made.frame.apply(head.mesh.vertices)[head.mesh.faces]
    rng = np.random.default_rng(3)
    weights = rng.dirichlet(np.ones(3), size=(len(corners), 40))
    cloud = np.einsum("tkc,tci->tki", weights, corners).reshape(-1, 3)
    at = skin(face)
    inward = np.zeros(len(base_face().cage.vertices))
    inward[[int(row) for row in base_face().data["followers"]]] = 1.0
    front = at[(at[:, 2] > at[:, 2].max() - 60) & (at[:, 1] > -80) & (base_face().matrix @ inward < 1e-9)]
    apart, _ = cKDTree(cloud).query(front)
    assert np.quantile(apart, 0.5) < 0.35           # about the cloud's own spacing
    assert np.quantile(apart, 0.95) < 0.8
    assert made.residual.median < 0.05
    assert made.residual.p95 < 0.4
    assert made.residual.largest < 2.5
    assert made.residual.reached > 0.95


def load_avatar_of(name):
    from facegen.data import meshes_dir

    return load_avatar(meshes_dir() / "avatars" / name / f"{name}.obj")


def test_the_landmarks_lie_where_they_were_set(man):
    from facegen.data import meshes_dir

    made, face = man
    head = load_avatar_of("human")
    marks = load_landmarks(meshes_dir() / "avatars" / "human" / "landmarks.yaml", head.mesh)
    own = face.landmark_points(face.mesh(3).vertices, detail=3)
    apart = {name: float(np.linalg.norm(made.frame.apply(place) - own[name]))
             for name, place in marks.points(head.mesh.vertices).items()
             if not name.startswith((*VAGUE, "brow", "eye_center"))}
    assert len(apart) > 25
    assert max(apart.values()) < 0.5, apart


@pytest.mark.parametrize("what", ["43E", "45E"])
def test_a_blink_closes_the_lids(man, what):
    """All along the margins: no more than a twentieth of the opening is left."""
    _, face = man
    base, rest, shut = base_face(), skin(face), skin(face, what)
    for margin in base.margins:
        upper, lower = margin[1:5], margin[[9, 8, 7, 6]]
        before, after = (np.linalg.norm(at[upper] - at[lower], axis=1) for at in (rest, shut))
        assert (after <= 0.05 * before).all()


def test_the_lips_meet_and_part(man):
    _, face = man
    upper, lower = base_face().seam.T
    gap = {what: np.linalg.norm(skin(face, what)[upper] - skin(face, what)[lower], axis=1).max()
           for what in ("neutral", "27E", "43E")}
    assert gap["neutral"] < 0.05
    assert gap["43E"] < 0.05
    assert gap["27E"] > 15


@pytest.mark.parametrize("what", ["neutral", *POSES])
def test_the_eyeballs_stay_behind_the_lids(man, what):
    _, face = man
    at, data = skin(face, what), face._data
    for centre, rows in zip(data.eye_centres, face._level(3).lid_vertices, strict=True):
        away = at[rows] - centre
        front = away[:, 2] > 0
        assert np.linalg.norm(away[front], axis=1).min() > 14.8 * data.eye_size


def test_teeth_lie_behind_the_lips(man):
    _, face = man
    for what in ("neutral", "43E", "sadness"):
        mesh, posed = face.mesh(3), face.pose(what, detail=3)
        teeth = posed[np.union1d(mesh.part_vertices("teeth_upper"), mesh.part_vertices("teeth_lower"))]
        before, _ = ahead(teeth[teeth[:, 2] > teeth[:, 2].max() - 20], posed[mesh.faces[mesh.face_parts == 0]])
        assert np.isfinite(before).all()        # the skin covers every tooth
        assert before.min() > 1.0


def test_adopting_the_base_face_gives_the_base_face_back(base, again, self_made):
    """Within a millimetre of sliding along the skin, and a twentieth across it."""
    for what in ("neutral", *POSES):
        apart = np.linalg.norm(skin(base, what) - skin(again, what), axis=1)
        assert apart.mean() < 0.3, what
        assert np.quantile(apart, 0.99) < 1.2, what
    assert self_made.residual.p95 < 0.05
    assert again._data.eye_size == pytest.approx(1.0, abs=0.01)
    for name, scale in base._data.scales.items():
        assert again._data.scales[name] == pytest.approx(scale, rel=0.02)
    assert again.feature_points.keys() == base.feature_points.keys()
    assert again.regions == base.regions


def test_copies_in_other_axes_and_units_make_the_same_face(base, self_made):
    angle = np.radians(37.0)
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    turn = turn @ np.array([[1, 0, 0], [0, 0, -1.0], [0, 1.0, 0]])
    other = make_face(*head_of(base, scale=0.013, rotation=turn, offset=(3.0, 4.0, 5.0)), name="self", origin="a test",
                      hair=True)
    assert other.frame.scale * 0.013 == pytest.approx(self_made.frame.scale, rel=1e-9)
    assert other.files.keys() == self_made.files.keys()
    for name, text in self_made.files.items():
        one, two = (numbers(text) for text in (text, other.files[name]))
        assert one.shape == two.shape
        assert np.abs(one - two).max() <= 0.002, name


def numbers(text):
    import re

    return np.array([float(word) for word in re.findall(r"-?\d+(?:\.\d+)?(?:e-?\d+)?", text)])


def test_mirrored_units_mirror_each_other(again):
    """On a head as symmetric as the base face, by the cage's own pairs."""
    names = (base_face().folder / "cage_names.txt").read_text(encoding="utf-8").split()
    other = [names.index(name[:-2] + {"L": "_R", "R": "_L"}[name[-1]] if name.endswith(("_L", "_R")) else name)
             for name in names]
    for unit in ("2D", "6D", "12E", "14D", "46E", "20C"):
        left, right = (again.pose(f"{side}{unit}", detail=0)[:len(names)] - again.mesh(0).vertices[:len(names)]
                       for side in "LR")
        assert np.abs(left[other] * [-1, 1, 1] - right).max() < 0.15, unit
        assert np.abs(left).max() > 1.0


def test_amounts_are_in_the_person_s_own_proportions(man, base):
    """A unit's table is the same, and moves a point as far as the person's measures are larger."""
    _, face = man
    unit = base.resolve("12E").deformation
    rows = [face._data.point_names.index("mouth_corner_L"), face._data.point_names.index("nose_wing_L")]
    moved, usual = (one.controls(unit).vectors[rows] for one in (face, base))
    ratio = {name: face._data.scales[name] / base._data.scales[name] for name in ("mouth", "middle")}
    assert moved[0] == pytest.approx(usual[0] * ratio["mouth"])
    assert moved[1] == pytest.approx(usual[1] * ratio["middle"])
    corners = face.landmark_points(face.mesh(3).vertices, detail=3)
    width = np.linalg.norm(corners["mouth_corner_L"] - corners["mouth_corner_R"])
    assert face._data.scales["mouth"][0] == pytest.approx(width, rel=0.05)


def test_brows_that_lie_near_together_fold_no_slit_between_them(man):
    """In anger the skin there still faces forward, all but the walls of its two furrows."""
    _, face = man
    mesh, posed = face.mesh(3), face.pose("anger", detail=3)
    marks = face.landmark_points(mesh.vertices, detail=3)
    faces = mesh.faces[mesh.face_parts == mesh.parts.index("skin")]
    middle = (marks["brow_inner_L"] + marks["brow_inner_R"]) / 2
    faces = faces[(np.abs(mesh.vertices[faces].mean(axis=1) - middle) < (10.0, 16.0, 12.0)).all(axis=1)]
    assert len(faces) > 500
    a, b, c = np.moveaxis(posed[faces], 1, 0)
    normals = np.cross(b - a, c - a)
    forward = normals[:, 2] / np.linalg.norm(normals, axis=1)
    assert forward.min() > -0.1
    assert (forward < 0.2).mean() < 0.02


def test_own_brows_hair_and_colours_come_along(man):
    _, face = man
    head = load_avatar_of("human")
    assert {"brows", "hair"} <= set(face.mesh().parts)
    assert face.colours["hair"] == pytest.approx(head.colours["hair_white"][:3], abs=0.1)
    assert face.colours["skin"] == pytest.approx(head.colours["skin"][:3], abs=0.1)
    raised = face.pose("1E+2E") - face.mesh().vertices
    assert raised[face.mesh().part_vertices("brows"), 1].mean() > 2.0

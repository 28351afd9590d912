"""Templates from files: a rigged GLB or a folder of OBJ files gives its shapes to other faces, and to itself."""

import shutil

import numpy as np
import pytest
from scipy.spatial import cKDTree

from facegen.cli import main
from facegen.data import meshes_dir
from facegen.errors import FileError, InputError
from facegen.face.deformer import Jaw
from facegen.face.face import load_face
from facegen.fileio.avatar import load_avatar, save_avatar
from facegen.fileio.shape_folder import load_shape_folder
from facegen.geometry.mesh import Mesh
from facegen.transfer.alignment import align
from facegen.transfer.apart import take_apart
from facegen.transfer.landmarks import load_landmarks
from facegen.transfer.margins import LIDS, LIPS, facing_margins
from facegen.transfer.measured_motion import measured_gaze, measured_jaw
from facegen.transfer.piece_motion import PieceMotion
from facegen.transfer.rig import Rigging, avatar_path, rig
from facegen.transfer.template_file import read_template
from facegen.transfer.transfer import transfer

SHAPES = ["eyeBlinkLeft", "eyeLookOutLeft", "eyeLookUpRight", "jawOpen", "mouthClose", "jawLeft", "mouthSmileLeft",
          "browInnerUp"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("templates")


@pytest.fixture(scope="module")
def cartoon(folder):
    return rig("cartoon", folder / "cartoon.glb", shapes=SHAPES, sets=["arkit"], normals=False).path


@pytest.fixture(scope="module")
def human(folder):
    return rig("human", folder / "human.glb", shapes=SHAPES, sets=["arkit"], normals=False).path


@pytest.fixture(scope="module")
def obj_folder(folder):
    made = rig("cartoon", folder / "cartoon", shapes=SHAPES, sets=["arkit"]).path
    shutil.copy(meshes_dir() / "avatars/cartoon/landmarks.yaml", made)
    return made


def of_kind(avatar, notes, *kinds):
    """Return the vertices of an avatar's parts of some kinds, as facegen noted them."""
    parts = [avatar.mesh.parts.index(part) for part, kind in notes["pieces"].items() if kind in kinds]
    return np.unique(avatar.mesh.faces[np.isin(avatar.mesh.face_parts, parts)])


@pytest.mark.parametrize("name", ["cartoon", "human"])
def test_a_template_transferred_to_itself_gives_itself(name, tmp_path, request):
    path = request.getfixturevalue(name)
    back = load_avatar(rig(name, tmp_path / "back.glb", template=path, normals=False).path)
    template = load_avatar(path)
    height = np.ptp(template.mesh.vertices[:, 1])
    assert [name for name in back.shapes if not name.endswith("_half")] == SHAPES
    for shape in SHAPES:
        assert np.abs(back.shapes[shape] - template.shapes[shape]).max() < 1e-6 * height, shape


def test_a_folder_of_obj_files_gives_itself(obj_folder, tmp_path):
    back = load_shape_folder(rig("cartoon", tmp_path / "back", template=obj_folder).path)
    template = load_shape_folder(obj_folder)
    assert {name for name in back.shapes if not name.endswith("_half")} == set(SHAPES)
    skin = np.unique(template.mesh.faces[template.mesh.face_parts == template.mesh.parts.index("skin")])
    for shape in SHAPES:
        off = np.abs(back.shapes[shape] - template.shapes[shape])[skin].max()
        assert off < 1e-6 * np.ptp(template.mesh.vertices[:, 1]), shape


def test_a_turned_scaled_and_moved_copy_moves_as_the_template(cartoon):
    turn = np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]])
    file = read_template(cartoon)
    mesh = file.avatar.mesh
    copy = Mesh.of(40 * mesh.vertices @ turn.T + [3, -70, 11], mesh.faces)
    found = transfer(copy, file.landmarks, file.template())
    skin = of_kind(file.avatar, file.avatar.notes, "skin")
    for shape in file.shapes:
        off = np.abs(found.shapes[shape] - 40 * file.avatar.shapes[shape] @ turn.T)[skin].max()
        assert off < 1e-6 * 40 * np.ptp(mesh.vertices[:, 1]), shape


def test_one_rigged_avatar_is_the_template_of_another(human, tmp_path):
    out = tmp_path / "cat.glb"
    assert main(["rig", "cat", "--template", str(human), "--shapes", "jawOpen, eyeLookOutLeft,mouthSmileLeft",
                 "-o", str(out)]) == 0
    cat = load_avatar(out)
    assert list(cat.shapes) == ["jawOpen", "eyeLookOutLeft", "mouthSmileLeft"]
    assert cat.notes["shapes"]["jawOpen"] == {"set": "arkit"}
    down = {kind: cat.shapes["jawOpen"][of_kind(cat, cat.notes, kind)][:, 1].min() / np.ptp(cat.mesh.vertices[:, 1])
            for kind in ("teeth_upper", "teeth_lower", "tongue")}
    assert down["teeth_lower"] < -0.02
    assert down["tongue"] < -0.02
    assert abs(down["teeth_upper"]) < 1e-3
    left, right = (np.linalg.norm(cat.shapes["eyeLookOutLeft"][of_kind(cat, cat.notes, kind)], axis=1).max()
                   for kind in ("eye_L", "eye_R"))
    assert left > 0.01 * np.ptp(cat.mesh.vertices[:, 1])
    assert right == 0
    face = load_face(out)
    smile = face.landmark_points(face.pose_shapes({"mouthSmileLeft": 1.0}))["mouth_corner_L"]
    assert (smile - face.landmark_points(face.mesh().vertices)["mouth_corner_L"])[1] > 1.0


@pytest.mark.parametrize("avatar", ["cat", "cartoon"])
def test_lips_meet_over_an_open_jaw_as_another_avatars_do(human, avatar):
    found = Rigging(avatar, template=human, shapes=["jawOpen", "mouthClose"]).shapes()
    mesh = load_avatar(avatar_path(avatar)).mesh
    rows = cKDTree(found.frame.apply(mesh.vertices)).query(found.skin.surface.vertices)[1]
    opened, closed = (found.frame.apply_vectors(found.shapes[name][rows]) for name in ("jawOpen", "mouthClose"))
    _, lips = facing_margins(found.skin, LIPS)
    at = found.skin.surface.vertices
    rest, wide, shut = (np.linalg.norm(lips.gap(places), axis=1).mean() for places in (
        at, at + opened, at + opened + closed))
    assert wide > 10.0                      # mm of a human-sized head
    assert abs(shut - rest) < 0.05 * (wide - rest)


@pytest.mark.parametrize(("name", "others"), [("cartoon", ("human", "cat", "horse")), ("cat", ("human",)),
                                              ("horse", ("human",)), ("human", ("cartoon",))])
def test_lids_shut_as_on_another_avatar(name, others, tmp_path):
    """Whatever the size of its eye: a cartoon's are four times as high as a person's. All pairs: see
    benchmarks/avatar_pairs.py."""
    blinks = ["AU43_L", "AU43_R"]
    template = rig(name, tmp_path / f"{name}.glb", shapes=blinks, sets=["units"], normals=False).path
    for other in others:
        found = Rigging(other, template=template).shapes()
        at, mesh = found.skin.surface.vertices, load_avatar(avatar_path(other)).mesh
        rows = cKDTree(found.frame.apply(mesh.vertices)).query(at)[1]
        for slit, blink in zip(LIDS, blinks, strict=True):
            lids, moved = facing_margins(found.skin, slit)[1], found.frame.apply_vectors(found.shapes[blink][rows])
            rest, shut = lids.gap(at), lids.gap(at + moved)
            left = np.linalg.norm(shut, axis=1).mean() / np.linalg.norm(rest, axis=1).mean()
            assert left < 0.05, (other, blink)
            # Nothing goes much farther than the edge does: no skin of the lid hangs over it.
            down = -rest[np.linalg.norm(rest, axis=1).argmax()]
            far = moved @ (down / np.linalg.norm(down))
            assert far.max() < 1.5 * (lids.upper @ far).max(), (other, blink)


def test_a_corrective_alone_brings_what_it_corrects_along_but_does_not_write_it(cartoon, tmp_path):
    out = rig("cartoon", tmp_path / "a.glb", template=cartoon, shapes=["mouthClose"])
    assert out.names == ("mouthClose",)
    assert list(load_avatar(out.path).shapes) == ["mouthClose"]


def test_the_jaw_is_known_from_shapes_that_are_not_asked_for(cartoon, tmp_path):
    cat = load_avatar(rig("cat", tmp_path / "a.glb", template=cartoon, shapes=["jawLeft"]).path)
    lower, upper = (cat.shapes["jawLeft"][of_kind(cat, cat.notes, kind)] for kind in ("teeth_lower", "teeth_upper"))
    assert lower[:, 0].min() > 0.005 * np.ptp(cat.mesh.vertices[:, 1])      # to the subject's left
    assert not upper.any()


@pytest.fixture(scope="module")
def taken_apart():
    """The cartoon's pieces in the working frame."""
    path = meshes_dir() / "avatars/cartoon/cartoon.obj"
    mesh = load_avatar(path).mesh
    landmarks = load_landmarks(path.with_name("landmarks.yaml"), mesh)
    base = load_face()
    frame = align(landmarks.points(mesh.vertices), base.landmark_points(base.mesh(0).vertices, detail=0))
    parts = take_apart(mesh, landmarks, frame)
    return PieceMotion(parts.pieces, parts.vertices, parts.faces, parts.points)


@pytest.mark.parametrize("bone", [True, False])
def test_the_jaw_is_read_off_teeth_or_chin(taken_apart, bone):
    """What moves by a known jaw gives that jaw back; a chin that is drawn up gives none."""
    pieces = taken_apart if bone else PieceMotion([p for p in taken_apart.pieces if p.kind != "teeth_lower"],
                                                  taken_apart.vertices, taken_apart.faces, taken_apart.face.points)
    wanted = np.array([[25.0, 0.0, 0.0], [0.0, 6.0, 0.0], [0.0, 0.0, 5.0], [12.0, -2.0, 1.0], [0.0, 0.0, 0.0]])
    jaw = Jaw(np.array([0.0, -35.0, -60.0]), np.zeros(3))
    share = np.where(pieces.vertices[:, 1] < pieces.face.lips[1] + 20, 1.0, 0.0)
    motion = np.concatenate([share[:, None] * jaw.movement(pieces.vertices, wanted),
                             np.tile([0.0, 4.0, 1.0], (1, len(share), 1))])
    hinge, found, shares = measured_jaw(pieces, motion)
    np.testing.assert_allclose(hinge.hinge[1:], jaw.hinge[1:], atol=1e-6)
    np.testing.assert_allclose(found[:-1], wanted, atol=1e-6)
    assert not found[-1].any()
    np.testing.assert_allclose(shares, share, atol=1e-6)


def test_no_jaw_where_nothing_opens(taken_apart):
    hinge, jaw, share = measured_jaw(taken_apart, np.zeros((2, len(taken_apart.vertices), 3)))
    assert hinge is None
    assert not jaw.any()
    assert not share.any()


def test_the_gaze_is_read_off_the_balls(taken_apart):
    wanted = np.array([[25.0, 0, 0, 0], [0, 0, 0, -25], [-10, 20, 15, 5], [0, 0, 0, 0]])
    motion = np.zeros((len(wanted), len(taken_apart.vertices), 3))
    motion[:] = taken_apart.move(motion, None, wanted)
    np.testing.assert_allclose(measured_gaze(taken_apart, motion), wanted, atol=1e-6)


@pytest.mark.parametrize(("arguments", "message"), [
    ({"template": "none.glb"}, "template: expected .* which does not exist"),
    ({"template": "neutral.glb"}, "neutral.glb has no shapes"),
    ({"template": "bare.glb"}, "bare.glb carries no landmarks .*--template-landmarks"),
    ({"template": "few.glb"}, "noted landmarks .*mouth_top.* missing"),
    ({"template": "there"}, "neutral.obj is missing"),
    ({"template": "alone"}, "no OBJ file, so no shape"),
    ({"template": "plain"}, "plain has no landmarks.yaml"),
    ({"template": "more"}, "smile.obj: has 4 vertices, neutral.obj has 3"),
    ({"template": "other"}, "smile.obj: has other faces"),
    ({"shapes": ["jawOpn"]}, "cartoon.glb has no shape 'jawOpn'; did you mean 'jawOpen'"),
    ({"shapes": []}, "shapes: expected one or more names"),
    ({"sets": ["arkit"]}, "sets: facegen's own shapes cannot be had from another template"),
    ({"person": "mika"}, "person: facegen's own"),
    ({"template_landmarks": "none.yaml"}, "none.yaml"),
    ({"template": None, "template_landmarks": "none.yaml"}, "template_landmarks: expected a template"),
    ({"template": None, "sets": ["arkit"], "shapes": ["jawOpn"]}, "'jawOpn' is not in the sets.*'jawOpen'"),
    ({"template": None, "shapes": []}, "shapes: expected one or more names"),
])
def test_what_is_no_template_is_said_and_nothing_is_written(tmp_path, cartoon, monkeypatch, arguments, message):
    monkeypatch.chdir(tmp_path)
    template = load_avatar(cartoon)
    neutral = load_avatar(meshes_dir() / "avatars/cartoon/cartoon.obj")
    save_avatar(neutral, "neutral.glb", {})
    save_avatar(neutral, "bare.glb", {"smile": neutral.mesh.vertices * 0.01})
    save_avatar(neutral, "few.glb", {"smile": neutral.mesh.vertices * 0.01}, notes={
        **template.notes, "landmarks": {name: at for name, at in template.notes["landmarks"].items()
                                        if not name.startswith("mouth_")}})
    triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
    for name, files in {"there": {"smile": triangle}, "alone": {"neutral": triangle},
                        "plain": {"neutral": triangle, "smile": triangle},
                        "more": {"neutral": triangle, "smile": "v 0 0 1\n" + triangle},
                        "other": {"neutral": triangle, "smile": triangle.replace("1 2 3", "2 3 1")}}.items():
        (tmp_path / name).mkdir()
        for stem, text in files.items():
            (tmp_path / name / f"{stem}.obj").write_text(text)
    with pytest.raises(InputError, match=message):
        rig("cartoon", tmp_path / "out.glb", **{"template": cartoon, **arguments})
    assert not (tmp_path / "out.glb").exists()


def test_a_folder_that_is_none(tmp_path):
    with pytest.raises(FileError, match="expected a folder"):
        load_shape_folder(tmp_path / "none")

"""From an avatar's file to a file with blendshapes, and back as a face."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from facegen.blendshapes.recipes import shape_sets
from facegen.cli import main
from facegen.errors import FileError, InputError
from facegen.face.face import load_face
from facegen.fileio.avatar import load_avatar
from facegen.geometry.ahead import ahead
from facegen.geometry.camera import frame
from facegen.geometry.mesh import Mesh
from facegen.render import render_passes
from facegen.transfer.halfway import half_name
from facegen.transfer.landmarks import Landmarks
from facegen.transfer.rig import avatar_names, rig
from facegen.transfer.transfer import transfer


@pytest.fixture(scope="module", params=avatar_names())
def rigged(request, tmp_path_factory):
    return rig(request.param, tmp_path_factory.mktemp("rig") / f"{request.param}.glb", sets=["units", "arkit"])


@pytest.fixture(scope="module")
def face(rigged):
    return load_face(rigged.path)


def test_every_shape_that_was_asked_for_is_in_the_file(rigged):
    names = set(load_avatar(rigged.path).shapes)
    assert names == set(rigged.names)
    assert names - {half_name(name) for name in rigged.found.halves} == set(shape_sets(["units", "arkit"]))


def test_left_shapes_leave_the_right_side_alone(rigged):
    """At most 3 % of their mean movement, and two micrometres, but for a strip of 12 mm beside the midline, in the
    template's shape and in the avatar's own: a muzzle is narrower than a person's mouth."""
    skin, shapes = rigged.found.skin, load_avatar(rigged.path).shapes
    rows = cKDTree(rigged.found.frame.apply(load_avatar(rigged.path).mesh.vertices)).query(skin.surface.vertices)[1]
    x, clear = skin.registered[:, 0], np.abs(skin.surface.vertices[:, 0]) > 12
    template = skin.template
    # Not of one side on the template either: what draws all of the mouth to the left, and what turns the jaw.
    whole = {"mouthLeft", *(name for name, jaw in zip(template.names, template.shapes.jaw, strict=True) if jaw.any())}
    left = [name for name in rigged.names if name.endswith(("_L", "Left")) and name not in whole]
    assert len(left) > 30
    for name in left:
        length = np.linalg.norm(rigged.found.frame.apply_vectors(shapes[name][rows]), axis=1)
        assert (clear * length)[x < -12].mean() <= 0.03 * length[x > 12].mean() + 0.002, name


def test_a_rigged_avatar_is_a_face(rigged, face):
    assert np.array_equal(face.pose({}), face.mesh().vertices)
    smile = face.landmark_points(face.pose("12"))
    rest = face.landmark_points(face.mesh().vertices)
    for side, outward in (("L", 1), ("R", -1)):
        corner = smile[f"mouth_corner_{side}"] - rest[f"mouth_corner_{side}"]
        assert corner[1] > 1.0                                  # up and out, mm on a human-sized head
        assert outward * corner[0] > 1.0


def test_no_eye_comes_through_the_skin_over_it(rigged, face):
    """Places of the left eye that are covered at rest, as seen from where it looks to, are covered when brow and cheek
    move."""
    mesh = face.mesh()
    eye, skin = (mesh.faces[np.isin(mesh.face_parts, [k for k, part in enumerate(mesh.parts) if part.startswith(name)])]
                 for name in ("eye_L", "skin"))
    at = rigged.found.frame.apply
    look = at(face.landmark_points(mesh.vertices)["eye_center_L"][None])[0] - at(mesh.vertices[np.unique(eye)]).mean(0)
    ahead_of = look / np.linalg.norm(look)
    aside = np.cross([0.0, 1.0, 0.0], ahead_of) / np.linalg.norm(ahead_of[[0, 2]])
    turn = np.stack([aside, np.cross(ahead_of, aside), ahead_of])
    shares = np.array([(i, j, 6 - i - j) for i in range(7) for j in range(7 - i)]) / 6

    def covered(vertices):
        vertices = at(vertices) @ turn.T
        return ahead(np.einsum("sc,fci->fsi", shares, vertices[eye]).reshape(-1, 3), vertices[skin])[0]

    rest = covered(mesh.vertices)
    for name in ("AU1_L", "AU2_L", "AU4_L", "AU6_L", "AU7_L", "AU9_L"):
        now = covered(face.pose_shapes({name: 1.0}))
        through = (rest > 0) & (now < -0.05) & (now > -3.0)             # not where the lid bares it
        assert not through.any(), (name, through.sum())


def test_the_jaw_opens_the_mouth_and_teeth_go_with_their_bone(rigged, face):
    rest, opened = face.landmark_points(face.mesh().vertices), face.landmark_points(face.pose("27"))
    gap = (opened["mouth_inner_top"] - opened["mouth_inner_bottom"])[1]
    width = np.linalg.norm(rest["mouth_corner_L"] - rest["mouth_corner_R"])
    assert 0.3 < gap / width < 1.1
    mesh = face.mesh()
    moved = np.linalg.norm(face.pose("27") - mesh.vertices, axis=1)
    upper, lower = (np.unique(mesh.faces[[mesh.parts[p].startswith(part) for p in mesh.face_parts]])
                    for part in ("teeth_upper", "teeth_lower"))
    assert moved[upper].max() < 1e-3
    assert moved[lower].min() > 3


def test_one_side_leaves_the_other_as_alone_as_on_the_template(rigged, template):
    avatar, skin = load_avatar(rigged.path), rigged.found.skin
    rows = cKDTree(rigged.found.frame.apply(avatar.mesh.vertices)).query(skin.surface.vertices)[1]
    x = skin.registered[:, 0]               # in the template's shape: the same places, however wide the mouth is
    for name in ("AU12_L", "AU2_L", "AU6_L", "AU10_L"):
        moved = np.linalg.norm(avatar.shapes[name][rows], axis=1)
        row = template.names.index(f"L{name[2:-2]}")
        own, at = np.linalg.norm(template.motion[row], axis=1), template.surface.vertices[:, 0]
        theirs = own[at < -12].mean() / own[at > 12].mean()
        assert moved[x < -12].mean() < (0.03 + 1.5 * theirs) * moved[x > 12].mean(), name


def test_a_template_transferred_to_itself_gives_its_skin(template):
    """Turned, scaled and moved copies too: the frame is found and undone."""
    turn = np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]])
    mesh = load_face().mesh(2)
    skin = np.isin(mesh.face_parts, [0])
    copy = Mesh.of(0.01 * mesh.vertices @ turn.T + [5, 6, 7], mesh.faces[skin])
    names = tuple(template.places)
    corners = np.array([template.places[name][0] for name in names])
    weights = np.array([template.places[name][1] for name in names])
    landmarks = Landmarks(names, np.zeros(len(names), int), corners, weights)
    found = transfer(copy, landmarks, template)
    n = len(template.surface.vertices)
    for row in (0, template.names.index("27"), template.names.index("L12")):
        wanted = 0.01 * template.motion[row] @ turn.T
        assert np.abs(found.shapes[template.names[row]][:n] - wanted).max() < 1e-6 * 0.01 * template.height


@pytest.mark.parametrize(("arguments", "message"), [
    ({"avatar": "cartoo"}, "did you mean 'cartoon'"),
    ({"avatar": "nobody.obj", "landmarks": "x.yaml"}, "nobody.obj"),
    ({"sets": ["arkits"]}, "did you mean 'arkit'"),
    ({"sets": []}, "expected one or more of units"),
    ({"method": "sumners"}, "did you mean 'sumner'"),
    ({"opening": 0.0}, "opening: expected a factor"),
    ({"lid_closure": 3.0}, "lid_closure: expected a factor"),
    ({"pieces": {"hat": "skull"}}, "hat"),
    ({"avatar": "nope.obj"}, r"avatar: expected a file, got 'nope\.obj', which does not exist"),
    ({"avatar": "catt"}, r"expected a file, or one of cartoon, cat.* did you mean 'cat'"),
])
def test_what_cannot_be_done_is_said_and_nothing_is_written(tmp_path, arguments, message):
    with pytest.raises(InputError, match=message):
        rig(**{"avatar": "cartoon", "output": tmp_path / "a.glb", "sets": ["vrm"], **arguments})
    assert not list(tmp_path.iterdir())


def test_landmarks_are_asked_for(tmp_path):
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    with pytest.raises(InputError, match="landmarks: expected the file"):
        rig(tmp_path / "a.obj", tmp_path / "a.glb")
    with pytest.raises(FileError):
        rig(tmp_path / "a.obj", tmp_path / "a.glb", landmarks=tmp_path / "none.yaml")


def test_the_command(tmp_path, capsys):
    out = tmp_path / "c.glb"
    assert main(["rig", "cartoon", "-o", str(out), "--set", "vrm", "--no-normals"]) == 0
    assert "18 shapes" in capsys.readouterr().out or out.exists()
    assert main(["render", "happiness", "--face", str(out), "-o", str(tmp_path / "c.png"), "--size", "64"]) == 0
    assert main(["rig", "cartoon"]) == 2
    assert main(["rig", "cartoon", "-o", str(out), "--lid-closure", "-1"]) == 2
    assert main(["rig", "cartoon", "-o", str(out), "--piece", "cap"]) == 2
    assert "PART=KIND" in capsys.readouterr().err


def test_the_inside_of_a_lip_has_its_partners_on_the_same_lip(rigged):
    """On a thin lip the side has faded there: more than every fifth had its partner on the other lip of the cat."""
    skin = rigged.found.skin
    feet, template = skin.feet, skin.template.surface
    found = feet.found
    own = skin.sides[found, 0]
    partner = (feet.weights[found] * skin.correspondence.sides[template.faces[feet.faces[found]], 0]).sum(axis=1)
    told = (np.abs(own) > 0.1) & (np.abs(partner) > 0.1)
    assert told.sum() > 50
    assert (own * partner < 0)[told].mean() < 0.05


LIP_POSES = ("22E", "25E", "27E", "18E+25E", "22E+25E", "12E+27E", "20E+27E")
LIP_VIEWS = ((0, 0), (0, -25), (35, 0))


def test_no_camera_sees_skin_from_behind(face):
    """The inner side of lips stays behind the outer one, in shapes and in sums of them: of skin and a mouth's lining a
    camera sees the side that looks outward. Four pixels in ten thousand may be otherwise: facets cross."""
    mesh = face.mesh()
    mouth = np.array([at for name, at in face.landmark_points(mesh.vertices).items() if name.startswith("mouth_")])
    lips = np.isin(mesh.face_parts, [k for k, part in enumerate(mesh.parts) if part in ("skin", "mouth")])
    size = 160

    def from_behind(pose, view):
        camera = frame(mesh.vertices, size=(size, size), view=view, orthographic=True)
        camera = replace(camera, target=mouth.mean(axis=0), scale=0.5 * size / np.ptp(mouth, axis=0).max(),
                         offset=(size / 2, size / 2))
        seen = render_passes(mesh.with_vertices(pose), passes=("triangle",), camera=camera)["triangle"]
        (x1, y1), (x2, y2) = np.diff(camera.project(pose)[mesh.faces, :2], axis=1).transpose(1, 2, 0)
        return (lips & (x1 * y2 > y1 * x2))[seen[seen >= 0]].sum()      # pixels count downward

    for view in LIP_VIEWS:
        rest = from_behind(mesh.vertices, view)
        for pose in LIP_POSES:
            if view[0] == 0 or "27" not in pose:        # aside, into an open mouth: beside the lining, the cheek's back
                assert from_behind(face.pose(pose), view) - rest <= 0.0004 * size**2, (pose, view)

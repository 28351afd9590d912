"""Lids meet over the eye and lips meet over the teeth, on every avatar that ships."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from facegen.face.face import load_face
from facegen.fileio.avatar import load_avatar
from facegen.render import render_passes
from facegen.transfer.closing import closing
from facegen.transfer.eyeball import EyeFront, fit_eye
from facegen.transfer.margins import LIDS, LIPS, facing_margins, find_margins
from facegen.transfer.rig import avatar_names, rig
from facegen.transfer.skin import lay_skin

# Of the eye that a camera sees at rest: what it may see of it when the lids are shut.
SEEN = {"human": 0.05}
OTHERS = 0.15


@pytest.fixture(scope="module", params=avatar_names())
def rigged(request, tmp_path_factory):
    return rig(request.param, tmp_path_factory.mktemp("closing") / f"{request.param}.glb", sets=["arkit", "units"])


@pytest.fixture(scope="module")
def skin_shapes(rigged):
    """The shapes on the skin's own vertices, mm."""
    avatar, found = load_avatar(rigged.path), rigged.found
    rows = cKDTree(found.frame.apply(avatar.mesh.vertices)).query(found.skin.surface.vertices)[1]
    return {name: found.frame.apply_vectors(shape[rows]) for name, shape in avatar.shapes.items()}


def gaps(rigged, slit, moved):
    """Distances of facing places of a slit's edges, mm."""
    skin = rigged.found.skin
    return np.linalg.norm(facing_margins(skin, slit)[1].gap(skin.surface.vertices + moved), axis=1)


@pytest.mark.parametrize(("slit", "name"), [(LIDS[0], "eyeBlinkLeft"), (LIDS[1], "eyeBlinkRight")])
def test_a_blink_closes_the_lids(rigged, skin_shapes, slit, name):
    rest = gaps(rigged, slit, 0.0)
    assert rest.max() > 3.0
    assert gaps(rigged, slit, skin_shapes[name]).mean() < 0.05 * rest.mean()
    half = gaps(rigged, slit, 0.5 * skin_shapes[name]).mean() / rest.mean()
    assert 0.4 < half < 0.6


@pytest.mark.parametrize(("slit", "name"), [(LIDS[0], "eyeBlinkLeft"), (LIDS[1], "eyeBlinkRight")])
def test_a_rim_moves_as_its_edge_does(rigged, skin_shapes, slit, name):
    """Scattered, it would be torn into points, or one of its sides stretched over the eye."""
    skin, moved = rigged.found.skin, skin_shapes[name]
    places, margins = skin.surface.vertices, facing_margins(skin, slit)[1]
    edge = margins.rows[margins.is_upper]
    to_upper, nearest = cKDTree(places[edge]).query(places)
    to_lower = cKDTree(margins.ends(places)[1]).query(places)[0]
    rim = np.flatnonzero((to_upper < 0.1 * to_lower) & (to_upper > 0))
    assert len(rim) > 5
    away = np.linalg.norm(moved[rim] - moved[edge[nearest[rim]]], axis=1)
    assert away.max() < 0.12 * gaps(rigged, slit, 0.0).max()


def test_a_camera_sees_no_eye_through_shut_lids(rigged):
    face = load_face(rigged.path)
    eyes = [i + 1 for i, name in enumerate(face.mesh().parts) if name.startswith("eye")]

    def seen(pose):
        return sum(np.isin(render_passes(face, pose, passes=["part"], size=256, view=view)["part"], eyes).sum()
                   for view in ((0, 0), (25, 0), (-25, 0)))

    name = rigged.path.stem
    assert seen({}) > 100
    assert seen("43E") <= SEEN.get(name, OTHERS) * seen({})


def test_mouth_close_takes_back_what_jaw_open_parted(rigged, skin_shapes):
    rest, opened = gaps(rigged, LIPS, 0.0), gaps(rigged, LIPS, skin_shapes["jawOpen"])
    closed = gaps(rigged, LIPS, skin_shapes["jawOpen"] + skin_shapes["mouthClose"])
    assert opened.max() > 10
    assert (closed - rest).mean() < 0.1 * (opened - rest).mean()


def test_the_template_needs_no_closing(template):
    """What it adds to a faithful copy of the template is nothing."""
    skin = lay_skin(template, template.surface, template.places)
    motion = template.motion.copy()
    for slit in (*LIDS, LIPS):
        found = closing(skin, slit)
        found.close(motion)
        found.seal(motion, np.arange(motion.shape[1]))
    assert np.abs(motion - template.motion).max() < 1e-6 * template.height


def test_a_face_without_landmarks_of_a_slit_has_none(template):
    places = {name: place for name, place in template.places.items() if name != "mouth_inner_top"}
    sides = np.zeros((len(template.surface.vertices), 3))
    assert find_margins(template.surface, LIPS, places, sides) is None
    places["mouth_inner_top"] = places["mouth_inner_bottom"]            # painted on: one line
    assert find_margins(template.surface, LIPS, places, sides) is None


@pytest.mark.parametrize(("slit", "name"), [(LIDS[0], "AU5_L"), (LIDS[1], "AU5_R")])
def test_lids_that_open_stay_as_near_to_the_eye(rigged, skin_shapes, slit, name):
    """Else a camera sees into the socket beside the eye."""
    skin, side = rigged.found.skin, name[-1]
    avatar = load_avatar(rigged.path)
    faces = np.concatenate([avatar.mesh.faces[piece.faces] for piece in rigged.found.pieces
                            if piece.kind == f"eye_{side}"])
    eye = rigged.found.frame.apply(avatar.mesh.vertices)[np.unique(faces)]
    margins = facing_margins(skin, slit)[1]
    ball = fit_eye([(eye, np.ones(len(eye)))], outward=np.array([0.0, 0.0, 1.0]), width=np.ptp(eye[:, 0]),
                   opening=margins.ends(skin.surface.vertices)[0].mean(axis=0))
    rest, wide = (np.linalg.norm(ball.in_radii(margins.ends(skin.surface.vertices + moved)[0]), axis=1)
                  for moved in (0.0, skin_shapes[name]))
    assert (wide - rest).max() < 0.05


def test_a_step_of_rounding_size_moves_no_lid(rigged):
    """A lid that lies in the eye, where only its front is seen, is not lifted out of it because a rounding moved it."""
    skin, parts = rigged.found.skin, {piece.kind: piece for piece in rigged.found.pieces}
    vertices = skin.surface.vertices
    eye = rigged.found.frame.apply(load_avatar(rigged.path).mesh.vertices)[np.unique(
        load_avatar(rigged.path).mesh.faces[parts["eye_L"].faces])]
    ball = fit_eye([(eye, np.ones(len(eye)))], outward=np.array([0.0, 0.0, 1.0]), width=np.ptp(eye[:, 0]),
                   opening=eye.mean(axis=0))
    lid = closing(skin, LIDS[0], EyeFront(ball, eye))
    moved = np.zeros_like(vertices)
    moved[lid.field.rows, 1] = -3.0                            # all of it is on its way already
    before = moved.copy()
    lid._move(moved, np.full((len(lid.field.rows), 3), 1e-7))
    assert np.abs(moved - before).max() < 1e-3

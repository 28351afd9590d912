"""The avatar of a work gets blendshapes: into the faces of the work, anew only where a choice changes something."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from facegen.errors import InputError
from facegen.face.avatar import AvatarFace
from facegen.face.face import load_face
from facegen.fileio.avatar import load_avatar, save_avatar
from facegen.studio import rigging
from facegen.studio.avatar_file import keep, open_avatar
from facegen.studio.desk import Desk
from facegen.studio.picking import as_places, removed
from facegen.studio.rigging import RigMaker, posed
from facegen.studio.task import Stopped
from facegen.studio.work import AvatarWork
from facegen.transfer.landmarks import load_landmarks, snap
from facegen.transfer.rig import avatar_files

NAME = "work-of-one"


def silent(stage, share):
    """Nobody listens."""


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A desk, what makes blendshapes in the folder of a work there, the work, its avatar, and what came out."""
    desk = Desk(tmp_path_factory.mktemp("works"))
    maker = RigMaker(desk.store.folder_of(NAME))
    opened = open_avatar(maker.folder, "cartoon")
    marks = load_landmarks(avatar_files("cartoon", None)[1], opened.avatar.mesh)
    work = AvatarWork(file="cartoon", landmarks=as_places(marks), sets="visemes").checked()
    assert not maker.is_made(work, opened)
    heard = []
    found = maker.make(work, opened, lambda stage, share: heard.append((stage, share)))
    return desk, maker, work, opened, found, heard


def test_it_is_a_face_of_the_work_and_of_no_other(made):
    desk, maker, work, opened, found, heard = made
    assert found.path == maker.folder / "faces" / "cartoon.glb"
    assert "cartoon.glb" in desk.face_names(NAME)
    assert "cartoon.glb" not in desk.face_names("another-work")
    with pytest.raises(InputError, match="unknown face"):
        desk.face("cartoon.glb", "another-work")
    face = desk.face("cartoon.glb", NAME)
    neutral = face.pose("neutral")
    assert np.abs(face.pose_shapes({"viseme_aa": 1.0}) - neutral).max() > 5.0
    assert len(heard) > 5
    assert all(0.0 <= share <= 1.0 for _, share in heard)
    assert maker.is_made(work, opened)
    assert RigMaker(maker.folder).is_made(work, opened), "after a crash too"


@pytest.mark.parametrize("change", [{"opening": 1.2}, {"lid_closure": 0.5}, {"weights": {"landmarks": 40.0}},
                                    {"sets": "arkit"}, {"pieces": {"3": "skull"}}])
def test_whatever_changes_the_shapes_makes_the_file_old(made, change):
    _, maker, work, opened, *_ = made
    assert not maker.is_made(replace(work, **change), opened)
    assert maker.is_there(opened)
    assert not maker.is_there(replace(opened, avatar=replace(opened.avatar, digest="0" * 64))), "another avatar's"
    assert maker.is_made(replace(work, symmetric=False, skipped={"jaw_L": True}), opened)


def test_tuning_computes_only_what_it_changes_and_shows_what_would_be_written(made):
    _, maker, work, opened, found, _ = made
    face = load_face(found.path)
    weights = {"viseme_aa": 0.7, "viseme_FF": 0.2}
    same, told = maker.tune(work, opened, weights)
    assert told.fresh == ()
    assert same == pytest.approx(AvatarFace(found.avatar).pose_shapes(weights), abs=1e-6)
    wider, told = maker.tune(replace(work, opening=1.5), opened, weights)
    assert "viseme_aa" in told.fresh
    assert set(told.fresh) <= set(weights)
    row = face.landmark_points(face.mesh().vertices)["chin"]
    assert np.isfinite(row).all()
    assert wider[:, 1].min() <= same[:, 1].min() + 1e-6
    low = np.linalg.norm(wider - posed(opened.avatar.mesh.vertices, told, {}), axis=1).max()
    assert low > 1.2 * np.linalg.norm(same - posed(opened.avatar.mesh.vertices, told, {}), axis=1).max()


def test_a_head_turns_while_it_is_tuned_after_a_reload_too(made):
    """The file that was made has the vertices of an OBJ avatar in another order, and seams twice."""
    _, maker, work, opened, found, _ = made
    meaning, file = load_face().resolve("51E+54D"), load_avatar(found.path)
    rows = np.r_[:len(file.mesh.vertices), 0][::-1]
    other = replace(file.mesh, vertices=file.mesh.vertices[rows], faces=len(rows) - 1 - file.mesh.faces)
    seams = replace(file, mesh=other, shapes={name: one[rows] for name, one in file.shapes.items()})
    for face in (AvatarFace(found.avatar), load_face(found.path), AvatarFace(seams)):
        mesh, _ = maker.shown(work, opened, face, meaning)
        assert mesh.parts == opened.avatar.mesh.parts
        wanted = face.pose(meaning)
        assert np.abs(wanted - face.pose("neutral")).max() > 30.0
        assert cKDTree(mesh.vertices).query(wanted)[0].max() < 1e-3
    assert len(wanted) != len(mesh.vertices)


def test_who_stops_it_finds_everything_as_it_was(made):
    _, maker, work, opened, found, _ = made
    before = found.path.read_bytes()

    def stop(stage, share):
        if share > 0.5:
            raise Stopped

    with pytest.raises(Stopped):
        maker.make(replace(work, opening=0.5), opened, stop)
    assert found.path.read_bytes() == before
    assert maker.is_made(work, opened)
    assert sorted(path.name for path in found.path.parent.iterdir()) == ["cartoon.glb"]


def test_missing_points_are_named(made):
    _, maker, work, opened, *_ = made
    with pytest.raises(InputError, match=r"1 point is missing: Chin\. Place them"):
        maker.make(removed(work, "chin"), opened, silent)
    with pytest.raises(InputError, match=r"25 points are missing: .* and 22 more"):
        rigging.pieces(AvatarWork(file="cartoon"), opened)


def test_pieces_are_known_before_anything_is_made_and_can_be_overruled(made):
    _, _, work, opened, *_ = made
    rows = rigging.pieces(work, opened)
    kinds = {row["name"].split("|")[0]: row for row in rows}
    assert kinds["skin"]["kind"] == "skin"
    assert kinds["cap"]["kind"] == "skull"
    assert rows[0]["triangles"] == max(row["triangles"] for row in rows)
    corrected = {str(number): "carried" for number in kinds["cap"]["components"]}
    other = rigging.pieces(replace(work, pieces=corrected), opened)
    assert {row["name"].split("|")[0]: row["kind"] for row in other}["cap"] == "carried"


def test_a_vrm_stays_one(tmp_path):
    """The cartoon as another program's file: in another folder, under another name, with a face that the work shows."""
    source, marks = avatar_files("cartoon", None)
    save_avatar(load_avatar(source), tmp_path / "me.vrm", {})
    desk = Desk(tmp_path / "works")
    maker = RigMaker(desk.store.folder_of(NAME))
    opened = open_avatar(maker.folder, keep(maker.folder, "me.vrm", (tmp_path / "me.vrm").read_bytes()))
    cartoon = load_avatar(source).mesh
    places = snap(load_landmarks(marks, cartoon).points(cartoon.vertices), opened.avatar.mesh)
    work = AvatarWork(file="me.vrm", landmarks=as_places(places), sets="vrm")
    made = maker.make(work, opened, silent)
    assert made.path.name == "me.vrm"
    assert "me.vrm" in desk.face_names(NAME)
    face = desk.face("me.vrm", NAME)
    assert np.abs(face.pose_shapes({"aa": 1.0}) - face.pose("neutral")).max() > 5.0

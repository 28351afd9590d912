"""What cannot be adopted: a clear error, and nothing written."""

from __future__ import annotations

import os
from types import SimpleNamespace

import numpy as np
import pytest

from facegen.adoption.adopt import adopt, doubts
from facegen.adoption.base import base_face
from facegen.adoption.checks import check_head
from facegen.adoption.residual import Residual
from facegen.adoption.write import save_folder
from facegen.data import meshes_dir
from facegen.errors import FileError, InputError, TableError
from facegen.fileio.avatar import load_avatar
from facegen.transfer.landmarks import load_landmarks

HUMAN = meshes_dir() / "avatars" / "human"


@pytest.fixture
def marks():
    """Landmark -> place (3,) of the old man, in his own units."""
    mesh = load_avatar(HUMAN / "human.obj").mesh
    return load_landmarks(HUMAN / "landmarks.yaml", mesh).points(mesh.vertices)


def landmark_file(path, points):
    rows = "".join(f"  {name}: [{', '.join(f'{x:.6f}' for x in at)}]\n" for name, at in points.items())
    path.write_text("landmarks:\n" + rows)
    return path


@pytest.fixture
def refused(tmp_path):
    """Return a function: arguments of adopt -> what the error says, after looking that nothing was written."""
    def check(*arguments, kind=InputError, **options):
        before = sorted(tmp_path.rglob("*"))
        with pytest.raises(kind) as caught:
            adopt(*arguments, tmp_path / "face", **options)
        assert sorted(tmp_path.rglob("*")) == before
        return str(caught.value)
    return check


@pytest.mark.parametrize("animal", ["cat", "horse", "cartoon"])
def test_no_human_face(refused, animal):
    said = refused(animal)
    assert "no human face" in said
    assert "facegen rig" in said


def test_missing_files_and_landmarks(refused, tmp_path, marks):
    assert "does not exist" in refused("nosuch.obj", landmarks=HUMAN / "landmarks.yaml", kind=FileError)
    assert "did you mean 'human'" in refused("humann", kind=FileError)
    assert "landmarks" in refused(HUMAN / "human.obj")
    del marks["mouth_top"], marks["chin"]
    path = landmark_file(tmp_path / "some.yaml", marks)
    assert "'mouth_top', 'chin' are missing" in refused(HUMAN / "human.obj", landmarks=path, kind=TableError)


def test_closed_eyes(refused, tmp_path, marks):
    middle = (marks["eye_upper_L"] + marks["eye_lower_L"]) / 2
    way = marks["eye_upper_L"] - middle
    marks |= {"eye_upper_L": middle + 0.01 * way, "eye_lower_L": middle - 0.01 * way}
    said = refused(HUMAN / "human.obj", landmarks=landmark_file(tmp_path / "l.yaml", marks))
    assert "'eye_upper_L'" in said              # between open lids there is no skin
    shut = dict(base_face().landmarks)
    check_head(SimpleNamespace(points=shut), base_face())
    shut["eye_lower_R"] = shut["eye_upper_R"] - [0, 0.5, 0]
    with pytest.raises(InputError, match="the right eye is closed"):
        check_head(SimpleNamespace(points=shut), base_face())


def test_a_face_far_from_its_head_is_told():
    assert not doubts(Residual(0.1, 0.5, 2.0, 0.95))
    assert "20 in 100" in doubts(Residual(0.1, 0.5, 2.0, 0.8))[0]
    assert "7.0 mm" in doubts(Residual(0.1, 0.5, 7.0, 0.95))[0]


def test_a_mesh_with_nan(refused, tmp_path):
    lines = (HUMAN / "human.obj").read_text().splitlines()
    row = next(i for i, line in enumerate(lines) if line.startswith("v "))
    lines[row] = "v nan 0 0"
    (tmp_path / "nan.obj").write_text("\n".join(lines))
    said = refused(tmp_path / "nan.obj", landmarks=HUMAN / "landmarks.yaml", kind=FileError)
    assert f"line {row + 1}" in said


@pytest.mark.parametrize(("place", "words"), [
    ("face.obj", "expected the name of a folder"), ("..", "expected the name of a folder"),
    ("nosuch/face", "does not exist; make it first"),
    ("file", "is a file"), ("full", "holds other files"), ("taken", "--force")])
def test_places_that_a_face_cannot_go_to(tmp_path, place, words):
    (tmp_path / "file").write_text("x")
    for folder, name in (("full", "notes.txt"), ("taken", "face.yaml")):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / name).write_text("x")
    with pytest.raises(FileError, match=words):
        adopt("human", tmp_path / place)
    assert (tmp_path / "full" / "notes.txt").read_text() == (tmp_path / "taken" / "face.yaml").read_text() == "x"


def test_a_folder_appears_whole_or_not_at_all(tmp_path, monkeypatch):
    folder = save_folder(tmp_path / "face", {"face.yaml": "old\n", "cage.obj": "old\n"})
    save_folder(folder, {"face.yaml": "new\n"})
    assert [one.name for one in folder.iterdir()] == ["face.yaml"]
    replace, calls = os.replace, []

    def full(source, target):
        calls.append(target)
        if len(calls) == 2:         # the old face is aside, the new one cannot take its place
            raise OSError("no space left")
        replace(source, target)

    monkeypatch.setattr("os.replace", full)
    with pytest.raises(FileError, match="no space left"):
        save_folder(folder, {"face.yaml": "newer\n"})
    assert len(calls) == 3
    assert (folder / "face.yaml").read_text() == "new\n"
    assert list(tmp_path.iterdir()) == [folder]


def test_a_surface_must_be_the_cage_s(man, tmp_path):
    from facegen.face.face import load_face

    made, _ = man
    files = {one.name: one.read_text() for one in made.path.iterdir()}
    lines = files["surface.obj"].splitlines()
    faces = [i for i, line in enumerate(lines) if line.startswith("f ")]
    broken = {
        "surface.obj": "\n".join(lines[:faces[-1]]),                            # a triangle short
        "face.yaml": files["face.yaml"].replace("\neye_size: ", "\neye_size: 9"),
        "landmarks.yaml": files["landmarks.yaml"].replace("chin: 113", "chin: 366"),
    }
    for number, (name, text) in enumerate(broken.items()):
        folder = save_folder(tmp_path / str(number), {**files, name: text})
        with pytest.raises(TableError, match=r"surface of this cage|eye_size|chin"):
            load_face(folder)
    dark = files["face.yaml"].replace("colours:\n  skin: [", "colours:\n  skin: [-9, 9, 9]  # ")
    folder = save_folder(tmp_path / "colour", {**files, "face.yaml": dark})
    with pytest.raises(TableError, match=r"colours\.skin: expected three numbers"):
        load_face(folder)


def test_a_face_that_was_replaced_is_read_again(man, tmp_path):
    from facegen.face.face import load_face
    from facegen.jobs.digests import face_digest

    made, face = man
    files = {one.name: one.read_text() for one in made.path.iterdir()}
    folder = save_folder(tmp_path / "face", files)
    first = load_face(folder)
    assert np.array_equal(first.pose("happiness"), face.pose("happiness"))
    digest = face_digest(str(folder), fresh=True)
    larger = files["surface.obj"].replace("\nv ", "\nv 0", 1)
    files["face.yaml"] = files["face.yaml"].replace("name: man", "name: another")
    save_folder(folder, files)
    assert load_face(folder).name == "another"
    save_folder(folder, {**files, "surface.obj": larger})
    assert face_digest(str(folder), fresh=True) != digest

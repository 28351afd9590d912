"""A sheet of what an avatar's blendshapes do."""

import inspect
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import facegen
from facegen.cli import main
from facegen.errors import FileError
from facegen.face.avatar import AvatarFace
from facegen.fileio.avatar import AvatarFile
from facegen.geometry.mesh import Mesh
from facegen.jobs.preview import ROW, save_preview, telling_poses, telling_shapes
from facegen.transfer.rig import rig as make

SHAPES = ["eyeBlinkLeft", "eyeBlinkRight", "jawOpen", "mouthClose", "mouthSmileLeft"]


def a_face(moves):
    """An avatar of random places with shapes (n, 3)."""
    n = len(next(iter(moves.values())))
    rng = np.random.default_rng(5)
    mesh = Mesh.of(rng.normal(size=(n, 3)), rng.permutation(np.arange(3 * (n // 3))).reshape(-1, 3))
    return AvatarFace(AvatarFile(Path("a.glb"), "glb", mesh, shapes=moves))


def slowly(moves, count, besides):
    """The obvious way: what least squares leave of each shape, over and over."""
    shown = [one.ravel() for one in besides]
    found = []
    while len(found) < count:
        left = {}
        for name, move in moves.items():
            rest = move.ravel()
            if len(shown):
                basis = np.array(shown).T
                rest = rest - basis @ np.linalg.lstsq(basis, rest, rcond=None)[0]
            if name not in found and (rest**2).sum() > 0.01 * (move**2).sum():
                left[name] = (rest**2).sum()
        if not left:
            break
        found.append(max(left, key=left.get))
        shown.append(moves[found[-1]].ravel())
    return [name for name in moves if name in found]


@pytest.mark.parametrize("seed", range(6))
def test_the_shapes_that_say_the_most_are_those_that_others_do_not_say(seed):
    rng = np.random.default_rng(seed)
    parts = rng.normal(size=(5, 30, 3)) * rng.uniform(0.2, 3, size=(5, 1, 1))
    mixed = np.einsum("ij,jnc->inc", rng.normal(size=(6, 5)), parts)
    moves = {f"s{i}": one for i, one in enumerate([*parts, *mixed])}
    face = a_face(moves)
    rest = face.mesh().vertices
    besides = [face.pose_shapes({"s0": 1.0, "s3": 0.5})] * (seed % 3)      # shown twice is shown once
    for count in (1, 3, 5, 11):
        assert telling_shapes(face, count, besides=besides) == slowly(
            {name: face.pose_shapes({name: 1.0}) - rest for name in moves}, count, [one - rest for one in besides])


def test_names_that_nobody_knows_are_shown_too():
    rng = np.random.default_rng(0)
    face = a_face({name: rng.normal(size=(30, 3)) for name in ("grump", "wobble")} | {"still": np.zeros((30, 3))})
    assert list(telling_poses(face)) == ["neutral", "grump", "wobble"]


def test_a_rigged_avatar_is_drawn_as_asked(tmp_path, capsys):
    sheet = tmp_path / "sheet.png"
    assert main(["rig", "cartoon", "--set", "arkit", "--shapes", ",".join(SHAPES), "--no-normals", "--json",
                 "-o", str(tmp_path / "c.npz"), "--preview", str(sheet)]) == 0
    assert '"preview": "' in capsys.readouterr().out
    with Image.open(sheet) as picture:
        assert picture.format == "PNG"
        assert picture.width == 2 * ROW * (192 + 8) + 8
    assert sorted(path.name for path in tmp_path.iterdir()) == ["c.npz", "sheet.png"]


def test_what_a_sheet_shows(tmp_path):
    made = facegen.rig("cartoon", tmp_path / "c", sets=["arkit"], shapes=SHAPES)
    face = AvatarFace(made.avatar)
    poses = telling_poses(face)
    assert next(iter(poses)) == "neutral"
    assert "eyes shut" in poses
    assert "disgust" not in poses                           # these shapes cannot wrinkle a nose
    assert "jawOpen + mouthClose" in poses                  # a corrective is shown with what it corrects
    np.testing.assert_array_equal(poses["jawOpen + mouthClose"], face.pose_shapes({"jawOpen": 1.0, "mouthClose": 1.0}))
    save_preview(face, tmp_path / "sheet.webp", size=32)
    with Image.open(tmp_path / "sheet.webp") as picture:
        assert picture.height > 32


@pytest.mark.parametrize(("name", "message"), [
    ("sheet.gif", r"ends in \.png"), ("none/sheet.png", "does not exist"), ("sheet", "no suffix")])
def test_a_sheet_that_cannot_be_written_is_said_before_anything_is_done(tmp_path, name, message):
    with pytest.raises(FileError, match=message):
        facegen.rig("cartoon", tmp_path / "c.glb", preview=tmp_path / name)
    assert main(["rig", "cartoon", "-o", str(tmp_path / "c.glb"), "--preview", str(tmp_path / name)]) == 2
    assert not list(tmp_path.iterdir())


def test_the_door_takes_all_that_rigging_takes():
    outer, inner = (inspect.signature(one).parameters for one in (facegen.rig, make))
    assert list(outer) == [*inner, "preview"]
    with pytest.raises(TypeError, match="landmark"):
        facegen.rig("cartoon", "a.glb", landmark="a.yaml")

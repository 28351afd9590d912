"""`facegen adopt` and the face it makes, wherever a face is taken."""

from __future__ import annotations

import json

import numpy as np
import pytest
from PIL import Image

from facegen.data import meshes_dir


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A face made by the command, with a preview."""
    from facegen.cli import main

    place = tmp_path_factory.mktemp("adopted")
    human = meshes_dir() / "avatars" / "human"
    assert main(["adopt", str(human / "human.obj"), "-l", str(human / "landmarks.yaml"), "-o", str(place / "man"),
                 "--preview", str(place / "man.png"), "--name", "old man", "-q"]) == 0
    return place / "man"


def test_the_preview_shows_it(folder):
    picture = np.asarray(Image.open(folder.with_suffix(".png")))
    assert picture.shape[2] == 3
    assert picture.std() > 20


def test_it_can_be_drawn_listed_and_put_in_a_batch(run, folder, tmp_path):
    code, _, err = run("render", "happiness", "--face", folder, "-o", tmp_path / "a.png", "--size", "96")
    assert (code, err) == (0, "")
    code, _, err = run("render", "43E", "--face", folder / "face.yaml", "-o", tmp_path / "b.png", "--size", "96")
    assert (code, err) == (0, "")
    a, b = (np.asarray(Image.open(tmp_path / name)) for name in ("a.png", "b.png"))
    assert not np.array_equal(a, b)
    code, _, err = run("batch", "--poses", "neutral,12E", "--faces", folder, "--sizes", "64", "-o", tmp_path / "out",
                       "-q")
    assert (code, err) == (0, "")
    assert len(list((tmp_path / "out").rglob("*.png"))) == 2


def test_json_and_refusals(run, folder, tmp_path):
    code, out, err = run("adopt", "human", "-o", folder)
    assert (code, out) == (2, "")
    assert "--force" in err
    code, out, err = run("adopt", "human")
    assert code == 2
    assert "-o" in err
    code, out, err = run("adopt", "human", "-o", tmp_path / "f", "--preview", tmp_path / "f.txt")
    assert code == 2
    assert not (tmp_path / "f").exists()
    code, out, err = run("adopt", "human", "-o", folder, "--force", "--json", "-q")
    assert (code, err) == (0, "")
    said = json.loads(out)
    assert said["folder"] == str(folder)
    assert said["residual_mm"]["p95"] < 0.5
    assert {"skin", "eye_L", "eye_R"} <= {row["kind"] for row in said["pieces"]}

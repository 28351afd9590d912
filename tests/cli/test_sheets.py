"""facegen gallery and figures write what they promise; drawing is replaced where it would take minutes."""

from __future__ import annotations

import numpy as np
import pytest
from PIL import Image

import facegen
from facegen.cli import gallery as sheets
from facegen.cli import main
from facegen.fileio.obj import load_obj

FIGURES = ("figure-6", "figure-7", "figure-8", "figure-9")


@pytest.fixture(scope="module")
def figures(tmp_path_factory):
    folder = tmp_path_factory.mktemp("made") / "new" / "figures"
    assert main(["figures", "-o", str(folder), "--size", "64"]) == 0
    return folder


def test_figures(figures):
    for name in ("akimoto-1986", "akimoto"):
        folder = figures / name
        assert {path.name for path in folder.iterdir()} == {
            "figures.png",
            *(f"{figure}{end}" for figure in FIGURES for end in (".yaml", ".obj", ".png", "-side.png"))}
        face = facegen.load_face(name)
        detail = {"akimoto-1986": 0, "akimoto": 2}[name]
        for figure in FIGURES:
            posed = face.pose(facegen.load_deformation(folder / f"{figure}.yaml"), detail=detail)
            mesh = load_obj(folder / f"{figure}.obj")
            np.testing.assert_allclose(mesh.vertices, posed, atol=6e-4)
            np.testing.assert_array_equal(mesh.faces, face.mesh(detail).faces)


def test_figure_data_are_the_papers(figures):
    for number in (7, 8, 9):
        data = facegen.load_deformation(figures / "akimoto-1986" / f"figure-{number}.yaml")
        assert data == facegen.resolve(f"akimoto-1986-figure-{number}").deformation


@pytest.fixture
def quick(monkeypatch):
    """Replace the drawing of one picture by a grey square, and note what was asked."""
    asked = []

    def draw(rig, one, person, size):
        rig.resolve(one.what, person=person)
        asked.append(one)
        return np.full((size, size, 3), 128, np.uint8)

    monkeypatch.setattr(sheets, "_draw", draw)
    return asked


def test_gallery_shows_everything(run, tmp_path, quick):
    assert run("gallery", "-o", tmp_path, "--size", 64) == (0, "", "")
    shown = {one.what for one in quick}
    assert set(facegen.load_expressions().expressions) <= shown
    units = facegen.load_units().catalogue.units.values()
    assert {unit.number for unit in units} <= {
        what.rstrip("E").lstrip("LRTB") for what in shown if "+" not in what}
    assert {one.view for one in quick if one.what == "neutral"} >= set(sheets.VIEWS)
    files = sorted(path.name for path in tmp_path.iterdir())
    assert all(name.endswith(".webp") for name in files)
    assert {"basic.webp", "views.webp", "eyes.webp", "mouth.webp", "units-upper-face.webp"} <= set(files)


def test_gallery_of_a_person(run, tmp_path, quick):
    assert run("gallery", "-o", tmp_path, "--size", 64, "--person", "mika", "--format", "png")[0] == 0
    assert "mika_doubt" in {one.what for one in quick}
    with Image.open(tmp_path / "basic.png") as sheet:
        assert sheet.width == 4 * 64 + 5 * 8


def test_a_close_up_is_closer():
    face = facegen.load_face()
    near, far = (sheets._draw(face, sheets.Picture("neutral", "", close=close), None, 64)
                 for close in ("eyes", None))
    assert near.shape == far.shape == (64, 64, 4)
    assert not np.array_equal(near, far)


@pytest.mark.parametrize("command", ["gallery", "figures"])
def test_errors(run, tmp_path, command):
    assert run(command)[0] == 2
    (tmp_path / "file").write_text("in the way")
    code, out, err = run(command, "-o", tmp_path / "file", "--size", 64)
    assert (code, out) == (2, "")
    assert err.startswith("facegen: ")
    assert run(command, "-o", tmp_path, "--size", 7)[0] == 2


def test_gallery_knows_its_formats(run, tmp_path):
    assert "--format" in run("gallery", "-o", tmp_path, "--format", "gif")[2]

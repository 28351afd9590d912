"""Units move the face as measured rigs do, and only where they should."""

from pathlib import Path

import numpy as np
import pytest

from facegen.facs.tables import load_units
from facegen.facs.yamlfile import read_data

FACTS = read_data(Path(__file__).with_name("measured_landmarks.yaml"))
OF_FACE = 57.8 / FACTS["eye_separation"]


def cage_vertex(face, point):
    weights = face.deformer.weights.tocsc()[:, [face._data.point_index[point]]].toarray().reshape(-1)
    same = (face.deformer.neutral == face.feature_points[point]).all(axis=1)
    return int(np.flatnonzero(same & (weights > 0.999))[0])


@pytest.mark.parametrize("unit", FACTS["units"])
def test_the_main_landmark_moves_as_measured(face, unit):
    (point, measured), = FACTS["units"][unit].items()
    expected = np.array(measured) * OF_FACE
    vertex = cage_vertex(face, point)
    moved = face.pose(f"{unit}E")[vertex] - face.mesh().vertices[vertex]
    cosine = moved @ expected / np.linalg.norm(moved) / np.linalg.norm(expected)
    assert cosine >= 0.85, f"{point} moves {moved.round(1)}, measured {expected.round(1)}"
    assert 0.65 <= np.linalg.norm(moved) / np.linalg.norm(expected) <= 1.35


def skin_moves(face, what):
    mesh = face.mesh()
    skin = mesh.part_vertices("skin")
    return mesh.vertices[skin], np.linalg.norm(face.pose(what)[skin] - mesh.vertices[skin], axis=1)


@pytest.mark.parametrize("unit", ["1", "2", "4", "5", "6", "7", "41", "42", "43", "44", "45", "L46", "63", "64"])
def test_units_of_the_upper_face_leave_the_mouth_alone(face, unit):
    at, moved = skin_moves(face, f"{unit}E")
    mouth = (at[:, 1] < -52) & (np.abs(at[:, 0]) < 24) & (at[:, 2] > 0)
    assert moved.max() > 1.0
    assert moved[mouth].max() < (2.5 if unit == "6" else 1.0)      # a raised cheek carries the lip's corner a little


@pytest.mark.parametrize("unit", ["11", "12", "13", "14", "15", "16", "17", "18", "20", "22", "23", "24", "25", "26",
                                  "27", "28", "29", "L30", "32", "33", "34", "35"])
def test_units_of_the_lower_face_leave_the_forehead_alone(face, unit):
    at, moved = skin_moves(face, f"{unit}E")
    assert moved.max() > 1.0
    assert moved[at[:, 1] > 8].max() < 1.0


@pytest.mark.parametrize("unit", ["2", "4", "6", "7", "10", "12", "14", "15", "16", "20", "43"])
def test_a_one_sided_unit_moves_one_side(face, unit):
    at, moved = skin_moves(face, f"L{unit}E")
    left, right = moved[at[:, 0] > 8], moved[at[:, 0] < -8]
    # the lower lip is one strip: its middle goes along
    assert (right**2).sum() < (0.2 if unit == "16" else 0.12) * (left**2).sum()


@pytest.mark.parametrize("unit", list(load_units().catalogue.units))
def test_every_unit_shows(face, unit):
    code = f"L{unit}E" if load_units().catalogue.units[unit].sides == "direction" else f"{unit}E"
    mesh = face.mesh()
    moved = np.linalg.norm(face.pose(code) - mesh.vertices, axis=1)
    assert moved.max() > 0.7


def test_child_and_adult_share_the_table(face, tmp_path):
    """A face twice as large moves twice as far: the table is in face-relative numbers."""
    import shutil

    from facegen.data import meshes_dir
    from facegen.face.face import load_face

    folder = tmp_path / "giant"
    shutil.copytree(meshes_dir() / "akimoto", folder)
    import yaml

    data = yaml.safe_load((folder / "face.yaml").read_text())
    data["parts"], data["folds"] = [], {}
    (folder / "landmarks.yaml").unlink()
    data.pop("landmarks", None)

    def twice(v):
        return [2 * x for x in v]

    data["measures"] = {k: 2 * v for k, v in data["measures"].items()}
    data["centre_O"] = twice(data["centre_O"])
    data["jaw"] |= {"hinge": twice(data["jaw"]["hinge"]), "glide": twice(data["jaw"]["glide"])}
    data["eyes"] = {k: twice(v) for k, v in data["eyes"].items()}
    data["head"] = {k: twice(v) for k, v in data["head"].items()}
    for name in ("tongue_tip", "tongue_body", "tongue_back"):
        del data["points"][name]
    (folder / "face.yaml").write_text(yaml.safe_dump(data))
    lines = (folder / "cage.obj").read_text().splitlines()
    (folder / "cage.obj").write_text("\n".join(
        " ".join(["v", *(str(2 * float(x)) for x in line.split()[1:])]) if line.startswith("v ") else line
        for line in lines))
    giant = load_face(folder)
    small = face.controls(face.resolve("12E+26C").deformation)
    large = giant.controls(giant.resolve("12E+26C").deformation, strict=False)
    a = face.deformer.deform(small.vectors, small.jaw, small.lids) - face.deformer.neutral
    b = giant.deformer.deform(large.vectors, large.jaw, large.lids) - giant.deformer.neutral
    assert np.allclose(b, 2 * a, atol=1e-6)

"""A depth image from the front, as a scanner makes it: no eyeballs, lips and lids grown together, no back."""

from __future__ import annotations

import numpy as np
import pytest

from facegen.adoption.adopt import make_face
from facegen.adoption.base import base_face
from facegen.adoption.write import save_folder
from facegen.data import meshes_dir
from facegen.face.face import load_face
from facegen.fileio.avatar import AvatarFile, load_avatar
from facegen.geometry.ahead import ahead
from facegen.geometry.mesh import Mesh
from facegen.transfer.landmarks import load_landmarks, snap

STEP, NOISE, DEEP, EDGE = 1.5, 0.1, 100.0, 20.0     # mm


@pytest.fixture(scope="module")
def scan(tmp_path_factory):
    """What is made of the scanned old man, and the face."""
    folder = meshes_dir() / "avatars" / "human"
    head = load_avatar(folder / "human.obj")
    points = load_landmarks(folder / "landmarks.yaml", head.mesh).points(head.mesh.vertices)
    unit = np.linalg.norm(points["eye_outer_L"] - points["eye_outer_R"]) / 90
    low, high = head.mesh.vertices.min(axis=0), head.mesh.vertices.max(axis=0)
    x, y = (np.arange(low[k], high[k], STEP * unit) for k in (0, 1))
    at = np.stack([*(one.ravel() for one in np.meshgrid(x, y, indexing="ij")), np.zeros(len(x) * len(y))], axis=1)
    depth, _ = ahead(at, head.mesh.vertices[head.mesh.faces])
    seen = np.isfinite(depth) & (depth > points["nose_tip"][2] - DEEP * unit)
    number = np.where(seen, np.cumsum(seen) - 1, -1).reshape(len(x), len(y))
    noise = NOISE * unit * np.random.default_rng(4).normal(size=seen.sum())
    vertices = np.column_stack([at[seen, :2], depth[seen] + noise])
    a, b, c, d = number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]
    faces = np.concatenate([np.stack(one, axis=-1).reshape(-1, 3) for one in ((a, b, c), (a, c, d))])
    faces = faces[(faces >= 0).all(axis=1)]
    faces = faces[np.ptp(vertices[faces, 2], axis=1) < EDGE * unit]
    mesh = Mesh.of(vertices, faces)
    marks = snap({name: place for name, place in points.items()
                  if not name.startswith(("head", "neck", "jaw", "temple", "eye_center"))}, mesh)
    made = make_face(AvatarFile(folder / "scan.obj", "obj", mesh), marks, name="scan", origin="a test")
    return made, load_face(save_folder(tmp_path_factory.mktemp("faces") / "scan", made.files))


def test_a_scan_becomes_a_whole_face(scan, base):
    made, face = scan
    assert made.residual.p95 < 0.5
    assert made.residual.reached > 0.9
    assert set(face.mesh().parts) == set(base.mesh().parts) - {"hair"}
    # The back that no scanner saw is where a head has it.
    assert np.ptp(face.mesh().vertices, axis=0) == pytest.approx(np.ptp(base.mesh().vertices, axis=0), rel=0.2)


def test_its_lids_close_and_its_mouth_opens(scan):
    _, face = scan
    rest = face.mesh(3).vertices
    shut, wide = face.pose("43E", detail=3), face.pose("27E", detail=3)
    for margin in base_face().margins:
        upper, lower = margin[1:5], margin[[9, 8, 7, 6]]
        assert (np.linalg.norm(shut[upper] - shut[lower], axis=1)
                <= 0.05 * np.linalg.norm(rest[upper] - rest[lower], axis=1)).all()
    upper, lower = base_face().seam.T
    assert np.linalg.norm(rest[upper] - rest[lower], axis=1).max() < 0.05
    assert np.linalg.norm(wide[upper] - wide[lower], axis=1).max() > 15

"""What was measured, as files have it; and what is refused, with where and why."""

import json

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import facegen
from facegen.fileio.obj import read_obj
from facegen.fitting.camera import parse_camera
from facegen.fitting.read import read_markers, read_measured
from facegen.fitting.views import Pinhole, WeakCamera


def read(path, base, **how):
    return read_measured([path], base, **how)


def table(path, header, rows):
    path.write_text("\n".join([header, *(",".join(map(str, row)) for row in rows)]) + "\n", encoding="utf-8")
    return path


def test_numbered_landmarks_as_openface_writes_them(base, tmp_path):
    header = "frame, face_id, timestamp, confidence, success, " + ", ".join(
        [f"eye_lmk_x_{k}" for k in range(2)] + [f"{axis}_{k}" for axis in "xyXYZ" for k in range(68)])
    values = np.arange(3 * 68 * 2).reshape(3, 136) + 0.5
    rows = [[k + 1, 0, 0.04 * k, 0.9, int(k != 1), 1, 2, *values[k], *range(204)] for k in range(3)]
    found = read(table(tmp_path / "of.csv", header, rows), base)
    assert (found.kind, found.values.shape) == ("landmarks", (3, 68, 2))
    assert found.values[2, 5].tolist() == [values[2, 5], values[2, 68 + 5]]
    assert np.isnan(found.values[1]).all()                      # success is 0
    assert found.times.tolist() == pytest.approx([0.0, 0.04, 0.08])


def test_named_markers_with_gaps(base, tmp_path):
    path = table(tmp_path / "m.csv", "time,chin_x,chin_y,chin_z,m1_x,m1_y,m1_z",
                 [[0, 1, 2, 3, 4, 5, 6], [0.1, "", "", "", 4, 5, 7]])
    found = read(path, base)
    assert (found.kind, found.names) == ("markers", ("chin", "m1"))
    assert np.isnan(found.values[1, 0]).all()
    assert found.values[1, 1].tolist() == [4, 5, 7]
    assert read(path, base, fps=50).times.tolist() == pytest.approx([0.0, 0.02])


def test_arrays(base, tmp_path):
    points = np.random.default_rng(0).normal(size=(4, 68, 2))
    np.save(tmp_path / "p.npy", points)
    assert read(tmp_path / "p.npy", base).values.tolist() == points.tolist()
    np.savez(tmp_path / "p.npz", points=points[:, :3], names=["chin", "a", "b"], times=np.arange(4) / 10)
    found = read(tmp_path / "p.npz", base)
    assert (found.kind, found.names, found.times.tolist()) == ("markers", ("chin", "a", "b"), [0.0, 0.1, 0.2, 0.3])
    np.savez(tmp_path / "v.npz", vertices=base.mesh().vertices)
    assert read(tmp_path / "v.npz", base).kind == "meshes"


def test_frames_in_yaml_and_json(base, tmp_path):
    path = tmp_path / "m.yaml"
    path.write_text("fps: 20\nmarkers: {m1: {face: 3, barycentric: [1, 0, 0]}}\nframes:\n"
                    "  - points: {chin: [0, -90, 20], m1: [1, 2, 3]}\n  - points: {chin: [0, -91, 20], m1: null}\n")
    found = read(path, base)
    assert (found.kind, found.names, found.times.tolist()) == ("markers", ("m1", "chin"), [0.0, 0.05])
    assert np.isnan(found.values[1, 0]).all()
    assert found.places["m1"]["face"] == 3
    frames = [[{"x": 0.1, "y": 0.2, "z": 0.0}, {"x": 0.3, "y": 0.4, "z": 0.0}], [[0.5, 0.6, 0], [0.7, 0.8, 0]]]
    (tmp_path / "mp.json").write_text(json.dumps(frames))
    found = read(tmp_path / "mp.json", base)
    assert (found.kind, found.values[1, 1].tolist()) == ("landmarks", [0.7, 0.8, 0.0])


def test_a_folder_of_meshes_goes_by_its_numbers(base, tmp_path):
    mesh = base.mesh()
    folder = tmp_path / "take"
    folder.mkdir()
    for number in (2, 10, 1):
        lines = [f"v {x} {y} {z + number}" for x, y, z in mesh.vertices.round(4).tolist()]
        lines += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in mesh.faces.tolist()]
        (folder / f"frame{number}.obj").write_text("\n".join(lines) + "\n")
    assert len(read_obj(folder / "frame1.obj").mesh.vertices) == len(mesh.vertices)
    found = read(folder, base)
    moved = found.values[:, 0, 2] - mesh.vertices[0, 2]
    assert moved == pytest.approx([1, 2, 10], abs=1e-3)
    cut = (folder / "frame1.obj").read_text().splitlines()
    (folder / "frame1.obj").write_text("\n".join([*cut[:len(mesh.vertices)], *cut[len(mesh.vertices) + 1:]]) + "\n")
    with pytest.raises(facegen.FileError, match="other triangles"):
        read(folder, base)
    (folder / "frame1.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    with pytest.raises(facegen.FileError, match="has 3 vertices"):
        read(folder, base)


@pytest.mark.parametrize(("name", "text", "said"), [
    ("a.csv", "time,jawOpen\n0,1\n", "expected columns of places"),
    ("a.csv", "time,chin_x,chin_z\n0,1,2\n", "expected columns of places"),
    ("a.csv", "x_0,y_0,x_1\n1,2,3\n", "point '1' has no column for y"),
    ("a.csv", "", "is empty"),
    ("a.yaml", "frames: []\n", "one frame or more"),
    ("a.yaml", "frames: [{points: {chin: [1, 2]}}, {points: {chin: [1, 2, 3]}}]\n", "the same in all frames"),
    ("a.yaml", "frames: [{points: {chin: [1, x]}}]\n", "frames.0.points.chin"),
    ("a.yaml", "frames: [{time: 0, points: {chin: [1, 2]}}, {points: {chin: [1, 2]}}]\n", "in every frame or in none"),
    ("a.json", "{", "is no JSON"),
    ("a.json", "[[1, 2]]", "two or three numbers"),
    ("a.npz", "no zip", "cannot be read"),
    ("a.mp4", "x", "expected a file that ends in"),
])
def test_what_is_refused(base, tmp_path, name, text, said):
    path = tmp_path / name
    path.write_text(text)
    with pytest.raises(facegen.InputError, match=said):
        read(path, base)


def test_more_that_is_refused(base, tmp_path):
    with pytest.raises(facegen.FileError, match="no such file"):
        read(tmp_path / "none.csv", base)
    (tmp_path / "empty").mkdir()
    with pytest.raises(facegen.FileError, match="found none"):
        read(tmp_path / "empty", base)
    with pytest.raises(facegen.InputError, match="none"):
        read_measured([], base)
    np.save(tmp_path / "t.npy", np.array(["a", "b"]))
    with pytest.raises(facegen.FileError, match="expected numbers of shape"):
        read(tmp_path / "t.npy", base)
    np.savez(tmp_path / "n.npz", points=np.zeros((2, 3, 2)), names=["a"])
    with pytest.raises(facegen.FileError, match="names: expected 3"):
        read(tmp_path / "n.npz", base)
    np.savez(tmp_path / "n.npz", points=np.zeros((2, 3, 2)), times=[1.0])
    with pytest.raises(facegen.FileError, match="times: expected 2"):
        read(tmp_path / "n.npz", base)
    table(tmp_path / "a.csv", "x_0,y_0,x_1,y_1", [[1, 2, 3, 4]])
    with pytest.raises(facegen.InputError, match="meshes only, or one file"):
        read_measured([tmp_path / "a.csv", tmp_path / "n.npz"], base)
    (tmp_path / "p.yaml").write_text("places: {}\n")
    with pytest.raises(facegen.TableError, match="unknown key 'places'"):
        read_markers(tmp_path / "p.yaml")


@given(data=st.one_of(st.binary(max_size=200), st.text("xyz_01,\n.-", max_size=200).map(str.encode)),
       suffix=st.sampled_from([".csv", ".json", ".yaml", ".npz", ".npy"]))
@settings(max_examples=120, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_any_bytes_are_read_or_refused(base, tmp_path, data, suffix):
    path = tmp_path / f"any{suffix}"
    path.write_bytes(data)
    try:
        said, shape = "", read(path, base).values.shape
    except facegen.InputError as error:
        said, shape = str(error), ()
    assert len(shape) == 3 or str(path) in said


def test_cameras_as_people_write_them(tmp_path):
    assert parse_camera("weak", (640, 480)) == WeakCamera((320.0, 240.0))
    wide = parse_camera("fov=90", (1000, 500))
    assert (wide.focal, wide.centre) == (pytest.approx((500.0, 500.0)), (500.0, 250.0))
    assert parse_camera("focal=1200x1210,centre=640x360") == Pinhole((1200.0, 1210.0), (640.0, 360.0))
    assert parse_camera("focal=1200", (1280, 720)) == Pinhole((1200.0, 1200.0), (640.0, 360.0))
    path = tmp_path / "camera.yaml"
    path.write_text("focal: [1200, 1210]\ncentre: [600, 350]\n")
    assert parse_camera(str(path)) == Pinhole((1200.0, 1210.0), (600.0, 350.0))
    for text, picture, said in (("wide", None, "expected weak"), ("fov=60", None, "picture's size"),
                                ("fov=0", (10, 10), "above 0"), ("fov=170", (10, 10), "below 160"),
                                ("focal=1200", None, "where the camera looks"), ("focal=-3", (9, 9), "above 0"),
                                ("focal=x", (9, 9), "expected a number"), ("fov=60,focal=9", (9, 9), "either"),
                                ("fov=60", (0, 9), "above 0"), (str(tmp_path / "no.yaml"), None, "no such file")):
        with pytest.raises(facegen.InputError, match=said):
            parse_camera(text, picture)

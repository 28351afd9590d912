"""One door to all formats: OBJ, PLY and STL in; GLB, OBJ sequences and NumPy arrays out."""

from __future__ import annotations

import builtins
import json
import os
from contextlib import suppress

import gltfs
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from facegen.data import meshes_dir
from facegen.errors import FacegenError, FileError, InputError
from facegen.fileio.avatar import AvatarFile, check_output, load_avatar, save_avatar
from facegen.fileio.srgb import to_linear, to_srgb
from facegen.geometry.mesh import Mesh

VERTICES, FACES = gltfs.ball()
OBJ = """# a face \\ with a backslash
mtllib face.mtl
o Head
v 0 0 0
v 1.50 0 0   # ignored
v 1 1 0
  v\t0 \\
   1 0
vt 0 0
usemtl skin
f 1/1 2/1 3/1 4/1
v 9 9 9
o Eye
v 0 0 5
usemtl white
f 1 2 -1
"""


@pytest.fixture
def obj(tmp_path):
    (tmp_path / "face.mtl").write_text("newmtl skin\nKd 0.5 1 0\nNs 3\nnewmtl white\nKd 1\nnewmtl odd\nKd x y z\n")
    path = tmp_path / "face.obj"
    path.write_bytes(OBJ.replace("\n", "\r\n").encode())
    return path


# -- OBJ in -----------------------------------------------------------------------------------------------------
def test_an_obj_file(obj):
    avatar = load_avatar(obj)
    assert (avatar.kind, avatar.mesh.parts, avatar.mesh.materials) == ("obj", ("Head", "Eye"), ("skin", "white"))
    assert avatar.colours == {"skin": (127.5, 255.0, 0.0), "white": (255.0, 255.0, 255.0)}
    np.testing.assert_array_equal(avatar.mesh.vertices[[3, 4]], [[0, 1, 0], [9, 9, 9]])       # unused ones stay
    assert (dict(avatar.shapes), dict(avatar.notes), avatar.vertex_colours) == ({}, {}, None)
    digest = avatar.digest
    obj.write_bytes(obj.read_bytes() + b"\n")
    assert load_avatar(obj).digest != digest


@pytest.mark.parametrize("line", ["gone.mtl", "../face.mtl", "/etc/passwd", "", "my face.mtl", "face.mtl more.mtl"])
def test_material_libraries(tmp_path, obj, line):
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "my face.mtl").write_text("newmtl skin\nKd 0 0 1\n")
    (tmp_path / "in" / "more.mtl").write_text("newmtl skin\nKd 0 1 0\n")
    path = tmp_path / "in" / "a.obj"
    path.write_text(OBJ.replace("face.mtl", line))
    known = {"my face.mtl": {"skin": (0, 0, 255)}, "face.mtl more.mtl": {"skin": (0, 255, 0)}}
    assert load_avatar(path).colours == known.get(line, {})


# -- GLB out ----------------------------------------------------------------------------------------------------
def test_an_obj_file_becomes_a_glb(obj, tmp_path):
    avatar = load_avatar(obj)
    shape = np.arange(18.0).reshape(6, 3)
    path = save_avatar(avatar, tmp_path / "a.glb", {"smile": shape}, notes={"a": np.float64(1), "b": np.ones(2)})
    back = load_avatar(path)
    rows = [0, 1, 2, 3, 0, 1, 5]            # a node a part: shared vertices stand in both, unused ones in none
    np.testing.assert_allclose(back.mesh.vertices, avatar.mesh.vertices[rows])
    np.testing.assert_allclose(back.shapes["smile"], shape[rows])
    assert (back.mesh.parts, back.mesh.materials) == (("Head", "Eye"), ("skin", "white"))
    assert back.colours["skin"] == pytest.approx(avatar.colours["skin"])
    assert back.notes == {"a": 1.0, "b": [1.0, 1.0]}
    found, _ = gltfs.parts_of(path)
    skin = found["materials"][0]
    assert skin["doubleSided"]
    assert skin["pbrMetallicRoughness"]["metallicFactor"] == 0
    assert skin["pbrMetallicRoughness"]["baseColorFactor"] == pytest.approx([*to_linear([127.5, 255, 0]), 1])
    assert [node["name"] for node in found["nodes"]] == ["Head", "Eye"]


def test_the_same_avatar_makes_the_same_bytes(obj, tmp_path):
    avatar = load_avatar(obj)
    one, two = (save_avatar(avatar, tmp_path / name, {"a": np.ones((6, 3))}) for name in ("a.glb", "b.glb"))
    assert one.read_bytes() == two.read_bytes()


def test_quantised_motion_of_any_unit(tmp_path):
    for size in (0.2, 250.0):
        mesh = Mesh.of(size * VERTICES, FACES)
        shape = 0.3 * size * np.roll(VERTICES, 1, axis=1)
        path = save_avatar(AvatarFile(tmp_path / "x", "ply", mesh), tmp_path / "a.glb", {"a": shape}, quantise=True)
        back = load_avatar(path)
        np.testing.assert_allclose(back.mesh.vertices, mesh.vertices, rtol=1e-6, atol=1e-6 * size)
        assert np.abs(back.shapes["a"] - shape).max() < 2 * np.abs(shape).max() / 65534 * 1.01
        plain = save_avatar(AvatarFile(tmp_path / "x", "ply", mesh), tmp_path / "b.glb", {"a": shape})
        assert path.stat().st_size < plain.stat().st_size


def test_smooth_normals_across_parts_and_in_a_soup(tmp_path):
    soup = Mesh.of(VERTICES[FACES].reshape(-1, 3), np.arange(3 * len(FACES)).reshape(-1, 3))
    path = save_avatar(AvatarFile(tmp_path / "x.stl", "stl", soup), tmp_path / "a.glb", {})
    found, data = gltfs.parts_of(path)
    accessor = found["accessors"][found["meshes"][0]["primitives"][0]["attributes"]["NORMAL"]]
    start = found["bufferViews"][accessor["bufferView"]].get("byteOffset", 0) + accessor.get("byteOffset", 0)
    normals = np.frombuffer(data, "<f4", 3 * accessor["count"], start).reshape(-1, 3)
    assert np.einsum("ni,ni->n", normals, soup.vertices).min() > 0.98


def test_a_rigged_glb_keeps_its_notes_unless_new_ones_come(tmp_path):
    avatar = load_avatar(gltfs.write(tmp_path / "a.glb", *gltfs.plain()))
    first = load_avatar(save_avatar(avatar, tmp_path / "b.glb", {}, notes={"version": 1}))
    assert load_avatar(save_avatar(first, tmp_path / "c.glb", {})).notes == {"version": 1}
    assert load_avatar(save_avatar(first, tmp_path / "c.glb", {}, notes={"x": 2})).notes == {"x": 2}


@settings(deadline=None, max_examples=40)
@given(st.floats(0, 255))
def test_colours_go_there_and_back(value):
    assert to_srgb(to_linear(value)) == pytest.approx(value, abs=1e-4)


# -- OBJ sequence -----------------------------------------------------------------------------------------------
def test_an_obj_sequence_keeps_every_other_character(obj, tmp_path):
    avatar = load_avatar(obj)
    shape = np.zeros((6, 3))
    shape[[1, 3]] = [[0, 0.25, 0], [1, 1, 1]]
    folder = save_avatar(avatar, tmp_path / "out", {"smile": shape, "nothing": 0 * shape})
    assert sorted(p.name for p in folder.iterdir()) == ["neutral.obj", "nothing.obj", "smile.obj"]
    assert (folder / "neutral.obj").read_bytes() == (folder / "nothing.obj").read_bytes() == obj.read_bytes()
    before, after = obj.read_bytes().split(b"\r\n"), (folder / "smile.obj").read_bytes().split(b"\r\n")
    assert after[4] == b"v 1.50000000 0.25000000 0.00000000   # ignored"
    assert after[6:8] == [b"  v\t1.00000000 \\", b"   2.00000000 1.00000000"]
    assert [i for i, (a, b) in enumerate(zip(before, after, strict=True)) if a != b] == [4, 6, 7]
    moved = load_avatar(folder / "smile.obj").mesh
    np.testing.assert_allclose(moved.vertices, avatar.mesh.vertices + shape, atol=1e-7)
    np.testing.assert_array_equal(moved.faces, avatar.mesh.faces)


@pytest.mark.parametrize("name", ["cage", "soft"])
def test_shipped_meshes_as_sequences(tmp_path, name):
    avatar = load_avatar(meshes_dir() / "akimoto" / f"{name}.obj")
    shape = np.random.default_rng(0).normal(size=avatar.mesh.vertices.shape)
    folder = save_avatar(avatar, tmp_path / "out", {"a": shape})
    np.testing.assert_allclose(load_avatar(folder / "a.obj").mesh.vertices, avatar.mesh.vertices + shape, atol=1e-5)
    assert (folder / "neutral.obj").read_bytes() == avatar.path.read_bytes()


def test_other_files_become_plain_obj_sequences(tmp_path):
    avatar = load_avatar(gltfs.write(tmp_path / "a.glb", *gltfs.seams()))
    shape = np.ones_like(avatar.mesh.vertices)
    folder = save_avatar(avatar, tmp_path / "out", {"a": shape})
    found = load_avatar(folder / "a.obj")
    np.testing.assert_allclose(found.mesh.vertices, avatar.mesh.vertices + 1, atol=1e-7)
    assert found.mesh.parts == ("Cube", "Head")


def test_a_folder_with_other_files_is_not_harmed(obj, tmp_path):
    folder = tmp_path / "out"
    folder.mkdir()
    (folder / "mine.txt").write_text("mine")
    (folder / "smile.obj").write_text("old")
    save_avatar(load_avatar(obj), folder, {"smile": np.ones((6, 3))})
    assert (folder / "mine.txt").read_text() == "mine"
    assert load_avatar(folder / "smile.obj").mesh.vertices[0, 0] == 1
    assert [p.name for p in tmp_path.iterdir() if ".part" in p.name] == []


def test_an_obj_sequence_that_fails_leaves_nothing(obj, tmp_path, monkeypatch):
    real, calls = os.replace, []

    def fail(*args):
        calls.append(args)
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", fail)
    with pytest.raises(FileError, match="No space left"):
        save_avatar(load_avatar(obj), tmp_path / "out", {"a": np.ones((6, 3))})
    monkeypatch.setattr(os, "replace", real)
    assert calls
    assert sorted(p.name for p in tmp_path.iterdir()) == ["face.mtl", "face.obj"]


@pytest.mark.parametrize(("names", "words"), [
    (["a/b"], "'a/b' cannot be the name of a file"), (["..",], "cannot be"), (["CON"], "cannot be"),
    (["a", "A"], "'a' and 'A' would be the same file"), (["x" * 200], "cannot be"), (["a:b"], "cannot be"),
    (["Neutral"], "neutral.obj is the avatar in rest")])
def test_names_that_are_no_file_names(obj, tmp_path, names, words):
    with pytest.raises(InputError, match=words):
        save_avatar(load_avatar(obj), tmp_path / "out", {name: np.ones((6, 3)) for name in names})
    assert not (tmp_path / "out").exists()


# -- NPZ --------------------------------------------------------------------------------------------------------
def test_numpy_arrays(obj, tmp_path):
    avatar = load_avatar(obj)
    path = save_avatar(avatar, tmp_path / "a.npz", {"AU1+4_L": np.full((6, 3), 0.1), "é": np.ones((6, 3))},
                       notes={"version": 1})
    with np.load(path) as found:
        assert set(found) == {"neutral", "faces", "names", "deltas", "notes"}
        assert found["names"].tolist() == ["AU1+4_L", "é"]
        assert (found["deltas"].dtype, found["deltas"].shape) == (np.float32, (2, 6, 3))
        np.testing.assert_array_equal(found["neutral"], avatar.mesh.vertices)
        np.testing.assert_array_equal(found["faces"], avatar.mesh.faces)
        assert json.loads(str(found["notes"])) == {"version": 1}


# -- PLY and STL ------------------------------------------------------------------------------------------------
PLY = """ply
format ascii 1.0
element vertex 5
property float x
property float y
property float z
property uchar red
property uchar green
property uchar blue
element face 2
property list uchar int vertex_indices
end_header
0 0 0 255 0 0
1 0 0 0 255 0
1 1 0 0 0 255
0 1 0 9 9 9
5 5 5 1 2 3
3 0 1 2
4 0 1 2 3
"""


def test_a_ply_file_keeps_its_vertices(tmp_path):
    (tmp_path / "a.ply").write_text(PLY)
    avatar = load_avatar(tmp_path / "a.ply")
    assert avatar.kind == "ply"
    np.testing.assert_array_equal(avatar.mesh.vertices, [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [5, 5, 5]])
    assert sorted(map(sorted, avatar.mesh.faces.tolist())) == [[0, 1, 2], [0, 1, 2], [0, 2, 3]]
    np.testing.assert_array_equal(avatar.vertex_colours[:2], [[255, 0, 0], [0, 255, 0]])
    back = load_avatar(save_avatar(avatar, tmp_path / "a.glb", {"a": np.ones((5, 3))}))
    np.testing.assert_allclose(back.vertex_colours, avatar.vertex_colours[:4], atol=0.01)


@pytest.mark.parametrize("binary", [True, False])
def test_an_stl_file_is_a_soup(tmp_path, binary):
    import trimesh

    ball = trimesh.Trimesh(VERTICES, FACES, process=False)
    ball.export(tmp_path / "a.stl", file_type="stl" if binary else "stl_ascii")
    avatar = load_avatar(tmp_path / "a.stl")
    np.testing.assert_allclose(avatar.mesh.vertices[avatar.mesh.faces], VERTICES[FACES], atol=1e-6)
    assert len(avatar.mesh.vertices) == 3 * len(FACES)


@pytest.mark.parametrize(("name", "content", "words"), [
    ("a.ply", b"", "is empty"), ("a.stl", b"", "is empty"), ("a.ply", b"ply\nnonsense", "cannot be read as a PLY"),
    ("a.ply", PLY.replace("vertex 5", "vertex 99999999999").encode(), "says that it has 99999999999 of 'vertex'"),
    ("a.ply", PLY.replace("3 0 1 2", "3 0 1 77").encode(), "faces refer to vertices|cannot be read"),
    ("a.ply", PLY.replace("0 0 0 255", "nan 0 0 255").encode(), "vertices are NaN or infinite, the first is number 0"),
    ("a.ply", PLY.partition("element face")[0].encode() + b"end_header\n" + b"0 0 0 1 1 1\n" * 5, "no triangles"),
    ("a.stl", b"x" * 80 + b"\xff\xff\xff\xff" + b"y" * 50, "4,294,967,295 triangles"),
    ("a.stl", b"nonsense", "cannot be read as a STL|no triangles"),
])
def test_broken_scans(tmp_path, name, content, words):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(FileError, match=words):
        load_avatar(tmp_path / name)


def test_scans_without_trimesh(tmp_path, monkeypatch):
    (tmp_path / "a.ply").write_text(PLY)
    real = builtins.__import__

    def without(name, *args, **kwargs):
        if name == "trimesh":
            raise ImportError(name)
        return real(name, *args, **kwargs)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(InputError, match=r'pip install "facegen\[avatars\]"'):
        load_avatar(tmp_path / "a.ply")


@settings(deadline=None, max_examples=60)
@given(st.sampled_from([("a.ply", PLY.encode()), ("a.obj", OBJ.encode()), ("a.stl", None)]),
       st.lists(st.tuples(st.floats(0, 1), st.integers(0, 255)), max_size=8), st.floats(0.2, 1))
def test_random_damage_of_scans(tmp_path_factory, sample, flips, cut):
    name, raw = sample
    if raw is None:
        raw = bytes(80) + (2).to_bytes(4, "little") + np.arange(26, dtype="<f4").tobytes()[:100]
    raw = bytearray(raw)
    for place, value in flips:
        raw[min(int(place * len(raw)), len(raw) - 1)] = value
    path = tmp_path_factory.mktemp("damage") / name
    path.write_bytes(raw[:int(cut * len(raw))])
    with suppress(FacegenError):
        assert len(load_avatar(path).mesh.faces)


# -- wrong arguments --------------------------------------------------------------------------------------------
@pytest.mark.parametrize(("shapes", "words"), [
    ({"a": np.ones((5, 3))}, r"'a' has shape \(5, 3\), expected \(6, 3\)"),
    ({"a": np.full((6, 3), np.nan)}, "'a' is NaN or infinite at 6 vertices"),
    ({"a": "x"}, "'a' is no array of numbers"), ({" ": np.ones((6, 3))}, "expected names, got ' '"),
    ({7: np.ones((6, 3))}, "expected names, got 7")])
@pytest.mark.parametrize("name", ["b.glb", "b.npz", "b"])
def test_wrong_shapes(obj, tmp_path, shapes, words, name):
    with pytest.raises(InputError, match=words):
        save_avatar(load_avatar(obj), tmp_path / name, shapes)
    assert not (tmp_path / name).exists()


def test_wrong_notes(obj, tmp_path):
    for notes in ({"a": object()}, {"a": float("nan")}):
        with pytest.raises(InputError, match="notes: cannot be written as JSON"):
            save_avatar(load_avatar(obj), tmp_path / "b.glb", {}, notes=notes)


@pytest.mark.parametrize(("name", "words"), [
    ("b.fbx", r"ends in \.glb, \.vrm, \.gltf, \.npz"), ("gone/b.glb", "does not exist"), ("gone/b", "does not exist"),
    ("file", "is a file, expected a folder"), ("folder.glb", "is a folder, expected a file")])
def test_wrong_places(obj, tmp_path, name, words):
    (tmp_path / "file").write_text("")
    (tmp_path / "folder.glb").mkdir()
    avatar = load_avatar(obj)
    for act in (lambda: save_avatar(avatar, tmp_path / name, {}), lambda: check_output(avatar, tmp_path / name, [])):
        with pytest.raises(FileError, match=words):
            act()


def test_a_file_that_would_be_too_large(obj, tmp_path, monkeypatch):
    from facegen.fileio import gltf_file

    monkeypatch.setattr(gltf_file, "MOST_BYTES", 1000)
    with pytest.raises(InputError, match="at most 1,000 can be read again"):
        save_avatar(load_avatar(obj), tmp_path / "b.glb", {})
    assert not (tmp_path / "b.glb").exists()



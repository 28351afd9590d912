"""Broken and hostile glTF files: a clear FileError that names the place, no hang, little memory, nothing written."""

from __future__ import annotations

import copy
import json
import os
import struct
import tracemalloc
from contextlib import suppress

import gltfs
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from facegen.errors import FacegenError, FileError
from facegen.fileio import gltf_read, gltf_scene, jsontree
from facegen.fileio.avatar import load_avatar, save_avatar


def refuse(tmp_path, raw, words, name="a.glb"):
    path = tmp_path / name
    path.write_bytes(raw)
    with pytest.raises(FileError, match=words) as error:
        load_avatar(path)
    assert str(path) in str(error.value)
    assert len(str(error.value)) < 600


def changed(kind, change):
    """Return a GLB of a kind whose JSON was changed."""
    found, data = gltfs.KINDS[kind]()
    change(found)
    return gltfs.glb(found, data)


def put(*path_and_value):
    """Return a function that sets one place of the JSON."""
    *path, key, value = path_and_value

    def change(found):
        for step in path:
            found = found[step]
        found[key] = value
    return change


GOOD = gltfs.glb(*gltfs.plain())


@pytest.mark.parametrize(("raw", "words"), [
    (b"", "is no GLB file"),
    (b"glTF", "20 bytes at least, got 4"),
    (GOOD[:500], r"says that it has .* bytes, but has 500"),
    (b"glTF" + struct.pack("<II", 1, len(GOOD)) + GOOD[12:], "GLB version 2, got version 1"),
    (GOOD[:12] + struct.pack("<I", 2**32 - 1) + GOOD[16:], "chunk at byte 12 says that it has 4,294,967,295 bytes"),
    (GOOD[:16] + b"JUNK" + GOOD[20:], "first chunk must be JSON"),
    (struct.pack("<III", 0x46546C67, 2, 22) + b"x" * 10, "chunk at byte 12"),
    (gltfs.glb({})[:20] + b"[1] ", "must be an object, got a list of 1"),
], ids=range(8))
def test_containers(tmp_path, raw, words):
    refuse(tmp_path, raw, words)


@pytest.mark.parametrize(("text", "words"), [
    ("", "cannot be read"), ("{", "cannot be read"), ("[1, 2]", "must be an object, got a list of 2"),
    ("{}", "'asset' is missing"), ('{"asset": {"version": "1.0"}}', "reads glTF 2, got '1.0'"),
    ('{"asset": {"version": "2.0"}}', "shows no triangles"),
    ('{"asset": {"version": "2.0"}, "nodes": null}', "nodes: expected a list, got nothing"),
    ('{"asset": {"version": "2.0"}, "nodes": [7]}', r"nodes\[0\]: expected an object, got 7"),
    ('{"asset": NaN}', "NaN is no JSON number"),
    ('{"asset": 1e999}', "1e999 is no JSON number"),
    ('{"asset": ' + "9" * 5000 + "}", "cannot be read"),
    ("[" * 100_000 + "]" * 100_000, "nested too deeply"),
    ('{"asset": {"version": "2.0"}, "nodes": {}}', "expected a list, got an object of 0"),
    ('{"asset": {"version": 2}}', r"asset\.version: expected a text, got 2"),
], ids=range(14))
def test_json_that_makes_no_sense(tmp_path, text, words):
    refuse(tmp_path, text.encode(), words, "a.gltf")


def test_json_bombs(tmp_path, monkeypatch):
    monkeypatch.setattr(jsontree, "MOST_TOKENS", 1000)
    refuse(tmp_path, b'{"asset": [' + b"{}," * 1000 + b"{}]}", "more than 1,000 values", "a.gltf")


@pytest.mark.parametrize(("change", "words"), [
    (put("accessors", 0, "count", 10**12), r"POSITION: more than 5,000,000 vertices"),
    (put("accessors", 0, "count", 1_000_000), r"accessors\[0\]: 1,000,000 elements of 12 bytes .* do not fit"),
    (put("accessors", 0, "count", 0), r"accessors\[0\]\.count: expected a whole number, 1 or more, got 0"),
    (put("accessors", 0, "count", -5), r"accessors\[0\]\.count"),
    (put("accessors", 0, "count", 2.5), r"accessors\[0\]\.count"),
    (put("accessors", 0, "count", True), r"accessors\[0\]\.count.*got true"),
    (put("accessors", 0, "type", "VEC2"), r"POSITION: needs VEC3, but accessor 0 holds VEC2"),
    (put("accessors", 0, "componentType", 5124), r"accessors\[0\]\.componentType: expected one of 5120"),
    (put("accessors", 0, "byteOffset", 10**15), r"accessors\[0\].*do not fit"),
    (put("accessors", 2, "count", 10**12), r"indices: 1,000,000,000,000 indices"),
    (put("accessors", 2, "componentType", 5126), r"accessors\[2\]|unsigned integers"),
    (put("bufferViews", 0, "byteLength", 10**12), r"bufferViews\[0\]: 1,000,000,000,000 bytes .* do not fit"),
    (put("bufferViews", 0, "byteOffset", -1), r"bufferViews\[0\]\.byteOffset"),
    (put("bufferViews", 0, "byteStride", 4), r"accessors\[0\]: its elements of 12 bytes overlap"),
    (put("bufferViews", 0, "byteStride", 10**6), r"byteStride: expected a whole number, 4..252"),
    (put("bufferViews", 0, "buffer", 3), r"bufferViews\[0\]\.buffer: refers to buffer 3; the last is 0"),
    (put("bufferViews", 0, "extensions", {"EXT_meshopt_compression": {}}), r"bufferViews|do not fit|compressed"),
    (put("buffers", 0, "byteLength", 10**9), r"buffers\[0\]\.byteLength: says 1,000,000,000 bytes, but there are"),
    (put("buffers", []), r"refers to buffer 0, but the file has none"),
    (put("meshes", 0, "primitives", 0, "attributes", "POSITION", 99), r"POSITION: refers to accessor 99; the last"),
    (put("meshes", 0, "primitives", 0, "attributes", {}), "shows no triangles"),
    (put("meshes", 0, "primitives", 0, "mode", 9), r"primitives\[0\]\.mode"),
    (put("meshes", 0, "primitives", 0, "material", 0), "refers to material 0, but the file has none"),
    (put("meshes", []), r"nodes\[0\]\.mesh: refers to mesh 0, but the file has none"),
    (put("nodes", 0, "mesh", "0"), r"nodes\[0\]\.mesh: expected a whole number"),
    (put("nodes", 0, "children", [0]), r"nodes\[0\]: is its own ancestor"),
    (put("nodes", 0, "children", [7]), r"nodes\[0\]\.children\[0\]: refers to node 7; the last is 0"),
    (put("nodes", 0, "matrix", [1] * 15), r"nodes\[0\]\.matrix: expected 16 numbers, got a list of 15"),
    (put("nodes", 0, "scale", [1e308, 1e308, 1e308]), r"nodes\[0\]: its transform goes beyond 1e\+30"),
    (put("nodes", 0, "scale", [1e200, 1, "x"]), r"nodes\[0\]\.scale\[2\]: expected a finite number"),
    (put("nodes", 0, "rotation", [0, 0, 0, 0]), r"nodes\[0\]\.rotation: a rotation of length zero"),
    (put("nodes", 0, "skin", 0), r"nodes\[0\]\.skin: refers to skin 0, but the file has none"),
    (put("scene", 5), "scene: refers to scene 5; the last is 0"),
    (put("scenes", 0, "nodes", []), "shows no triangles"),
    (put("extensionsRequired", ["KHR_draco_mesh_compression"]), r"extensionsRequired\[0\]: is compressed with Draco"),
    (put("extensionsRequired", ["EXT_meshopt_compression"]), "compressed with meshopt"),
    (put("extensionsRequired", ["ACME_teapots"]), "cannot read the extension 'ACME_teapots'"),
    (put("extensionsRequired", "x"), "extensionsRequired: expected a list"),
    (put("meshes", 0, "primitives", 0, "extensions", {"KHR_draco_mesh_compression": {"bufferView": 0}}),
     r"meshes\[0\]\.primitives\[0\]: is compressed with Draco"),
])
def test_places_that_are_wrong(tmp_path, change, words):
    refuse(tmp_path, changed("plain", change), words)


def test_a_name_that_utf_8_cannot_hold(tmp_path):
    found, data = gltfs.plain()
    found["nodes"][0]["name"] = "\ud800"
    avatar = load_avatar(gltfs.write(tmp_path / "a.glb", found, data))
    path = save_avatar(avatar, tmp_path / "b.glb", {"a": np.ones_like(avatar.mesh.vertices)})
    assert load_avatar(path).mesh.parts == ("\ud800",)


def test_compressed_views_are_refused_by_name(tmp_path):
    refuse(tmp_path, changed("plain", put("bufferViews", 0, "extensions", {"EXT_meshopt_compression": {"buffer": 0}})),
           r"bufferViews\[0\]: is compressed with meshopt")


@pytest.mark.parametrize(("kind", "change", "words"), [
    ("morphing", put("accessors", 3, "count", 5), r"targets\[0\]\.POSITION: needs 86 elements, but accessor 3 has 5"),
    ("morphing", put("accessors", 5, "sparse", "count", 500), r"sparse\.count: expected a whole number, 1..86"),
    ("morphing", put("accessors", 5, "sparse", "indices", "componentType", 5122), "unsigned integer"),
    ("morphing", put("meshes", 0, "primitives", 0, "targets", 0, 7), r"targets\[0\]: expected an object"),
    ("skin", put("skins", 0, "joints", []), r"skins\[0\]\.joints: a skin needs one joint"),
    ("skin", put("skins", 0, "joints", [0]), r"JOINTS_0: refers to joint 1; the last is 0"),
    ("skin", put("skins", 0, "joints", [0, 1, 2]), "2 matrices for 3 joints"),
    ("skin", put("nodes", 1, "children", [1]), "two parents|ancestor"),
    ("transformed", put("nodes", 2, "children", [0]), "node 0 has two parents"),
    ("shared", put("meshes", 0, "primitives", 0, "indices", 99), "refers to accessor 99"),
    ("seams", put("textures", 0, "source", 5), r"textures\[0\]\.source: refers to image 5"),
    ("seams", put("materials", 0, "pbrMetallicRoughness", "baseColorTexture", "index", -1), "baseColorTexture.index"),
])
def test_more_places(tmp_path, kind, change, words):
    refuse(tmp_path, changed(kind, change), words)


def test_numbers_that_are_none(tmp_path):
    found, data = gltfs.plain()
    for bad in (np.nan, np.inf):
        refuse(tmp_path, gltfs.glb(found, struct.pack("<f", bad) + data[4:]),
               r"accessors\[0\]: holds NaN or infinity in 1 of its elements, the first is number 0")
    start = found["bufferViews"][2]["byteOffset"]
    refuse(tmp_path, gltfs.glb(found, data[:start] + b"\xff\xff" + data[start + 2:]),
           r"indices: 1 indices are past the end, the first is number 0: 65535 of 86 vertices")
    found["nodes"][0].update(scale=[1e30] * 3, translation=[1e30] * 3)
    refuse(tmp_path, gltfs.glb(found, data), r"nodes\[0\]: takes vertices beyond 1e\+30")
    found, data = gltfs.morphing()
    found["nodes"][0].update(scale=[1e30] * 3)
    start = found["bufferViews"][found["accessors"][3]["bufferView"]]["byteOffset"]
    refuse(tmp_path, gltfs.glb(found, data[:start] + struct.pack("<f", 2) + data[start + 4:]),
           r"targets\[0\]\.POSITION: takes vertices beyond")
    found, data = gltfs.skin()
    found["nodes"][1]["scale"] = [1e29] * 3
    start = found["bufferViews"][found["accessors"][5]["bufferView"]]["byteOffset"]
    refuse(tmp_path, gltfs.glb(found, data[:start] + struct.pack("<f", 1e9) + data[start + 4:]),
           r"skins\[0\]: its joints go beyond")


def test_cycles_and_depth(tmp_path):
    found, data = gltfs.plain()
    found["nodes"] += [{"children": [2]}, {"children": [1]}]
    refuse(tmp_path, gltfs.glb(found, data), r"nodes\[1\]: is its own ancestor")
    found["nodes"][1:] = [{"children": [i + 1], "scale": [1, 1, 1]} for i in range(1, 20_000)] + [{"mesh": 0}]
    found["scenes"][0]["nodes"] = [1]
    path = gltfs.write(tmp_path / "deep.glb", found, data)
    assert load_avatar(path).mesh.parts == ("node 20000",)


def test_files_that_show_much_for_little(tmp_path, monkeypatch):
    found, data = gltfs.plain()
    found["nodes"] *= 100
    found["scenes"][0]["nodes"] = list(range(100))
    raw = gltfs.glb(found, data)
    for name, words in (("_MOST_VERTICES", "vertices in all"), ("_MOST_TRIANGLES", "triangles in all"),
                        ("_MOST_PRIMITIVES", "primitives in all")):
        with monkeypatch.context() as patch:
            patch.setattr(gltf_read, name, 80 if name == "_MOST_PRIMITIVES" else 5000)
            refuse(tmp_path, raw, words)
    monkeypatch.setattr(gltf_scene, "_MOST_NODES", 99)
    refuse(tmp_path, raw, "nodes: 100 nodes; facegen reads 99")
    monkeypatch.setattr(gltf_read, "_MOST_MOVES", 100)
    refuse(tmp_path, gltfs.glb(*gltfs.morphing()), "2 morph targets on 86 vertices; facegen reads at most 100")


def test_accessors_without_data_take_little_memory(tmp_path):
    found, data = gltfs.plain()
    for number in (0, 1):
        found["accessors"][number].update(count=4_000_000)
        del found["accessors"][number]["bufferView"]
    found["meshes"][0]["primitives"][0]["targets"] = [{"POSITION": 1}] * 1000
    path = gltfs.write(tmp_path / "a.glb", found, data)
    tracemalloc.start()
    try:
        with pytest.raises(FileError, match="morph targets on 4,000,000 vertices"):
            load_avatar(path)
        assert tracemalloc.get_traced_memory()[1] < 600e6
    finally:
        tracemalloc.stop()
    found["accessors"].append({**found["accessors"][0], "count": 10**9})
    found["meshes"][0]["primitives"][0]["indices"] = 3
    found["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = 3
    refuse(tmp_path, gltfs.glb(found, data), "more than 5,000,000 vertices")


@pytest.mark.parametrize("uri", ["../data.bin", "/etc/passwd", "http://localhost/data.bin", "file:///etc/passwd",
                                 "%2e%2e/data.bin", "a\x00b", "\\\\server\\data.bin", "sub/../../data.bin"])
def test_links_that_lead_away(tmp_path, uri):
    found, data = gltfs.plain()
    (tmp_path / "data.bin").write_bytes(data)
    (tmp_path / "in" / "sub").mkdir(parents=True)
    found["buffers"][0]["uri"] = uri
    refuse(tmp_path / "in", json.dumps(found).encode(), r"buffers\[0\]\.uri: .* leads out of the avatar's folder",
           "a.gltf")


def test_a_link_in_the_file_system_that_leads_away(tmp_path):
    found, data = gltfs.plain()
    (tmp_path / "data.bin").write_bytes(data)
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "data.bin").symlink_to(tmp_path / "data.bin")
    found["buffers"][0]["uri"] = "data.bin"
    refuse(tmp_path / "in", json.dumps(found).encode(), "leads out of", "a.gltf")


@pytest.mark.parametrize(("uri", "words"), [
    ("gone.bin", r"buffers\[0\]\.uri: cannot read .*gone\.bin.*no such file"), ("data:,%00", "truncated"),
    ("data:x;base64,@@@", "cannot be decoded"), ("data:x", "needs a comma"), (".", "it is a folder"), (7, "a text")])
def test_buffers_that_are_not_there(tmp_path, uri, words):
    found, _ = gltfs.plain()
    found["buffers"][0]["uri"] = uri
    refuse(tmp_path, json.dumps(found).encode(), words, "a.gltf")


def test_a_buffer_without_data(tmp_path):
    found, data = gltfs.plain()
    refuse(tmp_path, json.dumps(found).encode(), r"bufferViews\[0\]\.buffer: buffer 0 has no data", "a.gltf")
    found["buffers"].append({"byteLength": 8})
    avatar = load_avatar(gltfs.write(tmp_path / "a.glb", found, data))      # nothing refers to it
    with pytest.raises(FileError, match=r"buffers\[1\]: has no data"):
        save_avatar(avatar, tmp_path / "b.glb", {"a": np.ones_like(avatar.mesh.vertices)})


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes on this system")
def test_a_pipe_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "a.glb")
    with pytest.raises(FileError, match="no regular file"):
        load_avatar(tmp_path / "a.glb")


def test_a_file_that_is_too_large(tmp_path):
    with open(tmp_path / "a.glb", "wb") as file:
        file.truncate((1 << 30) + 1)
    with pytest.raises(FileError, match="1,073,741,825 bytes; facegen reads files of at most"):
        load_avatar(tmp_path / "a.glb")


SAMPLES = [gltfs.glb(*make()) for make in gltfs.KINDS.values()]


@settings(deadline=None, max_examples=150)
@given(st.sampled_from(SAMPLES), st.lists(st.tuples(st.floats(0, 1), st.integers(0, 255)), max_size=12),
       st.booleans(), st.floats(0, 1))
def test_random_damage(tmp_path_factory, sample, flips, cut, where):
    raw = bytearray(sample)
    for place, value in flips:
        raw[min(int(place * len(raw)), len(raw) - 1)] = value
    if cut:
        del raw[int(where * len(raw)):]
    load_and_save(tmp_path_factory, bytes(raw))


VALUES = st.sampled_from([None, -1, 0, 1, 3, 10**9, 10**30, 1.5, 1e300, "x", [], {}, [[]], [0, 0], True, "../x"])


@settings(deadline=None, max_examples=250)
@given(st.sampled_from(list(gltfs.KINDS.values())), st.lists(st.tuples(st.integers(0, 10**6), VALUES), min_size=1,
                                                           max_size=3))
def test_random_json(tmp_path_factory, make, changes):
    found, data = make()
    for number, value in changes:
        places = list(all_places(found))
        if places:
            box, key = places[number % len(places)]
            box[key] = copy.deepcopy(value)
    load_and_save(tmp_path_factory, gltfs.glb(found, data))


@pytest.mark.parametrize("make", [gltfs.morphing, gltfs.vrm])
def test_null_at_every_place(tmp_path_factory, make):
    places = len(list(all_places(make()[0])))
    assert places > 50
    for number in range(places):
        found, data = make()
        box, key = list(all_places(found))[number]
        box[key] = None
        load_and_save(tmp_path_factory, gltfs.glb(found, data))


def all_places(value):
    """Yield every container and key within a JSON value."""
    for key in (list(value) if isinstance(value, dict) else range(len(value)) if isinstance(value, list) else ()):
        yield value, key
        yield from all_places(value[key])


def load_and_save(factory, raw):
    folder = factory.mktemp("damage")
    (folder / "a.glb").write_bytes(raw)
    with suppress(FacegenError):
        avatar = load_avatar(folder / "a.glb")
        shape = np.zeros_like(avatar.mesh.vertices)
        shape[::3] = 0.125
        path = save_avatar(avatar, folder / "b.glb", {"new": shape})
        assert "new" in load_avatar(path).shapes

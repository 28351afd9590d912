"""Morph targets are appended to a glTF file, and everything else stays as it was."""

from __future__ import annotations

import copy
import time

import gltfs
import numpy as np
import pytest
from gltfs import Build, ball, parts_of

from facegen.errors import InputError
from facegen.fileio.avatar import check_output, load_avatar, save_avatar
from facegen.fileio.gltf_normals import TurningNormals
from facegen.geometry.normals import vertex_normals

VERTICES, FACES = ball()
KINDS = list(gltfs.KINDS)


def some_shapes(vertices, seed=0):
    """Return shapes (n, 3): one local, one of all vertices, one that moves nothing."""
    rng = np.random.default_rng(seed)
    size = np.ptp(vertices, axis=0).max()
    few = np.zeros_like(vertices)
    few[::7] = rng.normal(size=few[::7].shape) * 0.05 * size
    return {"few": few, "all": rng.normal(size=vertices.shape) * 0.05 * size, "none": np.zeros_like(vertices)}


def assert_same_shapes(found, expected, size, off=3e-7):
    assert set(found) == set(expected)
    for name, shape in expected.items():
        np.testing.assert_allclose(found[name], shape, atol=off * size, err_msg=name)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("normals", [True, False])
def test_what_is_written_is_read_again(load, tmp_path, kind, normals):
    avatar = load(kind)
    size = np.ptp(avatar.mesh.vertices, axis=0).max()
    shapes = some_shapes(avatar.mesh.vertices)
    back = load_avatar(save_avatar(avatar, tmp_path / "b.glb", shapes, notes={"version": 1}, normals=normals))
    assert_same_shapes(back.shapes, {**avatar.shapes, **shapes}, size)
    np.testing.assert_array_equal(back.mesh.vertices, avatar.mesh.vertices)
    np.testing.assert_array_equal(back.mesh.faces, avatar.mesh.faces)
    assert (back.mesh.parts, back.mesh.materials) == (avatar.mesh.parts, avatar.mesh.materials)
    assert back.notes == {"version": 1}


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "instanced"])
def test_the_rest_of_the_file_stays(load, tmp_path, kind):
    found, data = gltfs.KINDS[kind]()
    avatar = load(found, data)
    after, binary = parts_of(save_avatar(avatar, tmp_path / "b.glb", some_shapes(avatar.mesh.vertices)))
    assert binary.startswith(data)
    after = copy.deepcopy(after)
    for key in ("accessors", "bufferViews"):
        assert after[key][:len(found[key])] == found[key]
        after[key] = found[key]
    for mesh, old in zip(after["meshes"], found["meshes"], strict=True):
        assert mesh["extras"]["targetNames"][:len(old.get("extras", {}).get("targetNames", []))] == \
            old.get("extras", {}).get("targetNames", [])
        before = len(old["primitives"][0].get("targets", []))
        assert mesh["weights"] == old.get("weights", [0] * before) + [0] * (len(mesh["weights"]) - before)
        for primitive, one in zip(mesh["primitives"], old["primitives"], strict=True):
            assert len(primitive["targets"]) == len(mesh["weights"])
            assert primitive["targets"][:before] == one.get("targets", [])
            primitive.pop("targets")
            one.pop("targets", None)
        for one in (mesh, old):
            one.get("extras", {}).pop("targetNames", None)
            one.pop("weights", None)
            if not one.get("extras", True):
                del one["extras"]
    for node in (*after["nodes"], *found["nodes"]):
        node.pop("weights", None)
    for one in (after, found):
        one.pop("buffers")
        one.pop("animations", None)
    assert after == found


def test_nothing_to_write_changes_nothing(load, tmp_path):
    found, data = gltfs.morphing()
    after, binary = parts_of(save_avatar(load(found, data), tmp_path / "b.glb", {}))
    assert binary.startswith(data)
    found["buffers"][0]["byteLength"] = after["buffers"][0]["byteLength"]
    assert after == found


def test_animated_weights_keep_in_step(load, tmp_path):
    avatar = load("morphing")
    path = save_avatar(avatar, tmp_path / "b.glb", some_shapes(avatar.mesh.vertices))
    found, binary = parts_of(path)
    animation = found["animations"][0]
    sampler = animation["samplers"][animation["channels"][0]["sampler"]]
    accessor = found["accessors"][sampler["output"]]
    view = found["bufferViews"][accessor["bufferView"]]
    values = np.frombuffer(binary, "<f4", accessor["count"], view["byteOffset"] + accessor.get("byteOffset", 0))
    np.testing.assert_array_equal(values.reshape(3, 5), [[0, 0, 0, 0, 0], [1, 0.5, 0, 0, 0], [0, 1, 0, 0, 0]])
    assert found["nodes"][0]["weights"] == [0.25, 0, 0, 0, 0]
    assert found["meshes"][0]["weights"] == [0, 0.5, 0, 0, 0]


def test_weights_animated_by_pointer_are_refused(load, tmp_path):
    found, data = gltfs.morphing()
    found["animations"][0]["channels"][0]["target"] = {
        "path": "pointer", "extensions": {"KHR_animation_pointer": {"pointer": "/nodes/0/weights"}}}
    avatar = load(found, data)
    with pytest.raises(InputError, match=r"animations\[0\]\.channels\[0\].*by pointer"):
        save_avatar(avatar, tmp_path / "b.glb", some_shapes(avatar.mesh.vertices))


def test_a_name_of_the_file_is_kept(load, tmp_path):
    avatar = load("morphing")
    mine = {"blink": np.ones_like(avatar.mesh.vertices)}
    for act in (lambda: save_avatar(avatar, tmp_path / "b.glb", mine), lambda: check_output(avatar, "b.glb", mine)):
        with pytest.raises(InputError, match=r"'blink' of its own.*'facegen_blink'"):
            act()
    assert not (tmp_path / "b.glb").exists()
    same = save_avatar(avatar, tmp_path / "b.glb", avatar.shapes)       # the file's own shapes, as they are
    assert parts_of(same)[0]["meshes"] == gltfs.morphing()[0]["meshes"]
    assert check_output(avatar, tmp_path / "b.glb", ["new"]) == tmp_path / "b.glb"


def test_our_own_shapes_are_replaced(load, tmp_path):
    avatar = load("seams")
    shapes = some_shapes(avatar.mesh.vertices)
    first = load_avatar(save_avatar(avatar, tmp_path / "b.glb", shapes))
    only = np.where(np.arange(len(shapes["all"]))[:, None] < 24, 2 * shapes["all"], 0.0)    # of the cube alone
    again = load_avatar(save_avatar(first, tmp_path / "c.glb", {"all": only, "new": shapes["few"]}))
    assert_same_shapes(again.shapes, {**shapes, "all": only, "new": shapes["few"]}, 6.0)


def test_a_mesh_that_nothing_moves_gets_no_targets(load, tmp_path):
    avatar = load("seams")
    shape = np.zeros_like(avatar.mesh.vertices)
    shape[30] = 1.0
    found, _ = parts_of(save_avatar(avatar, tmp_path / "b.glb", {"one": shape, "none": 0 * shape}))
    cube, head = found["meshes"]
    assert "targets" not in cube["primitives"][0]
    assert "extras" not in cube
    assert head["extras"]["targetNames"] == ["one", "none"]


def test_few_moving_vertices_take_few_bytes(load, tmp_path):
    avatar = load("plain")
    shape = np.zeros_like(avatar.mesh.vertices)
    shape[[3, 40]] = [[1, 2, 3], [-1, 0, 0]]
    found, _ = parts_of(save_avatar(avatar, tmp_path / "b.glb", {"one": shape, "all": shape + 1}, normals=False))
    one, everything = (found["accessors"][target["POSITION"]]
                       for target in found["meshes"][0]["primitives"][0]["targets"])
    assert one["sparse"]["count"] == 2
    assert "bufferView" not in one
    assert (one["min"], one["max"]) == ([-1, 0, 0], [1, 2, 3])      # zero is among them
    assert "sparse" not in everything
    assert (everything["min"], everything["max"]) == ([0, 1, 1], [2, 3, 4])


def test_instances_share_a_mesh_only_while_they_move_alike(load, tmp_path):
    avatar = load("instanced")
    n = len(VERTICES)
    motion = np.random.default_rng(3).normal(size=(n, 3))
    alike = {"open": np.concatenate([motion, 2 * motion])}          # the second is twice as large
    path = save_avatar(avatar, tmp_path / "b.glb", alike)
    assert len(parts_of(path)[0]["meshes"]) == 1
    assert_same_shapes(load_avatar(path).shapes, alike, 6.0)
    left = {"open": np.concatenate([motion, 0 * motion])}
    path = save_avatar(avatar, tmp_path / "b.glb", left)
    found = parts_of(path)[0]
    assert [node["mesh"] for node in found["nodes"]] == [0, 1]
    assert "targets" not in found["meshes"][1]["primitives"][0]
    assert found["meshes"][1]["primitives"][0]["attributes"] == found["meshes"][0]["primitives"][0]["attributes"]
    assert_same_shapes(load_avatar(path).shapes, left, 6.0)


def test_quantised_motion_keeps_its_bound(load, tmp_path):
    avatar = load("transformed")
    shapes = some_shapes(0.2 * avatar.mesh.vertices)
    small = save_avatar(avatar, tmp_path / "b.glb", shapes, quantise=True)
    back = load_avatar(small)
    assert parts_of(small)[0]["extensionsRequired"] == ["KHR_mesh_quantization"]
    largest = 4 / (2 * 32767)           # the node stretches by at most 4
    for name, shape in shapes.items():
        assert np.abs(back.shapes[name] - shape).max() <= largest * np.sqrt(3) + 1e-6
    assert np.abs(back.shapes["all"] - shapes["all"]).max() > 0


def test_what_cannot_be_quantised_is_refused(load, tmp_path):
    avatar = load("plain")
    with pytest.raises(InputError, match=r"quantise: 'far' moves node 0 by 1\.5 .*reaches 1 only"):
        save_avatar(avatar, tmp_path / "b.glb", {"far": np.full_like(VERTICES, 1.5)}, quantise=True)
    b = Build()
    b.node(mesh=b.mesh(b.primitive(1e-3 * VERTICES, FACES)))
    with pytest.raises(InputError, match=r"too coarse for an avatar of 0\.002 units"):
        save_avatar(load(*b.result()), tmp_path / "b.glb", {"a": np.full_like(VERTICES, 1e-4)}, quantise=True)
    assert not (tmp_path / "b.glb").exists()


def test_motion_in_a_direction_that_the_file_flattens(load, tmp_path):
    found, data = gltfs.plain()
    found["nodes"][0]["scale"] = [1, 1, 0]
    avatar = load(found, data)
    flat = np.ones_like(VERTICES) * [1, 1, 0]
    back = load_avatar(save_avatar(avatar, tmp_path / "b.glb", {"flat": flat}))
    np.testing.assert_allclose(back.shapes["flat"], flat, atol=1e-6)
    with pytest.raises(InputError, match=r"'out' moves vertex 0 where node 0 .*flattened"):
        save_avatar(avatar, tmp_path / "b.glb", {"out": flat + np.array([0, 0, 1])})
    found["nodes"][0]["scale"] = [0, 0, 0]          # hidden: what cannot be seen cannot move
    found["nodes"].append({"mesh": 0})
    found["scenes"][0]["nodes"].append(1)
    shape = np.ones_like(np.concatenate([VERTICES, VERTICES]))
    back = load_avatar(save_avatar(load(found, data), tmp_path / "b.glb", {"all": shape}))
    np.testing.assert_allclose(back.shapes["all"][len(VERTICES):], 1, atol=1e-6)
    assert not np.any(back.shapes["all"][:len(VERTICES)])


def test_motion_too_far_for_float32(load, tmp_path):
    avatar = load("plain")
    with pytest.raises(InputError, match="farther than float32"):
        save_avatar(avatar, tmp_path / "b.glb", {"far": np.full_like(VERTICES, 1e39)})


def normals_of(path, name):
    """Return the normals of the first mesh with a shape applied, as a viewer has them."""
    avatar_json, binary = parts_of(path)
    primitive = avatar_json["meshes"][0]["primitives"][0]
    target = primitive["targets"][avatar_json["meshes"][0]["extras"]["targetNames"].index(name)]

    def values(index):
        one = avatar_json["accessors"][index]
        result = np.zeros((one["count"], 3))
        if "bufferView" in one:
            view = avatar_json["bufferViews"][one["bufferView"]]
            start = view.get("byteOffset", 0) + one.get("byteOffset", 0)
            result[:] = np.frombuffer(binary, "<f4", 3 * one["count"], start).reshape(-1, 3)
        if "sparse" in one:
            sparse = one["sparse"]
            starts = [avatar_json["bufferViews"][sparse[key]["bufferView"]].get("byteOffset", 0)
                      + sparse[key].get("byteOffset", 0) for key in ("indices", "values")]
            rows = np.frombuffer(binary, "<u2", sparse["count"], starts[0])
            result[rows] = np.frombuffer(binary, "<f4", 3 * sparse["count"], starts[1]).reshape(-1, 3)
        return result

    return values(primitive["attributes"]["NORMAL"]) + values(target["NORMAL"])


def test_normals_follow_a_smooth_surface(load, tmp_path):
    points, faces = ball(48, 32)
    b = Build()
    b.node(mesh=b.mesh(b.primitive(points, faces)))
    avatar = load(*b.result())
    stretched = points * [1, 2, 0.5]
    path = save_avatar(avatar, tmp_path / "b.glb", {"egg": stretched - points})
    expected = points / [1, 2, 0.5]
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    got = normals_of(path, "egg")
    np.testing.assert_allclose(np.linalg.norm(got, axis=1), 1, atol=2e-3)
    assert np.einsum("ni,ni->n", got, expected).min() > 0.999
    mirror = load_avatar(save_avatar(avatar, tmp_path / "c.glb", {"turn": points * [-1, 1, -1] - points}))
    np.testing.assert_allclose(normals_of(mirror.path, "turn")[0], [0, 1, 0], atol=1e-2)


def test_hard_edges_stay_hard(load, tmp_path):
    avatar = load("seams")
    turn = np.array([[0.8, -0.6, 0], [0.6, 0.8, 0], [0, 0, 1]])
    shape = avatar.mesh.vertices @ turn.T - avatar.mesh.vertices
    got = normals_of(save_avatar(avatar, tmp_path / "b.glb", {"turn": shape}), "turn")
    sides = np.repeat([[-1, 0, 0], [1, 0, 0], [0, -1, 0], [0, 1, 0], [0, 0, -1], [0, 0, 1]], 4, axis=0)
    np.testing.assert_allclose(got, sides @ turn.T, atol=1e-3)


def test_turning_normals_agree_with_vertex_normals_on_a_smooth_shape():
    points, faces = ball(64, 48)
    normals = vertex_normals(points, faces)
    weight = np.exp(-8 * ((points - points[700]) ** 2).sum(axis=1))[:, None]
    rows = np.flatnonzero(weight > 0.05)
    motion = (0.2 * weight * [1, 0.5, -0.3])[rows]
    moved = points.copy()
    moved[rows] += motion
    which, change = TurningNormals(points, normals, faces).change(rows, motion)
    expected = vertex_normals(moved, faces) - normals
    assert np.abs(expected).max() > 0.3
    np.testing.assert_allclose(change, expected[which], atol=0.03)      # 2 degrees: other weights, same surface
    assert np.sqrt(((change - expected[which]) ** 2).mean()) < 0.005
    quiet = np.setdiff1d(np.arange(len(points)), which)
    assert np.abs(expected[quiet]).max() < 0.005


def test_a_surface_without_area_keeps_its_normals():
    flat = np.zeros_like(VERTICES)
    up = np.tile([0.0, 1.0, 0.0], (len(flat), 1))
    which, _ = TurningNormals(flat, up, FACES).change(np.arange(len(flat)), VERTICES)
    assert not len(which)
    which, _ = TurningNormals(VERTICES, up, FACES).change(np.arange(len(flat)), -VERTICES)
    assert not len(which)


def test_files_with_normals_of_their_own_in_targets_decide(load, tmp_path):
    found, data = gltfs.morphing()
    with_normals, _ = parts_of(save_avatar(load(found, data), tmp_path / "b.glb", {"new": VERTICES}, normals=False))
    assert [set(one) for one in with_normals["meshes"][0]["primitives"][0]["targets"]] == [{"POSITION", "NORMAL"}] * 3
    for target in found["meshes"][0]["primitives"][0]["targets"]:
        del target["NORMAL"]
    without, _ = parts_of(save_avatar(load(found, data), tmp_path / "b.glb", {"new": VERTICES}))
    assert [set(one) for one in without["meshes"][0]["primitives"][0]["targets"]] == [{"POSITION"}] * 3


def test_meshes_that_cannot_have_targets(load, tmp_path):
    found, data = gltfs.plain()
    found["meshes"][0]["primitives"].append({"attributes": {"COLOR_0": 0}})
    with pytest.raises(InputError, match=r"meshes\[0\]\.primitives\[1\]: has no POSITION"):
        save_avatar(load(found, data), tmp_path / "b.glb", {"new": VERTICES})
    found, data = gltfs.morphing()
    found["meshes"][0]["primitives"].append(copy.deepcopy(found["meshes"][0]["primitives"][0]))
    found["meshes"][0]["primitives"][1]["targets"].pop()
    with pytest.raises(InputError, match="differ in the number of their morph targets"):
        save_avatar(load(found, data), tmp_path / "b.glb", {"new": VERTICES})
    found, data = gltfs.plain()
    found["meshes"][0]["extras"] = 7
    with pytest.raises(InputError, match=r"meshes\[0\]\.extras: expected an object, got 7"):
        save_avatar(load(found, data), tmp_path / "b.glb", {"new": VERTICES})


def test_names_in_primitives_are_kept_in_step(load, tmp_path):
    found, data = gltfs.morphing()
    found["meshes"][0]["primitives"][0]["extras"] = {"targetNames": found["meshes"][0]["extras"].pop("targetNames")}
    after, _ = parts_of(save_avatar(load(found, data), tmp_path / "b.glb", {"new": VERTICES}))
    assert after["meshes"][0]["extras"] == {"more": [1], "targetNames": ["blink", "smile", "new"]}
    assert after["meshes"][0]["primitives"][0]["extras"]["targetNames"] == ["blink", "smile", "new"]


@pytest.mark.parametrize("name", ["b.gltf", "b.glb"])
def test_several_buffers_and_pictures_become_one_file(tmp_path, name):
    found, data = gltfs.seams()
    cut = found["bufferViews"][3]["byteOffset"]
    for view in found["bufferViews"][3:]:
        view.update(buffer=1, byteOffset=view["byteOffset"] - cut)
    found["buffers"] = [{"uri": "one.bin", "byteLength": cut}, {"uri": "two.bin", "byteLength": len(data) - cut}]
    (tmp_path / "in").mkdir()
    picture = found["images"][0].pop("bufferView")
    view = found["bufferViews"][picture]
    (tmp_path / "in" / "face.png").write_bytes(data[cut + view["byteOffset"]:][:view["byteLength"]])
    found["images"] = [{"uri": "face.png", "name": "face"}, {"uri": "gone.png"}]
    (tmp_path / "in" / "one.bin").write_bytes(data[:cut])
    (tmp_path / "in" / "two.bin").write_bytes(data[cut:])
    (tmp_path / "in" / "a.gltf").write_text(gltfs.json.dumps(found))
    avatar = load_avatar(tmp_path / "in" / "a.gltf")
    shapes = some_shapes(avatar.mesh.vertices)
    back = load_avatar(save_avatar(avatar, tmp_path / name, shapes))
    assert_same_shapes(back.shapes, shapes, 6.0)
    np.testing.assert_array_equal(back.mesh.vertices, avatar.mesh.vertices)
    np.testing.assert_allclose(back.vertex_colours, avatar.vertex_colours)
    assert len(back.source.file.json["buffers"]) == 1
    assert back.source.file.json["images"][1] == {"uri": "gone.png"}
    assert "uri" not in back.source.file.json["images"][0]


def test_further_chunks_of_a_glb_stay(tmp_path):
    found, data = gltfs.plain()
    rest = gltfs.struct.pack("<II", 4, 0x12345678) + b"abcd"
    (tmp_path / "a.glb").write_bytes(gltfs.glb(found, data, rest))
    path = save_avatar(load_avatar(tmp_path / "a.glb"), tmp_path / "b.glb", {"new": VERTICES})
    assert path.read_bytes().endswith(rest)


def test_vrm_expressions(load, tmp_path):
    avatar = load("vrm", name="a.vrm")
    shapes = {"viseme_aa": VERTICES * 0.1, "sadness": VERTICES * 0.2}
    path = save_avatar(avatar, tmp_path / "b.vrm", shapes, expressions={
        "aa": {"viseme_aa": 1.0}, "sad": {"sadness": 0.8, "blink": 0.2, "viseme_aa": 0}, "happy": {"sadness": 1},
        "grumpy": {"sadness": 0.5}})
    found, _ = parts_of(path)
    groups = found["extensions"]["VRMC_vrm"]["expressions"]
    assert found["meshes"][0]["extras"]["targetNames"] == ["blink", "smile", "viseme_aa", "sadness"]
    assert groups["preset"]["aa"]["morphTargetBinds"] == [{"node": 0, "index": 2, "weight": 1.0}]
    assert groups["preset"]["sad"]["morphTargetBinds"] == [{"node": 0, "index": 3, "weight": 0.8},
                                                           {"node": 0, "index": 0, "weight": 0.2}]
    assert groups["preset"]["sad"]["overrideMouth"] == "block"              # what its author said stays
    assert groups["preset"]["happy"] == gltfs.vrm()[0]["extensions"]["VRMC_vrm"]["expressions"]["preset"]["happy"]
    assert groups["custom"]["grumpy"]["morphTargetBinds"] == [{"node": 0, "index": 3, "weight": 0.5}]
    again = save_avatar(load_avatar(path), tmp_path / "c.vrm", {}, expressions={"aa": {"sadness": 1.0}})
    groups = parts_of(again)[0]["extensions"]["VRMC_vrm"]["expressions"]
    assert groups["preset"]["aa"]["morphTargetBinds"] == [{"node": 0, "index": 3, "weight": 1.0}]    # ours: replaced


def test_wrong_expressions(load, tmp_path):
    avatar = load("vrm")
    for wrong, words in (({"aa": {"blnk": 1}}, "'blnk'.*did you mean 'blink'"), ({"aa": {"blink": 2}}, "must be 0..1"),
                         ({"": {}}, "expected a name"), ({"aa": 1}, "expected a name"),
                         ({"aa": {"blink": True}}, "must be 0..1")):
        with pytest.raises(InputError, match=words):
            save_avatar(avatar, tmp_path / "b.vrm", {}, expressions=wrong)
    plain = save_avatar(load("plain"), tmp_path / "b.glb", {"new": VERTICES}, expressions={"aa": {"new": 1}})
    assert "extensions" not in parts_of(plain)[0]           # no VRM: nothing to write them to


def test_100_shapes_are_written_quickly(load, tmp_path):
    points, faces = ball(160, 80)
    b = Build()
    b.node(mesh=b.mesh(b.primitive(points, faces)))
    avatar = load(*b.result())
    assert len(avatar.mesh.faces) > 25_000
    rng = np.random.default_rng(0)
    shapes = {}
    for i in range(100):
        weight = np.exp(-8 * ((points - points[rng.integers(len(points))]) ** 2).sum(axis=1))
        shapes[f"s{i}"] = np.where(weight > 0.01, weight, 0)[:, None] * [0.1, 0.1, 0]
    start = time.perf_counter()
    save_avatar(avatar, tmp_path / "b.glb", shapes)
    assert time.perf_counter() - start < 10         # 0.4 s; this only catches a loop over vertices

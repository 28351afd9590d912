"""glTF files of every make are read as what they show."""

from __future__ import annotations

import json
import time

import gltfs
import numpy as np
import pytest
from gltfs import I8, I16, U8, U16, Build, ball

from facegen.errors import FileError
from facegen.fileio.avatar import load_avatar

VERTICES, FACES = ball()


def volume(mesh):
    """Return six times the volume inside: positive if the triangles are seen counter-clockwise from outside."""
    a, b, c = mesh.vertices[mesh.faces].transpose(1, 0, 2)
    return float(np.einsum("ni,ni->n", a, np.cross(b, c)).sum())


@pytest.mark.parametrize("name", ["a.glb", "a.vrm", "a.gltf"])
def test_a_plain_mesh(load, name):
    avatar = load("plain", name=name)
    np.testing.assert_allclose(avatar.mesh.vertices, VERTICES, atol=1e-7)
    np.testing.assert_array_equal(avatar.mesh.faces, FACES)
    assert (avatar.kind, avatar.mesh.parts, avatar.mesh.materials) == \
        ("gltf" if name.endswith("gltf") else "glb", ("Ball",), ("default",))
    assert (dict(avatar.colours), avatar.vertex_colours, dict(avatar.shapes), dict(avatar.notes)) == ({}, None, {}, {})
    assert len(avatar.digest) == 64


def test_nodes_place_their_meshes_and_mirrors_keep_the_outside_out(load):
    avatar = load("transformed")
    turn = np.array([[0.28, -0.96, 0], [0.96, 0.28, 0], [0, 0, 1]])         # quaternion 0, 0, 0.6, 0.8
    child = VERTICES * [0.5, 2, -1] @ turn.T
    parent = np.array([[0, 0, 2], [0, 2, 0], [-2, 0, 0]])
    np.testing.assert_allclose(avatar.mesh.vertices, child @ parent.T + [1, 2, 3], atol=1e-6)
    assert avatar.mesh.parts == ("Child",)                                  # the hidden one is not shown
    assert volume(avatar.mesh) > 0


def test_primitives_that_share_vertices_have_them_once(load):
    avatar = load("shared")
    assert len(avatar.mesh.vertices) == len(VERTICES) + 4 + 2               # the fan's and the points' stay
    np.testing.assert_array_equal(avatar.mesh.faces[:len(FACES)], FACES)
    np.testing.assert_array_equal(avatar.mesh.faces[len(FACES):] - len(VERTICES), [[0, 1, 2], [0, 2, 3]])
    assert set(avatar.mesh.materials) == {"default", "red"}
    assert avatar.colours == {"red": pytest.approx((255, 0, 0))}


def test_a_strip_keeps_its_turn(load):
    b = Build()
    points = b.points([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [0, 2, 0]])
    b.node(mesh=b.mesh({"attributes": {"POSITION": points}, "mode": 5}))
    mesh = load(*b.result()).mesh
    a, b_, c = mesh.vertices[mesh.faces].transpose(1, 0, 2)
    assert mesh.parts == ("node 0",)
    np.testing.assert_array_equal(np.cross(b_ - a, c - a)[:, 2], [1, 1, 1])


def test_instances_stand_once_for_each_node(load):
    avatar = load("instanced")
    expected = np.concatenate([VERTICES + np.array([2, 0, 0]), 2 * VERTICES - [2, 0, 0]])
    np.testing.assert_allclose(avatar.mesh.vertices, expected, atol=1e-6)
    assert avatar.mesh.parts == ("Eye_L", "Eye_R")


@pytest.mark.parametrize(("kind", "size", "off"), [("interleaved", 1, 1e-7), ("quantised", 3, 5e-5)])
def test_ways_to_store_positions(load, kind, size, off):
    avatar = load(kind)
    np.testing.assert_allclose(avatar.mesh.vertices, size * VERTICES, atol=off)
    np.testing.assert_array_equal(avatar.mesh.faces, FACES)


def test_sparse_positions_over_a_bufferview_and_over_nothing(load):
    b = Build()
    base = b.points(VERTICES)
    b.json["accessors"][base]["sparse"] = {
        "count": 2, "indices": {"bufferView": b.view(np.array([3, 7], "<u2").tobytes()), "componentType": U16},
        "values": {"bufferView": b.view(np.array([[9, 8, 7], [6, 5, 4]], "<f4").tobytes())}}
    nothing = b.points(VERTICES, sparse=[5, 6, 20])
    corners = b.accessor(FACES.ravel(), U16)
    b.node(mesh=b.mesh({"attributes": {"POSITION": base}, "indices": corners},
                       {"attributes": {"POSITION": nothing}, "indices": corners}))
    vertices = load(*b.result()).mesh.vertices
    first, second = VERTICES.astype("f4").astype(float), np.zeros_like(VERTICES)
    first[[3, 7]] = [[9, 8, 7], [6, 5, 4]]
    second[[5, 6, 20]] = VERTICES[[5, 6, 20]]
    np.testing.assert_allclose(vertices, np.concatenate([first, second]), atol=1e-6)


@pytest.mark.parametrize(("kind", "largest"), [(I8, 127), (I16, 32767), (U8, 255), (U16, 65535)])
def test_normalised_integers(load, kind, largest):
    b = Build()
    low = -largest - 1 if kind in (I8, I16) else 0
    points = b.points([[largest, 0, 0], [0, largest, 0], [low, 0, largest]], kind=kind, normalised=True)
    b.node(mesh=b.mesh({"attributes": {"POSITION": points}}))
    np.testing.assert_array_equal(load(*b.result()).mesh.vertices,
                                  [[1, 0, 0], [0, 1, 0], [-1 if low else 0, 0, 1]])


def test_a_skin_in_rest(load):
    found, data = gltfs.skin()
    plain = load(found, data).mesh.vertices
    found["nodes"][3].update(translation=[5, 6, 7], rotation=[1, 0, 0, 0])  # must not count for a skinned mesh
    np.testing.assert_array_equal(load(found, data).mesh.vertices, plain)

    turn = np.array([[0.28, 0, 0.96], [0, 1, 0], [-0.96, 0, 0.28]])         # quaternion 0, 0.6, 0, 0.8
    bend = np.array([[0.28, -0.96, 0], [0.96, 0.28, 0], [0, 0, 1]])
    hips = 2 * VERTICES @ turn.T
    head = 2 * ((VERTICES - [0, 0.5, 0]) @ bend.T + [0, 1, 0]) @ turn.T
    upper = np.clip(VERTICES[:, 1:2] + 0.5, 0, 1)
    np.testing.assert_allclose(plain, hips * (1 - upper) + head * upper, atol=1e-6)


def test_morph_targets_dense_and_sparse(load):
    avatar = load("morphing")
    assert list(avatar.shapes) == ["blink", "smile"]
    np.testing.assert_allclose(avatar.shapes["blink"], np.where(VERTICES[:, 1:2] > 0.5, [0, 0.3, 0], 0), atol=1e-7)
    np.testing.assert_allclose(avatar.shapes["smile"], np.where(VERTICES[:, :1] > 0.9, [0.2, 0, 0], 0), atol=1e-7)
    np.testing.assert_allclose(avatar.mesh.vertices, VERTICES, atol=1e-7)   # the default weights are no part of rest


def test_names_of_morph_targets(load):
    found, data = gltfs.morphing()
    mesh = found["meshes"][0]
    names = mesh["extras"].pop("targetNames")
    assert list(load(found, data).shapes) == ["Face:target_0", "Face:target_1"]
    mesh["primitives"][0]["extras"] = {"targetNames": names}
    assert list(load(found, data).shapes) == names
    mesh["extras"]["targetNames"] = ["a", "a"]
    assert list(load(found, data).shapes) == ["a", "a#1"]
    mesh["extras"]["targetNames"] = ["", 7]
    assert list(load(found, data).shapes) == ["Face:target_0", "Face:target_1"]


def test_targets_turn_with_their_node(load):
    found, data = gltfs.morphing()
    found["nodes"][0].update(rotation=[0, 0, 0.6, 0.8], scale=[2, 2, 2], translation=[1, 1, 1])
    up = load(found, data).shapes["blink"]
    np.testing.assert_allclose(np.unique(up.round(6), axis=0), [[-0.576, 0.168, 0], [0, 0, 0]], atol=1e-6)


def test_names_that_are_used_twice_differ(load):
    b = Build()
    mesh = b.mesh(b.primitive(VERTICES, FACES, material=0), b.primitive(VERTICES, FACES, material=1))
    b.json["materials"] = [{"name": "m"}, {"name": "m"}]
    b.node(mesh=mesh, name="eye")
    b.node(mesh=mesh, name="eye")
    mesh = load(*b.result()).mesh
    assert (mesh.parts, mesh.materials) == (("eye", "eye#1"), ("m", "m#1"))


def test_colours_of_a_texture(load):
    avatar = load("seams")
    x = avatar.mesh.vertices[24:, 0] - 4
    np.testing.assert_allclose(avatar.vertex_colours[24:][x > 1e-6], [[20, 60, 180]] * int((x > 1e-6).sum()), atol=1)
    np.testing.assert_allclose(avatar.vertex_colours[24:][x < 0], [[200, 150, 120]] * int((x < 0).sum()), atol=1)
    np.testing.assert_allclose(avatar.vertex_colours[:24], 255)
    red, _, blue = avatar.colours["two"]
    assert 20 < red < 200
    assert 120 < blue < 180


def textured(picture, places, factor=(1, 1, 1, 1), **texture):
    b = Build()
    primitive = {"attributes": {"POSITION": b.points([[0, 0, 0], [1, 0, 0], [0, 1, 0]]),
                                "TEXCOORD_0": b.accessor(places)}, "material": 0}
    b.json.update(images=[{"bufferView": b.view(picture), "mimeType": "image/png"}],
                  textures=[{"source": 0, "sampler": 0}], samplers=[{}],
                  materials=[{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0, **texture},
                                                       "baseColorFactor": list(factor)}}])
    b.node(mesh=b.mesh(primitive))
    return b


def test_a_texture_is_looked_up_between_its_texels_and_repeats(load):
    picture = gltfs.png([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [255, 255, 255]]])
    at = [[0.25, 0.25], [-0.25, 1.25], [0.25, 0.75]]
    np.testing.assert_allclose(load(*textured(picture, at).result()).vertex_colours,
                               [[255, 0, 0], [0, 255, 0], [0, 0, 255]], atol=1e-4)
    half = 255 * (1.055 * 0.5 ** (1 / 2.4) - 0.055)         # half the light
    got = load(*textured(picture, [[0.5, 0.25], [0, 0.25], [0.25, 0.5]]).result()).vertex_colours
    np.testing.assert_allclose(got, [[half, half, 0], [half, half, 0], [half, 0, half]], atol=1e-4)
    for wrap, expected in ((33071, [255, 0, 0]), (33648, [255, 0, 0]), (10497, [0, 255, 0])):
        b = textured(picture, [[-0.25, 0.25]] * 3)
        b.json["samplers"][0]["wrapS"] = wrap
        np.testing.assert_allclose(load(*b.result()).vertex_colours[0], expected, atol=1e-4)
    moved = textured(picture, at, extensions={"KHR_texture_transform": {"offset": [0.5, 0]}})
    np.testing.assert_allclose(load(*moved.result()).vertex_colours[0], [0, 255, 0], atol=1e-4)
    dark = load(*textured(picture, at, factor=(0.5, 1, 1, 1)).result())
    np.testing.assert_allclose(dark.vertex_colours[0], [half, 0, 0], atol=1e-4)


def test_a_picture_that_cannot_be_read_is_no_error(load):
    avatar = load(*textured(b"\x89PNG\r\n\x1a\nnot really", [[0, 0]] * 3).result())
    assert (avatar.colours, avatar.vertex_colours) == ({}, None)
    b = textured(b"x", [[0, 0]] * 3)
    b.json["images"] = [{"uri": "../../secret.png"}]
    assert load(*b.result()).vertex_colours is None


def test_vertex_colours(load):
    b = Build()
    primitive = b.primitive(VERTICES, FACES)
    primitive["attributes"]["COLOR_0"] = b.accessor(np.tile([0, 65535, 0, 65535], (len(VERTICES), 1)), U16,
                                                    normalised=True)
    b.node(mesh=b.mesh(primitive))
    np.testing.assert_allclose(load(*b.result()).vertex_colours, np.tile([0, 255, 0], (len(VERTICES), 1)))


def test_buffers_beside_the_file(tmp_path):
    found, data = gltfs.morphing()
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "my data.bin").write_bytes(data)
    found["buffers"][0]["uri"] = "sub/my%20data.bin"
    path = tmp_path / "a.gltf"
    path.write_text(json.dumps(found))
    avatar = load_avatar(path)
    np.testing.assert_allclose(avatar.mesh.vertices, VERTICES, atol=1e-7)
    (tmp_path / "sub" / "my data.bin").write_bytes(data[:-1] + b"\x01")
    assert load_avatar(path).digest != avatar.digest


def test_50_000_vertices_are_read_quickly(load):
    vertices, faces = ball(320, 160)
    b = Build()
    normals = b.accessor(vertices, target=34962)
    b.node(mesh=b.mesh({"attributes": {"POSITION": b.points(vertices), "NORMAL": normals},
                        "indices": b.accessor(faces.ravel(), gltfs.U32)}))
    found, data = b.result()
    start = time.perf_counter()
    assert len(load(found, data).mesh.vertices) > 50_000
    assert time.perf_counter() - start < 3          # 0.05 s; this only catches a loop over vertices


def test_a_file_of_another_kind(tmp_path):
    (tmp_path / "a.fbx").write_bytes(b"x")
    with pytest.raises(FileError, match=r"ends in \.obj, .*got \.fbx"):
        load_avatar(tmp_path / "a.fbx")
    with pytest.raises(FileError, match="there is no such file"):
        load_avatar(tmp_path / "none.glb")
    (tmp_path / "folder.glb").mkdir()
    with pytest.raises(FileError, match="it is a folder"):
        load_avatar(tmp_path / "folder.glb")



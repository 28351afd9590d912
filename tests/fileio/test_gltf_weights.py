"""Animations of weights: read in every interpolation, written beside what was there, and read again."""

from __future__ import annotations

import copy
from contextlib import suppress

import gltfs
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import CubicHermiteSpline
from scipy.spatial.transform import Rotation

from facegen.errors import FileError, InputError
from facegen.fileio.avatar import load_avatar, save_animated
from facegen.fileio.gltf_animate import Keys, quaternions
from facegen.fileio.gltf_neck import Neck
from facegen.fileio.gltf_weights import read_weight_animation

NAMES = ["blink", "smile"]


def face(b, names=NAMES, node="Face", **more):
    """Add a ball with morph targets and return its node."""
    vertices, faces = gltfs.ball()
    primitive = b.primitive(vertices, faces)
    primitive["targets"] = [{"POSITION": b.points(0.1 * (k + 1) * vertices)} for k in range(len(names))]
    return b.node(mesh=b.mesh(primitive, extras={"targetNames": names}), name=node, **more)


def animated(b, node, times, values, interpolation=None, kind=gltfs.FLOAT, path="weights", name=None, **more):
    """Add an animation of one channel."""
    sampler = {"input": b.accessor(times, bounds=True), "output": b.accessor(values, kind, **more)}
    if interpolation:
        sampler["interpolation"] = interpolation
    b.json.setdefault("animations", []).append({
        "samplers": [sampler], "channels": [{"sampler": 0, "target": {"node": node, "path": path}}],
        **({"name": name} if name else {})})


@pytest.fixture
def write(tmp_path):
    def write(b, name="a.glb"):
        return gltfs.write(tmp_path / name, *b.result())
    return write


def test_linear(write):
    b = gltfs.Build()
    animated(b, face(b), [0, 0.5, 2], [0, 1, 0.25, 0.5, 1, 0], name="take")
    found = read_weight_animation(write(b))
    assert (found.name, found.names, found.turn, found.warnings) == ("take", ("blink", "smile"), None, ())
    np.testing.assert_array_equal(found.times, [0, 0.5, 2])
    np.testing.assert_array_equal(found.weights, [[0, 1], [0.25, 0.5], [1, 0]])


def test_steps_stand_until_just_before_the_next_key(write):
    b = gltfs.Build()
    animated(b, face(b, ["blink"]), [0.25, 1, 2], [0, 1, 0.5], "STEP")
    found = read_weight_animation(write(b))
    for t, expected in ((0.25, 0), (0.9999, 0), (1, 1), (1.9999, 1), (2, 0.5)):
        assert np.interp(t, found.times, found.weights[:, 0]) == pytest.approx(expected, abs=1e-9), t
    assert len(found.times) == 5


@given(st.lists(st.floats(-2, 2, width=32), min_size=9, max_size=9), st.floats(0.0625, 4, width=32))
def test_cubic_splines_are_cut_finely_enough(tmp_path_factory, numbers, length):
    b = gltfs.Build()
    values = np.array(numbers, np.float32).reshape(3, 3)             # in, value, out at each of three keys
    times = np.array([0, length, 2.5 * length], np.float32)
    animated(b, face(b, ["blink"]), times, values.ravel(), "CUBICSPLINE")
    path = gltfs.write(tmp_path_factory.mktemp("cubic") / "a.glb", *b.result())
    found = read_weight_animation(path)
    at = np.linspace(0, times[-1], 701)
    t, k = times.astype(float), values.astype(float)
    for a in (0, 1):
        oracle = CubicHermiteSpline(t[a:a + 2], k[a:a + 2, 1], [k[a, 2], k[a + 1, 0]])
        inside = at[(at >= t[a]) & (at <= t[a + 1])]
        np.testing.assert_allclose(np.interp(inside, found.times, found.weights[:, 0]), oracle(inside), atol=1.1e-4)


@pytest.mark.parametrize(("kind", "most"), [(gltfs.U8, 255), (gltfs.U16, 65535), (gltfs.I16, 32767)])
def test_normalised_integers(write, kind, most):
    b = gltfs.Build()
    wanted = np.array([0, 0.25, 1, 0.5, 0.75, 0])
    animated(b, face(b), [0, 1, 2], np.rint(wanted * most), kind=kind, normalised=True)
    np.testing.assert_allclose(read_weight_animation(write(b)).weights.ravel(), wanted, atol=0.6 / most)


def test_sparse_values(write):
    b = gltfs.Build()
    animated(b, face(b), [0, 1, 2], [0, 0, 0.5, 0, 0, 0], sparse=[2])
    np.testing.assert_array_equal(read_weight_animation(write(b)).weights, [[0, 0], [0.5, 0], [0, 0]])


def test_several_nodes_on_times_of_their_own(write):
    b = gltfs.Build()
    one, other, odd = face(b, node="Head"), face(b, ["smile", "jaw"], node="Teeth"), face(b, ["blink"], node="Lashes")
    animated(b, one, [0, 2], [0, 0, 1, 1])
    animated(b, other, [0, 1, 2], [0, 1, 0.5, 0, 1, 1])
    animated(b, odd, [0, 2], [0, 0.5])
    channels = b.json["animations"]
    for k, more in enumerate(channels[1:], 1):
        channels[0]["samplers"] += more["samplers"]
        channels[0]["channels"].append({**more["channels"][0], "sampler": k})
    del channels[1:]
    found = read_weight_animation(write(b))
    assert found.names == ("blink", "smile", "jaw")
    np.testing.assert_array_equal(found.times, [0, 1, 2])
    np.testing.assert_allclose(found.weights, [[0, 0, 1], [0.5, 0.5, 0], [1, 1, 1]])
    assert found.warnings == ("blink: moves otherwise on Lashes than on Head, whose weights are read",)


def test_which_animation(write):
    b = gltfs.Build()
    node = face(b)
    animated(b, node, [0, 1], [[0, 0, 0], [1, 1, 1]], path="translation", name="walk")
    animated(b, node, [0, 1], [0, 0, 1, 1], name="talk")
    animated(b, node, [0, 1], [0, 0, 0, 1], name="laugh")
    path = write(b)
    first = read_weight_animation(path)
    assert first.name == "talk"
    assert first.warnings == ("of 2 animations with weights, talk is read; the others: laugh",)
    assert read_weight_animation(path, "laugh").weights[1].tolist() == [0, 1]
    assert read_weight_animation(path, 2).name == "laugh"
    for wanted, words in (("laughs", "did you mean 'laugh'"), ("walk", "has no animation 'walk' with weights"),
                          (0, "expected one of 1, 2")):
        with pytest.raises(InputError, match=words):
            read_weight_animation(path, wanted)


def test_by_pointer(write):
    b = gltfs.Build()
    node = face(b)
    animated(b, node, [0, 1], [0, 0, 1, 0.5])
    for pointer in (f"/nodes/{node}/weights", "/meshes/0/weights"):
        found = copy.deepcopy(b.json["animations"][0]["channels"][0])
        found["target"] = {"path": "pointer", "extensions": {"KHR_animation_pointer": {"pointer": pointer}}}
        b.json["animations"][0]["channels"] = [found]
        b.json["extensionsUsed"] = ["KHR_animation_pointer"]
        np.testing.assert_array_equal(read_weight_animation(write(b)).weights, [[0, 0], [1, 0.5]])


def broken(change):
    b = gltfs.Build()
    animated(b, face(b), [0, 1, 2], [0, 0, 1, 1, 0, 0])
    change(b.json["animations"][0], b)
    return b


@pytest.mark.parametrize(("change", "words"), [
    (lambda a, b: a["samplers"][0].update(interpolation="WOBBLE"), "expected LINEAR, STEP, CUBICSPLINE"),
    (lambda a, b: a["samplers"][0].update(interpolation="CUBICSPLINE"), "expected 18 elements for 3 keys of 2 numbers"),
    (lambda a, b: a["samplers"][0].update(output=b.accessor([0, 1])), "expected 6 elements"),
    (lambda a, b: a["samplers"][0].update(output=b.accessor(np.zeros((6, 3)))), "needs SCALAR"),
    (lambda a, b: a["samplers"][0].update(input=b.accessor([0, 2, 1])), "ascending seconds"),
    (lambda a, b: a["samplers"][0].update(input=b.accessor([-1, 0, 1])), "ascending seconds"),
    (lambda a, b: a["samplers"][0].update(input=b.accessor([0, 1, np.nan])), "NaN"),
    (lambda a, b: a["samplers"][0].update(input=99), "refers to accessor 99"),
    (lambda a, b: a["channels"][0].update(sampler=7), "refers to sampler 7"),
    (lambda a, b: a["channels"][0]["target"].update(node=7), "refers to node 7"),
    (lambda a, b: a["channels"].append(a["channels"][0]), "another channel of this animation animates already"),
    (lambda a, b: a["channels"][0].pop("target"), "'target' is missing"),
    (lambda a, b: a.update(channels="x"), "expected a list"),
    (lambda a, b: b.json["nodes"][0].pop("mesh"), "animates no weights of morph targets"),
    (lambda a, b: b.json["meshes"][0]["primitives"][0].pop("targets"), "animates no weights of morph targets"),
    (lambda a, b: a["channels"][0]["target"].update(path="rotation"), "no animation of morph target weights"),
    (lambda a, b: b.json.pop("animations"), "no animation of morph target weights"),
])
def test_hostile_files(write, change, words):
    with pytest.raises(FileError, match=words):
        read_weight_animation(write(broken(change)))


@given(st.integers(0, 60), st.binary(min_size=1, max_size=3))
def test_damaged_bytes_are_told_or_read(tmp_path_factory, place, junk):
    b = gltfs.Build()
    animated(b, face(b), [0, 1, 2], [0, 0, 1, 1, 0, 0], "STEP")
    path = gltfs.write(tmp_path_factory.mktemp("junk") / "a.glb", *b.result())
    raw = bytearray(path.read_bytes())
    at = len(raw) * place // 61
    raw[at:at + len(junk)] = junk
    path.write_bytes(raw)
    with suppress(InputError):
        assert np.isfinite(read_weight_animation(path).weights).all()


# -- written ------------------------------------------------------------------------------------------------------
def keys(names, count=4, turn=False, seed=0):
    rng = np.random.default_rng(seed)
    turns = Rotation.from_euler("yxz", rng.uniform(-30, 30, (count, 3)), degrees=True).as_matrix() if turn else None
    return Keys("take", np.arange(count) / 8, tuple(names), rng.uniform(0, 1, (count, len(names))), turns,
                np.zeros((count, 3)) if turn else None)


def test_what_is_written_is_read(tmp_path):
    avatar = load_avatar(gltfs.write(tmp_path / "a.glb", *gltfs.morphing()))
    wanted = keys(["smile"])
    path, turned = save_animated(avatar, tmp_path / "b.glb", wanted)
    assert not turned
    found = read_weight_animation(path, "take")
    np.testing.assert_allclose(found.times, wanted.times, atol=1e-7)
    np.testing.assert_allclose(found.weights[:, found.names.index("smile")], wanted.weights[:, 0], atol=1e-7)
    assert (found.weights[:, found.names.index("blink")] == 0.25).all()         # the node's own weight


def test_everything_else_stays(tmp_path):
    source = gltfs.write(tmp_path / "a.glb", *gltfs.morphing())
    path, _ = save_animated(load_avatar(source), tmp_path / "b.glb", keys(["blink", "smile"]))
    before, data = gltfs.parts_of(source)
    after, more = gltfs.parts_of(path)
    assert more[:len(data) - len(data) % 4].startswith(data.rstrip(b"\0"))
    for key in ("nodes", "meshes", "scenes", "asset"):
        assert before[key] == after[key]
    for key in ("accessors", "bufferViews", "animations"):
        assert after[key][:len(before[key])] == before[key]
    again, _ = save_animated(load_avatar(path), tmp_path / "c.glb", keys(["blink"]))
    assert [one.get("name") for one in gltfs.parts_of(again)[0]["animations"]] == [None, "take", "take 2"]


@pytest.mark.parametrize("kind", ["plain", "instanced", "transformed", "shared", "seams", "quantised"])
def test_an_added_neck_moves_nothing_at_rest_and_turns_as_it_should(tmp_path, kind):
    b = gltfs.KINDS[kind]()
    avatar = load_avatar(gltfs.write(tmp_path / "a.glb", *b))
    vertices = avatar.mesh.vertices
    weight = np.clip((vertices[:, 1] - vertices[:, 1].min()) / np.ptp(vertices[:, 1]), 0, 1)
    pivot = vertices.mean(axis=0)
    wanted = keys([], turn=True)
    path, turned = save_animated(avatar, tmp_path / "b.glb", wanted, neck=Neck(pivot, weight))
    assert turned
    rest = load_avatar(path)
    np.testing.assert_allclose(rest.mesh.vertices, vertices, atol=1e-5 * np.ptp(vertices))
    found, _ = gltfs.parts_of(path)
    joint = found["animations"][-1]["channels"][0]["target"]["node"]
    turn = wanted.turn[2]
    found["nodes"][joint]["rotation"] = quaternions(wanted.turn)[2].tolist()
    posed = load_avatar(gltfs.write(tmp_path / "c.glb", found, gltfs.parts_of(path)[1])).mesh.vertices
    at = vertices - pivot
    np.testing.assert_allclose(posed, vertices + weight[:, None] * (at @ turn.T - at), atol=2e-5 * np.ptp(vertices))


def test_a_files_own_head_is_turned_in_the_world(tmp_path):
    b = gltfs.Build()
    vertices, faces = gltfs.ball()
    primitive = b.primitive(vertices, faces)
    primitive["attributes"]["JOINTS_0"] = b.accessor(np.zeros((len(vertices), 4)), gltfs.U8, target=34962)
    primitive["attributes"]["WEIGHTS_0"] = b.accessor(np.tile([1.0, 0, 0, 0], (len(vertices), 1)), target=34962)
    head = b.node(root=False, name="mixamorig:Head", rotation=[0, 0.6, 0, 0.8], translation=[0, 1, 0])
    b.node(name="Spine", rotation=[0.6, 0, 0, 0.8], children=[head])
    b.json["skins"] = [{"joints": [head]}]
    b.node(mesh=b.mesh(primitive), skin=0, name="Ball")
    avatar = load_avatar(gltfs.write(tmp_path / "a.glb", *b.result()))
    wanted = keys([], turn=True)
    path, turned = save_animated(avatar, tmp_path / "b.glb", wanted)
    assert turned
    found, data = gltfs.parts_of(path)
    assert found["animations"][0]["channels"] == [{"sampler": 0, "target": {"node": head, "path": "rotation"}}]
    reader = gltfs.parts_of(path)[0]
    accessor = found["accessors"][found["animations"][0]["samplers"][0]["output"]]
    view = found["bufferViews"][accessor["bufferView"]]
    start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
    own = np.frombuffer(data[start:start + 64], "<f4").reshape(4, 4)
    reader["nodes"][head]["rotation"] = own[1].tolist()
    posed = load_avatar(gltfs.write(tmp_path / "c.glb", reader, data)).mesh.vertices
    pivot = Rotation.from_quat([0.6, 0, 0, 0.8]).apply([0, 1, 0])
    expected = (avatar.mesh.vertices - pivot) @ wanted.turn[1].T + pivot
    np.testing.assert_allclose(posed, expected, atol=1e-5)


@given(st.lists(st.tuples(*[st.floats(-180, 180)] * 3), min_size=1, max_size=8))
def test_quaternions(angles):
    turns = Rotation.from_euler("xyz", angles, degrees=True)
    found = quaternions(turns.as_matrix().reshape(-1, 3, 3))
    np.testing.assert_allclose(Rotation.from_quat(found).as_matrix(), turns.as_matrix().reshape(-1, 3, 3), atol=1e-7)
    assert (np.einsum("ni,ni->n", found[1:], found[:-1]) >= -1e-9).all()


def test_where_it_cannot_be_written(tmp_path):
    avatar = load_avatar(gltfs.write(tmp_path / "a.glb", *gltfs.morphing()))
    with pytest.raises(FileError, match=r"expected a name that ends in \.glb, \.vrm, \.gltf"):
        save_animated(avatar, tmp_path / "a.obj", keys(["smile"]))
    with pytest.raises(FileError, match="does not exist"):
        save_animated(avatar, tmp_path / "no" / "a.glb", keys(["smile"]))

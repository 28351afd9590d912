"""Hostile files: none hangs, none takes the memory, none runs anything, and each is told of."""

from __future__ import annotations

import io
import json
import pickle
import struct
import sys
import time

import numpy as np
import pytest

import facegen
from facegen.animation.performance import Performance
from facegen.errors import FileError, InputError
from facegen.fileio.avatar import load_avatar
from facegen.fileio.obj import format_obj
from facegen.geometry.mesh import Mesh
from facegen.studio import apart, reading
from facegen.studio.counting import triangles
from facegen.studio.limits import Limits
from facegen.studio.reading import read_avatar_safely, read_recording_safely
from facegen.studio.task import Stopped
from facegen.transfer.rig import avatar_files, avatar_names

LIMITS = Limits(read_seconds=20.0, read_bytes=1 << 30)
AVATAR = {"triangles": LIMITS.triangles}
RECORDING = {"fps": None, "person": None, "seconds": LIMITS.recorded_seconds, "frames": LIMITS.frames,
             "numbers": LIMITS.numbers, "clean": {}}


def _glb(scene: dict, binary: bytes = b"", *, length: int | None = None) -> bytes:
    text = json.dumps(scene).encode()
    text += b" " * (-len(text) % 4)
    binary += bytes(-len(binary) % 4)
    body = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(binary), 0x004E4942) + binary
    return struct.pack("<4sII", b"glTF", 2, 12 + len(body) if length is None else length) + body


def _scene(count: int, *, size: int = 36, nodes: int = 1) -> dict:
    return {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": list(range(nodes))}],
            "nodes": [{"mesh": 0} for _ in range(nodes)], "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
            "accessors": [{"bufferView": 0, "componentType": 5126, "count": count, "type": "VEC3"}],
            "bufferViews": [{"buffer": 0, "byteLength": size}], "buffers": [{"byteLength": size}]}


@pytest.fixture(scope="module")
def shipped():
    return avatar_files("cat", None)[0]


def test_a_good_file_is_read_as_ever(shipped):
    found, known = read_avatar_safely(shipped), load_avatar(shipped)
    np.testing.assert_array_equal(found.mesh.vertices, known.mesh.vertices)
    np.testing.assert_array_equal(found.mesh.faces, known.mesh.faces)
    assert (found.path, found.kind, found.digest) == (known.path, known.kind, known.digest)
    assert found.colours == known.colours
    assert list(found.mesh.parts) == list(known.mesh.parts)


def test_every_kind_is_read(tmp_path, shipped):
    from facegen.fileio.avatar import save_avatar

    known = load_avatar(shipped)
    save_avatar(known, tmp_path / "cat.glb", {"up": np.ones_like(known.mesh.vertices)})
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0.0]])
    (tmp_path / "one.ply").write_text("ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
                                      "property float z\nelement face 1\nproperty list uchar int vertex_indices\n"
                                      "end_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n")
    found = read_avatar_safely(tmp_path / "cat.glb")
    np.testing.assert_allclose(found.shapes["up"], 1.0, atol=1e-6)
    found = reading._avatar(tmp_path / "one.ply", AVATAR)
    np.testing.assert_array_equal(found.mesh.vertices, vertices)


@pytest.mark.parametrize(("name", "content"), [
    ("a.glb", b""), ("a.glb", b"glTF"), ("a.glb", b"\x00" * 100),
    ("a.glb", b"glTF\x02\0\0\0\xff\xff\xff\xff" + b"x" * 40), ("huge.glb", _glb(_scene(2**31))),
    ("lies.glb", _glb(_scene(3), length=2**31)), ("a.gltf", b"[" * 100_000),
    ("a.gltf", b'{"asset": {"version": "2.0"}, "buffers": [{"byteLength": 3, "uri": "../../../../etc/passwd"}]}'),
    ("a.gltf", b'{"asset": {"version": "2.0"}, "buffers": [{"byteLength": 3, "uri": "file:///etc/passwd"}]}'),
    ("a.obj", b"v a b c\nf 1 2 3"), ("a.obj", b"v 0 0 0\nf 1 2 99999999999"), ("a.obj", b"\xff\xfe" * 1000),
    ("a.ply", b"ply\nformat binary_little_endian 1.0\nelement vertex 4000000000\nproperty float x\nend_header\n"),
    ("a.stl", b"\0" * 80 + b"\xff\xff\xff\xff"), ("a.vrm", b"PK\x03\x04"), ("a.exe", b"MZ"),
    ("cyclic.glb", _glb({**_scene(3), "nodes": [{"mesh": 0, "children": [1]}, {"children": [0]}]}))])
def test_broken_files_are_told_of(tmp_path, name, content):
    """By what the other process runs; that it is another one, costs a second each."""
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(FileError) as told:
        reading._avatar(path, AVATAR)
    assert name in str(told.value)
    assert "root:" not in str(told.value)
    assert "\n" not in str(told.value)


def test_triangles_are_counted_before_anything_is_made(tmp_path, monkeypatch):
    """Behind what the files say is nothing, so that only a header can have told."""
    (tmp_path / "a.ply").write_bytes(b"ply\nformat binary_little_endian 1.0\nelement vertex 9\nelement face 9000\nend")
    (tmp_path / "a.stl").write_bytes(b"\0" * 80 + struct.pack("<I", 9000))
    (tmp_path / "a.glb").write_bytes(_glb(_scene(27_000)))
    (tmp_path / "b.glb").write_bytes(_glb(_scene(3, nodes=9000)))
    (tmp_path / "a.obj").write_bytes(b"v 0 0 0\n" + b"f 1 1 1\n" * 9000)
    with pytest.raises(FileError, match="9,000 triangles, the studio takes up to 8,000"):
        read_avatar_safely(tmp_path / "a.glb", Limits(triangles=8000))
    monkeypatch.setattr(reading, "load_avatar", lambda path: pytest.fail("it was read"))
    for name in ("a.ply", "a.stl", "a.glb", "b.glb", "a.obj"):
        assert triangles(tmp_path / name) == 9000
        with pytest.raises(FileError, match="9,000 triangles, the studio takes up to 8,000"):
            reading._avatar(tmp_path / name, {"triangles": 8000})


@pytest.mark.parametrize("name", avatar_names())
def test_what_is_counted_is_what_is_read(name, tmp_path):
    from facegen.fileio.avatar import save_avatar

    path = avatar_files(name, None)[0]
    known = load_avatar(path)
    save_avatar(known, tmp_path / "a.glb", {})
    assert triangles(tmp_path / "a.glb") == len(known.mesh.faces)
    assert triangles(path) <= len(known.mesh.faces)         # polygons of an OBJ file have more


def test_what_takes_too_long_is_ended(tmp_path, monkeypatch):
    """A reader that never ends stands for any file that makes one so."""
    monkeypatch.setattr(apart, "_START", 2.0)
    monkeypatch.setattr(apart, "_PROGRAM", "while True: pass")
    (tmp_path / "a.obj").write_text("v 0 0 0")
    begin = time.monotonic()
    with pytest.raises(FileError, match="within 1 s"):
        read_avatar_safely(tmp_path / "a.obj", Limits(read_seconds=1.0))
    assert time.monotonic() - begin < 15.0


@pytest.mark.skipif(sys.platform != "linux", reason="the bounds are the system's")
@pytest.mark.parametrize(("does", "told"), [
    ("x = bytearray(1 << 30)", "more than 256 MiB"), ("import os; os.abort()", "fail"), ("1 / 0", "ZeroDivisionError"),
    ("open(f'{path}.bad', 'w', 1).write('x\\n')", "OSError"), ("while True: sum(range(10**6))", "within 1 s")])
def test_what_a_reader_does_stays_in_its_process(tmp_path, monkeypatch, does, told):
    (tmp_path / "a.obj").write_text("v 0 0 0")
    body = "\n".join(f"    {line}" for line in does.split("\n"))
    monkeypatch.setattr(apart, "_PROGRAM", apart._PROGRAM.replace(
        "apart.answer(", f"def bad(path, wish):\n{body}\nreading.JOBS['avatar'] = bad\napart.answer("))
    with pytest.raises(FileError, match=told):
        read_avatar_safely(tmp_path / "a.obj", Limits(read_seconds=1.0, read_bytes=256 << 20))


def test_who_waits_can_have_it_ended_at_once(tmp_path, monkeypatch):
    """What the button Stop does: nothing is left running."""
    monkeypatch.setattr(apart, "_PROGRAM", "import sys; sys.stdin.read()\nwhile True: pass")
    processes, told = [], []
    popen = apart.subprocess.Popen
    monkeypatch.setattr(apart.subprocess, "Popen", lambda *args, **options: processes.append(popen(*args, **options))
                        or processes[0])

    def waits(seconds):
        told.append(seconds)
        if len(told) == 3:
            raise Stopped

    for read in (read_avatar_safely, read_recording_safely):
        processes.clear(), told.clear()
        with pytest.raises(Stopped):
            read(tmp_path / "a.obj", LIMITS, waits=waits)
        assert told == sorted(told)
        assert processes[0].poll() is not None


def test_a_face_is_looked_for_in_the_other_process(tmp_path, monkeypatch):
    """It takes ten seconds to a minute; in the studio's own process others waited up to 0.4 s where it was busy."""
    from facegen.landmarking import propose
    from facegen.studio.proposing import Adviser
    from facegen.studio.work import AvatarWork

    path = tmp_path / "half.obj"
    path.write_text(format_obj(facegen.load_face().mesh(0)))
    mesh = load_avatar(path).mesh
    monkeypatch.setattr(propose, "recognise", lambda *_: pytest.fail("it was looked for here"))
    adviser, told = Adviser(mesh, path), []
    advice = adviser.advice(AvatarWork(file="half.obj"), told.append)
    assert advice.sure > 0.9
    assert {"nose_tip", "chin", "mouth_corner_L"} <= set(advice.places)
    assert advice.advised == "eye_outer_L"
    assert adviser.ready
    assert told
    told.clear()
    assert adviser.advice(AvatarWork(file="half.obj"), told.append).sure == advice.sure
    assert not told


def test_who_goes_while_a_face_is_looked_for_leaves_nothing(tmp_path, monkeypatch, shipped):
    from facegen.studio.proposing import Adviser
    from facegen.studio.work import AvatarWork

    def waits(seconds):
        raise Stopped

    adviser = Adviser(load_avatar(shipped).mesh, shipped)
    with pytest.raises(Stopped):
        adviser.advice(AvatarWork(file="cat"), waits)
    assert not adviser.ready
    monkeypatch.setattr(apart, "_PROGRAM", "raise SystemExit(3)")
    advice = adviser.advice(AvatarWork(file="cat"))
    assert "No face could be looked for" in advice.warnings[0]
    assert str(shipped.parent) not in advice.warnings[0]
    assert not advice.places


def test_a_recording_is_read_as_ever(tmp_path):
    path = tmp_path / "take.csv"
    path.write_text("time,jawOpen,who\n0,0,anna\n0.5,1,anna\n1,,bert\n")
    found, known = read_recording_safely(path, LIMITS), facegen.load_performance(path)
    np.testing.assert_array_equal(found.weights, known.weights)
    np.testing.assert_array_equal(found.times, known.times)
    assert (found.names, found.vocabulary, found.warnings, found.about) == (
        known.names, known.vocabulary, known.warnings, known.about)
    assert list(found.extra) == list(known.extra)
    assert list(found.extra["who"]) == ["anna", "anna", "bert"]
    with pytest.raises(InputError, match="has 3 frames, the timeline takes up to 2"):
        read_recording_safely(path, Limits(frames=2))


@pytest.mark.parametrize(("limit", "said"), [
    ({"seconds": 0.5}, "lasts 0.0 hours"), ({"frames": 2}, "has 3 frames"), ({"numbers": 14}, "holds 15 numbers")])
def test_a_recording_of_too_much_is_told_of(tmp_path, limit, said):
    path = tmp_path / "take.csv"
    path.write_text("time,jawOpen,browInnerUp\n0,0,0\n0.5,1,0\n1,0,0\n")
    assert isinstance(reading._recording(path, RECORDING), Performance)
    with pytest.raises(InputError, match=said):
        reading._recording(path, {**RECORDING, **limit})


@pytest.mark.parametrize(("name", "content"), [
    ("a.csv", b""), ("a.csv", b"\0" * 1000), ("a.csv", b"time,jawOpen\nx,y\n"),
    ("a.csv", b"a," * 100_000), ("a.json", b"[" * 100_000), ("a.json", b'{"a": ' * 100_000), ("a.json", b"[1e999]"),
    ("a.glb", b"glTF" + bytes(40)), ("a.glb", _glb(_scene(2**31))), ("a.fgp", b""), ("a.fgp", bytes(1000)),
    ("a.fgp", b"\xff" * 1000)])
def test_broken_recordings_are_told_of(tmp_path, name, content):
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(InputError) as told:
        reading._recording(path, RECORDING)
    assert len(str(told.value)) < 1000


def test_an_answer_is_nothing_but_avatars_and_recordings():
    """The process that read a stranger's file is not trusted either."""
    class Evil:
        def __reduce__(self):
            return (eval, ("__import__('os').getpid()",))

    import os

    for found in (pickle.dumps(Evil()), pickle.dumps(os.system), pickle.dumps(load_avatar),
                  b"cfacegen.fileio.binfile\nread_bytes\n."):
        with pytest.raises(pickle.UnpicklingError, match="no part of an answer"):
            apart.Answers(io.BytesIO(found)).load()
    mesh = Mesh.of(np.eye(3), np.array([[0, 1, 2]]))
    assert isinstance(apart.Answers(io.BytesIO(pickle.dumps(mesh, 5))).load(), Mesh)


def test_a_program_in_the_folder_is_not_run(tmp_path, monkeypatch, shipped):
    (tmp_path / "numpy.py").write_text("raise SystemExit('run')")
    (tmp_path / "json.py").write_text("raise SystemExit('run')")
    monkeypatch.chdir(tmp_path)
    assert read_avatar_safely(shipped).kind == "obj"

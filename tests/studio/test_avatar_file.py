"""Files that a browser sends: kept where they belong, refused in words."""

from contextlib import suppress

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from facegen.errors import FileError, InputError
from facegen.studio import avatar_file
from facegen.studio.avatar_file import (
    FOLDER,
    TAKEN,
    keep,
    keep_colours,
    keep_from,
    lost_colours,
    open_avatar,
    safe_name,
)
from facegen.studio.limits import Limits
from facegen.transfer.rig import avatar_files, avatar_names

pytestmark = pytest.mark.usefixtures("read_here")

TRIANGLE = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
_PLY = (b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
        b"element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n")


@given(st.text(max_size=80), st.sampled_from(TAKEN))
@settings(deadline=None, max_examples=40)
def test_no_name_leads_out_of_the_folder(name, suffix):
    safe = safe_name(name + suffix)
    assert safe.endswith(suffix)
    assert not set(safe) & set("/\\:\0 ")
    assert not safe.startswith(".")
    assert len(safe) < 80
    assert safe_name(safe) == safe


@pytest.mark.parametrize("name", ["cat.exe", "cat", "", "..", ".glb.yaml", "cat.glb/"])
def test_other_files_are_refused(name):
    with pytest.raises(InputError, match="expected an avatar that ends in"):
        safe_name(name)


def test_what_is_kept_is_found_again(tmp_path):
    assert keep(tmp_path, "../../My cat.OBJ", TRIANGLE) == "My_cat.obj"
    assert sorted(path.name for path in (tmp_path / FOLDER).iterdir()) == ["My_cat.obj"]
    found = open_avatar(tmp_path, "My_cat.obj")
    assert len(found.avatar.mesh.faces) == 1
    assert "1 triangles, 1 part" in found.summary
    assert found.output == "My_cat.glb"
    assert open_avatar(tmp_path, "My_cat.obj").avatar is found.avatar
    assert keep(tmp_path, "My cat.obj", TRIANGLE) == "My_cat.obj"
    assert keep(tmp_path, "My cat.obj", TRIANGLE + b"v 0 0 1\nf 1 2 4\n") == "My_cat-2.obj"
    assert len(open_avatar(tmp_path, "My_cat-2.obj").avatar.mesh.faces) == 2
    assert len(open_avatar(tmp_path, "My_cat.obj").avatar.mesh.faces) == 1, "who undoes has the first again"


def test_an_obj_files_colours_come_with_a_file_of_their_own(tmp_path):
    source = avatar_files("cartoon", None)[0]
    opened = open_avatar(tmp_path, keep(tmp_path, "painted.obj", source.read_bytes()))
    assert lost_colours(opened) == "cartoon.mtl"
    with pytest.raises(InputError, match=r"has no colours of painted\.obj, which has them in cartoon\.mtl"):
        keep_colours(tmp_path, opened, "other.mtl", b"")
    with pytest.raises(InputError, match="too large"):
        keep_colours(tmp_path, opened, "cartoon.mtl", bytes(2_000_000))
    keep_colours(tmp_path, opened, "../../cartoon.mtl", source.with_suffix(".mtl").read_bytes())
    again = open_avatar(tmp_path, "painted.obj")
    assert lost_colours(again) is None
    assert again.avatar.colours == open_avatar(tmp_path, "cartoon").avatar.colours
    assert keep(tmp_path, "cartoon.obj", source.read_bytes()) == "cartoon-2.obj", "one of that name ships"
    assert keep(tmp_path, "painted.ply", _PLY) == "painted-2.ply", "both would be rigged into painted.glb"
    copy = tmp_path / "other"
    assert open_avatar(copy, keep_from(copy, source)).avatar.colours == again.avatar.colours


@pytest.mark.parametrize("library", ["../../x.mtl", "/etc/passwd", ".mtl", "a\\..\\b.txt", "work.json"])
def test_a_file_of_colours_lies_beside_its_avatar_wherever_it_says(tmp_path, library):
    opened = open_avatar(tmp_path, keep(tmp_path, "a.obj", f"mtllib {library}\n".encode() + TRIANGLE))
    for name in (library, library.rsplit("/", 1)[-1]):
        with suppress(InputError):
            keep_colours(tmp_path, opened, name, b"newmtl a\n")
    assert {path.parent for path in tmp_path.rglob("*") if path.is_file()} == {tmp_path / FOLDER}
    assert {path.suffix for path in (tmp_path / FOLDER).iterdir()} <= {".obj", ".mtl"}


@pytest.mark.parametrize("name", avatar_names())
def test_shipped_avatars_are_opened_by_name(name, tmp_path):
    assert open_avatar(tmp_path, name).path == avatar_files(name, None)[0]


@pytest.mark.parametrize(("name", "content", "said"), [
    ("a.obj", b"v 0 0 0\n", "triangle|face"),
    ("a.obj", b"v 0 0 0\nv nan 0 0\nv 0 1 0\nf 1 2 3\n", "NaN|finite|number"),
    ("a.obj", b"v 1 1 1\nv 1 1 1\nv 1 1 1\nf 1 2 3\n", "one place"),
    ("a.vrm", TRIANGLE, "vrm"),
    ("a.gltf", b'{"asset": {"version": "2.0"}, "buffers": [{"uri": "../../etc/passwd", "byteLength": 9}]}', "gltf"),
])
def test_hostile_files_are_refused_and_leave_nothing(tmp_path, name, content, said):
    keep(tmp_path, "good.obj", TRIANGLE)
    with pytest.raises(InputError, match=said) as refused:
        keep(tmp_path, name, content)
    assert ".part" not in str(refused.value)
    assert str(tmp_path) not in str(refused.value), "where works are kept is nobody's business"
    assert sorted(path.name for path in (tmp_path / FOLDER).iterdir()) == ["good.obj"]


def test_what_is_too_much_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(avatar_file, "LIMITS", Limits(file_bytes=100, triangles=1))
    with pytest.raises(InputError, match="MB, the studio takes up to"):
        keep(tmp_path, "a.obj", TRIANGLE + b"#" * 100)
    with pytest.raises(InputError, match=r"^a\.obj: has 2 triangles, the studio takes up to 1"):
        keep(tmp_path, "a.obj", TRIANGLE + b"v 0 0 1\nf 1 2 4\n")
    assert not list((tmp_path / FOLDER).iterdir())


def test_a_file_that_went_away_is_said(tmp_path):
    with pytest.raises(FileError, match="open it again"):
        open_avatar(tmp_path, "cat.glb")

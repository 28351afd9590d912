"""The shelf opens what lies in the folders that were named, and nothing else, whatever it is asked for."""

from __future__ import annotations

import os
import shutil
import time
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from facegen.errors import FileError, InputError
from facegen.studio.files import Shelf
from facegen.studio.limits import Limits


@pytest.fixture
def heads(tmp_path):
    """A folder with two avatars, beside a secret."""
    (tmp_path / "heads" / "old").mkdir(parents=True)
    (tmp_path / "heads" / "anna.glb").write_bytes(b"glTF")
    (tmp_path / "heads" / "old" / "bert.OBJ").write_bytes(b"v 0 0 0")
    (tmp_path / "heads" / "notes.txt").write_text("x")
    (tmp_path / "heads" / ".hidden.obj").write_text("x")
    (tmp_path / "secret.obj").write_text("secret")
    (tmp_path / "heads2").mkdir()
    (tmp_path / "heads2" / "near.obj").write_text("x")
    return tmp_path / "heads"


def test_what_lies_there_is_listed_and_found(heads):
    shelf = Shelf([heads])
    assert shelf.names() == ("heads/anna.glb", "heads/old/bert.OBJ")
    assert shelf.names([".glb"]) == ("heads/anna.glb",)
    for name in shelf.names():
        assert shelf.resolve(name).is_file()
    assert Shelf().names() == ()


def test_folders_of_one_name_are_told_apart(heads, tmp_path):
    other = tmp_path / "other" / "heads"
    other.mkdir(parents=True)
    (other / "carl.ply").write_text("ply")
    shelf = Shelf([heads, other, heads])
    assert shelf.names() == ("heads/anna.glb", "heads/old/bert.OBJ", "heads-2/carl.ply")
    assert shelf.resolve("heads-2/carl.ply") == other / "carl.ply"


@pytest.mark.parametrize("name", [
    "", "heads", "heads/", "anna.glb", "/etc/passwd", "heads/../secret.obj", "heads/old/../../secret.obj",
    "../secret.obj", "heads//etc/passwd", "heads/./anna.glb", "heads\\anna.glb", "heads/..\\secret.obj",
    "heads/old\\..\\anna.glb", "C:/secret.obj", "heads/C:secret.obj", "heads/anna.glb\0.obj", "heads/anna.glb\0",
    "heads2/near.obj", "~/secret.obj", "file:///etc/passwd", "heads/%2e%2e/secret.obj", "heads/no.obj",
    "heads/notes.txt", "heads/old", "heads/.", "heads/..", "heads/" + "a/" * 3000 + "x.obj",
    "heads/" + "a" * 5000 + ".obj", "heads/old/", None, 5])
def test_traversal_is_refused(heads, name):
    with pytest.raises((InputError, FileError)):
        Shelf([heads]).resolve(name)


def test_links_are_followed_only_within(heads, tmp_path):
    (heads / "out.obj").symlink_to(tmp_path / "secret.obj")
    (heads / "away").symlink_to(tmp_path)
    (heads / "in.glb").symlink_to(heads / "anna.glb")
    (heads / "round.obj").symlink_to(heads / "round.obj")
    (heads / "up.obj").symlink_to("../secret.obj")
    shelf = Shelf([heads])
    assert shelf.names() == ("heads/anna.glb", "heads/in.glb", "heads/old/bert.OBJ")
    assert shelf.resolve("heads/in.glb") == heads / "anna.glb"
    for name in ("heads/out.obj", "heads/away/secret.obj", "heads/round.obj", "heads/up.obj"):
        with pytest.raises(FileError):
            shelf.resolve(name)


def test_only_regular_files_are_opened(heads):
    os.mkfifo(heads / "pipe.obj")
    (heads / "folder.obj").mkdir()
    (heads / "device.obj").symlink_to("/dev/zero")
    shelf = Shelf([heads])
    assert not {name for name in shelf.names() if "pipe" in name or "device" in name or "folder" in name}
    for name in ("heads/pipe.obj", "heads/folder.obj", "heads/device.obj"):
        with pytest.raises(FileError):
            shelf.resolve(name)


def test_large_files_are_refused(heads):
    with pytest.raises(FileError, match="MiB"):
        Shelf([heads], Limits(file_bytes=3)).resolve("heads/anna.glb")


def test_names_that_are_nearly_right_are_told(heads):
    with pytest.raises(FileError, match="no such file"):
        Shelf([heads]).resolve("heads/ana.glb")
    with pytest.raises(InputError, match=r"did you mean 'heads/anna\.glb'"):
        Shelf([heads]).resolve("head/anna.glb")


def test_a_folder_that_is_none_is_told_of(tmp_path):
    with pytest.raises(FileError, match="is no folder"):
        Shelf([tmp_path / "no"])


@settings(deadline=None)
@given(st.text(alphabet="./\\abe-ﬁ:%~\0 \n", max_size=30))
def test_no_text_leads_out(name):
    root = Path(__file__).parent
    try:
        found = Shelf([root]).resolve(f"{root.name}/{name}", [".py"])
    except (InputError, FileError):
        return
    assert found.is_relative_to(root)


def test_a_page_opens_an_avatar_from_a_folder(tmp_path):
    """From the panel to the work, by the process that reads strangers' files; a name that is none is told of."""
    from fake_client import FakeClient

    from facegen.studio.avatar_panel import AvatarPanel
    from facegen.studio.desk import Desk
    from facegen.studio.page import Page
    from facegen.transfer.rig import avatar_files

    (tmp_path / "heads").mkdir()
    shutil.copy(avatar_files("cat", None)[0], tmp_path / "heads" / "tom.obj")
    (tmp_path / "heads" / "broken.glb").write_bytes(b"glTF")
    page = Page(FakeClient(), "work-of-one", Desk(tmp_path / "works", Shelf([tmp_path / "heads"])),
                {"Avatar": AvatarPanel})
    choice = page.client.gui.find("Or from a folder")
    assert choice.visible
    choice.enter("heads/tom.obj")
    _until(lambda: page.work.avatar.file == "tom.obj")
    _until(lambda: choice.value == "-")
    for name in ("heads/broken.glb", "heads/../../secret.obj"):
        before = len(page.client.notices)
        choice.enter(name)
        _until(lambda before=before: len(page.client.notices) > before)
    assert page.work.avatar.file == "tom.obj"
    page.close()


def test_without_folders_there_is_nothing_to_choose(tmp_path):
    from fake_client import FakeClient

    from facegen.studio.avatar_panel import AvatarPanel
    from facegen.studio.desk import Desk
    from facegen.studio.page import Page

    page = Page(FakeClient(), "work-of-one", Desk(tmp_path), {"Avatar": AvatarPanel})
    assert not page.client.gui.find("Or from a folder").visible
    page.close()


def _until(true, seconds=30.0):
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end
        time.sleep(0.02)

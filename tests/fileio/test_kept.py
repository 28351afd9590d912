"""Arrays kept in a folder: bit for bit, or none at all; never a reason to stop."""

import os
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from facegen.fileio.kept import VARIABLE, Kept, content_key, kept_in

KEY, OTHER, THIRD = (content_key(name) for name in "abc")
ARRAY = np.random.default_rng(0).normal(size=(20, 3))


@pytest.fixture
def kept(tmp_path):
    return Kept(tmp_path / "deep" / "folder")


@pytest.fixture
def file(kept):
    kept.keep(KEY, ARRAY)
    return kept.folder / f"{KEY}.array"


def test_what_was_kept_is_found_bit_for_bit(kept, file):
    found = kept.find(KEY, ARRAY.shape)
    assert found.tobytes() == ARRAY.tobytes()
    found[0] = 0                                    # the caller's own
    assert kept.find(OTHER, ARRAY.shape) is None
    assert kept.find(KEY, (21, 3)) is None
    assert [path.name for path in kept.folder.iterdir()] == [file.name]


def test_no_numbers_are_kept_too(kept):
    kept.keep(KEY, np.empty((0, 3)))
    assert kept.find(KEY, (0, 3)).shape == (0, 3)


@settings(deadline=None)
@given(data=st.data())
def test_a_file_with_any_byte_changed_or_missing_is_none(tmp_path_factory, data):
    kept = Kept(tmp_path_factory.mktemp("kept"))
    kept.keep(KEY, ARRAY)
    file = kept.folder / f"{KEY}.array"
    whole = file.read_bytes()
    at = data.draw(st.integers(0, len(whole) - 1))
    file.write_bytes(whole[:at] + bytes([whole[at] ^ data.draw(st.integers(1, 255))]) + whole[at + 1:])
    assert kept.find(KEY, ARRAY.shape) is None
    file.write_bytes(whole[:at])
    assert kept.find(KEY, ARRAY.shape) is None
    kept.keep(KEY, ARRAY)
    assert np.array_equal(kept.find(KEY, ARRAY.shape), ARRAY)


def test_a_folder_in_the_files_place_is_none(kept, file):
    file.unlink()
    file.mkdir()
    kept.keep(KEY, ARRAY)
    assert kept.find(KEY, ARRAY.shape) is None


def test_where_nothing_can_be_written_nothing_is_kept(tmp_path):
    (tmp_path / "file").write_text("no folder")
    kept = Kept(tmp_path / "file" / "below")
    kept.keep(KEY, ARRAY)
    assert kept.find(KEY, ARRAY.shape) is None
    assert Kept(Path("nul\0byte")).find(KEY, ARRAY.shape) is None
    Kept(Path("nul\0byte")).keep(KEY, ARRAY)


def test_the_longest_unused_go_and_other_files_stay(kept, file):
    kept = Kept(kept.folder, most=2 * file.stat().st_size)
    mine, left = kept.folder / "notes.array", kept.folder / f".{KEY}.array.0123.part"
    for other in (mine, left):
        other.write_bytes(bytes(5000))
    kept.keep(OTHER, ARRAY)
    for age, path in enumerate((left, kept.folder / f"{OTHER}.array", file), start=2):
        os.utime(path, (time.time() - 3600 * age,) * 2)
    assert kept.find(KEY, ARRAY.shape) is not None  # used now: no longer the longest unused
    kept.keep(THIRD, ARRAY)
    assert kept.find(OTHER, ARRAY.shape) is None
    assert kept.find(KEY, ARRAY.shape) is not None
    assert kept.find(THIRD, ARRAY.shape) is not None
    assert mine.exists()
    assert not left.exists()


def test_the_newest_stays_whatever_its_size(kept):
    small = Kept(kept.folder, most=10)
    for key in (KEY, OTHER):
        small.keep(key, ARRAY)
        assert small.find(key, ARRAY.shape) is not None
    assert len(list(kept.folder.iterdir())) == 1


@pytest.mark.parametrize(("system", "variables", "folder"), [
    ("linux", {"XDG_CACHE_HOME": "/a/b"}, "/a/b/facegen"),
    ("linux", {"XDG_CACHE_HOME": "relative"}, "/home/me/.cache/facegen"),
    ("linux", {}, "/home/me/.cache/facegen"),
    ("darwin", {}, "/home/me/Library/Caches/facegen"),
    ("win32", {"LOCALAPPDATA": "/c/local"}, "/c/local/facegen"),
    ("win32", {}, "/home/me/AppData/Local/facegen"),
    ("linux", {"XDG_CACHE_HOME": "/a/b", VARIABLE: "/elsewhere"}, "/elsewhere"),
])
def test_the_folder_is_where_the_system_keeps_such_files(monkeypatch, system, variables, folder):
    for name in ("XDG_CACHE_HOME", "LOCALAPPDATA", VARIABLE):
        monkeypatch.delenv(name, raising=False)
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    monkeypatch.setattr(sys, "platform", system)
    monkeypatch.setattr(Path, "home", lambda: Path("/home/me"))
    assert kept_in("things") == Kept(Path(folder) / "things")


def test_a_user_without_a_home_has_none(monkeypatch):
    def homeless():
        raise RuntimeError("Could not determine home directory.")

    for name in ("XDG_CACHE_HOME", "LOCALAPPDATA", VARIABLE):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(Path, "home", homeless)
    assert kept_in("things") is None


@pytest.mark.parametrize("other", [
    (ARRAY.reshape(3, 20), "x"), (ARRAY.astype("f4"), "x"), (np.nextafter(ARRAY, 9), "x"), (ARRAY, "y"), ("x", ARRAY),
    (ARRAY[:10], ARRAY[10:], "x")])
def test_other_contents_have_other_keys(other):
    assert content_key(*other) != content_key(ARRAY, "x")


def test_how_the_same_numbers_lie_in_memory_does_not_count():
    assert content_key(np.asfortranarray(ARRAY)) == content_key(ARRAY.astype(">f8")) == content_key(ARRAY)

"""A registration is found again while avatar, landmarks and pieces are the same, and only then."""

from pathlib import Path

import numpy as np
import pytest

from facegen.cli import main
from facegen.fileio.kept import VARIABLE
from facegen.transfer import registration_key, skin
from facegen.transfer.rig import rig

CARTOON = Path(__file__).parents[2] / "meshes" / "avatars" / "cartoon"


@pytest.fixture
def rigged(tmp_path, monkeypatch):
    """Return a function that rigs the cartoon: options -> (shapes, whether its skin was registered)."""
    monkeypatch.setenv(VARIABLE, str(tmp_path / "cache"))
    calls, register = [], skin.register

    def counted(*args, **how):
        calls.append(1)
        return register(*args, **how)

    monkeypatch.setattr(skin, "register", counted)
    for name in ("cartoon.obj", "landmarks.yaml"):
        (tmp_path / name).write_bytes((CARTOON / name).read_bytes())

    def make(**how):
        calls.clear()
        made = rig(tmp_path / "cartoon.obj", tmp_path / "out.npz",
                   **{"landmarks": tmp_path / "landmarks.yaml", "sets": ["vrm"], **how})
        return made.found.shapes, bool(calls)

    return make


def same(one, other):
    return one.keys() == other.keys() and all(one[name].tobytes() == other[name].tobytes() for name in one)


def files(folder):
    return list((folder / "cache" / "registrations").iterdir())


def test_the_second_time_gives_the_same_shapes_without_registration(rigged, tmp_path):
    first, registered = rigged()
    assert registered
    again, registered = rigged()
    assert not registered
    assert same(again, first)
    assert not rigged(sets=["visemes"])[1], "only the vocabulary changed"
    assert not rigged(opening=1.2)[1], "the jaw has nothing to do with it"
    assert len(files(tmp_path)) == 1


def test_without_the_cache_nothing_is_kept_nor_found(rigged, tmp_path):
    first, _ = rigged(cache=False)
    assert not (tmp_path / "cache").exists()
    rigged()
    again, registered = rigged(cache=False)
    assert registered
    assert same(again, first)


def test_another_vertex_landmark_or_skin_is_registered_anew(rigged, tmp_path):
    rigged()
    assert not rigged(pieces={"moustache": "skull"})[1], "it is no part of the skin"
    assert rigged(pieces={"collar": "skin"})[1]
    for name, old, new in (("landmarks.yaml", "barycentric: [-0.00000, 0.41619, 0.58381]}",
                            "barycentric: [-0.00000, 0.41620, 0.58380]}"),
                           ("cartoon.obj", "v 0.00000 -1.24968", "v 0.00001 -1.24968")):
        file = tmp_path / name
        text = file.read_text()
        assert old in text
        file.write_text(text.replace(old, new, 1))
        assert rigged()[1], name
        file.write_text(text)
        assert not rigged()[1], name


def test_a_damaged_file_is_made_anew(rigged, tmp_path):
    first, _ = rigged()
    file, = files(tmp_path)
    whole = file.read_bytes()
    for damaged in (whole[:-9], bytes(len(whole))):
        file.write_bytes(damaged)
        again, registered = rigged()
        assert registered
        assert same(again, first)
        assert file.read_bytes() == whole


def test_a_place_that_cannot_be_written_does_not_matter(rigged, tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv(VARIABLE, str(tmp_path / "file"))
    assert rigged()[1]


def test_other_code_or_code_that_cannot_be_read(rigged, monkeypatch):
    rigged()
    monkeypatch.setattr(registration_key, "_code", lambda: "other")
    assert rigged()[1]

    def unreadable():
        raise OSError

    monkeypatch.setattr(registration_key, "_code", unreadable)
    assert rigged()[1]


def test_the_code_that_counts_is_all_that_registers():
    root = Path(registration_key.__file__).parents[1]
    assert all((root / name).is_file() for name in registration_key.CODE)


def test_the_commands_option(tmp_path, monkeypatch):
    monkeypatch.setenv(VARIABLE, str(tmp_path / "cache"))
    assert main(["rig", "cartoon", "-o", str(tmp_path / "a.npz"), "--set", "vrm", "--no-cache", "-q"]) == 0
    assert not (tmp_path / "cache").exists()
    assert main(["rig", "cartoon", "-o", str(tmp_path / "b.npz"), "--set", "vrm", "-q"]) == 0
    assert len(files(tmp_path)) == 1
    one, two = (np.load(tmp_path / name)["deltas"] for name in ("a.npz", "b.npz"))
    assert np.array_equal(one, two)

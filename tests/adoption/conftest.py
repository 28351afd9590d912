"""Heads to adopt: the shipped old man, and the base face itself as if it were somebody's mesh."""

from __future__ import annotations

import pytest
from heads import head_of

from facegen.adoption.adopt import adopt, make_face
from facegen.adoption.write import save_folder
from facegen.face.face import load_face


@pytest.fixture(scope="session")
def base():
    return load_face()


@pytest.fixture(scope="session")
def man(tmp_path_factory):
    """What `adopt` says of the shipped old man, and the face it made."""
    made = adopt("human", tmp_path_factory.mktemp("faces") / "man")
    return made, load_face(made.path)


@pytest.fixture(scope="session")
def self_made(base):
    """The files of the face that the base face's own mesh makes."""
    return make_face(*head_of(base), name="self", origin="a test", hair=True)


@pytest.fixture(scope="session")
def again(self_made, tmp_path_factory):
    """The face that the base face's own mesh makes."""
    return load_face(save_folder(tmp_path_factory.mktemp("faces") / "self", self_made.files))

"""The shipped human, with landmarks that its author set, and what is proposed for it; made once."""

from functools import cache

import pytest

from facegen.fileio.avatar import load_avatar
from facegen.landmarking import propose
from facegen.landmarking.fit import BENT, lay, likeness
from facegen.landmarking.propose import Proposer
from facegen.transfer.alignment import align
from facegen.transfer.landmarks import load_landmarks
from facegen.transfer.rig import avatar_files


def shipped(name):
    """Return a shipped avatar's mesh and its landmarks, name -> place (3,)."""
    path, marks = avatar_files(name, None)
    mesh = load_avatar(path).mesh
    return mesh, load_landmarks(marks, mesh).points(mesh.vertices)


@pytest.fixture(scope="session")
def human():
    mesh, true = shipped("human")
    return Proposer(mesh), true


@pytest.fixture(scope="session")
def avatar():
    """Return a function: name -> a shipped avatar's `Proposer` and landmarks, to which the head's place was told.

    To look for it all round takes seconds, and is tested with the human; here it is about what clicks do then.
    """
    @cache
    def make(name):
        mesh, true = shipped(name)

        def told(head, model):
            start = align(model.rest, true)
            laid = lay(model, head.shown.search, start, {}, BENT)
            return laid, likeness(model, laid, head.shown.search)

        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(propose, "recognise", told)
            proposer = Proposer(mesh)
            proposer.propose({})
        return proposer, true

    return make

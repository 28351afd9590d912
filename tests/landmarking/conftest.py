"""The shipped human, with landmarks that its author set, and what is proposed for it; made once."""

import pytest

from facegen.fileio.avatar import load_avatar
from facegen.landmarking.propose import Proposer
from facegen.transfer.landmarks import load_landmarks
from facegen.transfer.rig import avatar_files


@pytest.fixture(scope="session")
def human():
    path, marks = avatar_files("human", None)
    mesh = load_avatar(path).mesh
    return Proposer(mesh), load_landmarks(marks, mesh).points(mesh.vertices)

import sys
from pathlib import Path

import pytest

from facegen.face.face import load_face

sys.path.insert(0, str(Path(__file__).parent))      # measure.py


@pytest.fixture(scope="session")
def face():
    return load_face()


@pytest.fixture(scope="session")
def paper_face():
    return load_face("akimoto-1986")


@pytest.fixture(scope="session")
def measure(face):
    from measure import Measure

    return Measure(face)

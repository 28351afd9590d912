from __future__ import annotations

import hashlib
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))      # tasks.py, here and in worker processes

# Small and drawn by NumPy: what is tested here is the work, not the picture.
JOBS = {"poses": ["happiness", "6C+12D", "figure-8"], "views": ["0,0", "30,0"], "people": [None, "mika"], "sizes": 48,
        "detail": 0, "renderer": "soft"}


@pytest.fixture
def jobs():
    return dict(JOBS)


@pytest.fixture
def contents():
    """A function that returns path -> digest of all files of a folder."""
    def read(folder: Path) -> dict[str, str]:
        return {path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
                for path in sorted(folder.rglob("*")) if path.is_file()}
    return read


@pytest.fixture(scope="session")
def serial(tmp_path_factory):
    """The folder of a whole data set made in this process."""
    from facegen.jobs.batch import run_batch

    folder = tmp_path_factory.mktemp("serial") / "set"
    run_batch(JOBS, folder, workers=1)
    return folder

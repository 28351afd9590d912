"""The judges: other people's programs, installed where the environment says.

``FACEGEN_JUDGES`` names a folder in which ``npm ci`` has installed this folder's package.json; tests that need it are
skipped without it, unless ``FACEGEN_CI`` is set, where a missing judge is a failure.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from pathlib import Path

import pytest
from rigged import missing, rigged_cartoon

HERE = Path(__file__).parent


@pytest.fixture(scope="session")
def judges() -> Path:
    """The folder with node_modules."""
    folder = os.environ.get("FACEGEN_JUDGES")
    if not folder or not (Path(folder) / "node_modules").is_dir():
        missing("FACEGEN_JUDGES names no folder in which tests/judges/package.json was installed by npm ci")
    if shutil.which("node") is None:
        missing("node is not installed")
    return Path(folder)


@pytest.fixture(scope="session")
def cartoon(tmp_path_factory):
    """A shipped avatar that facegen rigged: its file, the avatar before, and its shapes."""
    return rigged_cartoon(tmp_path_factory.mktemp("cartoon"))


@pytest.fixture
def validate(judges):
    """A function that returns gltf-validator's report of a file."""
    def report(path: Path) -> dict:
        done = subprocess.run(["node", str(HERE / "validate.cjs"), str(judges), str(path)], capture_output=True,
                              text=True, timeout=60, check=False)
        assert done.returncode == 0, done.stderr
        return json.loads(done.stdout)

    return report

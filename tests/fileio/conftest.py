"""glTF files of every kind, written and loaded."""

from __future__ import annotations

import gltfs
import pytest

from facegen.fileio.avatar import load_avatar


@pytest.fixture
def load(tmp_path):
    """A function that loads a glTF file of a kind's name or of JSON and data."""
    def load(kind, data=None, name="a.glb"):
        found, data = gltfs.KINDS[kind]() if isinstance(kind, str) else (kind, data)
        return load_avatar(gltfs.write(tmp_path / name, found, data))
    return load

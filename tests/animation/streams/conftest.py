"""A recording's file from a text."""

from __future__ import annotations

import pytest

from facegen.animation.streams import load_performance


@pytest.fixture
def load(tmp_path):
    """Return a function: the text of a file -> its performance."""
    def read(text, name="r.csv", **how):
        path = tmp_path / name
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return load_performance(path, **how)

    return read

"""The accelerator changes the time, not the shapes: rounding decides nothing on the way."""

import numpy as np
import pytest

from facegen.geometry import factor
from facegen.transfer.rig import avatar_names, rig


@pytest.mark.parametrize("name", avatar_names())
def test_both_solvers_give_the_same_shapes(name, tmp_path, monkeypatch):
    pytest.importorskip("qdldl")
    found = []
    for library in (factor._qdldl, lambda: None):
        monkeypatch.setattr(factor, "_qdldl", library)
        made = rig(name, tmp_path / "a.npz", sets=["units"], cache=False).found
        found.append(made.frame.scale * np.stack(list(made.shapes.values())))       # mm, head-sized
    assert np.abs(found[0] - found[1]).max() < 1e-6

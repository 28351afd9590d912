"""The weights of the energies, as a user gives them."""

import re

import numpy as np
import pytest

from facegen.cli import main
from facegen.errors import FileError, InputError
from facegen.fileio.avatar import load_avatar
from facegen.transfer.baselines import PAPER, PaperWeights
from facegen.transfer.rig import rig
from facegen.transfer.solve import OURS, Weights
from facegen.transfer.weights import read_weights


def test_presets_numbers_and_files_say_the_same(tmp_path):
    assert read_weights(None) is None
    assert read_weights("ours") == OURS
    assert read_weights("paper") == read_weights(PAPER) == PAPER == PaperWeights(1, 100, 10, 1)
    wanted = Weights(gradients=2.0, landmarks=20.0, smooth=0.5, anchor=0.032)
    (tmp_path / "w.yaml").write_text("gradients: 2\nsmooth: 0.5\n")
    assert read_weights("gradients=2, smooth=0.5") == wanted
    assert read_weights({"gradients": 2, "smooth": np.float64(0.5)}) == wanted
    assert read_weights(tmp_path / "w.yaml") == read_weights(str(tmp_path / "w.yaml")) == wanted
    (tmp_path / "w.yml").write_text("preset: paper\nsmooth: 0\n")
    assert read_weights("preset=paper,smooth=0") == read_weights(tmp_path / "w.yml") == PaperWeights(1, 100, 0, 1)


@pytest.mark.parametrize(("what", "message"), [
    ("papre", "weights: expected ours, paper, .* did you mean 'paper'"),
    ("", "weights: expected ours"),
    ("gradient=1", "unknown weight 'gradient'; did you mean 'gradients'"),
    ("preset=paper,anchor=1", "unknown weight 'anchor'.*known: gradients, landmarks, smooth, identity"),
    ("gradients=1,", "expected NAME=NUMBER by commas"),
    ("gradients=1,gradients=2", "gradients is given twice"),
    ("gradients=much", "gradients: expected a number, got 'much'"),
    ("gradients=nan", "gradients: expected a number from 0 to 1e[+]09, got nan"),
    ("gradients=-1", "gradients: expected a number from 0"),
    ("anchor=inf", "anchor: expected a number from 0"),
    ("landmarks=1e12", "landmarks: expected a number from 0"),
    ("gradients=0,landmarks=0,anchor=0", "at least one of gradients, landmarks, anchor above 0"),
    ("gradients=0,landmarks=0,anchor=0,smooth=1", "without them nothing moves"),
    ({"gradients": True}, "gradients: expected a number from 0"),
    ({"gradients": "1"}, "gradients: expected a number from 0"),
    ({"preset": "theirs"}, "preset: expected ours, paper"),
    ({1: 1}, "unknown weight '1'"),
    (Weights(gradients=float("nan")), "gradients: expected a number"),
    (PaperWeights(0, 0, 1, 1), "at least one of gradients, landmarks above 0"),
])
def test_what_is_no_weights_is_said(what, message):
    with pytest.raises(InputError, match=message):
        read_weights(what)


def test_files_that_are_none(tmp_path):
    with pytest.raises(FileError, match=re.escape("none.yaml")):
        read_weights("none.yaml")
    (tmp_path / "w.yaml").write_text("smoth: 1\n")
    with pytest.raises(InputError, match=r"w.yaml: unknown weight 'smoth'; did you mean 'smooth'"):
        read_weights(tmp_path / "w.yaml")
    (tmp_path / "w.yaml").write_text("- 1\n")
    with pytest.raises(InputError, match=r"w.yaml"):
        read_weights(tmp_path / "w.yaml")


def test_weights_decide_what_the_avatar_gets(tmp_path, capsys):
    made = {}
    for name in ("ours", "paper", "gradients=1,anchor=10,landmarks=0", "gradients=1,landmarks=20,anchor=0.032"):
        out = tmp_path / "c.glb"
        assert main(["rig", "cartoon", "--set", "arkit", "--shapes", "mouthSmileLeft", "--no-normals", "-q",
                     "--weights", name, "-o", str(out)]) == 0
        made[name] = load_avatar(out).shapes["mouthSmileLeft"]
    ours, paper, anchored, spelt = made.values()
    assert np.array_equal(ours, spelt)
    size = np.linalg.norm(ours)
    assert np.linalg.norm(paper - ours) > 0.05 * size
    assert np.linalg.norm(anchored - ours) > 0.01 * size
    assert main(["rig", "cartoon", "--weights", "papr", "-o", str(tmp_path / "d.glb")]) == 2
    assert "did you mean 'paper'" in capsys.readouterr().err
    with pytest.raises(InputError, match="the method 'sumner' has none to choose"):
        rig("cartoon", tmp_path / "d.glb", method="sumner", weights="paper", sets=["vrm"])
    assert not (tmp_path / "d.glb").exists()


@pytest.mark.parametrize("weights", [
    "gradients=0,anchor=0", "gradients=1e-9,landmarks=1e9,anchor=0", "preset=paper,gradients=0,smooth=0,identity=0"])
def test_a_singular_system_is_refused_not_solved(tmp_path, capsys, weights):
    """Landmarks alone, or so much heavier that the others are lost in rounding, say nothing of the skin between."""
    out = tmp_path / "c.glb"
    assert main(["rig", "cartoon", "--shapes", "aa", "--set", "vrm", "--weights", weights, "-o", str(out)]) == 2
    said = capsys.readouterr().err
    assert re.search(r"singular to working precision: \d+ of \d+ vertices|cannot be solved", said)
    assert "tied to nothing" in said
    assert not out.exists()

"""Recordings in another vocabulary: what single poses give, without jumps."""

from __future__ import annotations

import numpy as np
import pytest

from facegen.blendshapes.recipes import shape_set
from facegen.face.convert import convert
from facegen.face.convert_many import convert_many

UNITS = ("1", "2", "4", "5", "6", "7", "9", "10", "12", "14", "15", "17", "20", "26", "45")


def test_what_can_be_read_off_is_what_single_poses_give():
    """Units that ARKit has: the same numbers, to rounding."""
    names = ("1", "L2", "4", "5", "6", "7", "9", "R12", "14", "15", "20", "L45")
    weights = np.random.default_rng(0).random((6, len(names)))
    many = convert_many(names, weights, "units", "arkit")
    for row in range(6):
        alone = convert(dict(zip(names, weights[row].tolist(), strict=True)), "units", "arkit")
        here = {name: value for name, value in zip(many.names, many.weights[row], strict=True) if value > 1e-12}
        there = {name: value for name, value in alone.weights.items() if value > 1e-12}
        common = set(here) & set(there)
        assert len(common) >= len(here) - 4             # the corrective of 1 with 4 is fitted
        for name in common - {"browInnerUp", "browDownLeft", "browDownRight", "eyeSquintLeft", "eyeSquintRight"}:
            assert here[name] == pytest.approx(there[name], abs=0.03)
        assert many.residual[row] <= alone.residual + 0.01


@pytest.mark.parametrize(("source", "target"), [("units", "arkit"), ("arkit", "units"), ("units", "vrm"),
                                                ("visemes", "arkit"), ("arkit", "visemes"), ("vrm", "units"),
                                                ("expressions", "arkit")])
def test_it_loses_about_as_little_as_single_poses(source, target):
    rng = np.random.default_rng(2)
    names = UNITS if source == "units" else tuple(shape_set(source))[:40]
    weights = rng.random((8, len(names))) * (rng.random((8, len(names))) < 0.25)
    many = convert_many(names, weights, source, target)
    alone = [convert(dict(zip(names, row.tolist(), strict=True)), source, target).residual for row in weights]
    assert many.weights.min(initial=0.0) >= 0.0
    assert many.weights.max(initial=0.0) <= 1.0
    assert np.mean(many.residual) <= np.mean(alone) + 0.03
    assert 0.0 <= many.lost <= 1.0


def test_units_there_and_back():
    rng = np.random.default_rng(1)
    names = ("1", "2", "4", "5", "9", "12", "14", "15", "17", "20")         # 45 would take 5 with it, as a lid does
    weights = np.round(rng.random((20, len(names))) * 0.6, 6)
    there = convert_many(names, weights, "units", "arkit")
    back = convert_many(there.names, there.weights, "arkit", "units")
    assert set(names) <= set(back.names)
    pairs = {name: (weights[:, k], back.weights[:, back.names.index(name)]) for k, name in enumerate(names)}
    for name in ("2", "5", "9", "12", "14", "15"):
        np.testing.assert_allclose(*pairs[name], atol=0.02)


def test_it_moves_as_smoothly_as_what_it_follows():
    """Along a straight way between poses no weight jumps: single poses, pruned each for itself, do."""
    rng = np.random.default_rng(5)
    names = ("11", "13", "16", "22", "23", "25", "26", "32", "38")
    a, b = rng.random(len(names)), rng.random(len(names))
    way = np.linspace(0.0, 1.0, 200)[:, None]
    many = convert_many(names, a + way * (b - a), "units", "arkit")
    steps = np.abs(np.diff(many.weights, axis=0)).max()
    assert steps < 0.03


def test_sides_stay_apart_and_fold_where_they_never_differ():
    many = convert_many(("mouthSmileLeft", "mouthSmileRight", "browDownLeft", "browDownRight"),
                        np.array([[0.2, 0.2, 0.1, 0.3], [0.5, 0.5, 0.2, 0.2]]), "arkit", "units")
    assert set(many.names) == {"L4", "R4", "12"}
    assert many.lost < 1e-9


def test_units_of_the_head_are_left_out_and_told():
    many = convert_many(("12", "57"), np.array([[0.5, 0.5]]), "units", "arkit")
    assert many.left_out == ("57",)
    assert set(many.names) == {"mouthSmileLeft", "mouthSmileRight"}


def test_a_corrective_counts_as_far_as_what_it_corrects():
    open_mouth = convert_many(("jawOpen", "mouthClose"), np.array([[0.5, 0.0], [0.5, 0.5]]), "arkit", "units")
    alone = convert_many(("mouthClose",), np.array([[1.0]]), "arkit", "units")
    assert not alone.weights.any()
    assert not np.allclose(open_mouth.weights[0], open_mouth.weights[1], atol=0.05)


def test_rest_is_rest():
    many = convert_many(("12",), np.zeros((3, 1)), "units", "arkit")
    assert (many.names, many.weights.shape, many.lost) == ((), (3, 0), 0.0)

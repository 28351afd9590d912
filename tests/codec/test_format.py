"""The format: a second decoder, written from the page, agrees; and old streams stay readable."""

from __future__ import annotations

import numpy as np
import pytest
from codec.faces import idle, lively
from codec.stranger import PRIORS, Stream

from facegen.animation.performance import Performance
from facegen.blendshapes.recipes import shape_set
from facegen.codec import syntax
from facegen.codec.recording import decode_packets, encode_performance


def arkit(frames=40):
    names = tuple(shape_set("arkit"))
    dice = np.random.default_rng(4)
    weights = np.clip(np.cumsum(dice.normal(0, 0.1, (frames, len(names))), axis=0), 0, 1)
    return Performance(np.arange(frames) / 30, names, weights, "arkit", place=dice.normal(0, 40, (frames, 3)))


def any_rig():
    return Performance(np.arange(9) / 10, ("grumpf", "Ärger.links"), np.linspace(-1, 3, 18).reshape(9, 2), "shapes")


@pytest.mark.parametrize("options", [{}, {"frames": 1, "key_every": 7}, {"frames": 5, "key_every": 3},
                                     {"frames": 64, "fps": 29.97}, {"quality": 0.05}], ids=str)
@pytest.mark.parametrize("performance", [lively(lost=True), idle(), arkit(), any_rig()], ids=["lively", "idle", "arkit",
                                                                                             "any rig"])
def test_a_stranger_decodes_the_same_from_the_page(performance, options):
    parts = [part for part in ("head", "place", "gaze") if getattr(performance, part) is not None]
    packets = encode_performance(performance, parts=parts, **options)
    ours, theirs = decode_packets(packets), Stream(packets, list(shape_set("arkit")))
    assert ours.names == tuple(theirs.names)
    assert len(ours) == len(theirs.rows)
    assert ours.times == pytest.approx(np.arange(len(ours)) / theirs.rate)
    for k, row in enumerate(theirs.rows):
        if row is None:
            assert np.isnan(ours.weights[k]).all()
            continue
        assert ours.weights[k] == pytest.approx(theirs.weights(row), abs=1e-9)
        rest = row[len(ours.names):]
        for part in parts[:2]:
            if part != "gaze":
                assert getattr(ours, part)[k] == pytest.approx(rest[:3], abs=1e-9)
                rest = rest[3:]
        if "gaze" in parts:
            yaw, pitch, apart, slant = rest
            assert ours.gaze[k] == pytest.approx([yaw + apart / 2, pitch + slant / 2, yaw - apart / 2,
                                                  pitch - slant / 2], abs=1e-9)


def test_the_page_has_the_models_of_the_code():
    assert {question: [list(kind) for kind in kinds] * (4 if len(kinds) == 1 else 1)
            for question, kinds in syntax._PRIORS.items()} == PRIORS


def test_a_stream_of_this_version_stays_readable():
    """Whoever must change these bytes changes the version; golden() is what was encoded."""
    packets = [bytes.fromhex(one) for one in GOLDEN]
    found = decode_packets(packets)
    assert found.names == ("L12", "R12", "26")
    assert found.weights[::4] == pytest.approx(np.array(GOLDEN_WEIGHTS), abs=1e-6)
    assert found.head[-1] == pytest.approx(GOLDEN_HEAD, abs=1e-6)


def golden():
    t = np.arange(13) / 25
    weights = np.stack([np.sin(3 * t), np.sin(3 * t) * 0.9, np.clip(np.sin(9 * t), 0, 1)], axis=1)
    return Performance(t, ("L12", "R12", "26"), weights, "units", head=np.outer(t, [20.0, -10.0, 4.0]))


GOLDEN = [
    "100000de69ac57e45d000178dae36460906460e460606698d737bba1a58e9181c1c7d0882b08888dcc0046510559",
    "110000d4ca98b82fc6cb96f2c723d0d3",
    "110001f784f42c70598507b1d20961df593b",
    "1300021ab9",
]
GOLDEN_WEIGHTS = [
    [0, 0, 0],
    [0.4259796, 0.4259796, 0.9313934],
    [0.8178808, 0.6815673, 0.2328483],
    [1, 0.8860375, 0],
]
GOLDEN_HEAD = [9.5, -4.835154, 1.908389]

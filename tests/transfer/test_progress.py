"""Rigging tells how far it is, and stops when the one who listens raises."""

import pytest

from facegen import forked
from facegen.progress import counted, within
from facegen.transfer.rig import rig


class Stop(Exception):
    """The user pressed cancel."""


@pytest.fixture(scope="module", autouse=True)
def one_process():
    """How often two of them tell of shapes depends on which is faster: those are stopped in tests/test_forked.py."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(forked, "may_fork", lambda: False)
        yield


@pytest.fixture(scope="module")
def told(one_process, tmp_path_factory):
    """What was told while the cartoon was rigged."""
    said = []
    rig("cartoon", tmp_path_factory.mktemp("told") / "a.glb", sets=["vrm"], cache=False,
        progress=lambda stage, share: said.append((stage, share)))
    return said


def test_shares_never_fall_and_each_stage_is_told_once_it_begins(told):
    shares, stages = [share for _, share in told], [stage for stage, _ in told]
    assert shares == sorted(shares)
    assert shares[0] == 0.0
    assert 0.5 < shares[-1] <= 1.0
    assert list(dict.fromkeys(stages)) == [
        "reading the avatar", "making the shapes of the template", "telling the pieces apart",
        "laying the skin on the template", "finding lids, lips and eyes",
        "carrying the shapes over", "writing the avatar"]
    assert stages == sorted(stages, key=list(dict.fromkeys(stages)).index), "no stage comes back"


@pytest.mark.parametrize("name", ["a.glb", "a.npz", "a"])
def test_whoever_raises_stops_it_and_no_output_is_touched(told, tmp_path, name):
    """At the first and last call of every stage; what was there before stays as it is."""
    before = tmp_path / name
    if before.suffix:
        before.write_bytes(b"as it was")
    kept = {file.name: file.read_bytes() for file in tmp_path.iterdir()}
    stages = [stage for stage, _ in told]
    calls = {stages.index(stage) for stage in stages} | {len(stages) - 1}
    for last in sorted(calls) if name == "a.glb" else [len(stages) - 1]:
        heard = []

        def listen(stage, share, heard=heard, last=last):
            heard.append(stage)
            if len(heard) > last:
                raise Stop

        with pytest.raises(Stop):
            rig("cartoon", before, sets=["vrm"], cache=False, progress=listen)
        assert heard == stages[:last + 1], "nothing goes on after the stop"
        assert {file.name: file.read_bytes() for file in tmp_path.iterdir()} == kept


def test_a_part_of_the_work_is_a_part_of_the_shares():
    said = []
    inner = within(lambda stage, share: said.append((stage, share)), 0.2, 0.6)
    assert list(counted(inner, "adding", "abcd")) == list("abcd")
    assert said == [("adding", pytest.approx(share)) for share in (0.2, 0.3, 0.4, 0.5)]

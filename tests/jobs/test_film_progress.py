"""Films and animations tell how far they are, and stop when the one who listens raises."""

import pytest

import facegen
from facegen.animation.animated import save_animation
from facegen.fileio.video import save_video
from facegen.jobs.frames import save_clip

QUICK = {"size": 32, "face": "akimoto-1986", "detail": 0, "renderer": "soft", "fps": 10}
CLIP = facegen.load_clip({"keyframes": [{"t": 0, "pose": "0"}, {"t": 0.4, "pose": "happiness"}]})
NAMES = ["a.gif", "a.mp4", "a.glb", "frames"]


class Stop(Exception):
    """The person pressed stop."""


def made(path, progress, workers=1):
    if path.suffix == ".glb":
        save_animation(CLIP, path, face="akimoto-1986", fps=10, detail=0, progress=progress)
    else:
        save_clip(CLIP, path, workers=workers, progress=progress, **QUICK)


@pytest.mark.parametrize("name", NAMES)
def test_shares_never_fall_and_every_frame_is_told(tmp_path, name):
    told = []
    made(tmp_path / name, lambda stage, share: told.append((stage, share)))
    shares = [share for _, share in told]
    assert shares == sorted(shares)
    assert shares[0] == 0.0
    assert 0.85 < shares[-1] <= 1.0
    stages = [stage for stage, _ in told]
    if name == "a.glb":
        assert stages == ["making the keys"] * 4 + ["writing the animation"]
    else:
        assert [f"drawing, {k} of 4" for k in range(1, 5)] == [stage for stage in stages if " of " in stage]
    assert ("writing the film" in stages) == (name in ("a.gif", "a.mp4"))


@pytest.mark.parametrize("name", NAMES)
def test_whoever_raises_stops_it_at_any_word_and_no_file_is_touched(tmp_path, name):
    told = []
    (tmp_path / "first").mkdir()
    made(tmp_path / "first" / name, lambda stage, share: told.append(stage))
    target = tmp_path / name
    if target.suffix:
        target.write_bytes(b"as it was")
    for last in range(len(told)):
        heard = []

        def listen(stage, share, heard=heard, last=last):
            heard.append(stage)
            if len(heard) > last:
                raise Stop

        before = sorted(one.name for one in target.iterdir()) if target.is_dir() else None
        with pytest.raises(Stop):
            made(target, listen)
        if target.suffix:
            assert target.read_bytes() == b"as it was"
        else:                       # frames that were drawn stay, whole, for the next run
            names = sorted(one.name for one in target.iterdir()) if target.is_dir() else []
            assert set(before or ()) <= set(names)
            assert not [each for each in names if not each.startswith((".facegen", "frame_"))]
    made(target, lambda stage, share: None)                 # and the next run makes it


def test_a_stop_reaches_other_processes(tmp_path):
    def listen(stage, share):
        if " of " in stage:
            raise Stop

    with pytest.raises(Stop):
        made(tmp_path / "a.gif", listen, workers=2)
    assert not (tmp_path / "a.gif").exists()


def test_frames_that_come_one_by_one_have_no_share(tmp_path):
    import numpy as np

    told = []
    save_video((np.zeros((8, 8, 3), np.uint8) for _ in range(3)), tmp_path / "a.mp4",
               progress=lambda stage, share: told.append(share))
    assert told == [0.0] * 3

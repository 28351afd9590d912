"""facegen animate, morph and turntable."""

from __future__ import annotations

import json

import pytest
from PIL import Image

import facegen

QUICK = ("--face", "akimoto-1986", "--size", "32", "--workers", "1", "--detail", "0", "--renderer", "soft")
SCRIPT = "keyframes:\n  - {t: 0, pose: '0'}\n  - {t: 0.4, pose: happiness}\n"


@pytest.fixture
def script(tmp_path):
    path = tmp_path / "clip.yaml"
    path.write_text(SCRIPT)
    return path


def test_animate(run, tmp_path, script):
    out = tmp_path / "a.gif"
    assert run("animate", script, "-o", out, "--fps", 10, *QUICK) == (0, "", "")
    with Image.open(out) as film:
        assert film.size == (32, 32)
        assert film.n_frames == 4
    assert sorted(tmp_path.iterdir()) == [out, script]


def test_animate_tells(run, tmp_path, script):
    out = tmp_path / "frames"
    code, text, err = run("animate", script, "-o", f"{out}/", "--fps", 10, "--idle", 3, "--person", "mika", "--view",
                          "20,5", "--background", "#203040", "--json", *QUICK)
    told = json.loads(text)
    assert (code, err) == (0, "")
    assert told["frames"] == told["made"] == len(list(out.glob("frame_*.png"))) == 4
    assert (told["duration"], told["fps"], told["view"], told["person"]) == (0.4, 10, [20, 5], "mika")
    again = json.loads(run("animate", script, "-o", out, "--fps", 10, "--idle", 3, "--person", "mika", "--view", "20,5",
                           "--background", "#203040", "--json", *QUICK)[1])
    assert (again["made"], again["kept"]) == (0, 4)


def test_warnings_and_quiet(run, tmp_path, script):
    script.write_text(SCRIPT.replace("happiness", "18+20"))
    code, _, err = run("animate", script, "-o", tmp_path / "a.gif", "--fps", 5, *QUICK)
    assert code == 0
    assert err.startswith("facegen: warning: 18")
    assert run("animate", script, "-o", tmp_path / "a.gif", "--fps", 5, "-q", *QUICK) == (0, "", "")


def test_morph(run, tmp_path):
    out = tmp_path / "morph.webp"
    code, text, _ = run("morph", "happiness", "12C+4D", "figure-8", "-o", out, "--seconds", "0.2", "--hold", "0.1",
                        "--back", "--fps", "10", "--json", *QUICK)
    assert code == 0
    assert json.loads(text)["frames"] == 9
    with Image.open(out) as film:
        assert film.n_frames > 1


def test_turntable(run, tmp_path):
    out = tmp_path / "turn.webp"
    code, text, _ = run("turntable", "happiness", "-o", out, "--seconds", "0.5", "--fps", "12", "--range=-30,30",
                        "--json", *QUICK)
    assert code == 0
    assert json.loads(text)["frames"] == 6
    with Image.open(out) as film:
        assert film.n_frames == 6


@pytest.mark.parametrize(("argv", "words"), [
    (["animate", "clip.yaml"], "-o: say where the film goes"),
    (["animate", "none.yaml", "-o", "a.gif"], "no such file"),
    (["animate", "clip.yaml", "-o", "a.gfi"], "did you mean '.gif'"),
    (["animate", "clip.yaml", "-o", "no/a.gif"], "does not exist"),
    (["animate", "clip.yaml", "-o", "a.mp4", "--size", "33"], "34x34"),
    (["animate", "clip.yaml", "-o", "a.gif", "--fps", "0"], "fps"),
    (["animate", "clip.yaml", "-o", "a.gif", "--fps", "nan"], "fps"),
    (["animate", "clip.yaml", "-o", "a.gif", "--idle", "-2"], "idle"),
    (["animate", "clip.yaml", "-o", "a.gif", "--person", "mikka"], "did you mean 'mika'"),
    (["animate", "clip.yaml", "-o", "a.gif", "--renderer", "sfot"], "did you mean 'soft'"),
    (["animate", "clip.yaml", "-o", "a.gif", "--workers", "0"], "workers"),
    (["animate", "clip.yaml", "-o", "a.gif", "--size", "5000"], "4096"),
    (["animate", "bad.yaml", "-o", "a.gif"], "bad.yaml: keyframes.0.pose: unknown expression 'hapiness'; did you mean"),
    (["morph", "happiness", "-o", "a.gif"], "two or more"),
    (["morph", "happiness", "angre", "-o", "a.gif"], "did you mean"),
    (["morph", "happiness", "anger"], "-o: say"),
    (["morph", "happiness", "anger", "-o", "a.gif", "--seconds", "-1"], "seconds"),
    (["turntable", "happiness", "-o", "a.gif", "--range", "wide"], "--range"),
    (["turntable", "happiness", "-o", "a.gif", "--range", "1,2,3"], "--range"),
    (["turntable", "happiness", "-o", "a.gif", "--seconds", "0"], "duration"),
    (["turntable", "happiness"], "-o: say"),
])
def test_wrong_wishes(run, tmp_path, monkeypatch, script, argv, words):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "bad.yaml").write_text("keyframes: [{t: 1, pose: hapiness}]\n")
    before = sorted(tmp_path.iterdir())
    code, out, err = run(*argv)
    assert (code, out) == (2, "")
    assert err.startswith("facegen: ")
    assert words in err
    assert "Traceback" not in err
    assert sorted(tmp_path.iterdir()) == before


def test_stopped_by_hand(run, tmp_path, monkeypatch, script):
    from facegen.jobs.frames import FrameTask

    def stop(_):
        raise KeyboardInterrupt

    monkeypatch.setattr(FrameTask, "make", stop)
    assert run("animate", script, "-o", tmp_path / "a.gif", *QUICK) == (1, "", "facegen: stopped\n")
    assert not (tmp_path / "a.gif").exists()


def test_the_sample_reads():
    from pathlib import Path

    assert facegen.load_clip(Path(__file__).parents[2] / "examples" / "greeting.yaml").frames(25) == 100

"""facegen speak and facegen phoneme."""

from __future__ import annotations

import json
import os

import numpy as np
import pytest
from PIL import Image

from facegen import load_performance
from facegen.animation import espeak
from facegen.fileio.sound import Sound, save_wav

QUICK = ("--face", "akimoto-1986", "--size", "32", "--workers", "1", "--detail", "0", "--renderer", "soft", "--fps",
         "10")


@pytest.fixture
def there():
    if not espeak.installed():
        if os.environ.get("FACEGEN_CI"):
            pytest.fail("espeak-ng: must be installed where FACEGEN_CI is set")
        pytest.skip("espeak-ng is not installed")


def test_sounds_as_json_need_nothing(run):
    code, text, err = run("speak", "--phonemes", "HH AH0 L OW1", "--json")
    told = json.loads(text)
    assert (code, err) == (0, "")
    assert [one["sound"] for one in told["sounds"]] == ["h", "ə", "l", "oʊ"]
    assert [one["viseme"] for one in told["sounds"][-1]["visemes"]] == ["viseme_O", "viseme_U"]
    assert told["duration"] > told["sounds"][-1]["end"]


def test_a_film(run, tmp_path):
    out = tmp_path / "a.gif"
    code, text, err = run("speak", "--phonemes", "M AA1", "-o", out, "-e", "happiness", "--idle", 3, "--json", *QUICK)
    assert (code, err) == (0, "")
    assert json.loads(text)["frames"] == round(10 * json.loads(text)["duration"])
    with Image.open(out) as film:
        assert film.n_frames > 3
    assert list(tmp_path.iterdir()) == [out]


def test_an_animation_of_blendshapes(run, tmp_path):
    out = tmp_path / "a.glb"
    assert run("speak", "--phonemes", "M AA1", "-o", out, "--detail", "0", "--face", "akimoto") == (0, "", "")
    made = load_performance(out)
    closed, wide = made.column("AU24"), made.column("AU27")
    m, a = (round(25 * t) for t in (0.25 + 0.035, 0.25 + 0.07 + 0.07))
    assert closed[m] > 0.45 > 5 * wide[m]
    assert wide[a] > 0.25 > closed[a]


def test_what_json_prints_is_timing(run, tmp_path):
    one = run("speak", "--phonemes", "HH AH0 L OW1", "--json")[1]
    path = tmp_path / "a.json"
    path.write_text(one, encoding="utf-8")
    two = json.loads(run("speak", "--timing", path, "--json")[1])
    assert two["sounds"] == json.loads(one)["sounds"]


@pytest.mark.usefixtures("there")
def test_text(run, tmp_path):
    av = pytest.importorskip("av")
    out = tmp_path / "a.mp4"
    assert run("speak", "Hallo", "-l", "de", "-o", out, *QUICK) == (0, "", "")
    with av.open(str(out)) as film:
        assert [one.type for one in film.streams] == ["video", "audio"]
        assert sum(np.abs(one.to_ndarray()).max() for one in film.decode(audio=0)) > 0.1
    code, _, err = run("speak", "Hallo", "-l", "de", "-o", tmp_path / "a.gif", *QUICK)
    assert (code, err) == (0, "facegen: warning: .gif holds no sound; .mp4 and .webm do\n")


def test_a_recording_of_ones_own(run, tmp_path):
    av = pytest.importorskip("av")
    wav = save_wav(Sound((8000 * np.sin(np.arange(8000))).astype(np.int16), 8000), tmp_path / "a.wav")
    cues = tmp_path / "a.tsv"
    cues.write_text("0.0\tX\n0.2\tA\n0.5\tD\n0.8\tX\n")
    out = tmp_path / "a.webm"
    assert run("speak", "--timing", cues, "--sound", wav, "-o", out, *QUICK) == (0, "", "")
    with av.open(str(out)) as film:
        assert len(film.streams.audio) == 1
        assert sum(1 for _ in film.decode(video=0)) == 10                # as long as the sound


def test_in_a_script(run, tmp_path):
    (tmp_path / "a.tsv").write_text("0.0\tX\n0.2\tA\n0.5\tD\n0.8\tX\n")
    script = tmp_path / "a.yaml"
    script.write_text("events: [{at: 0, pose: happiness}]\nspeech: a.tsv\n")
    assert run("animate", script, "-o", tmp_path / "a.gif", *QUICK) == (0, "", "")


def test_phoneme(run, tmp_path):
    out = tmp_path / "th.gif"
    assert run("phoneme", "TH", "-o", out, "--size", 64, "--slow", 1, "--fps", 5, "--face", "akimoto-1986") \
        == (0, "", "")
    with Image.open(out) as film:
        assert film.size == (192, 80)
    still = tmp_path / "th.webp"
    assert run("phoneme", "θ s", "-o", still, "--size", 64, "--still") == (0, "", "")
    with Image.open(still) as picture:
        assert picture.size == (192, 160)


@pytest.mark.parametrize(("words", "message"), [
    (("speak", "hello"), "-o: say where the film goes"),
    (("speak", "-o", "a.gif"), "expected TEXT, --phonemes or --timing, one of the three"),
    (("speak", "a", "--phonemes", "AA", "-o", "a.gif"), "expected TEXT, --phonemes or --timing, one of the three"),
    (("speak", "--phonemes", "HH QQ", "-o", "a.gif"), "phonemes: position 4: 'QQ' is no code of ARPAbet; did you mean"),
    (("speak", "--timing", "none.json", "-o", "a.gif"), "none.json: there is no such file"),
    (("speak", "--phonemes", "AA", "-o", "a.gif", "--effort", "9"), "effort: expected a factor in 0..2, got 9"),
    (("speak", "--phonemes", "AA", "-o", "a.gif", "--speed", "0"), "speed: expected a factor in 0.1..10, got 0"),
    (("speak", "--phonemes", "AA", "-o", "a.gif", "--alphabet", "sampa"), "did you mean 'xsampa'"),
    (("speak", "--phonemes", "AA", "-o", "a.gif", "-e", "hapiness"), "did you mean 'happiness'"),
    (("speak", "--phonemes", "AA", "-o", "a.gif", "--tier", "x", "--face", "akimotto"), "did you mean 'akimoto'"),
    (("phoneme", "TH"), "-o: say where it goes"),
    (("phoneme", "-o", "a.gif"), "expected SOUNDS or --text, one of the two"),
    (("phoneme", "XQ", "-o", "a.gif"), "'XQ' is no code of ARPAbet"),
    (("phoneme", "TH", "-o", "a.gif", "--still"), "a name that ends in .png"),
])
def test_bad_input(run, tmp_path, monkeypatch, words, message):
    monkeypatch.chdir(tmp_path)
    code, out, err = run(*words)
    assert (code, out) == (2, "")
    assert message in err
    assert "Traceback" not in err
    assert not list(tmp_path.iterdir())


def test_without_espeak(run, tmp_path, monkeypatch):
    monkeypatch.setattr(espeak, "_program", lambda: None)
    monkeypatch.setattr(espeak, "_libraries", lambda: [])
    code, _, err = run("speak", "hello", "-o", tmp_path / "a.gif", *QUICK)
    assert code == 2
    assert "apt-get install espeak-ng" in err
    assert not list(tmp_path.iterdir())

"""facegen encode and decode."""

from __future__ import annotations

import io
import json
import os
import signal
import socket
import subprocess
import sys
import time

import numpy as np
import pytest
from PIL import Image

from facegen.animation.streams import load_performance, save_performance
from facegen.codec.packets import MAGIC

CLIP = """
keyframes:
  - {t: 0, pose: '0'}
  - {t: 0.4, pose: happiness, head: {yaw: 10}, eyes: {yaw: -8}}
  - {t: 0.8, pose: '4C+45E'}
"""
QUICK = ("--face", "akimoto-1986", "--size", "32", "--renderer", "soft", "--detail", "0")


@pytest.fixture
def script(tmp_path):
    path = tmp_path / "clip.yaml"
    path.write_text(CLIP)
    return path


@pytest.fixture
def stream(run, tmp_path, script):
    out = tmp_path / "talk.fgp"
    assert run("encode", script, "-o", out, "-q") == (0, "", "")
    return out


class Pipe(io.StringIO):
    """A stdin or stdout with bytes below it."""

    def __init__(self, data=b""):
        super().__init__()
        self.buffer = io.BytesIO(data)


def test_there_and_back(run, tmp_path, script):
    out, back = tmp_path / "talk.fgp", tmp_path / "back.csv"
    code, text, err = run("encode", script, "-o", out, "--json")
    told = json.loads(text)
    assert code == 0
    assert err.endswith("bit/s\n")
    assert (told["frames"], told["fps"], told["parts"]) == (20, 25, ["head", "gaze"])
    assert told["bytes"] == out.stat().st_size < 300
    assert out.read_bytes().startswith(MAGIC)
    code, text, err = run("decode", out, "-o", back, "--json")
    told = json.loads(text)
    assert (code, told["frames"], told["received"]["taken"], told["stopped"]) == (0, 20, 2, False)
    assert err == f"{out}: 20 frames\n"
    again = load_performance(back)
    assert again.column("L12")[10] == pytest.approx(1.0, abs=0.2)
    assert again.head[10, 0] == pytest.approx(10, abs=0.6)
    assert again.gaze[10, 0] == pytest.approx(-8, abs=3)
    assert sorted(tmp_path.iterdir()) == sorted([out, back, script])


def test_a_recording_keeps_its_vocabulary(run, tmp_path):
    source = tmp_path / "live.csv"
    weights = np.linspace(0, 1, 40)
    source.write_text("time,jawOpen,mouthSmileLeft,mouthSmileRight\n" + "".join(
        f"{k / 60:.4f},{w:.3f},{w / 2:.3f},{w / 2:.3f}\n" for k, w in enumerate(weights)))
    assert run("encode", source, "-o", tmp_path / "a.fgp", "--quality", "0.2", "-q")[0] == 0
    assert run("decode", tmp_path / "a.fgp", "-o", tmp_path / "b.csv", "-o", tmp_path / "c.csv", "-q") == (0, "", "")
    again = load_performance(tmp_path / "b.csv")
    assert again.vocabulary == "arkit"
    assert again.rate == pytest.approx(25)
    assert again.column("jawOpen")[-1] == pytest.approx(weights[-1], abs=0.05)
    assert (tmp_path / "b.csv").read_bytes() == (tmp_path / "c.csv").read_bytes()


def test_pipes(run, monkeypatch, tmp_path, script, stream):
    out = Pipe()
    monkeypatch.setattr(sys, "stdout", out)
    from facegen.cli import main

    assert main(["encode", str(script), "-q"]) == 0
    assert out.buffer.getvalue() == stream.read_bytes()
    monkeypatch.undo()
    monkeypatch.setattr(sys, "stdin", Pipe(stream.read_bytes()))
    assert main(["decode", "-o", str(tmp_path / "back.csv"), "-q"]) == 0
    assert len(load_performance(tmp_path / "back.csv")) == 20


def test_pictures_and_a_film(run, tmp_path):
    script, stream = tmp_path / "short.yaml", tmp_path / "short.fgp"
    script.write_text("keyframes:\n  - {t: 0, pose: '0'}\n  - {t: 0.3, pose: happiness}\n")
    run("encode", script, "-o", stream, "--fps", 10, "-q")
    frames, film = tmp_path / "frames", tmp_path / "film.gif"
    assert run("decode", stream, "--render", frames, "-q", *QUICK) == (0, "", "")
    assert [path.name for path in sorted(frames.iterdir())] == [f"frame_{k:05d}.png" for k in range(1, 4)]
    with Image.open(frames / "frame_00003.png") as one, Image.open(frames / "frame_00001.png") as other:
        assert one.size == (32, 32)
        assert one.tobytes() != other.tobytes()
    code, text, err = run("decode", stream, "--render", film, "-q", "--json", *QUICK)
    assert (code, err) == (0, "")
    assert json.loads(text)["render"] == str(film)
    with Image.open(film) as one:
        assert one.n_frames == 3
    code, _, err = run("decode", stream, "--render", frames, *QUICK)
    assert code == 2
    assert "holds frames already" in err


def test_what_was_lost_is_said(run, tmp_path, stream):
    data = stream.read_bytes()
    (tmp_path / "cut.fgp").write_bytes(data[:-12])
    code, _, err = run("decode", tmp_path / "cut.fgp", "-o", tmp_path / "back.csv")
    assert code == 0
    assert "damaged" in err
    assert len(load_performance(tmp_path / "back.csv")) == 16


@pytest.mark.parametrize(("words", "message"), [
    (["encode", "{script}", "-o", "udp://nowhere"], "address: expected udp://HOST:PORT"),
    (["encode", "{script}", "-o", "{folder}/none/x.fgp"], "the folder"),
    (["encode", "{script}", "-o", "{folder}/x.fgp", "--quality", "0"], "--quality: expected a number in 0.02..20"),
    (["encode", "{script}", "-o", "{folder}/x.fgp", "--frames", "99"], "--frames: expected 1..64"),
    (["encode", "{script}", "-o", "{folder}/x.fgp", "--key-every", "0"], "--key-every: expected packets"),
    (["encode", "{script}", "-o", "{folder}/x.fgp", "--fps", "0"], "fps: expected frames a second"),
    (["encode", "{script}", "-o", "{folder}/x.fgp", "--parts", "head,gase"], "did you mean 'gaze'"),
    (["encode", "{script}", "-o", "{folder}/x.fgp", "--parts", "place"], "--parts: the performance has no place"),
    (["encode", "{script}", "--json"], "--json: stdout carries the stream"),
    (["encode", "{folder}/no.csv", "-o", "{folder}/x.fgp"], "no.csv"),
    (["decode", "{stream}"], "-o: say where the recording goes"),
    (["decode", "{stream}", "-o", "{folder}/out.xyz"], "expected a name that ends in"),
    (["decode", "{stream}", "-o", "{folder}/no/out.csv"], "the folder"),
    (["decode", "{stream}", "-o", "{folder}/out.csv", "--to", "openfacee"], "did you mean 'openface'"),
    (["decode", "{stream}", "-o", "{folder}/out.csv", "--timeout", "0"], "--timeout: expected seconds"),
    (["decode", "{stream}", "-o", "{folder}/out.csv", "--wait", "70"], "wait: expected packets"),
    (["decode", "{stream}", "--render", "{folder}/out.mov"], "expected a name that ends in"),
    (["decode", "{script}", "-o", "{folder}/out.csv"], "no dictionary came"),
    (["decode", "{folder}/no.fgp", "-o", "{folder}/out.csv"], "no.fgp: cannot be read"),
    (["decode", "udp://:0", "-o", "{folder}/out.csv"], "address: expected udp://HOST:PORT"),
    (["decode", "udp://127.0.0.1:{port}", "-o", "{folder}/out.csv", "--timeout", "0.2"], "nothing was received"),
])
def test_bad_input_is_said_and_touches_nothing(run, tmp_path, script, stream, words, message):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as udp:
        udp.bind(("127.0.0.1", 0))
        port = udp.getsockname()[1]
    before = sorted(tmp_path.iterdir())
    code, out, err = run(*(word.format(script=script, stream=stream, folder=tmp_path, port=port) for word in words))
    assert (code, out) == (2, "")
    assert message in err
    assert "Traceback" not in err
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.skipif(os.name == "nt", reason="sends a Unix signal")
def test_ctrl_c_keeps_what_came(tmp_path, stream):
    """A sender that falls silent in the middle; then Ctrl-C, when a picture says that the receiver reads."""
    out, pictures = tmp_path / "out.csv", tmp_path / "pictures"
    receiver = subprocess.Popen([sys.executable, "-m", "facegen", "decode", "-", "-o", str(out), "--wait", "0",
                                 "--render", str(pictures), *QUICK], stdin=subprocess.PIPE, stderr=subprocess.PIPE)
    receiver.stdin.write(stream.read_bytes()[:-12])
    receiver.stdin.flush()
    until = time.monotonic() + 60
    while not (pictures / "frame_00001.png").exists() and time.monotonic() < until:
        time.sleep(0.05)
    receiver.send_signal(signal.SIGINT)
    receiver.stdin.close()
    receiver.stdin = None
    _, err = receiver.communicate(timeout=60)
    assert (receiver.returncode, err.decode().splitlines()[-1]) == (1, "-: 16 frames, stopped")
    assert len(load_performance(out)) == len(list(pictures.iterdir())) == 16


def test_save_performance_knows_streams(tmp_path, run, stream):
    """What decode writes is what any recording is."""
    run("decode", stream, "-o", tmp_path / "back.csv", "-q")
    save_performance(load_performance(tmp_path / "back.csv"), tmp_path / "again.csv", "csv")
    assert len(load_performance(tmp_path / "again.csv")) == 20

"""Sound as WAV files, mixed, and in films."""

from __future__ import annotations

import wave

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from facegen.errors import FileError, InputError
from facegen.fileio.sound import Sound, mixed, read_wav, save_wav
from facegen.fileio.video import save_video


def tone(hertz=440.0, seconds=1.0, rate=22_050):
    t = np.arange(round(seconds * rate)) / rate
    return Sound((9000 * np.sin(2 * np.pi * hertz * t)).astype(np.int16), rate)


def test_round_trip(tmp_path):
    path = save_wav(tone(), tmp_path / "a.wav")
    again = read_wav(path)
    assert again.rate == 22_050
    assert np.array_equal(again.samples, tone().samples)
    with wave.open(str(path)) as file:
        assert (file.getnchannels(), file.getsampwidth()) == (1, 2)


def test_channels_are_mixed(tmp_path):
    path = tmp_path / "a.wav"
    with wave.open(str(path), "wb") as file:
        file.setparams((2, 2, 8000, 0, "NONE", ""))
        file.writeframes(np.array([[100, 300], [-100, 100]], "<i2").tobytes())
    assert read_wav(path).samples.tolist() == [200, 0]


@pytest.mark.parametrize("suffix", [".mp4", ".webm"])
def test_a_film_with_sound(tmp_path, suffix):
    av = pytest.importorskip("av")
    frames = [np.full((32, 32, 3), 5 * k, np.uint8) for k in range(25)]
    path = save_video(frames, tmp_path / f"a{suffix}", fps=25, sound=tone())
    with av.open(str(path)) as film:
        assert [one.type for one in film.streams] == ["video", "audio"]
        heard = np.concatenate([one.to_ndarray()[0] for one in film.decode(audio=0)])
        rate = film.streams.audio[0].rate
    assert abs(len(heard) / rate - 1.0) < 0.05
    assert abs(np.abs(np.fft.rfft(heard)).argmax() * rate / len(heard) - 440) < 2
    again = save_video(frames, tmp_path / f"b{suffix}", fps=25, sound=tone())
    assert path.read_bytes() == again.read_bytes()
    silent = save_video(frames, tmp_path / f"c{suffix}", fps=25)
    with av.open(str(silent)) as film:
        assert [one.type for one in film.streams] == ["video"]


def test_a_gif_holds_no_sound(tmp_path):
    with pytest.raises(InputError, match=r"sound: \.gif holds no sound"):
        save_video([np.zeros((8, 8, 3), np.uint8)], tmp_path / "a.gif", sound=tone())
    assert not list(tmp_path.iterdir())


def test_mixed():
    both = mixed([(0.0, tone(400, 0.5)), (1.0, tone(800, 0.5, 44_100))])
    assert both.rate == 44_100
    assert both.duration == pytest.approx(1.5)
    assert not both.samples[round(0.6 * 44_100): round(0.9 * 44_100)].any()
    first = both.samples[: 22_050].astype(float)
    assert abs(np.abs(np.fft.rfft(first)).argmax() * 44_100 / len(first) - 400) < 3
    assert mixed([]) is None
    assert mixed([(0.0, tone()), (0.0, tone()), (0.0, tone()), (0.0, tone())]).samples.max() == 32767
    assert tone().after(0.5).duration == pytest.approx(1.5)


@pytest.mark.parametrize(("make", "message"), [
    (lambda path: None, "there is no such file"),
    (lambda path: path.mkdir(), "it is a folder"),
    (lambda path: path.write_bytes(b"hello"), "cannot be read as a WAV file"),
    (lambda path: path.write_bytes(b""), "cannot be read as a WAV file"),
    (lambda path: odd(path, 1), "expected 16 bits a sample, got 8"),
    (lambda path: odd(path, 2, rate=1), "expected up to 16 channels and two hours"),
    (lambda path: odd(path, 2, frames=b""), "has no samples"),
])
def test_wrong_files(tmp_path, make, message):
    make(tmp_path / "a.wav")
    with pytest.raises(FileError, match=message):
        read_wav(tmp_path / "a.wav")


def odd(path, width, rate=8000, frames=b"\0\0\0\0"):
    with wave.open(str(path), "wb") as file:
        file.setparams((1, width, rate, 0, "NONE", ""))
        file.writeframes(frames)


@given(st.data())
def test_damaged_files_are_read_or_refused(tmp_path_factory, data):
    path = tmp_path_factory.getbasetemp() / "damaged.wav"
    save_wav(tone(seconds=0.01), path)
    raw = bytearray(path.read_bytes())
    for _ in range(data.draw(st.integers(1, 4))):
        raw[data.draw(st.integers(0, 60))] = data.draw(st.integers(0, 255))
    path.write_bytes(raw[: data.draw(st.integers(0, len(raw)))])
    try:
        assert len(read_wav(path).samples)
    except FileError:
        return


def test_wrong_places(tmp_path):
    with pytest.raises(FileError, match=r"a name that ends in \.wav"):
        save_wav(tone(), tmp_path / "a.mp3")
    with pytest.raises(InputError, match="sound: expected a Sound"):
        save_wav(np.zeros(3), tmp_path / "a.wav")

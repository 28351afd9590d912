"""Films: as many frames as were given, as long as they should be, whole or not there."""

from __future__ import annotations

import errno
import sys
from fractions import Fraction

import numpy as np
import pytest
from PIL import Image, ImageSequence

import facegen
from facegen.fileio import video
from facegen.fileio.video import durations, save_video

PILLOW = (".gif", ".webp", ".apng", ".png")


def frames(count=12, height=48, width=64, channels=3):
    """Return frames with a bright square that moves right over a slope of colours."""
    y, x = np.mgrid[0:height, 0:width]
    ground = np.stack([40 + 2 * x, 60 + 2 * y, np.full_like(x, 120), np.full_like(x, 255)], axis=-1)[..., :channels]
    result = []
    for k in range(count):
        one = ground.copy()
        one[16:32, 3 * k:3 * k + 16, :3] = [230, 200, 60]
        result.append(one.astype(np.uint8))
    return result


def decoded(path):
    import av

    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        found = list(container.decode(stream))
        return [frame.to_ndarray(format="rgb24") for frame in found], [frame.time for frame in found], stream, \
            container.duration


@pytest.mark.parametrize("fps", [12, 25, 29.97, 50])
@pytest.mark.parametrize("suffix", [".mp4", ".webm"])
def test_video(tmp_path, suffix, fps):
    given = frames()
    path = save_video(iter(given), tmp_path / f"a{suffix}", fps=fps)
    found, times, stream, duration = decoded(path)
    assert stream.codec_context.name in {".mp4": ("h264",), ".webm": ("vp9", "libvpx-vp9")}[suffix]
    assert len(found) == len(given)
    np.testing.assert_allclose(times, np.arange(len(given)) / fps, atol=0.0011)
    assert duration / 1e6 == pytest.approx(len(given) / fps, abs=0.002 + (1 / fps if suffix == ".webm" else 0))
    for one, other in zip(found, given, strict=True):
        assert one.shape == other.shape
        inside = np.abs(one.astype(int) - other)[20:28]         # colours are right, not only shapes
        assert np.median(inside) <= 4
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("fps", [7, 24, 30, 50])
@pytest.mark.parametrize("suffix", PILLOW)
def test_pillow_films(tmp_path, suffix, fps):
    given = frames()
    path = save_video(given, tmp_path / f"a{suffix}", fps=fps)
    with Image.open(path) as film:
        assert film.n_frames == len(given)
        assert film.info.get("loop") == 0
        length = 0.0
        for one, other in zip(ImageSequence.Iterator(film), given, strict=True):
            assert np.abs(np.asarray(one.convert("RGB")).astype(int) - other).mean() < 6
            length += one.info["duration"]      # known once the frame is read
    assert length / 1000 == pytest.approx(len(given) / fps, abs=0.006)


def test_a_gif_has_one_palette(tmp_path):
    path = save_video(frames(), tmp_path / "a.gif", fps=10)
    data = path.read_bytes()
    assert data[10] & 0x80                                      # a global table of colours
    local = save_video(frames(1), tmp_path / "one.gif")
    assert len(data) - 11 * local.stat().st_size < -11 * 700        # eleven palettes of 768 bytes fewer


@pytest.mark.parametrize("suffix", [".webp", ".apng"])
def test_transparency_is_kept(tmp_path, suffix):
    given = frames(4, channels=4)
    for one in given:
        one[:8, :, 3] = 0
    path = save_video(given, tmp_path / f"a{suffix}")
    with Image.open(path) as film:
        film.seek(2)
        alpha = np.asarray(film.convert("RGBA"))[..., 3]
    assert (alpha[:8] == 0).all()
    assert (alpha[8:] == 255).all()


@pytest.mark.parametrize("suffix", [".mp4", ".webm", ".gif"])
def test_or_gets_white_behind(tmp_path, suffix):
    given = frames(4, channels=4)
    for one in given:
        one[:16, :, 3] = 0
    path = save_video(given, tmp_path / f"a{suffix}")
    if suffix == ".gif":
        with Image.open(path) as film:
            top = np.asarray(film.convert("RGB"))[:12]
    else:
        top = decoded(path)[0][1][:12]
    assert top.min() > 245


@pytest.mark.parametrize("ticks", [100, 1000])
@pytest.mark.parametrize("fps", [Fraction(30000, 1001), Fraction(7), Fraction(24), Fraction(50), Fraction(1, 10)])
def test_durations_never_stray(fps, ticks):
    marks = np.cumsum([0, *durations(200, fps, ticks)]) / 1000
    exact = np.arange(201) / float(fps)
    assert np.abs(marks - exact).max() <= 0.5 / ticks + 1e-9


@pytest.mark.parametrize("suffix", [".mp4", ".webm", *PILLOW])
def test_the_same_bytes_each_time(tmp_path, suffix):
    one, other = (save_video(frames(5), tmp_path / f"{name}{suffix}").read_bytes() for name in "ab")
    assert one == other


@pytest.mark.parametrize(("name", "given", "options", "words"), [
    ("a.avi", frames(2), {}, "expected a name that ends in .mp4"),
    ("a.mp5", frames(2), {}, "did you mean '.mp4'"),
    ("a", frames(2), {}, "no suffix"),
    ("no/a.mp4", frames(2), {}, "does not exist"),
    ("a.mp4", [], {}, "got none"),
    ("a.mp4", frames(2, width=63), {}, "64x48"),
    ("a.webm", frames(2, height=47), {}, "64x48"),
    ("a.mp4", [*frames(2), *frames(1, width=32)], {}, "frame 2"),
    ("a.webp", [*frames(2), *frames(1, width=32)], {}, "one shape for all"),
    ("a.mp4", [np.zeros((48, 64), np.uint8)], {}, "pixels"),
    ("a.gif", frames(2), {"fps": 60}, "0.1..50"),
    ("a.mp4", frames(2), {"fps": 0}, "0.1..1000"),
    ("a.mp4", frames(2), {"fps": float("nan")}, "0.1..1000"),
    ("a.mp4", frames(2), {"fps": "25"}, "frames a second"),
])
def test_wrong_wishes(tmp_path, name, given, options, words):
    with pytest.raises(facegen.InputError) as caught:
        save_video(given, tmp_path / name, **options)
    assert words in str(caught.value)
    assert not list(tmp_path.iterdir())


def test_a_folder_in_its_place(tmp_path):
    (tmp_path / "a.mp4").mkdir()
    with pytest.raises(facegen.FileError, match="is a folder"):
        save_video(frames(2), tmp_path / "a.mp4")


@pytest.mark.parametrize("suffix", [".mp4", ".webm"])
def test_without_pyav(tmp_path, monkeypatch, suffix):
    monkeypatch.setitem(sys.modules, "av", None)
    with pytest.raises(facegen.InputError, match=r'pip install "facegen\[video\]"'):
        save_video(frames(2), tmp_path / f"a{suffix}")
    assert save_video(frames(2), tmp_path / "a.gif").exists()


class _FullDisk:
    """A file on a disk with room for a hundred bytes."""

    def __init__(self, file):
        self.file, self.room = file, 100

    def write(self, data):
        self.room -= len(data)
        if self.room < 0:
            raise OSError(errno.ENOSPC, "No space left on device")
        return self.file.write(data)

    def __getattr__(self, name):
        if name == "fileno":
            raise AttributeError(name)
        return getattr(self.file, name)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.file.close()


@pytest.mark.parametrize("suffix", [".mp4", ".webm", *PILLOW])
def test_a_full_disk_leaves_the_old_film(tmp_path, monkeypatch, suffix):
    path = tmp_path / f"a{suffix}"
    path.write_bytes(b"precious")
    monkeypatch.setattr(video, "open", lambda *a: _FullDisk(open(*a)), raising=False)  # noqa: SIM115
    with pytest.raises(facegen.FileError, match="No space left"):
        save_video(frames(6), path)
    assert path.read_bytes() == b"precious"
    assert list(tmp_path.iterdir()) == [path]


def test_an_error_in_the_frames_leaves_nothing(tmp_path):
    def stopped():
        yield from frames(3)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        save_video(stopped(), tmp_path / "a.mp4")
    assert not list(tmp_path.iterdir())

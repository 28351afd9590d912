"""Moving pictures as files: MP4 and WebM through PyAV, GIF, WebP and APNG through Pillow.

The only file that imports PyAV.
"""

from __future__ import annotations

import itertools
import math
import os
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from facegen.errors import InputError
from facegen.fileio.images import check_pixels, over_colour
from facegen.fileio.sound import Sound
from facegen.fileio.textfile import check_place, whole_file
from facegen.progress import Progress, silent

_PAPER = (255, 255, 255)
# Frames from which a GIF's one palette is made: enough to see every colour of a face, few enough to be quick.
_PALETTE_FRAMES = 16
_PALETTE_PIXELS = 300_000
_SOUND_RATE = 48_000        # Opus knows no other, and every player knows it
_SOUND_PIECE = 4096         # samples
_BT709 = 1      # the number of the colour standard of HD video, in FFmpeg's tables


@dataclass(frozen=True)
class Format:
    """One kind of film. ``ticks``: durations are whole numbers of 1 / ticks s; ``fastest``: most frames a second.

    even: width and height must be. clear: it keeps transparency. sound: the codec of its sound, if it can have one.
    """

    kind: str
    codec: str = ""
    options: dict[str, str] = field(default_factory=dict)
    ticks: int = 0
    fastest: float = 1000.0
    even: bool = False
    clear: bool = False
    sound: str = ""


# Quality: x264 18 and VP9 24 cannot be told from the frames at normal size. One thread: the same bytes on any machine.
FORMATS = {
    ".mp4": Format("mp4", "libx264", {"crf": "18", "preset": "fast", "threads": "1"}, even=True, sound="aac"),
    ".webm": Format("webm", "libvpx-vp9", {"crf": "24", "b": "0", "cpu-used": "4", "deadline": "good", "threads": "1"},
                    even=True, sound="libopus"),
    # Browsers show frames of less than 0.02 s slower, not faster.
    ".gif": Format("GIF", ticks=100, fastest=50.0),
    ".webp": Format("WEBP", options={"quality": 88, "method": 3}, ticks=1000, clear=True),
    ".apng": Format("PNG", options={"compress_level": 6}, ticks=1000, clear=True),
    ".png": Format("PNG", options={"compress_level": 6}, ticks=1000, clear=True),
}


def save_video(frames: Iterable[ArrayLike], path: str | os.PathLike[str], *, fps: float = 25.0,
               sound: Sound | None = None, progress: Progress = silent) -> Path:
    """Write frames, each (h, w, 3) or (h, w, 4) uint8, as a film by the path's suffix; return the path.

    .mp4 (H.264) and .webm (VP9) need PyAV, ``pip install "facegen[video]"``, and even sizes. .gif, .webp, .apng and
    .png run round and round. .webp, .apng and .png keep transparency, the others get white behind. The file appears
    whole or not at all. Frames may come one by one: MP4 and WebM hold one at a time. sound: begins with the first
    frame; MP4 and WebM only. progress: called before each frame; its share stays 0 where frames come one by one.

    Raises InputError for the frames or fps, FileError for the path. ::

        facegen.save_video((renderer.draw(pose) for pose in clip.sample(25)), "smile.mp4", fps=25)
    """
    path = Path(path)
    frames = frames if isinstance(frames, Sequence) else iter(frames)
    first = next(iter(frames), None)
    if first is None:
        raise InputError("frames: expected one at least, got none")
    shape = check_pixels(first).shape
    form = check_film(path, size=(shape[1], shape[0]), fps=fps)
    if sound is not None and not form.sound:
        raise InputError(f"sound: {path.suffix} holds no sound; take .mp4 or .webm, or leave sound out")
    if not isinstance(frames, Sequence):
        frames = itertools.chain([first], frames)
    with whole_file(path, "the film ") as draft, open(draft, "wb") as file:
        rate = Fraction(fps).limit_denominator(10_000)
        if form.codec:
            _write_video(file, form, _told(frames, progress), rate, shape, sound)
        else:
            _write_pillow(file, form, frames, rate, shape, progress)
    return path


def _told(frames: Iterable[ArrayLike], progress: Progress) -> Iterator[ArrayLike]:
    """Yield frames and tell of each."""
    count = len(frames) if isinstance(frames, Sequence) else 0
    for k, frame in enumerate(frames):
        progress("writing the film", k / count if count else 0.0)
        yield frame


def check_film(path: str | os.PathLike[str], *, size: tuple[int, int], fps: float) -> Format:
    """Return the format of a path that a film of this size (width, height) can be written to: ask before long work.

    Raises FileError for the path, InputError for the size, the rate or a missing package.
    """
    suffix = check_place(path, FORMATS).suffix.lower()
    form = FORMATS[suffix]
    if form.even and any(side % 2 for side in size):
        raise InputError(f"size: {suffix} needs an even width and height, got {size[0]}x{size[1]}; take "
                         f"{size[0] + size[0] % 2}x{size[1] + size[1] % 2}")
    if isinstance(fps, bool) or not isinstance(fps, (int, float, Fraction)) or not 0.1 <= fps <= form.fastest:
        raise InputError(f"fps: {suffix} shows 0.1..{form.fastest:g} frames a second, got {fps!r}")
    if form.codec:
        _av()
    return form


def _av() -> Any:
    """Return PyAV, or raise InputError that says how to get it."""
    try:
        import av
    except ImportError as error:
        raise InputError("video: .mp4 and .webm need PyAV, which is not installed: pip install \"facegen[video]\" "
                         "(.gif, .webp and .apng work without)") from error
    return av


def _checked(frames: Iterable[ArrayLike], shape: tuple[int, ...], clear: bool) -> Iterator[NDArray[np.uint8]]:
    """Yield the frames, all of one size, without alpha unless the format keeps it."""
    for k, frame in enumerate(frames):
        pixels = check_pixels(frame)
        if pixels.shape != shape:
            raise InputError(f"frames: expected one shape for all, frame {k} is {pixels.shape}, the first {shape}")
        yield pixels if clear or pixels.shape[2] == 3 else over_colour(pixels, _PAPER)


# -- PyAV -------------------------------------------------------------------------------------------------------
def _write_video(file: Any, form: Format, frames: Iterable[ArrayLike], fps: Fraction, shape: tuple[int, ...],
                 sound: Sound | None) -> None:
    av, out = _av(), _Watched(file)
    try:
        # "bitexact": no random numbers and no version in the file, so that the same frames make the same bytes
        with av.open(out, "w", format=form.kind, options={"fflags": "+bitexact"}) as container:
            stream = container.add_stream(form.codec, rate=fps, options=form.options)
            stream.width, stream.height, stream.pix_fmt = shape[1], shape[0], "yuv420p"
            stream.time_base = stream.codec_context.time_base = 1 / fps
            context = stream.codec_context
            context.colorspace = context.color_primaries = context.color_trc = _BT709
            context.color_range = 1     # 16..235, which every player expects
            if sound is not None:       # all streams before the first packet
                voice = container.add_stream(form.sound, rate=_SOUND_RATE, layout="mono")
            for k, pixels in enumerate(_checked(frames, shape, clear=False)):
                frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(pixels), format="rgb24")
                frame = frame.reformat(format="yuv420p", dst_colorspace="ITU709", dst_color_range="MPEG")
                frame.pts, frame.time_base = k, 1 / fps
                container.mux(stream.encode(frame))
            container.mux(stream.encode())
            if sound is not None:
                for frame in _sound_frames(av, sound):
                    container.mux(voice.encode(frame))
                container.mux(voice.encode())
    except av.FFmpegError as error:
        raise out.error or OSError(str(error)) from error


def _sound_frames(av: Any, sound: Sound) -> Iterator[Any]:
    """Yield a sound in pieces; the encoder brings them to its own rate and form."""
    for start in range(0, len(sound.samples), _SOUND_PIECE):
        piece = np.ascontiguousarray(sound.samples[None, start: start + _SOUND_PIECE])
        frame = av.AudioFrame.from_ndarray(piece, format="s16", layout="mono")
        frame.sample_rate, frame.pts, frame.time_base = sound.rate, start, Fraction(1, sound.rate)
        yield frame


class _Watched:
    """A file that remembers why it could not be written: FFmpeg only says that it failed."""

    def __init__(self, file: Any) -> None:
        self._file, self.error = file, None
        self.seek, self.tell, self.name = file.seek, file.tell, file.name

    def write(self, data: bytes) -> int:
        try:
            return self._file.write(data)
        except OSError as error:
            self.error = error
            raise

    def seekable(self) -> bool:
        return True

    def writable(self) -> bool:
        return True


# -- Pillow -----------------------------------------------------------------------------------------------------
def _write_pillow(file: Any, form: Format, frames: Iterable[ArrayLike], fps: Fraction, shape: tuple[int, ...],
                  progress: Progress) -> None:
    if not isinstance(frames, Sequence):
        frames = list(frames)       # Pillow must know how many there are
    film = _film(frames, shape, form, progress)
    options = dict(form.options)
    if form.kind == "PNG":
        options["default_image"] = False
    film.save(file, form.kind, save_all=True, duration=durations(len(frames), fps, form.ticks), loop=0, **options)


def durations(count: int, fps: Fraction, ticks: int) -> list[int]:
    """Return how long each frame stands, milliseconds, in whole ticks whose sum never strays by more than half one."""
    marks = [round(k * ticks / fps) for k in range(count + 1)]
    return [(after - before) * 1000 // ticks for before, after in itertools.pairwise(marks)]


def _film(frames: Sequence[ArrayLike], shape: tuple[int, ...], form: Format, progress: Progress) -> Any:
    """Return a Pillow image of many frames that holds one at a time, and tells how far its writer is."""
    from PIL import Image

    def picture(k: int) -> Any:
        return Image.fromarray(next(_checked([frames[k]], shape, form.clear)))

    palette = _palette(picture, len(frames)) if form.kind == "GIF" else None

    class Film(Image.Image):
        n_frames = len(frames)
        is_animated = n_frames > 1

        def __init__(self) -> None:
            super().__init__()
            self._farthest = 0
            self.seek(0)

        def seek(self, frame: int) -> None:
            if not 0 <= frame < self.n_frames:
                raise EOFError
            self._farthest = max(self._farthest, frame)         # writers go back to the first
            progress("writing the film", self._farthest / self.n_frames)
            one = picture(frame)
            if palette is not None:
                one = one.quantize(palette=palette, dither=Image.Dither.NONE)   # dither would crawl between frames
                self.palette = one.palette
            self.im, self._mode, self._size, self._at = one.im, one.mode, one.size, frame

        def tell(self) -> int:
            return self._at

    return Film()


def _palette(picture: Any, count: int) -> Any:
    """Return an image with the one palette of a GIF, from frames spread over it."""
    from PIL import Image

    chosen = np.unique(np.linspace(0, count - 1, min(count, _PALETTE_FRAMES)).round().astype(int))
    samples = [picture(int(k)) for k in chosen]
    width, height = samples[0].size
    apart = math.ceil(math.sqrt(width * height * len(samples) / _PALETTE_PIXELS))
    width, height = max(1, width // apart), max(1, height // apart)
    sheet = Image.new("RGB", (width, height * len(samples)))
    for k, sample in enumerate(samples):
        sheet.paste(sample.resize((width, height), Image.Resampling.NEAREST), (0, k * height))
    # A few rounds of k-means halve the largest errors, which are those of small things such as teeth.
    return sheet.quantize(256, method=Image.Quantize.MEDIANCUT, kmeans=3)

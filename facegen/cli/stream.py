"""``facegen encode`` and ``decode``: performances as streams of very few bits, over a pipe, a file or UDP."""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, BinaryIO

import typer

from facegen.cli.options import FaceName, Json, PersonName, Quiet, Size, View, print_json, read_size, read_view, warn
from facegen.cli.picture import Detail, RendererName
from facegen.cli.play import RecordedRate
from facegen.cli.recordings import (
    Calibrate,
    CalibrateHead,
    FaceId,
    Smooth,
    Source,
    read_recording,
)
from facegen.errors import FileError, InputError

if TYPE_CHECKING:
    from facegen.codec.decoder import Frame

_PIPE = "-"
_SCRIPTS = (".yaml", ".yml")
_OWN = "csv"
_PATIENT, _LIVE = 16, 2     # packets that a missing one is waited for
_DAY = 86_400.0

Recording = Annotated[Path, typer.Argument(
    metavar="IN", help="A recording (`facegen list formats`), or a clip (.yaml).")]
Sink = Annotated[str, typer.Option(
    "--output", "-o", metavar="OUT", help="A file, - for a pipe, or udp://HOST:PORT.")]
Rate = Annotated[float, typer.Option("--fps", metavar="N", help="Frames a second that are sent.")]
Quality = Annotated[float | None, typer.Option(
    "--quality", metavar="MM", help="Millimetres of the face's movement in a step: more is coarser. [default: 0.8]")]
FramesEach = Annotated[int, typer.Option(
    "--frames", metavar="N", help="Frames of a packet, 1 to 64: fewer is less delay and more bits.")]
KeyEvery = Annotated[int, typer.Option(
    "--key-every", metavar="N", help="Of so many packets one needs no other; of 1, a lost one costs its own frames "
                                     "only.")]
Parts = Annotated[str | None, typer.Option(
    "--parts", metavar="PARTS", help="What is sent beside weights, by commas: head, place, gaze, or none. "
                                     "[default: head and gaze where there are]")]
Realtime = Annotated[bool, typer.Option("--realtime", help="Send each frame at its time.")]
Incoming = Annotated[str, typer.Argument(metavar="IN", help="A file, - for a pipe, or udp://[HOST]:PORT to listen at.")]
Outputs = Annotated[list[Path] | None, typer.Option(
    "--output", "-o", metavar="OUT", help="A recording in any format that facegen writes; repeatable.")]
Target = Annotated[str | None, typer.Option(
    "--to", metavar="FORMAT", help="What the recordings are to be (`facegen list formats`); of .csv, facegen's own.")]
Shown = Annotated[Path | None, typer.Option(
    "--render", metavar="OUT", help="Draw the frames: a film (.mp4, .gif ...) at the end, or, for a name without "
                                    "suffix, a folder of pictures that fills as they come.")]
Wait = Annotated[int | None, typer.Option(
    "--wait", metavar="N", help="Packets that a missing one is waited for. [default: 16; 2 for pictures as they come]")]
Timeout = Annotated[float, typer.Option("--timeout", metavar="S", help="Seconds of silence after which UDP is over.")]


def encode(recording: Recording, output: Sink = _PIPE, fps: Rate = 25.0, quality: Quality = None,
           frames: FramesEach = 16, key_every: KeyEvery = 1, parts: Parts = None, realtime: Realtime = False,
           source: Source = None, recorded_fps: RecordedRate = None, face_id: FaceId = None,
           calibrate: Calibrate = None, calibrate_head: CalibrateHead = False, smooth: Smooth = None,
           person: PersonName = None, json: Json = False, quiet: Quiet = False) -> None:
    """Send a performance as a stream of less than 1 kbit/s.

    For example: facegen encode recording.csv -o talk.fgp
    Or: facegen encode recording.csv -o udp://192.168.1.7:5004 --realtime
    """
    from facegen.codec.link import SCHEME, read_address, send_udp, write_stream
    from facegen.codec.recording import encoder_for, in_order, rows
    from facegen.codec.steps import QUALITY

    address = read_address(output, sends=True) if output.startswith(SCHEME) else None
    if json and output == _PIPE:
        raise InputError("--json: stdout carries the stream; take -o FILE")
    if recording.suffix.lower() in _SCRIPTS:
        from facegen.animation.script import load_clip
        from facegen.codec.sampled import clip_performance

        performance = clip_performance(load_clip(recording, person=person), fps)
        if not quiet:
            warn(performance.warnings)
    else:
        performance = read_recording(recording, source=source, fps=recorded_fps, face_id=face_id, calibrate=calibrate,
                                     calibrate_head=calibrate_head, smooth=smooth, quiet=quiet,
                                     rate="--recorded-fps")
    performance = in_order(performance)
    try:
        encoder = encoder_for(performance, fps=fps, parts=_parts(parts), frames=frames, key_every=key_every,
                              quality=QUALITY if quality is None else quality)
    except InputError as error:
        raise InputError(_named(str(error))) from error
    courses = rows(performance, encoder.dictionary.rate)
    if address is not None:
        count = send_udp(encoder, courses, address, realtime=realtime)
    else:
        with _writer(output) as file:
            count = write_stream(encoder, courses, file, realtime=realtime)
    seconds = encoder.frames_taken / float(encoder.dictionary.rate)
    if not quiet:
        warn(encoder.told())
        print(f"{output}: {encoder.frames_taken} frames in {count} bytes, {8 * count / seconds:.0f} bit/s",
              file=sys.stderr)
    if json:
        print_json({"output": output, "frames": encoder.frames_taken, "fps": float(encoder.dictionary.rate),
                    "bytes": count, "bits_per_second": 8 * count / seconds, "names": list(encoder.dictionary.names),
                    "parts": list(encoder.dictionary.parts), "warnings": [*performance.warnings, *encoder.told()]})


def decode(source: Incoming = _PIPE, output: Outputs = None, target: Target = None, render: Shown = None,
           face: FaceName = "akimoto", size: Size = "512", view: View = "0,0", renderer: RendererName = "auto",
           detail: Detail = None, wait: Wait = None, timeout: Timeout = 30.0, json: Json = False,
           quiet: Quiet = False) -> None:
    """Receive a stream, and write it as a recording or draw it.

    For example: facegen encode recording.csv | facegen decode -o again.csv
    Or, to see who is sent: facegen decode udp://:5004 --render talk.mp4 --face human.glb
    """
    outputs = list(output or ())
    if not outputs and render is None:
        raise InputError("-o: say where the recording goes, for example -o out.csv, or --render out.mp4")
    if not 0 < timeout <= _DAY:
        raise InputError(f"--timeout: expected seconds above 0 and up to a day, got {timeout:g}")
    from facegen.animation.streams import save_performance
    from facegen.animation.streams.formats import for_output
    from facegen.codec.decoder import Decoder
    from facegen.codec.link import SCHEME, read_address, read_stream, receive_udp
    from facegen.codec.recording import performance_of
    from facegen.fileio.textfile import check_place

    address = read_address(source, sends=False) if source.startswith(SCHEME) else None
    kinds = [for_output(path, target, _OWN) for path in outputs]
    for path, kind in zip(outputs, kinds, strict=True):     # before anything is received
        check_place(path, kind.suffixes)
    pixels, angles = read_size(size), read_view(view)
    film, live = None, None
    if render is not None and render.suffix:
        from facegen.fileio.video import check_film

        check_film(film := render, size=pixels, fps=25.0)
    decoder = Decoder(wait=(_PATIENT if render is None or film else _LIVE) if wait is None else wait)
    if render is not None and film is None:
        from facegen.jobs.live_pictures import LivePictures

        live = LivePictures(render, face=face, size=pixels, view=angles, detail=detail, renderer=renderer)
    kept: list[Frame] = []
    with _stoppable() as stop, (nullcontext() if address is not None else _reader(source)) as file:
        frames = receive_udp(decoder, address, timeout=timeout, stopped=stop.asked,
                             ready=lambda: _listening(source, quiet)) if address is not None else \
            read_stream(decoder, stop.watched(file), stopped=stop.asked)
        for one in frames:
            kept.append(one)
            if live is not None:
                live.draw(one, decoder.dictionary)
    performance = performance_of(decoder, kept)
    said = list(performance.warnings) + list(live.warnings if live is not None else ())
    for path, kind in zip(outputs, kinds, strict=True):
        said += [one for one in save_performance(performance, path, kind.name).warnings if one not in said]
    if film is not None:
        from facegen.cli.options import progress
        from facegen.jobs.frames import as_motion, save_clip

        rate = float(decoder.dictionary.rate)
        said += [one for one in as_motion(performance).warnings if one not in said]
        with progress("frames", as_motion(performance).frames(rate), quiet=quiet) as step:
            save_clip(performance, film, fps=rate, size=pixels, view=angles, face=face, detail=detail,
                      renderer=renderer, step=step)
    if not quiet:
        warn(said)
        print(f"{source}: {len(kept)} frames" + (", stopped" if stop.asked() else ""), file=sys.stderr)
    if json:
        print_json({"input": source, "frames": len(kept), "seconds": kept[-1].time, "outputs": list(map(str, outputs)),
                    "render": None if render is None else str(render), "received": vars(decoder.received),
                    "stopped": stop.asked(), "warnings": said})
    if stop.asked():
        raise typer.Exit(1)


def _named(message: str) -> str:
    """Return an error of the encoder with the option's name before it."""
    names = {"fps": "--fps", "quality": "--quality", "frames": "--frames", "key_every": "--key-every",
             "parts": "--parts"}
    name, colon, rest = message.partition(":")
    return f"{names[name]}{colon}{rest}" if name in names else message


def _parts(text: str | None) -> list[str] | None:
    """Return "head, gaze" as names, "none" as none."""
    if text is None:
        return None
    return [part.strip() for part in text.split(",") if part.strip() not in ("", "none")]


@contextmanager
def _writer(output: str) -> Iterator[BinaryIO]:
    """Yield where a stream of bytes goes; a file appears whole or not at all."""
    if output == _PIPE:
        if sys.stdout.isatty():
            raise InputError("-o: the stream is not text; say where it goes, -o talk.fgp, or pipe it: | facegen decode")
        yield sys.stdout.buffer
        return
    from facegen.fileio.textfile import check_place, whole_file

    path = check_place(output, [Path(output).suffix.lower()])
    with whole_file(path, "the stream ") as draft, open(draft, "wb") as file:
        yield file


@contextmanager
def _reader(source: str) -> Iterator[BinaryIO]:
    if source == _PIPE:
        yield sys.stdin.buffer
        return
    try:
        with open(source, "rb") as file:
            yield file
    except OSError as error:
        raise FileError(f"{source}: cannot be read: {error.strerror or error}") from error


def _listening(source: str, quiet: bool) -> None:
    if not quiet:
        print(f"{source}: listening; Ctrl-C ends and keeps what came", file=sys.stderr, flush=True)


class _Stop:
    """Whether the user has said stop: what was received is then kept. Ctrl-C twice stops at once."""

    def __init__(self) -> None:
        self._asked = self._waits = False

    def asked(self) -> bool:
        """Return whether."""
        return self._asked

    def interrupt(self, *_: object) -> None:
        """Take a Ctrl-C: only waiting is interrupted, never work on what has come."""
        again, self._asked = self._asked, True
        if again or self._waits:
            raise KeyboardInterrupt

    def watched(self, file: BinaryIO) -> _Watched:
        """Return a file that ends when the user says stop."""
        return _Watched(file, self)

    def read(self, file: BinaryIO, size: int) -> bytes:
        """Return what comes next, nothing after a Ctrl-C."""
        try:
            self._waits = True
            return b"" if self._asked else file.read1(size)
        except KeyboardInterrupt:
            return b""
        finally:
            self._waits = False


class _Watched:
    def __init__(self, file: BinaryIO, stop: _Stop) -> None:
        self._file, self._stop = file, stop

    def read1(self, size: int) -> bytes:
        return self._stop.read(self._file, size)


@contextmanager
def _stoppable() -> Iterator[_Stop]:
    """Let Ctrl-C end what waits, not what is being written."""
    stop = _Stop()
    if threading.current_thread() is not threading.main_thread():
        yield stop
        return
    before = signal.signal(signal.SIGINT, stop.interrupt)
    try:
        yield stop
    finally:
        signal.signal(signal.SIGINT, before)

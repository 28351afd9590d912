"""The ways packets take: a row of bytes in a file or a pipe, or UDP.

UDP packets are the packets themselves, one a datagram; RTP's concerns (numbers, order, time) are the packets' own.
"""

from __future__ import annotations

import socket
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from typing import BinaryIO
from urllib.parse import urlsplit

from facegen.codec.decoder import Decoder, Frame
from facegen.codec.encoder import Encoder
from facegen.codec.packets import MAGIC, MTU, Unframer, framed
from facegen.errors import FileError, InputError

SCHEME = "udp://"
REPEAT = 5.0
"""Seconds of the stream after which the dictionary is sent again over UDP, for who comes late."""

_ENDS = 3                   # times the end is sent over UDP, for none is acknowledged
_APART = 0.002              # seconds between datagrams that are not sent in real time: receivers' buffers are small
_AFTER_END = 0.3            # seconds that a receiver waits for what the end has overtaken
_LOOK = 0.1                 # seconds after which a receiver looks whether it shall stop
_PIECE = 1 << 16


@dataclass(frozen=True)
class Address:
    """Where datagrams go or are awaited."""

    host: str
    port: int


def read_address(text: str, *, sends: bool) -> Address:
    """Return "udp://host:port" as an address; no host is this machine to send to, and any of its own to listen at."""
    try:
        parts = urlsplit(text)
        host, port = parts.hostname, parts.port
    except ValueError:
        host = port = None
    if not text.startswith(SCHEME) or not port or parts.path not in ("", "/"):
        raise InputError(f"address: expected udp://HOST:PORT with a port 1..65535, such as udp://127.0.0.1:5004, "
                         f"got {text!r}")
    return Address(host or ("127.0.0.1" if sends else ""), port)


# -- sending --------------------------------------------------------------------------------------------------------
def write_stream(encoder: Encoder, rows: Iterable[dict], file: BinaryIO, *, realtime: bool = False) -> int:
    """Write frames as a stream of bytes, each packet as soon as it is made; return how many bytes."""
    file.write(MAGIC)
    count, rate = len(MAGIC), encoder.dictionary.rate
    for packet in _paced(encoder, rows, rate if realtime else None):
        data = framed(packet)
        file.write(data)
        file.flush()
        count += len(data)
    return count


def send_udp(encoder: Encoder, rows: Iterable[dict], address: Address, *, realtime: bool = False,
             repeat: float = REPEAT) -> int:
    """Send frames as datagrams, the dictionary again every ``repeat`` seconds of them; return how many bytes.

    FileError if the address cannot be reached.
    """
    rate = encoder.dictionary.rate
    every = max(1, round(float(rate) * repeat))
    count = 0
    with _opened(address, sends=True) as udp:
        frames = 0

        def counted() -> Iterator[dict]:
            nonlocal frames
            for row in rows:
                frames += 1
                yield row

        again = every
        for packet in _paced(encoder, counted(), rate if realtime else None):
            several = [packet]
            if frames >= again:
                several += encoder.introduce()
                again += every
            for data in several:
                count += _sent(udp, data)
                if not realtime:
                    time.sleep(_APART)
        for _ in range(_ENDS - 1):
            time.sleep(_APART)
            count += _sent(udp, packet)
    return count


def _paced(encoder: Encoder, rows: Iterable[dict], rate: Fraction | None) -> Iterator[bytes]:
    """Yield packets; at a rate, no frame before its time."""
    start = time.monotonic()
    for k, row in enumerate(rows):
        if rate is not None:
            time.sleep(max(0.0, start + float(k / rate) - time.monotonic()))
        yield from encoder.push(**row)
    yield from encoder.finish()


def _sent(udp: socket.socket, data: bytes) -> int:
    try:
        return udp.send(data)
    except ConnectionRefusedError:          # nobody listens, yet: UDP does not mind
        return len(data)
    except OSError as error:
        raise FileError(f"udp: a packet cannot be sent: {error.strerror or error}") from error


def _opened(address: Address, *, sends: bool) -> socket.socket:
    """Return a socket that sends to an address or listens at it."""
    try:
        kind, at = socket.AF_INET, (address.host, address.port)
        if address.host:
            found = socket.getaddrinfo(address.host, address.port, type=socket.SOCK_DGRAM)
            kind, _, _, _, at = found[0]
        udp = socket.socket(kind, socket.SOCK_DGRAM)
        try:
            if sends:
                udp.connect(at)
            else:
                udp.bind(at)
        except OSError:
            udp.close()
            raise
    except (OSError, UnicodeError) as error:
        what = "reached" if sends else "listened at"
        raise FileError(f"udp://{address.host}:{address.port}: cannot be {what}: "
                        f"{getattr(error, 'strerror', None) or error}") from error
    return udp


# -- receiving ------------------------------------------------------------------------------------------------------
def read_stream(decoder: Decoder, file: BinaryIO, *, stopped: Callable[[], bool] = lambda: False
                ) -> Iterator[Frame]:
    """Yield the frames in a stream of bytes as they come, to the last that can be read.

    After it, ``decoder.received.damaged`` counts a stretch that was no packet too. stopped: asked after every piece.
    """
    unframer, last = Unframer(), False
    while not last and not stopped():
        piece = file.read1(_PIECE)
        last = not piece
        for packet in unframer.push(piece, last=last):
            yield from decoder.push(packet)
        if decoder.complete:
            break
    decoder.received.damaged += unframer.skipped > 0
    yield from decoder.finish()


def receive_udp(decoder: Decoder, address: Address, *, timeout: float = 30.0,
                stopped: Callable[[], bool] = lambda: False, ready: Callable[[], None] = lambda: None
                ) -> Iterator[Frame]:
    """Yield the frames that come as datagrams, until the stream ends or nothing comes for ``timeout`` seconds.

    stopped: asked every tenth of a second. ready: called once datagrams can come. FileError if the address cannot be
    listened at.
    """
    with _opened(address, sends=False) as udp:
        udp.settimeout(_LOOK)
        ready()
        until = time.monotonic() + timeout
        while not stopped() and not decoder.complete and time.monotonic() < until:
            try:
                data = udp.recv(MTU + 1)
            except TimeoutError:
                continue
            told, damaged = decoder.end_told, decoder.received.damaged
            yield from decoder.push(data)
            if not told and decoder.received.damaged == damaged:       # what is no packet of ours keeps nobody waiting
                until = time.monotonic() + (_AFTER_END if decoder.end_told else timeout)
    yield from decoder.finish()

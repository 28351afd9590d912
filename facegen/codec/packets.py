"""Packets: five bytes before what they carry, so that a lost, doubled or damaged one is known; and packets in a row
of bytes, as a pipe and a file have them.
"""

from __future__ import annotations

import binascii
from dataclasses import dataclass

from facegen.codec.syntax import PacketError

VERSION = 1
DICTIONARY, KEY, NEXT, END = range(4)
HEADER = 5

MTU = 1200
"""Bytes of a packet at most: what passes everywhere without being split, tunnels and IPv6 included."""

MAGIC = b"FGP1"
"""The first bytes of a file and of a pipe."""

MARK = 0xFA
"""Goes before every packet there, with its length in two bytes."""

ROUND = 1 << 16
"""Packets are numbered up to this, then from 0 on again."""


@dataclass(frozen=True)
class Packet:
    """One packet. ``number``: of the motion packet; for others, of the one that comes next."""

    kind: int
    number: int
    body: bytes

    def bytes(self, stream: bytes) -> bytes:
        """Return it as it travels; ``stream``: the id of its dictionary."""
        head = bytes([VERSION << 4 | self.kind]) + (self.number % ROUND).to_bytes(2, "big")
        return head + _check(stream, head, self.body) + self.body


def kind_of(data: bytes) -> int | None:
    """Return what kind of packet these bytes could be, or None if they cannot be one."""
    if not HEADER <= len(data) <= MTU or data[0] >> 4 != VERSION or data[0] & 0b1100:
        return None
    return data[0] & 0b11


def read_packet(data: bytes, stream: bytes) -> Packet:
    """Return the packet in these bytes; PacketError if it is damaged or of another stream than ``stream``."""
    kind = kind_of(data)
    if kind is None:
        raise PacketError("packet: no packet of this version")
    head, body = data[:3], data[HEADER:]
    if data[3:HEADER] != _check(stream, head, body):
        raise PacketError("packet: damaged, or of another stream")
    return Packet(kind, int.from_bytes(data[1:3], "big"), body)


def _check(stream: bytes, head: bytes, body: bytes) -> bytes:
    return binascii.crc_hqx(stream + head + body, 0xFFFF).to_bytes(2, "big")


def framed(packet: bytes) -> bytes:
    """Return a packet as it goes into a file or a pipe."""
    return bytes([MARK]) + len(packet).to_bytes(2, "big") + packet


class Unframer:
    """Takes a row of bytes in any pieces, gives the packets in it.

    What is no packet is passed over up to the next one: ``skipped`` counts those bytes. ::

        unframer = Unframer()
        for piece in pieces:
            for packet in unframer.push(piece): ...
        rest = unframer.push(b"", last=True)
    """

    def __init__(self) -> None:
        self._held, self.skipped = b"", 0

    def push(self, data: bytes, *, last: bool = False) -> list[bytes]:
        """Return the packets that are whole now; ``last``: nothing comes after, so what has begun is not waited for."""
        held, at, packets = self._held + data, 0, []
        while at < len(held):
            taken, packet = _look(held, at)
            if taken == 0 and not last:
                break
            if packet is not None:
                packets.append(packet)
            elif not held.startswith(MAGIC, at):
                taken = 1
                self.skipped += 1
            at += taken
        self._held = held[at:]
        return packets


def _look(held: bytes, at: int) -> tuple[int, bytes | None]:
    """Return how many bytes to take from a place on, 0 if more must come to know, and the packet in them if any."""
    left = len(held) - at
    if held[at] == MAGIC[0] and MAGIC.startswith(held[at:at + len(MAGIC)]):
        return (len(MAGIC) if left >= len(MAGIC) else 0), None
    if held[at] != MARK:
        return 1, None
    if left < 3 + HEADER:
        return 0, None
    length = int.from_bytes(held[at + 1:at + 3], "big")
    if kind_of(held[at + 3:at + 3 + HEADER]) is None or not HEADER <= length <= MTU:
        return 1, None
    if left < 3 + length:
        return 0, None
    after = held[at + 3 + length:at + 4 + length]       # a damaged length does not end where a packet begins
    if after and after[0] not in (MARK, MAGIC[0]):
        return 1, None
    return 3 + length, held[at + 3:at + 3 + length]

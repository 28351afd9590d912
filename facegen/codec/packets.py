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

_KNOWN = 8                  # dictionaries whose packets are known by their checks in one row of bytes

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

    What is no packet, or fails its check, is passed over up to the next one: ``skipped`` counts those bytes. Before a
    dictionary has come packets cannot be checked, and are given as they are. ::

        unframer = Unframer()
        for piece in pieces:
            for packet in unframer.push(piece): ...
        rest = unframer.push(b"", last=True)
    """

    def __init__(self) -> None:
        self._held, self.skipped = b"", 0
        self._streams: list[bytes] = []

    def push(self, data: bytes, *, last: bool = False) -> list[bytes]:
        """Return the packets that are whole now; ``last``: nothing comes after, so what has begun is not waited for."""
        held, at, packets = self._held + data, 0, []
        while at < len(held):
            taken, packet = _look(held, at)
            if taken == 0 and not last:
                break
            if packet is not None and self._whole(packet):
                packets.append(packet)
            elif not held.startswith(MAGIC, at):
                taken = 1
                self.skipped += 1
            at += taken
        self._held = held[at:]
        return packets

    def _whole(self, packet: bytes) -> bool:
        """Return whether a packet passes its check, and keep the id if it is a dictionary's."""
        streams = [b""] if kind_of(packet) == DICTIONARY else self._streams
        if not any(packet[3:HEADER] == _check(stream, packet[:3], packet[HEADER:]) for stream in streams):
            return not streams
        stream = packet[HEADER:HEADER + 4]
        if kind_of(packet) == DICTIONARY and stream not in self._streams:
            self._streams = [*self._streams, stream][-_KNOWN:]
        return True


def _look(held: bytes, at: int) -> tuple[int, bytes | None]:
    """Return how many bytes to take from a place on, 0 if more must come to know, and what they hold if a packet."""
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
    return (3 + length, held[at + 3:at + 3 + length]) if left >= 3 + length else (0, None)

"""What a stream is of: the names, the steps, the rate. Sent before all else, and again for who comes later."""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

from facegen.animation.performance import VOCABULARIES
from facegen.blendshapes.recipes import shape_set
from facegen.codec.syntax import EYE, HEAD, SIDE, WEIGHT, PacketError
from facegen.errors import InputError, nearest

MOST_NAMES = 512
MOST_FRAMES = 64
"""Frames of one packet."""

LARGEST = 1 << 16
"""Bytes of a dictionary, unpacked."""

NUMBERS = ("units", "expressions", "arkit", "visemes", "vrm", "shapes")
"""A vocabulary's number in the format is its place here, for good."""

HEAD_ANGLES = ("head yaw", "head pitch", "head roll")
PLACES = ("place x", "place y", "place z")
GAZES = ("gaze yaw", "gaze pitch", "gaze yaw difference", "gaze pitch difference")
_PARTS = (("head", HEAD_ANGLES), ("place", PLACES), ("gaze", GAZES))

_START = struct.Struct(">BBHHBHB")
_NAMED, _MASKED = range(2)
_COARSEST = 64.0            # the step of code 0; 16 codes halve it


@dataclass(frozen=True)
class Dictionary:
    """All that a decoder must know before motion means anything.

    names: (k,) shapes of the vocabulary. rate: frames a second. frames: of a packet. steps: of each parameter, which
    are the names and then, as far as they are in ``parts`` ("head", "place", "gaze"), `HEAD_ANGLES` (degrees),
    `PLACES` (mm) and `GAZES` (degrees): of both eyes together, and how much more the left eye's is. partners: of each
    name, how many places after it the name is with which it is sent as sum and difference, or 0. bounded: whether
    weights lie in 0..1.
    """

    vocabulary: str
    names: tuple[str, ...]
    rate: Fraction
    frames: int
    codes: tuple[int, ...]
    parts: tuple[str, ...] = ()
    partners: tuple[int, ...] = ()
    bounded: bool = True

    def __post_init__(self) -> None:
        if self.vocabulary not in VOCABULARIES or self.vocabulary not in NUMBERS:
            raise InputError(f"vocabulary: expected {', '.join(NUMBERS)}, got {self.vocabulary!r}"
                             f"{nearest(str(self.vocabulary), NUMBERS)}")
        if len(self.names) > MOST_NAMES or len(set(self.names)) < len(self.names):
            raise InputError(f"names: expected up to {MOST_NAMES}, each once, got {len(self.names)}")
        if bad := [name for name in self.names if not name or "\n" in name]:
            raise InputError(f"names: expected text of one line, got {bad[0]!r}")
        if not (0 < self.rate <= 1000 and max(self.rate.as_integer_ratio()) <= 0xFFFF):
            raise InputError(f"fps: expected frames a second above 0 and up to 1000, got {float(self.rate):g}")
        if isinstance(self.frames, bool) or not 1 <= self.frames <= MOST_FRAMES:
            raise InputError(f"frames: expected 1..{MOST_FRAMES} a packet, got {self.frames!r}")
        if [part for part, _ in _PARTS if part in self.parts] != list(self.parts):
            raise InputError(f"parts: expected some of head, place, gaze in this order, got {self.parts!r}")
        if not self.partners:
            object.__setattr__(self, "partners", (0,) * len(self.names))
        if len(self.codes) != len(self.kinds) or not all(0 <= code <= 255 for code in self.codes):
            raise InputError(f"codes: expected {len(self.kinds)} of 0..255, got {len(self.codes)}")

    @property
    def extras(self) -> tuple[str, ...]:
        """What is sent after the weights."""
        return tuple(name for part, names in _PARTS if part in self.parts for name in names)

    @cached_property
    def kinds(self) -> tuple[int, ...]:
        """The kind of every parameter."""
        kinds = [WEIGHT] * len(self.names)
        for _, right in self.pairs:
            kinds[right] = SIDE
        return (*kinds, *(EYE if name in GAZES else HEAD for name in self.extras))

    @cached_property
    def pairs(self) -> tuple[tuple[int, int], ...]:
        """Places of the names that are sent as sum and difference."""
        if len(self.partners) != len(self.names):
            raise InputError(f"partners: expected {len(self.names)}, got {len(self.partners)}")
        found = [(k, k + ahead) for k, ahead in enumerate(self.partners) if ahead]
        both = [place for pair in found for place in pair]
        if len(set(both)) < len(both) or any(place >= len(self.names) for place in both):
            raise InputError("partners: expected names that each have one partner at most")
        return tuple(found)

    @property
    def steps(self) -> tuple[float, ...]:
        """The step of every parameter, in its unit."""
        return tuple(_COARSEST * 2.0 ** (-code / 16) for code in self.codes)

    @cached_property
    def data(self) -> bytes:
        """The dictionary as it is sent."""
        rate, per = self.rate.as_integer_ratio()
        flags = sum(1 << k for k, (part, _) in enumerate(_PARTS) if part in self.parts) | self.bounded << 3
        known = tuple(shape_set("arkit")) if self.vocabulary == "arkit" else ()
        if self.names and self.names == tuple(name for name in known if name in self.names):
            mask = sum(1 << k for k, name in enumerate(known) if name in self.names)
            listed, way = mask.to_bytes(7, "little"), _MASKED
        else:
            listed, way = "\n".join(self.names).encode(), _NAMED
        start = _START.pack(flags, NUMBERS.index(self.vocabulary), rate, per, self.frames, len(self.names), way)
        return zlib.compress(start + bytes(self.codes) + bytes(self.partners) + listed, 9)

    @cached_property
    def id(self) -> bytes:
        """Four bytes that stand for it."""
        return zlib.crc32(self.data).to_bytes(4, "big")


def step_code(step: float) -> int:
    """Return the code of the step nearest to, and not above, a wanted one."""
    return min(max(math.ceil(16 * math.log2(_COARSEST / step) - 1e-9), 0), 255)


def read_dictionary(data: bytes) -> Dictionary:
    """Return the dictionary that was sent as these bytes; PacketError for others."""
    unpacker = zlib.decompressobj()
    try:
        plain = unpacker.decompress(data, LARGEST)
    except zlib.error as error:
        raise PacketError(f"dictionary: {error}") from None
    if len(plain) < _START.size:
        raise PacketError(f"dictionary: expected {_START.size} bytes or more, got {len(plain)}")
    flags, vocabulary, rate, per, frames, count, way = _START.unpack_from(plain)
    parts = tuple(part for k, (part, _) in enumerate(_PARTS) if flags >> k & 1)
    wide = count + sum(len(names) for part, names in _PARTS if part in parts)
    codes, partners, listed = _cut(plain, _START.size, wide, count)
    if flags >> 4 or vocabulary >= len(NUMBERS) or way not in (_NAMED, _MASKED) or not per:
        raise PacketError("dictionary: holds what this version does not know")
    try:
        names = _masked(listed) if way == _MASKED else tuple(listed.decode().split("\n")) if listed else ()
        if len(names) != count:
            raise PacketError(f"dictionary: expected {count} names, got {len(names)}")
        found = Dictionary(NUMBERS[vocabulary], names, Fraction(rate, per), frames, tuple(codes), parts,
                           tuple(partners), bool(flags >> 3 & 1))
        _ = found.pairs, found.kinds
    except UnicodeDecodeError as error:
        raise PacketError(f"dictionary: {error}") from None
    except InputError as error:
        raise PacketError(f"dictionary: {error}") from None
    found.__dict__["data"] = data       # its own bytes, whatever packed them
    return found


def _cut(plain: bytes, at: int, *lengths: int) -> Sequence[bytes]:
    """Return pieces of these lengths from a place on, and what is left."""
    pieces = []
    for length in lengths:
        pieces.append(plain[at:at + length])
        at += length
    if at > len(plain):
        raise PacketError(f"dictionary: expected {at} bytes or more, got {len(plain)}")
    return [*pieces, plain[at:]]


def _masked(listed: bytes) -> tuple[str, ...]:
    mask = int.from_bytes(listed, "little")
    known = tuple(shape_set("arkit"))
    if len(listed) != 7 or mask >> len(known):
        raise PacketError("dictionary: expected a mask of ARKit's 52 shapes in 7 bytes")
    return tuple(name for k, name in enumerate(known) if mask >> k & 1)

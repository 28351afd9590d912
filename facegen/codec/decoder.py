"""Packets in, frames out: in order, on time, whatever the way did to the packets."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from facegen.codec.dictionary import GAZES, HEAD_ANGLES, LARGEST, PLACES, Dictionary, read_dictionary
from facegen.codec.packets import DICTIONARY, END, KEY, ROUND, Packet, kind_of, read_packet
from facegen.codec.pairs import from_sums
from facegen.codec.rangecoder import RangeDecoder
from facegen.codec.syntax import Models, Motion, PacketError, code_motion
from facegen.errors import InputError

WAIT = 4
"""Packets after a missing one that are held back for it, by default."""

CONCEALED = 2.0
"""Seconds of missing packets that are bridged; of a longer gap nobody can know what the face did."""

FAR = 64
"""A packet that many numbers away is believed only when a second one follows it."""

MOST_FRAMES_LOST = 4096
"""Frames that are given as missing in one gap; a longer one is passed over in time."""

_HELD = 64                  # packets kept while the dictionary has not come


@dataclass(frozen=True, eq=False)
class Frame:
    """One frame. time: seconds from the stream's first. weights: (k,); NaN, as all, where no face was seen.

    head (3,), place (3,), gaze (4,): as in `Performance`, None if not sent. concealed: made up for a lost packet.
    """

    number: int
    time: float
    weights: NDArray[np.float64]
    head: NDArray[np.float64] | None = None
    place: NDArray[np.float64] | None = None
    gaze: NDArray[np.float64] | None = None
    concealed: bool = False


@dataclass
class Received:
    """What happened to packets: ``taken`` were decoded; ``lost`` never came or came too ``late``, ``doubled`` came
    again, ``damaged`` cannot be read, ``unusable`` need one that is lost; frames were ``concealed`` or are
    ``missing``."""

    taken: int = 0
    lost: int = 0
    late: int = 0
    doubled: int = 0
    damaged: int = 0
    unusable: int = 0
    concealed: int = 0
    missing: int = 0


@dataclass
class _Parts:
    """Pieces of a dictionary that is not whole yet."""

    id: bytes = b""
    count: int = 0
    pieces: dict[int, bytes] = field(default_factory=dict)


class Decoder:
    """Gives the frames of a stream. It takes any bytes and never raises for them: `received` counts what was wrong.

    wait: packets that may overtake a missing one before it counts as lost; more patience is more delay. What is lost
    is bridged by lines from the last frame to the next for up to `CONCEALED` seconds, and is then "no face"; at the
    end of a stream the face holds still. ::

        decoder = Decoder()
        for data in packets:
            for frame in decoder.push(data): ...
        for frame in decoder.finish(): ...
    """

    def __init__(self, *, wait: int = WAIT) -> None:
        if isinstance(wait, bool) or not isinstance(wait, int) or not 0 <= wait < FAR:
            raise InputError(f"wait: expected packets, 0..{FAR - 1}, got {wait!r}")
        self.dictionary: Dictionary | None = None
        self.received = Received()
        self.ended = False
        self._wait, self._early = wait, []
        self._parts = _Parts()
        self._waiting: dict[int, Packet] = {}
        self._next: int | None = None           # the packet that comes next
        self._end: int | None = None            # the number of packets, once known
        self._far: int | None = None
        self._shift = 0                         # packets by which the sender's numbers are behind time
        self._frame: int | None = None          # the frame that comes next
        self._row: NDArray[np.float64] | None = None
        self._models, self._ends, self._chain = Models(), [], -1

    @property
    def complete(self) -> bool:
        """Whether the end was told and nothing is missing before it."""
        return self.ended or (self._end is not None and self._next is not None and self._next >= self._end)

    @property
    def end_told(self) -> bool:
        """Whether the sender said that it is done; packets may still be on their way."""
        return self._end is not None

    def push(self, data: bytes) -> list[Frame]:
        """Take a packet and return the frames that are ready, in order."""
        if not isinstance(data, (bytes, bytearray, memoryview)):
            raise InputError(f"data: expected the bytes of a packet, got {type(data).__name__}")
        data = bytes(data)
        if self.ended:
            self.received.late += 1
            return []
        kind = kind_of(data)
        try:
            if kind == DICTIONARY:
                return self._learn(read_packet(data, b"").body)
            if self.dictionary is None:
                if kind is None or len(self._early) == _HELD:
                    raise PacketError("packet: there is no dictionary yet")
                self._early.append(data)
                return []
            packet = read_packet(data, self.dictionary.id)
        except PacketError:
            self.received.damaged += 1
            return []
        return self._sort(packet)

    def finish(self) -> list[Frame]:
        """Return the frames that were held back; nothing comes after."""
        if self.ended:
            return []
        frames = self._release(patience=0)
        if self._end is not None and self._next is not None and self._end > self._next:
            self.received.lost += self._end - self._next
            frames += self._bridge((self._end + self._shift) * self.dictionary.frames, None)
        self.received.damaged += len(self._early)
        self.ended = True
        return frames

    # -- dictionary ------------------------------------------------------------------------------------------------
    def _learn(self, body: bytes) -> list[Frame]:
        """Take a piece of a dictionary; only the first that is whole counts."""
        if len(body) < 6 or not body[4] < body[5] <= LARGEST // 1024:
            raise PacketError("dictionary: expected an id, a piece's number and their count")
        if self.dictionary is not None:
            if body[:4] != self.dictionary.id:
                raise PacketError("dictionary: of another stream")
            return []
        if (body[:4], body[5]) != (self._parts.id, self._parts.count):
            self._parts = _Parts(body[:4], body[5])
        self._parts.pieces[body[4]] = body[6:]
        if len(self._parts.pieces) < body[5]:
            return []
        pieces, self._parts = self._parts, _Parts()
        found = read_dictionary(b"".join(pieces.pieces[k] for k in range(pieces.count)))
        if found.id != pieces.id:
            raise PacketError("dictionary: damaged")
        self.dictionary = found
        self._row = None
        early, self._early = self._early, []
        return [frame for data in early for frame in self.push(data)]

    # -- order -----------------------------------------------------------------------------------------------------
    def _sort(self, packet: Packet) -> list[Frame]:
        """Put a packet where it belongs, and return what is ready."""
        if self._next is None:                  # the first: 0, or the lowest of the first few
            if packet.kind == END:
                self._end = packet.number
                return []
            self._waiting[packet.number] = packet
            if 0 not in self._waiting and len(self._waiting) <= self._wait:
                return []
            return self._release(self._wait)
        number = self._next + (packet.number - self._next + ROUND // 2) % ROUND - ROUND // 2
        if abs(number - self._next) > FAR and not self._believed(packet, number):
            return []
        number = self._next + (packet.number - self._next + ROUND // 2) % ROUND - ROUND // 2
        if packet.kind == END:
            self._end = number
        elif number < self._next:
            self.received.late += 1
        elif number in self._waiting:
            self.received.doubled += 1
        else:
            self._waiting[number] = packet
        return self._release(self._wait)

    def _believed(self, packet: Packet, number: int) -> bool:
        """Return whether a packet far from the expected is followed there: the sender began anew, or time was lost."""
        follows = self._far is not None and number == self._far + 1
        self._far = number
        if not follows:
            self.received.late += number < self._next
            return False
        if number < self._next:                 # began anew: go on in time where we are
            self._shift += self._next - number
            self._waiting.clear()
            self._next = number
        return True

    def _release(self, patience: int) -> list[Frame]:
        """Return the frames of the packets that are next, passing over what is given up."""
        frames: list[Frame] = []
        if self._next is None and self._waiting:
            low = _earliest(list(self._waiting))
            self._waiting = {low + (number - low) % ROUND: one for number, one in self._waiting.items()}
            self._next = low
        while self._waiting:
            if self._next not in self._waiting:
                if max(self._waiting) - self._next < patience:
                    break
                self.received.lost += min(self._waiting) - self._next
                self._next = min(self._waiting)
            frames += self._frames(self._waiting.pop(self._next))
            self._next += 1
        return frames

    # -- frames ----------------------------------------------------------------------------------------------------
    def _frames(self, packet: Packet) -> list[Frame]:
        """Return the frames of a packet, and before them those that bridge what was lost."""
        d, number = self.dictionary, self._next
        key = packet.kind == KEY
        if not key and self._chain != number - 1:
            self.received.unusable += 1
            return []
        if key:
            self._models = Models()
        before = None if key else self._ends
        try:
            motion = code_motion(RangeDecoder(packet.body), self._models, d.kinds, d.frames, before)
        except PacketError:
            self.received.damaged += 1
            self._chain = -1
            return []
        self.received.taken += 1
        self._chain = number
        first = (number + self._shift) * d.frames
        rows = self._rows(motion)
        if motion.curves:
            self._ends = [curve[len(rows) - 1] for curve in motion.curves]
        elif key:
            self._ends = [0] * len(d.kinds)
        start = rows[0] if motion.found[0] else None
        frames = self._bridge(first, start) if self._frame is not None else []
        if self._frame is None:
            self._frame = first
        for row, seen in zip(rows, motion.found, strict=True):
            frames.append(self._frame_of(row if seen else np.full(len(row), np.nan)))
        self._row = rows[-1] if motion.found[-1] else None
        return frames

    def _rows(self, motion: Motion) -> NDArray[np.float64]:
        """Return the parameters (n, k) of a packet's frames, in their units."""
        d, count = self.dictionary, len(motion.found)
        if not motion.curves:
            return np.full((count, len(d.kinds)), np.nan)
        frames = np.arange(count)
        rows = np.empty((count, len(d.kinds)))
        for k, curve in enumerate(motion.curves):
            knots = sorted(curve)
            rows[:, k] = np.interp(frames, knots, [curve[knot] for knot in knots])
        return rows * d.steps

    def _bridge(self, until: int, to: NDArray[np.float64] | None) -> list[Frame]:
        """Return the frames from where we are to ``until``, which is none if nothing is missing."""
        gap = until - (self._frame if self._frame is not None else until)
        if gap <= 0:
            return []
        if gap > MOST_FRAMES_LOST:
            self.received.missing += gap
            self._frame = until
            return []
        start = self._row
        if gap > CONCEALED * self.dictionary.rate or (start is None and to is None):
            row = np.full(len(self.dictionary.kinds), np.nan)
            self.received.missing += gap
            return [self._frame_of(row, concealed=True) for _ in range(gap)]
        start = to if start is None else start
        end = start if to is None else to
        self.received.concealed += gap
        return [self._frame_of(start + (end - start) * k / (gap + 1), concealed=True) for k in range(1, gap + 1)]

    def _frame_of(self, row: NDArray[np.float64], *, concealed: bool = False) -> Frame:
        d, number = self.dictionary, self._frame
        self._frame += 1
        row = from_sums(row, d.pairs)
        weights = row[:len(d.names)]
        values = dict(zip(d.extras, row[len(d.names):].tolist(), strict=True))
        if "gaze" in d.parts:
            mean, half = (np.array([values[name] for name in names]) for names in (GAZES[:2], GAZES[2:]))
            gaze = np.concatenate([mean + half / 2, mean - half / 2])
        return Frame(number, float(number / d.rate), np.clip(weights, 0.0, 1.0) if d.bounded else weights,
                     np.array([values[name] for name in HEAD_ANGLES]) if "head" in d.parts else None,
                     np.array([values[name] for name in PLACES]) if "place" in d.parts else None,
                     gaze if "gaze" in d.parts else None, concealed)


def _earliest(numbers: list[int]) -> int:
    """Return the number that comes before the others, round the end of numbers."""
    return min(numbers, key=lambda one: max((other - one) % ROUND for other in numbers))

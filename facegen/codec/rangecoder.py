"""An adaptive binary range coder: bits in, nearly as few bits out as their probabilities allow.

Based on: G. Martin, Range encoding, 1979, in the byte-wise form with carries; every yes-or-no question has a model of
its own that learns how it is mostly answered. Whole numbers only, so that every machine decodes the same.
`docs/codec.md` repeats all of it bit for bit.
"""

from __future__ import annotations

PROBABILITY_BITS = 16
ONE = 1 << PROBABILITY_BITS

LEAST = 64
"""Smallest probability of an answer, of `ONE`: a surprise costs 10 bits at most, a certainty 0.0014 at least."""

SLOWEST = 30
"""Answers after which a model learns no slower: faces rest and move, old answers must fade."""

_TOP = 1 << 32
_BOTTOM = 1 << 24
_MASK = _TOP - 1
_RATES = tuple(2 * ONE // (2 * n + 3) for n in range(SLOWEST + 1))      # 1 / (n + 1.5), Krichevsky-Trofimov's pace


class Model:
    """How likely the answer to one question is "no", and how many answers that rests on."""

    __slots__ = ("no", "seen")

    def __init__(self, no: float = 0.5, seen: int = 0) -> None:
        self.no = min(max(round(no * ONE), LEAST), ONE - LEAST)
        self.seen = min(seen, SLOWEST)

    def copy(self) -> Model:
        """Return a model that knows the same and learns by itself."""
        other = Model.__new__(Model)
        other.no, other.seen = self.no, self.seen
        return other

    def learn(self, bit: int) -> None:
        """Move towards an answer."""
        rate = _RATES[self.seen]
        if bit:
            self.no = max(self.no - (self.no * rate >> PROBABILITY_BITS), LEAST)
        else:
            self.no = min(self.no + ((ONE - self.no) * rate >> PROBABILITY_BITS), ONE - LEAST)
        if self.seen < SLOWEST:
            self.seen += 1


class RangeEncoder:
    """Takes bits, gives bytes.

    `bit` returns what it is given, as `RangeDecoder.bit` returns what it finds: one function can write and read. ::

        coder = RangeEncoder()
        coder.bit(model, 1)
        data = coder.finish()
    """

    reads = False

    def __init__(self) -> None:
        self._low, self._range, self._out = 0, _MASK, bytearray()

    def bit(self, model: Model, bit: int) -> int:
        """Write the answer to a question, and let its model learn."""
        bound = (self._range >> PROBABILITY_BITS) * model.no
        if bit:
            self._low += bound
            self._range -= bound
        else:
            self._range = bound
        model.learn(bit)
        self._shift()
        return bit

    def even(self, bit: int) -> int:
        """Write an answer that nothing is known about."""
        self._range >>= 1
        if bit:
            self._low += self._range
        self._shift()
        return bit

    def finish(self) -> bytes:
        """Return the fewest bytes that mean what was written; zeros are thought after them."""
        high = self._low + self._range - 1
        for kept in range(5):
            unit = 1 << (32 - 8 * kept)
            value = -(-self._low // unit) * unit
            if value <= high:
                break
        self._low = value
        for _ in range(4):
            self._emit()
        return bytes(self._out).rstrip(b"\0")

    def _shift(self) -> None:
        while self._range < _BOTTOM:
            self._emit()
            self._range <<= 8

    def _emit(self) -> None:
        """Move the highest byte of `low` to the output; a carry goes back into what is there."""
        if self._low >= _TOP:
            at = len(self._out) - 1
            while self._out[at] == 255:
                self._out[at] = 0
                at -= 1
            self._out[at] += 1
            self._low -= _TOP
        self._out.append(self._low >> 24)
        self._low = (self._low & 0xFFFFFF) << 8


class RangeDecoder:
    """Gives back the bits that `RangeEncoder` took, to the same questions in the same order.

    Any bytes decode to some answers: who asks must ask a bounded number of questions.
    """

    reads = True

    def __init__(self, data: bytes) -> None:
        self._data, self._at, self._range = data, 4, _MASK
        self._code = int.from_bytes(data[:4].ljust(4, b"\0"), "big")

    def bit(self, model: Model, _bit: int = 0) -> int:
        """Return the answer to a question, and let its model learn."""
        bound = (self._range >> PROBABILITY_BITS) * model.no
        if self._code < bound:
            self._range, bit = bound, 0
        else:
            self._code -= bound
            self._range -= bound
            bit = 1
        model.learn(bit)
        self._shift()
        return bit

    def even(self, _bit: int = 0) -> int:
        """Return an answer that nothing was known about."""
        self._range >>= 1
        bit = int(self._code >= self._range)
        if bit:
            self._code -= self._range
        self._shift()
        return bit

    def _shift(self) -> None:
        while self._range < _BOTTOM:
            more = self._data[self._at] if self._at < len(self._data) else 0
            self._code = (self._code << 8 | more) & _MASK
            self._range <<= 8
            self._at += 1

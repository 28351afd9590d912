"""Frames of a performance in, packets out."""

from __future__ import annotations

import math
import numbers
from collections.abc import Mapping, Sequence
from fractions import Fraction

import numpy as np
from numpy.typing import ArrayLike, NDArray

from facegen.codec.dictionary import Dictionary, step_code
from facegen.codec.packets import DICTIONARY, END, HEADER, KEY, MTU, NEXT, Packet
from facegen.codec.pairs import partners, to_sums
from facegen.codec.plan import REACH, TRADE, plan_curve, still
from facegen.codec.rangecoder import RangeEncoder
from facegen.codec.steps import COARSEST, QUALITY, extra_steps, movement
from facegen.codec.syntax import FARTHEST, Models, Motion, code_motion
from facegen.errors import InputError, nearest

FRAMES = 16
"""Frames of a packet by default: 0.64 s at 25 a second, where longer packets save little."""

FINEST, ROUGHEST = 0.02, 20.0
_ATTEMPTS = 8               # to make a packet fit into `MTU`, each with the trade four times as hard
_CHUNK = MTU - HEADER - 6
_WIDTHS = {"head": 3, "place": 3, "gaze": 4}


class Encoder:
    """Sends frames as packets; the first ones are the dictionary.

    names: (k,) shapes of ``vocabulary`` (as `Performance` has them). fps: frames a second. parts: which of "head",
    "place" and "gaze" come too. quality: millimetres of face movement in a step. frames: of a packet, 1..64, which is
    the delay. key_every: packets from one that needs no other to the next such. steps: in the weights' unit, name ->
    step, instead of what ``quality`` gives. InputError for what cannot be. ::

        encoder = Encoder(("1", "4", "12"), fps=25)
        for weights in ...:
            for packet in encoder.push(weights, head=(yaw, pitch, roll)):
                socket.send(packet)
        for packet in encoder.finish(): ...
    """

    def __init__(self, names: Sequence[str], *, vocabulary: str = "units", fps: float | Fraction = 25,
                 parts: Sequence[str] = ("head", "gaze"), quality: float = QUALITY, frames: int = FRAMES,
                 key_every: int = 1, steps: Mapping[str, float] | None = None) -> None:
        if isinstance(names, str):
            raise InputError(f"names: expected several names, got {names!r}")
        names = tuple(map(str, names))
        self.quality = _number("quality", quality, FINEST, ROUGHEST)
        if isinstance(key_every, bool) or not isinstance(key_every, int) or not 1 <= key_every <= 1000:
            raise InputError(f"key_every: expected packets, 1..1000, got {key_every!r}")
        if isinstance(frames, bool) or not isinstance(frames, int):
            raise InputError(f"frames: expected a whole number, got {frames!r}")
        if wrong := [part for part in parts if part not in _WIDTHS]:
            raise InputError(f"parts: expected head, place, gaze, got {wrong[0]!r}{nearest(str(wrong[0]), _WIDTHS)}")
        parts = tuple(part for part in _WIDTHS if part in parts)
        ahead = partners(names, vocabulary)
        codes = [0] * (len(names) + sum(_WIDTHS[part] for part in parts))
        draft = Dictionary(vocabulary, names, _rate(fps), frames, tuple(codes), parts, ahead, vocabulary != "shapes")
        self.dictionary = Dictionary(vocabulary, names, draft.rate, frames, self._codes(draft, steps or {}), parts,
                                     ahead, draft.bounded)
        self.key_every = key_every
        self.clipped = self.coarser = 0
        """Weights outside 0..1 that were clipped; packets that had to be coarser than asked, to fit."""
        self._steps = np.array(self.dictionary.steps)
        self._last = np.zeros(len(self._steps))
        self._rows: list[NDArray[np.float64]] = []
        self._found: list[bool] = []
        self._number, self._taken, self._started, self._ended = 0, 0, False, False
        self._models, self._ends = Models(), None

    def _codes(self, draft: Dictionary, given: Mapping[str, float]) -> tuple[int, ...]:
        if unknown := [name for name in given if name not in draft.names]:
            raise InputError(f"steps: there is no {unknown[0]!r} among the names{nearest(unknown[0], draft.names)}")
        wanted = np.minimum(self.quality / np.maximum(movement(draft.vocabulary, draft.names), 1e-9), COARSEST)
        for name, step in given.items():
            wanted[draft.names.index(name)] = _number(f"steps: {name}", step, 0.002, 64.0)
        for a, b in draft.pairs:
            finest = min(wanted[a], wanted[b])
            wanted[a], wanted[b] = finest / math.sqrt(2), finest * math.sqrt(2)     # errors as of two alone
        return tuple(map(step_code, (*wanted.tolist(), *extra_steps(draft.parts, self.quality))))

    # -- frames ----------------------------------------------------------------------------------------------------
    def push(self, weights: ArrayLike | Mapping[str, float], *, head: ArrayLike | None = None,
             place: ArrayLike | None = None, gaze: ArrayLike | None = None) -> list[bytes]:
        """Take the next frame and return the packets that are ready.

        weights: (k,), NaN for what is not known, or name -> weight, others 0. All NaN: no face was seen. head, place,
        gaze: as in `Performance`; None or NaN keeps the last. InputError for a wrong shape or name.
        """
        if self._ended:
            raise InputError("push: the stream has ended; make a new Encoder")
        row = self._row(weights, {"head": head, "place": place, "gaze": gaze})
        self._found.append(bool(np.isfinite(row[:len(self.dictionary.names)]).any()) or not self.dictionary.names)
        self._rows.append(row)
        self._taken += 1
        ready = self._start()
        if len(self._rows) == self.dictionary.frames:
            ready.append(self._packet())
        return ready

    def finish(self) -> list[bytes]:
        """Return the last packets: what has not filled one, and the end."""
        if self._ended:
            return []
        ready = self._start()
        if self._rows:
            ready.append(self._packet())
        self._ended = True
        return [*ready, Packet(END, self._number, b"").bytes(self.dictionary.id)]

    def introduce(self) -> list[bytes]:
        """Return the packets of the dictionary, for one who comes later: they may be sent at any time."""
        data = self.dictionary.data
        chunks = [data[at:at + _CHUNK] for at in range(0, len(data), _CHUNK)]
        return [Packet(DICTIONARY, self._number, self.dictionary.id + bytes([k, len(chunks)]) + chunk).bytes(b"")
                for k, chunk in enumerate(chunks)]

    @property
    def frames_taken(self) -> int:
        """How many frames were pushed."""
        return self._taken

    def told(self) -> tuple[str, ...]:
        """Return what was odd about the frames, in words."""
        said = []
        if self.clipped:
            said.append(f"{self.clipped} weights lie outside 0..1 and were sent as the nearest that does not")
        if self.coarser:
            said.append(f"{self.coarser} packets were sent coarser than asked, to fit into {MTU} bytes")
        return tuple(said)

    # -- inside ----------------------------------------------------------------------------------------------------
    def _start(self) -> list[bytes]:
        if self._started:
            return []
        self._started = True
        return self.introduce()

    def _row(self, weights: ArrayLike | Mapping[str, float], others: Mapping[str, ArrayLike | None]
             ) -> NDArray[np.float64]:
        names = self.dictionary.names
        if isinstance(weights, Mapping):
            if unknown := [name for name in weights if name not in names]:
                raise InputError(f"weights: the stream has no {unknown[0]!r}{nearest(str(unknown[0]), names)}")
            weights = [weights.get(name, 0.0) for name in names]
        row = [_row("weights", weights, len(names))]
        if self.dictionary.bounded:
            within = np.clip(row[0], 0.0, 1.0)
            self.clipped += int(np.nansum(within != row[0])) - int(np.isnan(row[0]).sum())
            row[0] = within
        for part, value in others.items():
            if part in self.dictionary.parts:
                found = _row(part, np.full(_WIDTHS[part], np.nan) if value is None else value, _WIDTHS[part])
                if part == "gaze":              # left and right as the mean of both, and left less right
                    found = np.concatenate([(found[:2] + found[2:]) / 2, found[:2] - found[2:]])
                row.append(found)
        return to_sums(np.concatenate(row), self.dictionary.pairs)

    def _packet(self) -> bytes:
        """Return the packet of the frames that are held."""
        key = self._ends is None or self._number % self.key_every == 0
        courses = self._filled(np.array(self._rows)) / self._steps
        limit = FARTHEST - 1
        courses = np.clip(courses, -limit, limit)
        found, self._rows, self._found = self._found, [], []
        trade, reach = TRADE, REACH
        for attempt in range(_ATTEMPTS + 1):
            last = attempt == _ATTEMPTS         # nothing fits: say that no face was seen
            body, models, ends = self._coded(courses, [False] * len(found) if last else found, key, trade, reach)
            if len(body) <= MTU - HEADER:
                break
            trade, reach = 4 * trade, 2 * reach
        self.coarser += attempt > 0
        self._models, self._ends = models, ends
        packet = Packet(KEY if key else NEXT, self._number, body)
        self._number += 1
        return packet.bytes(self.dictionary.id)

    def _coded(self, courses: NDArray[np.float64], found: list[bool], key: bool, trade: float, reach: float
               ) -> tuple[bytes, Models, list[int]]:
        before = None if key else self._ends
        models = Models() if key else self._models.copy()
        coder, motion = RangeEncoder(), Motion(found)
        if any(found):
            first, last = 0 if key else -1, len(found) - 1
            rests, at = still(courses, None if key else np.array(before), trade=trade)
            for k, (rest, step) in enumerate(zip(rests.tolist(), at.tolist(), strict=True)):
                motion.curves.append({first: step, last: step} if rest else plan_curve(
                    courses[:, k], None if key else before[k], self.dictionary.kinds[k], trade=trade, reach=reach))
        code_motion(coder, models, self.dictionary.kinds, self.dictionary.frames, before, motion)
        ends = [curve[len(found) - 1] for curve in motion.curves] or before or [0] * len(self._steps)
        return coder.finish(), models, ends

    def _filled(self, rows: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the rows (n, k) without gaps: a line between what is known, else what was known last."""
        frames = np.arange(len(rows))
        for k in np.flatnonzero(np.isnan(rows).any(axis=0)):
            known = np.isfinite(rows[:, k])
            rows[:, k] = np.interp(frames, frames[known], rows[known, k]) if known.any() else self._last[k]
        self._last = rows[-1]
        return rows


def _row(name: str, values: ArrayLike, width: int) -> NDArray[np.float64]:
    try:
        row = np.array(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError(f"{name}: expected {width} numbers, got {type(values).__name__}") from None
    if row.shape != (width,) or np.isinf(row).any():
        raise InputError(f"{name}: expected {width} finite numbers or NaN, got shape {row.shape}")
    return row


def _number(name: str, value: object, low: float, high: float) -> float:
    if isinstance(value, bool) or not isinstance(value, numbers.Real) or not low <= value <= high:
        raise InputError(f"{name}: expected a number in {low:g}..{high:g}, got {value!r}")
    return float(value)


def _rate(fps: object) -> Fraction:
    """Return a rate as a fraction that the format holds: 25, 29.97 as 30000/1001 and so on."""
    if isinstance(fps, bool) or not isinstance(fps, (numbers.Real, Fraction)) or not 0.01 <= fps <= 1000:
        raise InputError(f"fps: expected frames a second, 0.01..1000, got {fps!r}")
    return Fraction(fps).limit_denominator(1001) if fps >= 1 else Fraction(fps).limit_denominator(50_000)

"""A whole performance as a stream, and back."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from facegen.animation.performance import Performance
from facegen.blendshapes.recipes import shape_set
from facegen.codec.decoder import Decoder, Frame
from facegen.codec.dictionary import Dictionary
from facegen.codec.encoder import FRAMES, Encoder
from facegen.codec.steps import QUALITY
from facegen.errors import InputError

FPS = 25.0

_UNEVEN = 1e-3              # of an interval: times off by less are the rate's own
_GAP = 0.25                 # seconds without frames, from which on no face was seen


def encode_performance(performance: Performance, *, fps: float | Fraction = FPS, parts: Sequence[str] | None = None,
                       quality: float = QUALITY, frames: int = FRAMES, key_every: int = 1) -> list[bytes]:
    """Return the packets of a performance: dictionary, motion, end. Arguments as for `Encoder`.

    parts: by default the head's angles and the gaze, if there are any. Its times are made even, from 0 on. ::

        packets = encode_performance(performance)
        again = decode_packets(packets)
    """
    performance = in_order(performance)
    encoder = encoder_for(performance, fps=fps, parts=parts, quality=quality, frames=frames, key_every=key_every)
    packets = [packet for row in rows(performance, fps) for packet in encoder.push(**row)]
    return packets + encoder.finish()


def in_order(performance: Performance) -> Performance:
    """Return a performance with ARKit's shapes in their set's own order, in which a dictionary needs no names."""
    places = {name: place for place, name in enumerate(shape_set("arkit"))}
    if performance.vocabulary != "arkit" or not set(performance.names) <= set(places):
        return performance
    order = sorted(range(len(performance.names)), key=lambda k: places[performance.names[k]])
    return replace(performance, names=tuple(performance.names[k] for k in order),
                   weights=performance.weights[:, order])


def encoder_for(performance: Performance, *, fps: float | Fraction = FPS, parts: Sequence[str] | None = None,
                quality: float = QUALITY, frames: int = FRAMES, key_every: int = 1) -> Encoder:
    """Return an encoder for a performance's names and parts; InputError for a part that it does not have."""
    if parts is None:
        parts = [part for part in ("head", "gaze") if getattr(performance, part) is not None]
    for part in parts:
        if getattr(performance, part, 0) is None:
            raise InputError(f"parts: the performance has no {part}")
    return Encoder(performance.names, vocabulary=performance.vocabulary, fps=fps, parts=parts, quality=quality,
                   frames=frames, key_every=key_every)


def rows(performance: Performance, fps: float | Fraction) -> Iterator[dict[str, NDArray[np.float64]]]:
    """Yield what `Encoder.push` takes, ``fps`` times a second: lines between the recorded frames.

    No face was seen where the nearest recorded frame has none, and in gaps of more than a quarter of a second.
    """
    p = performance
    since = p.times - p.times[0]
    at = np.arange(int(np.floor(p.duration * float(fps) + _UNEVEN)) + 1) / float(fps)
    right = np.clip(np.searchsorted(since, at), 1, max(len(p) - 1, 1)) if len(p) > 1 else np.zeros(len(at), int)
    left = np.maximum(right - 1, 0)
    if len(p) > 1:
        near = np.where(at - since[left] <= since[right] - at, left, right)
        apart = since[right] - since[left]
        lost = ~p.found[near] | ((apart > _GAP) & (np.abs(at - since[near]) > _GAP / 2))
    else:
        lost = ~p.found[left]
    columns = {"weights": p.weights, "head": p.head, "place": p.place, "gaze": p.gaze}
    sampled = {name: _sampled(since, values, at) for name, values in columns.items() if values is not None}
    if "weights" in sampled:
        sampled["weights"][lost] = np.nan
    for k in range(len(at)):
        yield {name: values[k] for name, values in sampled.items()}


def _sampled(since: NDArray[np.float64], values: NDArray[np.float64], at: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return values (n, k) at other times; columns that have none stay NaN."""
    found = np.full((len(at), values.shape[1]), np.nan)
    for k, column in enumerate(values.T):
        known = np.isfinite(column)
        if known.any():
            found[:, k] = np.interp(at, since[known], column[known])
    return found


def decode_packets(packets: Iterable[bytes], *, wait: int = 16) -> Performance:
    """Return the performance in packets, in whatever order and state they are; InputError if there is none.

    What was lost, and what else was odd, is in its ``warnings``.
    """
    decoder = Decoder(wait=wait)
    frames = [frame for packet in packets for frame in decoder.push(packet)]
    return performance_of(decoder, [*frames, *decoder.finish()])


def performance_of(decoder: Decoder, frames: Sequence[Frame]) -> Performance:
    """Return frames that a decoder gave as a performance."""
    if not frames:
        missing = "no frame" if decoder.dictionary is not None else "no dictionary"
        raise InputError(f"packets: {missing} came; {_told(decoder) or 'nothing was received'}")
    d: Dictionary = decoder.dictionary
    warnings = [told] if (told := _told(decoder)) else []
    stack = {part: np.array([getattr(frame, part) for frame in frames]) for part in d.parts}
    return Performance(np.array([frame.time for frame in frames]), d.names, np.array([one.weights for one in frames]),
                       d.vocabulary, **stack, about={"format": "facegen stream"}, warnings=tuple(warnings))


def _told(decoder: Decoder) -> str:
    """Return what went wrong on the way, in words."""
    found = decoder.received
    said = [f"{count} packet{'s' if count > 1 else ''} {what}" for count, what in (
        (found.lost, "lost"), (found.late, "too late"), (found.doubled, "doubled"), (found.damaged, "damaged"),
        (found.unusable, "of no use without one that was lost")) if count > 0]
    frames = [f"{count} frame{'s' if count > 1 else ''} {what}" for count, what in (
        (found.concealed, "bridged"), (found.missing, "missing")) if count > 0]
    return "received: " + ", ".join(said + frames) if said or frames else ""

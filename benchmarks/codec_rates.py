"""Bits against millimetres: parameter streams of real recordings, beside zlib on the same steps and MPEG-4's figure.

    python benchmarks/codec_rates.py            prints the tables of docs/codec.md; --write puts them there, and a chart
    python benchmarks/codec_rates.py --count    how often each question is answered "no": priors are rounded from this

Errors are distances between the skin's vertices of the base face (level 1), played from the recording and from the
stream, over all vertices and all frames: movements of shapes are added, a turned head is taken to first order.
"""

from __future__ import annotations

import argparse
import platform
import random
import time
import zlib
from collections.abc import Iterable
from functools import cache
from pathlib import Path

import numpy as np
from real_recordings import recordings

import facegen.codec.encoder
from facegen import Performance, load_clip, load_face
from facegen.animation.clip import Clip
from facegen.animation.idle import Idle
from facegen.blendshapes.recipes import shape_set
from facegen.codec.packets import DICTIONARY, kind_of
from facegen.codec.pairs import from_sums, to_sums
from facegen.codec.rangecoder import Model
from facegen.codec.recording import decode_packets, encode_performance, encoder_for, rows
from facegen.codec.sampled import clip_performance
from facegen.codec.syntax import Models
from facegen.face.motion import posed, shape_motion
from facegen.facs.deformation import Deformation

FPS = 25
QUALITIES = (0.4, 0.8, 1.6, 3.2)
LENGTHS = ((1, 25), (4, 6), (8, 3), (16, 1), (16, 4), (32, 1))
LOSSES = (0.0, 0.02, 0.05, 0.1, 0.2)
UDP_IP = 28                 # bytes that UDP and IPv4 put before a packet
DOCS = Path(__file__).parents[1] / "docs"


@cache
def motion(vocabulary: str, names: tuple[str, ...]) -> np.ndarray:
    """Return how each weight, then yaw, pitch and roll, moves the skin (k + 3, n, 3), mm."""
    face = load_face()
    mesh = face.mesh(1)
    if vocabulary == "units":
        moved = np.array([face.pose({name: 1.0}, detail=1) - mesh.vertices for name in names])
    else:
        known = shape_set(vocabulary)
        moved = shape_motion(face, {name: known[name] for name in names}, detail=1)
    turns = posed(face, [[Deformation(head={axis: 5.0})] for axis in ("yaw", "pitch", "roll")], detail=1)
    return np.concatenate([moved, (turns - mesh.vertices) / 5])[:, mesh.part_vertices("skin")]


def even(performance: Performance) -> Performance:
    """Return a recording at `FPS`, as the encoder takes it."""
    taken = list(rows(performance, FPS))
    columns = {name: np.array([one[name] for one in taken]) for name in taken[0]}
    return Performance(np.arange(len(taken)) / FPS, performance.names, vocabulary=performance.vocabulary, **columns)


def distances(truth: Performance, other: Performance, *, head: bool = True) -> np.ndarray:
    """Return how far each vertex of the skin is off (frames, n), mm, where both have a face."""
    columns = [truth.names.index(name) for name in other.names]
    places = np.rint(other.times * FPS).astype(int)
    off = other.weights - truth.weights[places][:, columns]
    parts = [off, other.head - truth.head[places]] if head and truth.head is not None else [off]
    off = np.concatenate(parts, axis=1)
    off = off[np.isfinite(off).all(axis=1)]
    basis = motion(truth.vocabulary, other.names)[:off.shape[1]]
    return np.linalg.norm(np.einsum("nk,kvi->nvi", off, basis), axis=2)


def performances() -> dict[str, Performance]:
    """Return the recordings, and two composed performances, at `FPS`."""
    composed = {"idle (composed)": clip_performance(Clip((), 40.0, Idle(3)), FPS),
                "greeting (composed)": clip_performance(
                    load_clip(Path(__file__).parents[1] / "examples" / "greeting.yaml"), FPS)}
    return {name: even(one) for name, one in recordings().items()} | composed


def bits(packets: Iterable[bytes], seconds: float) -> float:
    """Return bits a second."""
    return 8 * sum(map(len, packets)) / seconds


def zlib_bits(performance: Performance, quality: float, whole: bool) -> tuple[float, float]:
    """Return bits a second of every frame at the nearest steps, as differences from frame to frame, through zlib: all
    at once, or each packet's frames by themselves; and its mean error, mm."""
    encoder = encoder_for(performance, quality=quality)
    dictionary, steps = encoder.dictionary, np.array(encoder.dictionary.steps)
    parts = [performance.weights]
    if performance.head is not None:
        parts.append(performance.head)
    if performance.gaze is not None:
        parts += [(performance.gaze[:, :2] + performance.gaze[:, 2:]) / 2,
                  performance.gaze[:, :2] - performance.gaze[:, 2:]]
    rows_ = to_sums(np.concatenate(parts, axis=1), dictionary.pairs)
    for k, column in enumerate(rows_.T):
        known = np.isfinite(column)
        rows_[:, k] = np.interp(np.arange(len(rows_)), np.flatnonzero(known), column[known])
    values = np.rint(rows_ / steps).astype(np.int16)
    size = 0
    for group in [values] if whole else [values[at:at + 16] for at in range(0, len(values), 16)]:
        change = np.diff(group, axis=0, prepend=0 * group[:1])
        data = change.T.astype(np.int8 if abs(change).max() < 128 else np.int16).tobytes()
        size += len(zlib.compress(data, 9))
    back = from_sums(values * steps, dictionary.pairs)
    names = len(performance.names)
    again = Performance(performance.times, performance.names, back[:, :names], performance.vocabulary,
                        head=None if performance.head is None else back[:, names:names + 3])
    return 8 * size / (len(values) / FPS), float(distances(performance, again).mean())


def rate_table(found: dict[str, Performance]) -> list[str]:
    """Return the table of rate against error, and keep what the chart needs."""
    columns = ("performance", "seconds", "step, mm", "bit/s", "dictionary, bytes", "mean error, mm", "99 %", "max",
               "without the head: mean", "max", "gaze, largest, degrees", "zlib: bit/s", "mean error",
               "zlib by packet: bit/s")
    lines = [f"| {' | '.join(columns)} |", "|---|" + "---|" * (len(columns) - 1)]
    for name, one in found.items():
        seconds = len(one) / FPS
        for quality in QUALITIES:
            packets = encode_performance(one, quality=quality)
            setup = [packet for packet in packets if kind_of(packet) == DICTIONARY]
            rate = bits(packets, seconds) - bits(setup, seconds)
            again = decode_packets(packets)
            off, face = distances(one, again), distances(one, again, head=False)
            gaze = "" if one.gaze is None else f"{np.nanmax(abs(again.gaze - one.gaze)):.1f}"
            zipped, zipped_off = zlib_bits(one, quality, whole=True)
            POINTS.setdefault(name, []).append((rate, off.mean(), zipped, zipped_off))
            cells = (name, f"{seconds:.1f}", f"{quality:g}", f"{rate:.0f}", str(sum(map(len, setup))),
                     f"{off.mean():.2f}", f"{np.percentile(off, 99):.1f}", f"{off.max():.1f}", f"{face.mean():.2f}",
                     f"{face.max():.1f}", gaze, f"{zipped:.0f}", f"{zipped_off:.2f}",
                     f"{zlib_bits(one, quality, whole=False)[0]:.0f}")
            lines.append(f"| {' | '.join(cells)} |")
    return lines


POINTS: dict[str, list[tuple[float, float, float, float]]] = {}


def delay_table(one: Performance) -> list[str]:
    """Return the table of delay against rate."""
    seconds = len(one) / FPS
    columns = ("frames a packet", "key every", "delay, s", "bit/s", "with UDP and IP", "mean error, mm",
               "encode, frames/s", "decode, frames/s")
    lines = [f"| {' | '.join(columns)} |", "|---|" + "---|" * (len(columns) - 1)]
    for frames, key_every in LENGTHS:
        start = time.perf_counter()
        packets = encode_performance(one, frames=frames, key_every=key_every)
        middle = time.perf_counter()
        again = decode_packets(packets)
        end = time.perf_counter()
        packets = [packet for packet in packets if kind_of(packet) != DICTIONARY]
        lines.append(f"| {frames} | {key_every} | {frames / FPS:.2f} | {bits(packets, seconds):.0f} | "
                     f"{bits(packets, seconds) + 8 * UDP_IP * len(packets) / seconds:.0f} | "
                     f"{distances(one, again).mean():.2f} | {len(one) / (middle - start):.0f} | "
                     f"{len(one) / (end - middle):.0f} |")
    return lines


def loss_table(one: Performance, rounds: int = 5) -> list[str]:
    """Return the table of packets lost against error."""
    settings = ((16, 1), (16, 4), (4, 6))
    lines = ["| packets lost | " + " | ".join(f"{frames} frames, key every {key}" for frames, key in settings) + " |",
             "|---|" + "---|" * len(settings)]
    for loss in LOSSES:
        cells = []
        for frames, key_every in settings:
            packets, errors = encode_performance(one, frames=frames, key_every=key_every), []
            for seed in range(rounds):
                dice = random.Random(seed)
                sent = [packet for packet in packets
                        if kind_of(packet) == DICTIONARY or dice.random() >= loss]
                errors.append(distances(one, decode_packets(sent)).mean())
            cells.append(f"{np.mean(errors):.2f} mm")
        lines.append(f"| {100 * loss:.0f} % | " + " | ".join(cells) + " |")
    return lines


def chart(path: Path) -> None:
    """Draw rate against error."""
    import matplotlib

    matplotlib.use("Agg")
    matplotlib.rcParams["svg.hashsalt"] = "facegen"
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(figsize=(7.5, 4.5))
    for k, (name, points) in enumerate(POINTS.items()):
        points = np.array(points)
        axes.plot(points[:, 0], points[:, 1], "o-", color=f"C{k}", label=name)
        axes.plot(points[:, 2], points[:, 3], ":", color=f"C{k}", linewidth=1)
    axes.axhline(0.5, color="0.7", linewidth=1)
    axes.axvline(1000, color="0.7", linewidth=1)
    axes.axvline(2000, color="0.7", linewidth=1, linestyle="--")
    axes.text(2000, axes.get_ylim()[1], " MPEG-4 FAP", va="top", color="0.4")
    axes.set(xscale="log", xlabel="bit/s (dotted: every frame at the nearest step, the whole recording through zlib)",
             ylabel="mean error of the skin, mm", xlim=(60, None), ylim=(0, None))
    axes.legend(fontsize="small")
    figure.tight_layout()
    figure.savefig(path, metadata={"Date": None})


def count(found: dict[str, Performance]) -> None:
    """Print how often every question is answered "no"."""
    answers: dict[tuple, list[int]] = {}

    class Counted(Model):
        __slots__ = ("key",)

        def learn(self, bit: int) -> None:
            answers.setdefault(self.key, [0, 0])[bit] += 1
            super().learn(bit)

    class Counting(Models):
        def __call__(self, *key: object) -> Model:
            known = super().__call__(*key)
            if not isinstance(known, Counted):
                key = (*key, 0, 0)[:3]
                counted = Counted()
                counted.no, counted.seen, counted.key = known.no, known.seen, key
                self._of[key] = known = counted
            return known

    facegen.codec.encoder.Models = Counting
    for one in found.values():
        encode_performance(one)
    for key, (no, yes) in sorted(answers.items()):
        print(f"{key[0]:12} kind {key[1]} context {key[2]:2}: {no + yes:5} answers, no {(no + 1) / (no + yes + 2):.3f}")


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", action="store_true")
    parser.add_argument("--write", action="store_true", help="put the tables into docs/codec.md, and the chart beside")
    wanted = parser.parse_args()
    found = performances()
    if wanted.count:
        count(found)
        return
    tables = {"rate": rate_table(found), "delay": delay_table(found["facecap"]), "loss": loss_table(found["facecap"])}
    tables["machine"] = [f"`python benchmarks/codec_rates.py --write`, {time.strftime('%Y-%m-%d')}, "
                         f"{platform.machine()}, Python {platform.python_version()}, numpy {np.__version__}."]
    for lines in tables.values():
        print("\n".join(lines), end="\n\n", flush=True)
    if wanted.write:
        page = DOCS / "codec.md"
        text = page.read_text(encoding="utf-8")
        for name, lines in tables.items():
            start, end = f"<!-- {name} -->\n", f"<!-- /{name} -->"
            head, _, rest = text.partition(start)
            _, _, tail = rest.partition(end)
            text = head + start + "\n".join(lines) + "\n" + end + tail
        page.write_text(text, encoding="utf-8")
        chart(DOCS / "images" / "codec.svg")


if __name__ == "__main__":
    main()

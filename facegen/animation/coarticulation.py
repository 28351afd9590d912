"""Sounds share the mouth: visemes over time, as a track of a clip.

Based on: M. M. Cohen, D. W. Massaro, "Modeling coarticulation in synthetic visual speech" (1993). Every sound s has a
target T_s and a dominance D_s over time; lips, jaw and tongue each have dominances of their own, and a target at time t
is their mean:

    F(t) = sum_s D_s(t) T_s / sum_s D_s(t),    D_s(t) = alpha_s exp(-|tau| / theta_s)

with tau the time from the sound's core, and theta another before (anticipation) than after it. Ours: a core that is a
share of the sound, so that long sounds are held; a rounded tip, so that nothing jumps; and what a sound *must* do, the
closed lips of p, the teeth on the lip of f, the tongue at the ridge of t, takes all weight at its middle: there
F = T, however open the vowels are beside it. F is a mean of targets, so no jaw opens beyond them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from facegen.animation.clip import Pose
from facegen.animation.easing import min_jerk
from facegen.animation.performance import Performance
from facegen.animation.speech import Speech, parts_of
from facegen.animation.speech_table import CHANNELS, SILENCE, Phoneme, load_speech_table
from facegen.blendshapes.recipes import shape_set
from facegen.errors import InputError

JAW = "27"
"""The unit whose weight is the jaw's opening: viseme jaws are shares of it."""

_CORE = (0.35, 0.35)            # of a sound's length, from its ends: between them its dominance does not fall yet
_MUST = (0.15, 0.25)            # the same for what must be; the burst of a p comes before its end
_MARGIN = 0.05                  # s; the most that a core keeps from the ends: what is long is held
_SHORTEST_MUST = 0.042          # s; so that one frame in 25 a second shows the lips closed
_CHANGE = 0.020                 # s; between two that both must be, at least
_ROUND = 0.010                  # s; how the tip of a dominance is rounded
_SILENT_EDGE = 1.0              # s of rest before the first and after the last sound
_STRESSED = {"none": 0.85, "secondary": 0.95, "primary": 1.0, None: 1.0}     # share of the opening
_TONGUE_TIMES = (0.045, 0.045)  # s, lead and lag
_CLOSING, _OPENING = 0.08, 0.09     # s; how long before and after its core what must be comes and goes
_TINY = 1e-4                    # a share that nobody sees
_EPSILON = 1e-15                # keeps the odds of what is certain finite

Array = NDArray[np.float64]


@dataclass(frozen=True)
class SpeechTrack:
    """Speech as a track of a clip; ``clip.Track`` is the other kind.

    effort: how wide the mouth opens, 1 as the tables have it; lips close all the same. replaces: atoms of what lies
    below that fade while the mouth speaks, or "all"; None takes those of the table.
    """

    name: str
    speech: Speech
    effort: float = 1.0
    replaces: str | frozenset[str] | None = None
    optional: ClassVar[bool] = True             # a face without a tongue speaks as well

    def __post_init__(self) -> None:
        if isinstance(self.effort, bool) or not isinstance(self.effort, (int, float)) or not 0.0 <= self.effort <= 2.0:
            raise InputError(f"effort: expected a factor in 0..2, got {self.effort!r}")

    @property
    def end(self) -> float:
        """When all is said, seconds."""
        return self.speech.duration

    @property
    def begins(self) -> float:
        """When the last sound begins, seconds."""
        return self.speech.sounds[-1].start

    @property
    def corners(self) -> tuple[float, ...]:
        """The middles of the sounds, seconds: where the mouth is widest and narrowest."""
        return tuple((one.start + one.end) / 2 for one in self.speech.sounds)

    @property
    def poses(self) -> tuple[Pose, ...]:
        """Every pose in it."""
        return tuple(pose for poses in self._scores.poses for pose in poses)

    def mirrored(self) -> SpeechTrack:
        """Return itself: both halves of the mouth speak alike."""
        return self

    def shares(self, t: float) -> list[tuple[float, Pose]]:
        """Return the poses of lips, jaw and tongue that are there at a time, each with its share 0..1."""
        scores, made = self._scores, []
        for channel, poses in enumerate(scores.poses):
            together: dict[int, float] = {}
            for k, share in zip(*scores.near(channel, t), strict=True):
                together[scores.pose_of[channel][k]] = together.get(scores.pose_of[channel][k], 0.0) + share
            made += [(share, poses[k]) for k, share in together.items() if share > _TINY]
        return made

    def fades(self, t: float) -> list[tuple[str | frozenset[str], float]]:
        """Return which atoms below fade at a time, and to what share."""
        scores, table = self._scores, load_speech_table()
        rows, shares = scores.near(0, t)
        present = 1.0 - min(1.0, float(shares[scores.silent[rows]].sum()))
        closed = min(1.0, float(scores.musts(0, np.array([t]), rows).sum()))
        faded = [(table.replaces if self.replaces is None else self.replaces, 1.0 - present)]
        if self.replaces != "all":
            faded.append((table.closing, 1.0 - closed))
        return faded

    def weights(self, times: ArrayLike, channel: str = "lips") -> tuple[tuple[str, ...], Array]:
        """Return the names of the visemes and their weights (n, 15), 0..1, at times (n,) of one channel."""
        names = tuple(shape_set("visemes"))
        scores, number = self._scores, CHANNELS.index(channel)
        made = np.zeros((len(times), len(names)))
        for row, t in enumerate(np.asarray(times, float)):
            for k, share in zip(*scores.near(number, float(t)), strict=True):
                made[row, names.index(scores.visemes[k])] += share * scores.amounts[k]
        return names, np.clip(made, 0.0, 1.0)

    @cached_property
    def _scores(self) -> _Scores:
        return _Scores(self.speech, self.effort)


def performance_of(track: SpeechTrack, fps: float = 25.0) -> Performance:
    """Return speech as a recording of viseme weights, ``fps`` frames a second, for any rig that has the visemes."""
    count = max(1, round(track.end * fps))
    times = np.arange(count) / fps
    names, weights = track.weights(times)
    return Performance(times, names, weights, "visemes", about={"format": "speech", **track.speech.about},
                       warnings=track.speech.warnings)


class _Scores:
    """The sounds' parts (n,) as arrays, silence between and round them included."""

    def __init__(self, speech: Speech, effort: float) -> None:
        table = load_speech_table()
        rows: list[tuple[float, float, str, str | None, float, Phoneme]] = []
        for one in speech.sounds:
            for start, end, part in parts_of(one):
                viseme = one.phoneme.visemes[min(part, len(one.phoneme.visemes) - 1)]
                tongue = one.phoneme.tongues[min(part, len(one.phoneme.tongues) - 1)]
                amount = one.phoneme.amount
                if "lips" not in table.visemes[viseme].must:
                    amount = min(1.0, amount * effort * _STRESSED[one.stress])
                rows.append((start, end, viseme, tongue, amount, one.phoneme))
        rest = (SILENCE, "rest", 1.0, table.pause)
        edges = [-_SILENT_EDGE, *(t for row in rows for t in row[:2]), speech.duration + _SILENT_EDGE]
        gaps = [(a, b, *rest) for a, b in zip(edges[::2], edges[1::2], strict=True) if b > a]
        rows = sorted([*rows, *gaps], key=lambda row: row[0])

        self.start, self.end = (np.array([row[k] for row in rows]) for k in (0, 1))
        self.visemes = [row[2] for row in rows]
        self.amounts = np.array([row[4] for row in rows])
        self.silent = np.array([row[5].kind == "pause" for row in rows])
        holds = [table.visemes[viseme] for viseme in self.visemes]
        tongues = [None if row[3] is None else table.tongues[row[3]] for row in rows]

        def dominance(channel: str) -> list[float]:
            return [getattr(hold, channel) if row[5].dominance is None else row[5].dominance
                    for hold, row in zip(holds, rows, strict=True)]

        self.alpha = np.array([dominance("lips"), dominance("jaw"), [one.hold if one else 0.0 for one in tongues]])
        self.must = np.array([["lips" in hold.must for hold in holds], ["jaw" in hold.must for hold in holds],
                              [bool(one and one.must) for one in tongues]])
        lead, lag = ([getattr(hold, name) for hold in holds] for name in ("lead", "lag"))
        self.lead = np.array([lead, lead, [_TONGUE_TIMES[0]] * len(rows)])
        self.lag = np.array([lag, lag, [_TONGUE_TIMES[1]] * len(rows)])
        self.reach = 40.0 * max(float(self.lead.max()), float(self.lag.max()))

        low, high = self._core(_MUST, _SHORTEST_MUST)
        self.low, self.high = np.tile(low, (len(CHANNELS), 1)), np.tile(high, (len(CHANNELS), 1))
        for low, high, must in zip(self.low, self.high, self.must, strict=True):
            of = np.flatnonzero(must)
            one, other = of[:-1], of[1:]                # each in its own time, and a moment to change between them
            border = (self.end[one] + self.start[other]) / 2
            middle = (low + high) / 2
            high[one] = np.minimum(high[one], np.maximum(middle[one], border - _CHANGE / 2))
            low[other] = np.maximum(low[other], np.minimum(middle[other], border + _CHANGE / 2))

        # Equal poses are one: few, whatever the length of the speech.
        kinds = [[(row[2], row[4]) for row in rows], [(row[2], row[4]) for row in rows], [row[3] for row in rows]]
        self.poses: list[list[Pose]] = []
        self.pose_of: list[list[int]] = []
        for make, channel in zip((_lips, _jaw, _tongue), kinds, strict=True):
            order = {kind: k for k, kind in enumerate(dict.fromkeys(channel))}
            self.poses.append([make(kind) for kind in order])
            self.pose_of.append([order[kind] for kind in channel])

    def near(self, channel: int, t: float) -> tuple[NDArray[np.intp], Array]:
        """Return the rows (k,) that count at a time, and their shares (k,), which sum to 1."""
        first = int(np.searchsorted(self.end, t - self.reach))
        last = int(np.searchsorted(self.start, t + self.reach))
        rows = np.arange(min(first, len(self.start) - 1), max(last, first + 1))
        rows = rows[rows < len(self.start)]
        low, high = self._core(_CORE, 0.0, rows)
        before, after = np.maximum(0.0, low - t), np.maximum(0.0, t - high)
        away = _rounded(before) / self.lead[channel, rows] + _rounded(after) / self.lag[channel, rows]
        alpha = self.alpha[channel, rows]
        if not alpha.any():
            return rows, np.full(len(rows), 1.0 / len(rows))
        with np.errstate(divide="ignore"):
            logs = np.log(alpha) - away
        soft = np.exp(logs - logs.max())
        must = self.musts(channel, np.array([t]), rows)[0]
        # By odds, so that in the middle of one the ramps of its neighbours count nothing.
        certain, odds = 1.0 - float(np.prod(1.0 - must)), np.sqrt(must / (np.maximum(1.0 - must, 0.0) + _EPSILON))
        shares = (1.0 - certain) * soft / soft.sum()
        return rows, shares + certain * odds / odds.sum() if certain else shares

    def musts(self, channel: int, times: Array, rows: NDArray[np.intp]) -> Array:
        """Return how far (n, k) what must be is there: 1 in the middle of its sound."""
        before = np.maximum(0.0, self.low[channel, rows] - times[:, None])
        after = np.maximum(0.0, times[:, None] - self.high[channel, rows])
        left = np.maximum(0.0, 1.0 - before / _CLOSING - after / _OPENING)
        return np.where(self.must[channel, rows], min_jerk(left), 0.0)

    def _core(self, share: tuple[float, float], least: float, rows: NDArray[np.intp] | slice = slice(None)
              ) -> tuple[Array, Array]:
        """Return where the cores of sounds begin and end (k,), seconds."""
        start, length = self.start[rows], self.end[rows] - self.start[rows]
        low = start + np.minimum(share[0] * length, _MARGIN)
        high = start + length - np.minimum(share[1] * length, _MARGIN)
        middle, half = (low + high) / 2, np.maximum(high - low, least) / 2
        return middle - half, middle + half


def _rounded(tau: Array) -> Array:
    return np.sqrt(tau * tau + _ROUND * _ROUND) - _ROUND


@cache
def _viseme(name: str) -> Mapping[str, float]:
    return shape_set("visemes")[name].weights


def _lips(kind: tuple[str, float]) -> Pose:
    atoms = {code: weight * kind[1] for code, weight in _viseme(kind[0]).items() if code != JAW}
    return _pose(atoms)


def _jaw(kind: tuple[str, float]) -> Pose:
    return _pose({JAW: _viseme(kind[0]).get(JAW, 0.0) * kind[1]})


def _tongue(name: str | None) -> Pose:
    raw = load_speech_table().tongues[name].deformation if name else None
    return Pose(raw=raw or None)


def _pose(weights: Mapping[str, float]) -> Pose:
    from facegen.facs.tables import load_units

    return Pose(load_units().catalogue.expand(weights))

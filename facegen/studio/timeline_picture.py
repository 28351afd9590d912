"""The timeline as a picture: curves of what moves, tracks with their keys and events, and the head of time. SVG."""

from __future__ import annotations

import html
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from facegen.studio.curves import Curves
from facegen.studio.timeline import TrackView, event_times, item_text, time_of

WIDTH, LEFT, RIGHT = 360.0, 4.0, 4.0
_CURVES, _LANE, _AXIS, _LEGEND, _TOP = 92.0, 22.0, 16.0, 13.0, 4.0
# Colours that the colour-blind tell apart (Okabe and Ito's set), on white.
COLOURS = ("#d55e00", "#0072b2", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")
_INK, _FAINT, _MARK = "#444", "#d9d9d9", "#b05c48"
_MOST_TICKS = 8
_MOST_LANES = 12        # tracks that are drawn


@dataclass(frozen=True)
class Chosen:
    """The key or event that is being edited."""

    track: str
    index: int


def picture(duration: float, shown: Curves | None, several: Sequence[TrackView], head: float,
            chosen: Chosen | None = None) -> str:
    """Return the picture as SVG text. What a person wrote stands in it as text, never as markup."""
    return Drawing(duration, shown, several, chosen).at(head)


class Drawing:
    """All but the head of time is drawn once."""

    def __init__(self, duration: float, shown: Curves | None, several: Sequence[TrackView],
                 chosen: Chosen | None) -> None:
        self.duration = max(duration, 1e-3)
        parts: list[str] = []
        y = _TOP
        if shown is not None:
            parts += self._draw_curves(shown, y)
            y += _CURVES
        for track in several[:_MOST_LANES]:
            parts += self._lane(track, y, chosen)
            y += _LANE
        self._bottom = y
        parts += self._ticks(y)
        y += _AXIS
        if shown is not None:
            for k, label in enumerate(shown.labels):
                colour = COLOURS[k % len(COLOURS)]
                parts.append(f'<rect x="{LEFT}" y="{y + 2:.1f}" width="10" height="4" fill="{colour}"/>')
                parts.append(_text(label, LEFT + 15, y + 8, _INK))
                y += _LEGEND
            if shown.others:
                parts.append(_text(f"and {shown.others} more", LEFT + 15, y + 8, "#888"))
                y += _LEGEND
        self._head = (f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH:g} {y + 2:.1f}" width="100%" '
                      'role="img" aria-label="Timeline" style="display:block;background:#fff;border-radius:4px;'
                      'font-family:sans-serif;font-size:9px">')
        self._parts = "".join(parts)

    def at(self, head: float) -> str:
        """Return the picture with the head of time at so many seconds."""
        x = self._x(head)
        mark = (f'<line x1="{x:.1f}" x2="{x:.1f}" y1="0" y2="{self._bottom:.1f}" stroke="{_MARK}" stroke-width="1.5"/>'
                f'<path d="M{x - 4:.1f},0 h8 l-4,6 z" fill="{_MARK}"/>')
        return f"{self._head}{self._parts}{mark}</svg>"

    def _x(self, t: float) -> float:
        return LEFT + (WIDTH - LEFT - RIGHT) * min(max(t / self.duration, 0.0), 1.0)

    def _draw_curves(self, shown: Curves, top: float) -> list[str]:
        height = _CURVES - 8.0
        parts = [f'<line x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{top + height * (1 - level):.1f}" '
                 f'y2="{top + height * (1 - level):.1f}" stroke="{_FAINT}" stroke-width="0.6"/>'
                 for level in (0.0, 0.5, 1.0)]
        for k in range(len(shown.labels)):
            points = " ".join(f"{self._x(t):.1f},{top + height * (1 - value):.1f}"
                              for t, value in zip(shown.times, shown.values[:, k], strict=True))
            parts.append(f'<polyline points="{points}" fill="none" stroke="{COLOURS[k % len(COLOURS)]}" '
                         'stroke-width="1.4"/>')
        if not shown.labels:
            parts.append(_text("Nothing moves yet", WIDTH / 2 - 38, top + height / 2, "#888"))
        return parts

    def _lane(self, track: TrackView, top: float, chosen: Chosen | None) -> list[str]:
        middle = top + _LANE / 2 + 3
        parts = [f'<line x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{middle:.1f}" y2="{middle:.1f}" stroke="{_FAINT}"/>',
                 _text(track.label[:40], LEFT, top + 7, "#888")]
        for index, item in enumerate(track.items):
            lit = chosen == Chosen(track.place, index)
            if track.kind == "keyframes":
                parts.append(self._key(item, middle, lit))
            elif track.kind == "events":
                parts.append(self._event(item, middle, lit))
            else:
                parts.append(f'<rect x="{LEFT}" y="{middle - 3:.1f}" width="{WIDTH - LEFT - RIGHT}" height="6" '
                             'fill="#e7d9d3"/>')
        return parts

    def _key(self, item: Mapping[str, Any], y: float, lit: bool) -> str:
        x, r = self._x(time_of(item)), 6.0 if lit else 4.5
        return (f'<path d="M{x - r:.1f},{y:.1f} L{x:.1f},{y - r:.1f} L{x + r:.1f},{y:.1f} L{x:.1f},{y + r:.1f} z" '
                f'fill="{_MARK if lit else _INK}">{_title(item)}</path>')

    def _event(self, item: Mapping[str, Any], y: float, lit: bool) -> str:
        at, onset, apex, end = (self._x(t) for t in event_times(item))
        low, high = f"{y + 4:.1f}", f"{y - 5:.1f}"
        return (f'<path d="M{at:.1f},{low} L{onset:.1f},{high} L{apex:.1f},{high} L{end:.1f},{low} z" '
                f'fill="{_MARK if lit else "#8aa"}" stroke="{_INK}" stroke-width="0.6">{_title(item)}</path>')

    def _ticks(self, y: float) -> list[str]:
        step = 10.0 ** math.floor(math.log10(self.duration / _MOST_TICKS))
        step *= next(factor for factor in (1, 2, 5, 10) if self.duration / (step * factor) <= _MOST_TICKS)
        parts = []
        for k in range(int(self.duration / step + 1e-9) + 1):
            x = self._x(k * step)
            label = f"{k * step:g}" + (" s" if k == 0 else "")
            parts.append(f'<line x1="{x:.1f}" x2="{x:.1f}" y1="{y:.1f}" y2="{y + 3:.1f}" stroke="{_INK}"/>')
            parts.append(_text(label, min(x + 1.5, WIDTH - 5 * len(label) - 2), y + 11, _INK))
        return parts


def _text(words: str, x: float, y: float, colour: str) -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" fill="{colour}">{html.escape(words)}</text>'


def _title(item: Mapping[str, Any]) -> str:
    return f"<title>{html.escape(f'{time_of(item):g} s: {item_text(item)}')}</title>"

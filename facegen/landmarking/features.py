"""What of a face can be seen where it is: the lids' opening and the line of the lips, in small pictures of the skin.

The eyes are looked at with what fills them taken away: their opening is then a hole, or a hollow. Between closed lips
the skin turns under, and out again: going down, its normal's upward part jumps. Both are found where they are sharp,
and left alone where they are not.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from facegen.geometry.operators import Surface
from facegen.render.zbuffer import prepare, scan

Array = NDArray[np.float64]

# Millimetres of the base face to a pixel.
_PIXEL = 0.4
# What lies this much deeper than the lids' margin, mm, is behind it; an opening is, mostly, this deep.
_HOLLOW, _DEEP = 2.5, 4.0
# An opening is one between these shares of the expected one's width.
_WIDTHS = (0.5, 1.7)
# It is no farther from where it is expected than this share of its width.
_NEAR = 0.45
# How much the normal's upward part jumps at the lips' line, in the middle; and what share of that is left at its ends.
_JUMP, _ENDS = 0.6, 0.35
# The lips' line is looked for within so many millimetres of where it is expected, and may climb so many pixels from
# one column to the next.
_BAND, _CLIMB = 11.0, 2


# Lips are seen as a line, or open by no more than this share of the mouth's width.
_OPEN = 1.0
# What lies this much deeper than the lips, mm, is the mouth's inside.
_CAVITY = 8.0
# The tip of the nose is the foremost place within so many millimetres of where it is expected.
_TIP = 12.0


@dataclass(frozen=True, eq=False)
class View:
    """A picture of the skin from the front. ``ids`` (h, w): triangles, -1 for none; ``depth`` (h, w): mm ahead, NaN for
    none; pixel (i, j) shows (``left`` + j, ``top`` - i) times ``pixel``, mm."""

    ids: NDArray[np.int32]
    depth: Array
    left: float
    top: float
    pixel: float = _PIXEL

    def place(self, i: int, j: int) -> Array:
        """Return the place (3,) that a pixel shows, mm."""
        return np.array([self.left + (j + 0.5) * self.pixel, self.top - (i + 0.5) * self.pixel, self.depth[i, j]])

    def pixel_of(self, at: Array) -> tuple[int, int]:
        """Return the pixel (i, j) that shows a place."""
        i, j = int((self.top - at[1]) / self.pixel), int((at[0] - self.left) / self.pixel)
        return min(max(i, 0), len(self.ids) - 1), min(max(j, 0), self.ids.shape[1] - 1)


def view_of(skin: Surface, middle: Array, half: tuple[float, float], deep: float = 60.0, pixel: float = _PIXEL
            ) -> View:
    """Return a picture of a skin in the base face's frame, mm: of what lies within ``half`` of a place, aside and up,
    and not much farther back."""
    low, high = skin.corners.min(axis=1), skin.corners.max(axis=1)
    near = ((high[:, 0] > middle[0] - half[0]) & (low[:, 0] < middle[0] + half[0])
            & (high[:, 1] > middle[1] - half[1]) & (low[:, 1] < middle[1] + half[1]) & (high[:, 2] > middle[2] - deep))
    rows = np.flatnonzero(near)
    width, height = (round(2 * one / pixel) for one in half)
    left, top = middle[0] - half[0], middle[1] + half[1]
    if not len(rows):
        return View(np.full((height, width), -1, np.int32), np.full((height, width), np.nan), left, top, pixel)
    points = skin.corners[rows].reshape(-1, 3)
    back, front = points[:, 2].min(), points[:, 2].max()
    span = max(front - back, 1e-9)
    pixels = np.column_stack([(points[:, 0] - left) / pixel, (top - points[:, 1]) / pixel,
                              0.01 + 0.98 * (points[:, 2] - back) / span])
    ids, nearness = scan(prepare(pixels, np.arange(len(points)).reshape(-1, 3), width=width, height=height, samples=1))
    ids, nearness = ids[:, 0], nearness[:, 0].astype(float)
    depth = np.where(ids >= 0, back + (nearness - 0.01) / 0.98 * span, np.nan)
    return View(np.where(ids >= 0, rows[ids], -1).astype(np.int32), depth, left, top, pixel)


def eye_opening(skin: Surface, points: Mapping[str, Array], s: str) -> dict[str, Array]:
    """Return the outer corner and the middles of an eye's lids, name -> place (3,), from the opening between them; none
    where there is none. The inner corner is not seen so well: skin fills it before the lids meet.

    skin: without the eyes; points: where they are expected; all in the base face's frame, mm. s: "L" or "R".
    """
    inner, outer, upper, lower = (points[f"eye_{name}_{s}"] for name in ("inner", "outer", "upper", "lower"))
    middle, wide = (inner + outer) / 2, float(np.linalg.norm(outer - inner))
    view = view_of(skin, middle, (1.1 * wide, 0.8 * wide))
    margin = inner[2], outer[2]
    x = view.left + (np.arange(view.ids.shape[1]) + 0.5) * _PIXEL
    share = np.clip((x - inner[0]) / (outer[0] - inner[0] if abs(outer[0] - inner[0]) > 1e-9 else 1e-9), 0.0, 1.0)
    bulge = (upper[2] + lower[2]) / 2 - (margin[0] + margin[1]) / 2
    expected = margin[0] + (margin[1] - margin[0]) * share + bulge * 4 * share * (1 - share)
    hole = (view.ids < 0) | (view.depth < expected - _HOLLOW)
    label, count = ndimage.label(hole)
    if not count:
        return {}
    inside = label[[0, -1]].ravel().tolist() + label[:, [0, -1]].ravel().tolist()
    sizes = np.bincount(label.ravel())
    sizes[0] = 0
    sizes[list(set(inside))] = 0                # what reaches the picture's border is no opening
    best = int(sizes.argmax())
    if not sizes[best]:
        return {}
    i, j = np.nonzero(label == best)
    opening = float(j.max() - j.min() + 1) * _PIXEL
    at = np.array([view.left + (j.mean() + 0.5) * _PIXEL, view.top - (i.mean() + 0.5) * _PIXEL])
    below = np.where(view.ids < 0, np.inf, expected - view.depth)[i, j]
    if np.median(below) < _DEEP:
        return {}
    if not _WIDTHS[0] * wide < opening < _WIDTHS[1] * wide or np.linalg.norm(at - middle[:2]) > _NEAR * wide:
        return {}
    columns = np.unique(j)
    end, beside = (columns[-1], columns[-1] + 1) if s == "L" else (columns[0], columns[0] - 1)
    found = {f"eye_outer_{s}": view.place(*_edge(view, round(float(i[j == end].mean())), beside))}
    column = round(float(j.min() + j.max()) / 2)
    rows = i[j == column]
    if len(rows):
        found[f"eye_upper_{s}"] = view.place(*_edge(view, int(rows.min()) - 1, column))
        found[f"eye_lower_{s}"] = view.place(*_edge(view, int(rows.max()) + 1, column))
    return {name: place for name, place in found.items() if np.isfinite(place).all()}


def _edge(view: View, i: int, j: int) -> tuple[int, int]:
    return min(max(i, 0), len(view.ids) - 1), min(max(j, 0), view.ids.shape[1] - 1)


def lip_line(skin: Surface, points: Mapping[str, Array]) -> dict[str, Array]:
    """Return the corners of the mouth and the middles of the lips' inner edges, name -> place (3,), from the line
    between the lips; none where it is not sharp. As `eye_opening`."""
    corners = points["mouth_corner_L"], points["mouth_corner_R"]
    middle = (points["mouth_inner_top"] + points["mouth_inner_bottom"]) / 2
    wide = float(np.linalg.norm(corners[0] - corners[1]))
    view = view_of(skin, middle, (0.95 * wide, 0.45 * wide + _BAND))
    up = np.where(view.ids >= 0, skin.normals[view.ids, 1], 0.0)
    up = ndimage.uniform_filter(up, (1, 3))
    jump = np.full_like(up, -1.0)
    jump[2:-2] = (up[3:-1] + up[4:]) / 2 - (up[:-4] + up[1:-3]) / 2         # below less above
    aside = (view.left + (np.arange(view.ids.shape[1]) + 0.5) * _PIXEL - middle[0]) / (wide / 2)
    back = (corners[0][2] + corners[1][2]) / 2 - middle[2]                  # lips curve back round the teeth
    shown = (view.ids >= 0) & (np.nan_to_num(view.depth, nan=-np.inf) > middle[2] + back * aside**2 - _CAVITY)
    jump[~shown] = np.where(_between(shown), 1.0, -1.0)[~shown]             # an open mouth is a line as well
    i0, j0 = view.pixel_of(middle)
    band = round(_BAND / _PIXEL)
    low, high = max(i0 - band, 0), min(i0 + band + 1, len(jump))
    window = jump[low:high, max(j0 - 2, 0):j0 + 3].mean(axis=1)
    start = low + int(window.argmax())
    if window.max() < _JUMP:
        return {}
    strong = float(window.max())
    found = {}
    for side, name in ((1, "mouth_corner_L"), (-1, "mouth_corner_R")):
        i, j, last, missed = start, j0, None, 0
        while 0 < j + side < jump.shape[1] - 1 and missed < 4:
            j += side
            near = slice(max(i - _CLIMB, 0), i + _CLIMB + 1)
            best = near.start + int(jump[near, j].argmax())
            if jump[best, j] >= _ENDS * strong:
                i, last, missed = best, (best, j), 0
            else:
                missed += 1
        if last is not None:
            found[name] = view.place(*last)
    found["mouth_inner_top"] = view.place(*_edge(view, _shown_from(shown, start, j0, -1), j0))
    found["mouth_inner_bottom"] = view.place(*_edge(view, _shown_from(shown, start, j0, 1), j0))
    found = {name: place for name, place in found.items()
             if not name.startswith("mouth_inner") or abs(place[1] - view.place(start, j0)[1]) < _OPEN * wide}
    width = [abs(found[name][0] - middle[0]) for name in ("mouth_corner_L", "mouth_corner_R") if name in found]
    if len(width) < 2 or not _WIDTHS[0] * wide < sum(width) < _WIDTHS[1] * wide or min(width) < 0.5 * max(width):
        found = {name: at for name, at in found.items() if name.startswith("mouth_inner")}
    return {name: place for name, place in found.items() if np.isfinite(place).all()}


def nose_tip(skin: Surface, points: Mapping[str, Array]) -> dict[str, Array]:
    """Return the tip of the nose as name -> place (3,); none where the foremost place near it lies on a slope. As
    `eye_opening`."""
    view = view_of(skin, points["nose_tip"], (_TIP, _TIP))
    if not (view.ids >= 0).any():
        return {}
    i, j = np.unravel_index(int(np.nanargmax(view.depth)), view.depth.shape)
    if not 1 < i < len(view.ids) - 2 or not 1 < j < view.ids.shape[1] - 2:
        return {}
    return {"nose_tip": view.place(int(i), int(j))}


def _between(shown: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return which pixels have skin above and below."""
    above = np.logical_or.accumulate(shown, axis=0)
    below = np.logical_or.accumulate(shown[::-1], axis=0)[::-1]
    return above & below


def _shown_from(shown: NDArray[np.bool_], i: int, j: int, step: int) -> int:
    """Return the first row from i on, upward (-1) or downward (1), that shows skin, one pixel off the line."""
    i += step
    while 0 < i < len(shown) - 1 and not shown[i, j]:
        i += step
    return i

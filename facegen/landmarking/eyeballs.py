"""Eyeballs, and what of each is seen between its lids, whichever way the eye looks: corners and lids lie round that.

A ball is a piece of the mesh about as long as wide. Seen from straight before it, what covers it ends at the lids'
margins; a horse's eyes look aside, so every eye is looked at along its own direction.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from facegen.geometry.operators import Surface
from facegen.landmarking.features import View, view_of

Array = NDArray[np.float64]

# A ball has at least so many corners of triangles, and its shortest extent is this share of its longest.
_FEWEST, _ROUND = 36, 0.5
# A lid that was set lies this near to the ball's surface, one that is only expected this near, in radii; radii of
# eyes are between these shares of the expected width.
_ON, _EXPECTED = 0.45, 0.8
_RADII = (0.25, 1.3)
# What lies within so many radii of the middle is the eye's: cornea, iris and glint may be pieces of their own.
_EYES_OWN = 1.25
# Triangles within so many radii may cover it.
_NEAR = 2.5
# The picture shows so many radii to each side; the eye is looked at anew, along what was seen of it, so many times.
_SHOWN, _LOOKS = 1.5, 3
# Less of a ball than this share of its disc is a sliver between closed lids.
_SLIVER = 0.04
# Lashes are thinner than so many pixels.
_LASH = 3
LIDS = ("inner", "outer", "upper", "lower")


@dataclass(frozen=True, eq=False)
class Ball:
    """A round piece: its ``middle`` (3,) and ``radius``, in the axes and units of the surface it was found on."""

    middle: Array
    radius: float


def balls_of(surface: Surface, label: NDArray) -> list[Ball]:
    """Return the pieces of a surface that are about as long as wide. label (n,): the piece of each vertex."""
    used = np.repeat(label[surface.faces[:, 0]], 3)
    places = surface.corners.reshape(-1, 3)
    count = np.bincount(used)
    found = []
    for c, rows in enumerate(np.split(np.argsort(used, kind="stable"), np.cumsum(count)[:-1])):
        if count[c] < _FEWEST:
            continue
        at = places[rows]
        spread = np.sqrt(np.linalg.eigvalsh(np.cov(at.T))[::-1].clip(0.0))
        if spread[2] > _ROUND * spread[0]:
            middle = (at.max(axis=0) + at.min(axis=0)) / 2
            found.append(Ball(middle, float(np.sqrt(((at - middle) ** 2).sum(axis=1).max()))))
    return found


def ball_of_eye(balls: Sequence[Ball], points: Mapping[str, Array], s: str, known: Mapping[str, Array]) -> Ball | None:
    """Return which ball is the eye of a side, or None. points: where its lids are expected; known: where they are."""
    lids = [f"eye_{name}_{s}" for name in LIDS]
    wide = float(np.linalg.norm(points[f"eye_outer_{s}"] - points[f"eye_inner_{s}"]))
    set_ones = [known[name] for name in lids if name in known]
    at, near = (np.array(set_ones), _ON) if set_ones else (np.array([points[name] for name in lids]), _EXPECTED)
    best, least = None, near
    for ball in balls:
        if not _RADII[0] * wide < ball.radius < _RADII[1] * wide:
            continue
        off = float(np.abs(np.linalg.norm(at - ball.middle, axis=1) / ball.radius - 1.0).mean())
        if off < least:
            best, least = ball, off
    return best


def seen_eye(surface: Surface, label: NDArray, ball: Ball, points: Mapping[str, Array], s: str,
             known: Mapping[str, Array], pupil: NDArray[np.bool_]) -> dict[str, Array]:
    """Return the corners, the lids and the middle of an eye, name -> place (3,), as far as they are not known; none
    where too little of the ball is seen.

    surface, label: all of the mesh, and the piece of each of its vertices. points, known: as `ball_of_eye`. pupil (m,):
    which triangles are one, as names say.
    """
    lids = {name: known.get(f"eye_{name}_{s}", points[f"eye_{name}_{s}"]) for name in LIDS}
    out = np.mean(list(lids.values()), axis=0) - ball.middle
    across = (lids["outer"] - lids["inner"]) * (1.0 if s == "L" else -1.0)
    off = np.linalg.norm(surface.vertices - ball.middle, axis=1) / ball.radius
    farthest = np.zeros(int(label.max()) + 1)
    np.maximum.at(farthest, label, off)
    near = (off[surface.faces] < _NEAR).any(axis=1)
    piece = Surface(surface.vertices, surface.faces[near])
    own, pupil = farthest[label[piece.faces[:, 0]]] < _EYES_OWN, pupil[near]
    for _ in range(_LOOKS):
        z = out / max(float(np.linalg.norm(out)), 1e-12)
        x = across - (across @ z) * z
        x = x / max(float(np.linalg.norm(x)), 1e-12)
        axes = np.stack([x, np.cross(z, x), z])
        turned = Surface((piece.vertices - ball.middle) @ axes.T, piece.faces)
        view = view_of(turned, np.zeros(3), (_SHOWN * ball.radius,) * 2, deep=ball.radius,
                       pixel=ball.radius / 40)
        mask = _opening(view, own)
        if mask.sum() < _SLIVER * np.pi * 40**2:
            return {}
        i, j = np.nonzero(mask)
        middle = np.array([view.left + (j.mean() + 0.5) * view.pixel, view.top - (i.mean() + 0.5) * view.pixel])
        shift = middle / ball.radius
        out = axes.T @ np.array([*middle, ball.radius * np.sqrt(max(1.0 - float(shift @ shift), 0.1))])
    found = _round(view, mask, {name: axes @ (at - ball.middle) for name, at in lids.items()}, s,
                   {name for name in LIDS if f"eye_{name}_{s}" in known})
    if f"eye_center_{s}" not in known:
        found[f"eye_center_{s}"] = _centre(view, mask, pupil)
    return {name: ball.middle + axes.T @ place for name, place in found.items()}


def _centre(view: View, mask: NDArray[np.bool_], pupil: NDArray[np.bool_]) -> Array:
    """Return the place of a patch that is in the middle of the pupil, or of the patch where none is seen."""
    shown = mask & (view.ids >= 0)
    black = shown & pupil[view.ids]
    i, j = np.nonzero(black if black.any() else shown)
    k = int(((i - i.mean()) ** 2 + (j - j.mean()) ** 2).argmin())
    return view.place(int(i[k]), int(j[k]))


def _opening(view: View, own: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return which pixels show the eye: the largest patch, lashes closed over."""
    eye = (view.ids >= 0) & own[view.ids]
    eye = ndimage.binary_closing(eye, iterations=_LASH)
    label, count = ndimage.label(eye)
    if not count:
        return eye
    sizes = np.bincount(label.ravel())
    sizes[0] = 0
    return ndimage.binary_fill_holes(label == sizes.argmax())


def _round(view: View, mask: NDArray[np.bool_], lids: Mapping[str, Array], s: str, known: set[str]) -> dict[str, Array]:
    """Return "eye_..." -> place in the picture's axes, of corners and lids round a patch."""
    i, j = np.nonzero(mask)
    at = np.column_stack([view.left + (j + 0.5) * view.pixel, view.top - (i + 0.5) * view.pixel])
    middle = at.mean(axis=0)
    if {"inner", "outer"} <= known:
        along = lids["outer"][:2] - lids["inner"][:2]
    elif "outer" in known:
        along = lids["outer"][:2] - middle
    elif "inner" in known:
        along = middle - lids["inner"][:2]
    else:
        along = np.array([1.0 if s == "L" else -1.0, 0.0])
    along = along / max(float(np.linalg.norm(along)), 1e-12)
    upward = np.array([-along[1], along[0]]) * (1.0 if along[0] > 0 else -1.0)
    t, v = (at - middle) @ along, (at - middle) @ upward
    half = (t.max() + t.min()) / 2
    slot = np.abs(t - half) < 0.75 * view.pixel
    ends = {"outer": (at[t.argmax()], along), "inner": (at[t.argmin()], -along)}
    if slot.any():
        ends["upper"] = at[slot][v[slot].argmax()], upward
        ends["lower"] = at[slot][v[slot].argmin()], -upward
    found = {}
    for name, (end, way) in ends.items():
        if name not in known:
            place = _first_skin(view, mask, end, way)
            if place is not None:
                found[f"eye_{name}_{s}"] = place
    return found


def _first_skin(view: View, mask: NDArray[np.bool_], end: Array, way: Array) -> Array | None:
    """Return the first place beside a patch, from its end on."""
    for step in range(1, 8):
        i, j = view.pixel_of(np.append(end + step * view.pixel * way, 0.0))
        if not mask[i, j] and view.ids[i, j] >= 0:
            return view.place(i, j)
    return None

"""Where a face may be on a mesh, and which way it looks: views from all round, in each plane of symmetry.

A view is a picture of depths. On its middle line, at every height and in several sizes, the relief of the base face is
compared with what is there: their correlation after taking away what every rounded thing has, a slope and a bulge.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from facegen.face.face import load_face
from facegen.landmarking.symmetry import Plane
from facegen.transfer.alignment import Similarity
from facegen.transfer.enclosure import sample_surface

Array = NDArray[np.float64]

# Millimetres of the base face that the picture shows, and pixels across it.
_HALF, _LOW, _HIGH = 66.0, -105.0, 45.0
_ACROSS = 16
_PIXEL = 2 * _HALF / _ACROSS
# Views all round, so many degrees apart.
_TURN = 12.0
# The largest face fills the mesh with this share of its longest side, the smallest is a person's on a whole body.
_LARGEST, _SMALLEST, _STEP = 1.1, 1 / 16, 1.22
# Depths farther behind the foremost place of a picture than this, mm, are background.
_DEEP = 110.0
# Samples lie so much closer than pixels.
_CLOSER = 1.4
# So many places are looked at more closely.
_BEST = 8


@dataclass(frozen=True, eq=False)
class Candidate:
    """``frame``: from the base face's frame to the mesh's; ``score``: correlation of the reliefs, at most one."""

    frame: Similarity
    score: float


def candidates(corners: Array, planes: Sequence[Plane]) -> list[Candidate]:
    """Return places where a face may be, best first. corners (m, 3, 3): the mesh's triangles."""
    template, smooth = _template()
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    extent, diagonal = float((high - low).max()), float(np.linalg.norm(high - low))
    found: list[Candidate] = []
    for plane in planes:
        middle = (low + high) / 2
        middle = middle - (middle @ plane.normal - plane.offset) * plane.normal
        base = _axes_in(plane, corners.mean(axis=1))
        aside = np.abs((corners - middle) @ plane.normal).min(axis=1)
        scale = _LARGEST * diagonal / (_HIGH - _LOW) / 1.2
        while scale * (_HIGH - _LOW) > _SMALLEST * extent:
            samples = sample_surface(corners[aside < scale * _HALF], scale * _PIXEL / _CLOSER) - middle
            across, flat = samples @ plane.normal, base @ samples.T
            near = np.abs(across) < scale * _HALF
            across, flat = across[near], np.ascontiguousarray(flat[:, near])
            column = np.floor(across / (scale * _PIXEL) + _ACROSS / 2).astype(np.int64).clip(0, _ACROSS - 1)
            for angle in np.radians(np.arange(0.0, 360.0, _TURN)):
                out = np.array([np.cos(angle), np.sin(angle)])
                up = np.array([-out[1], out[0]])
                for score, at, z, upward in _look(column, up @ flat, out @ flat, scale, template, smooth):
                    y3, z3 = upward * up @ base, out @ base
                    rotation = np.column_stack([np.cross(y3, z3), y3, z3])
                    found.append(Candidate(Similarity(scale, rotation, middle + at * y3 + z * z3), score))
            scale /= _STEP
    return _best(found)


def _look(column: NDArray, height: Array, depth: Array, scale: float, template: Array, smooth: Array):
    """Yield (score, height of the base face's origin, its depth, 1 up or -1 down) of the best places of one view."""
    norm, pixel = np.linalg.norm(template), scale * _PIXEL
    if not len(column):
        return
    lowest = height.min() - pixel
    row = np.floor((height - lowest) / pixel).astype(np.int64)
    rows = int(row.max()) + 2
    tall = len(template) // _ACROSS
    if rows < 0.7 * tall:
        return
    pad = tall // 3
    picture = np.full((rows + 2 * pad) * _ACROSS, -np.inf, np.float32)
    np.maximum.at(picture, (row + pad) * _ACROSS + column, depth.astype(np.float32))
    picture = picture.reshape(-1, _ACROSS)
    for upward, view in ((1, picture), (-1, picture[::-1, ::-1])):
        windows = np.lib.stride_tricks.sliding_window_view(view, (tall, _ACROSS))[:, 0].reshape(-1, tall * _ACROSS)
        windows = windows / np.float32(scale)
        front = windows.max(axis=1)
        good = np.isfinite(front)
        windows = np.where(good[:, None], np.maximum(windows, front[:, None] - np.float32(_DEEP)), np.float32(0.0))
        rest = windows - (windows @ smooth) @ smooth.T
        size = np.linalg.norm(rest, axis=1)
        dot = rest @ template
        score = np.where(good & (size > 0.25 * norm), dot / (np.maximum(size, 1e-6 * norm) * norm), -1.0)
        # a relief much stronger or weaker than a face's is none
        gain = dot / norm**2
        score = np.where((gain > 0.35) & (gain < 3.0), score, -1.0)
        for k in np.argsort(-score)[:2]:
            if score[k] > 0.3:
                low = lowest + (k - pad) * pixel if upward > 0 else -(lowest + (len(view) - k - pad) * pixel)
                yield float(score[k]), low - _LOW * scale, scale * float((windows[k] - _depths()).mean()), upward


def _axes_in(plane: Plane, samples: Array) -> Array:
    """Return two directions (2, 3) at right angles in a plane; with its normal first they are right-handed."""
    flat = samples - samples.mean(axis=0)
    flat = flat - (flat @ plane.normal)[:, None] * plane.normal
    first = np.linalg.eigh(flat.T @ flat)[1][:, 2]
    return np.stack([first, np.cross(plane.normal, first)])


def _best(found: list[Candidate]) -> list[Candidate]:
    kept: list[Candidate] = []
    for one in sorted(found, key=lambda one: -one.score):
        if all(_unlike(one.frame, other.frame) for other in kept):
            kept.append(one)
        if len(kept) == _BEST:
            break
    return kept


def _unlike(a: Similarity, b: Similarity) -> bool:
    apart = np.linalg.norm(a.offset - b.offset) / (100.0 * max(a.scale, b.scale))
    return bool(apart > 0.25 or np.trace(a.rotation.T @ b.rotation) < 1 + 2 * np.cos(np.radians(20.0))
                or abs(np.log(a.scale / b.scale)) > 0.25)


@cache
def _depths() -> Array:
    """Return the base face's picture of depths, flat, mm."""
    mesh = load_face().mesh(1)
    shown = np.isin(mesh.face_parts, [mesh.parts.index(part) for part in ("skin", "eye_L", "eye_R")])
    corners = mesh.vertices[mesh.faces[shown]]
    samples = sample_surface(corners, 1.5)
    column = np.floor(samples[:, 0] / _PIXEL + _ACROSS / 2).astype(int)
    row = np.floor((samples[:, 1] - _LOW) / _PIXEL).astype(int)
    tall = round((_HIGH - _LOW) / _PIXEL)
    inside = (column >= 0) & (column < _ACROSS) & (row >= 0) & (row < tall)
    picture = np.full(tall * _ACROSS, -np.inf)
    np.maximum.at(picture, row[inside] * _ACROSS + column[inside], samples[inside, 2])
    return np.maximum(picture, picture.max() - _DEEP)


@cache
def _template() -> tuple[Array, Array]:
    """Return the base face's relief (p,), and orthonormal slopes and bulges (p, b) that are taken away."""
    depths = _depths()
    tall = len(depths) // _ACROSS
    y, x = np.meshgrid(np.linspace(-1, 1, tall), np.linspace(-1, 1, _ACROSS), indexing="ij")
    smooth = np.linalg.qr(np.stack([np.ones_like(x), y, x**2, y**2, x**2 * y, x**4], axis=-1).reshape(-1, 6))[0]
    return (depths - smooth @ (smooth.T @ depths)).astype(np.float32), smooth.astype(np.float32)

"""Eyeballs with their iris and pupil, and the rings of a lid round the opening over one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from clay import Clay, on_path
from numpy.typing import ArrayLike, NDArray
from sheet import Sheet, mirror_image

from facegen.geometry.mesh import Mesh

# Rounds of smoothing of the outermost ring; the nearer ones get fewer, the margin none.
_EVENING = 4


@dataclass(frozen=True)
class Eye:
    """The left eye: ``frame`` (3, 3) has the rows outwards (to the outer corner), up and gaze."""

    centre: NDArray
    radius: float
    frame: NDArray

    @classmethod
    def looking(cls, centre: ArrayLike, radius: float, yaw: float, pitch: float, roll: float = 0.0) -> Eye:
        """Return an eye; yaw to its own side, pitch up, roll lifts the outer corner, in degrees."""
        y, p, r = np.radians([yaw, pitch, roll])
        gaze = np.array([np.sin(y) * np.cos(p), np.sin(p), np.cos(y) * np.cos(p)])
        side = np.array([np.cos(y), 0.0, -np.sin(y)])
        up = np.cross(gaze, side)
        return cls(
            np.asarray(centre, float),
            radius,
            np.stack([np.cos(r) * side + np.sin(r) * up, np.cos(r) * up - np.sin(r) * side, gaze]),
        )

    def on_ball(self, outline: ArrayLike, height: float = 1.0) -> NDArray:
        """Return places (k, 3) at angles (k, 2) from the gaze (radians outwards and up), ``height`` radii out."""
        outline = np.asarray(outline, float)
        angle = np.linalg.norm(outline, axis=1)
        away = outline / np.maximum(angle, 1e-12)[:, None]
        d = np.cos(angle)[:, None] * self.frame[2] + np.sin(angle)[:, None] * (away @ self.frame[:2])
        return self.centre + height * self.radius * d


def almond(
    count: int,
    width: float,
    upper: float,
    lower: float,
    *,
    point: float = 0.5,
    inner_drop: float = 0.0,
    lean: float = 0.0,
) -> NDArray:
    """Return an outline (count, 2) in radians from angles in degrees: outer corner first, upper lid next.

    width: from the middle to a corner. point: 0 for an ellipse, 1 for sharp corners. inner_drop: how far the inner
    corner is drawn down. lean: moves the highest place inwards (and the lowest outwards), -1..1.
    """
    t = np.linspace(0, 2 * np.pi, 721)
    x, s = np.cos(t), np.sin(t)
    rise = (1 - point) * np.abs(s) + point * s**2
    rise *= 1 - np.sign(s) * lean * x
    y = np.where(s > 0, upper, -lower) * rise - inner_drop * np.clip(-x, 0, 1) ** 4
    fine = np.radians(np.stack([width * x, y], axis=1))
    evenly = np.linspace(0, 1, count // 2 + 1)
    upper_lid, lower_lid = on_path(fine[:361], evenly), on_path(fine[360:], evenly)
    return np.concatenate([upper_lid[:-1], lower_lid[:-1]])


def ellipse(count: int, width: float, height: float) -> NDArray:
    """Return an ellipse (count, 2) in radians, half axes in degrees, starting at the outer side."""
    t = 2 * np.pi * np.arange(count) / count
    return np.radians(np.stack([width * np.cos(t), height * np.sin(t)], axis=1))


def lid_rings(
    eye: Eye,
    clay: Clay,
    outline: NDArray,
    offsets: Sequence[float],
    *,
    crest: float,
    inside: float,
    pocket: float,
    edge: float | None = None,
) -> list[NDArray]:
    """Return rings (k, 3) round an opening, the outermost first: on the skin, the margin, then behind the lid.

    offsets: distances of the rings on the skin from the margin, the largest first. crest, inside: heights of the margin
    and of the lid's inner side above the ball's middle, in radii. pocket: how far the skin goes behind the lid (1.3 is
    three tenths of the opening). edge: adds a ring at most so far from the margin, towards the nearest on the skin,
    which may lie high above it in a corner.
    """
    margin = eye.on_ball(outline, crest)
    ahead, behind = np.roll(margin, -1, axis=0), np.roll(margin, 1, axis=0)
    out = np.cross(ahead - behind, margin - eye.centre)
    out /= np.linalg.norm(out, axis=1, keepdims=True)
    # Even the directions out along the ring: at the pointed corners they would fan.
    for _ in range(2):
        out = out + 0.5 * (np.roll(out, 1, axis=0) + np.roll(out, -1, axis=0))
        out /= np.linalg.norm(out, axis=1, keepdims=True)
    skin = []
    for d in offsets:
        ring = clay.onto(margin + d * out)
        for _ in range(int(_EVENING * d / max(offsets))):
            ring = clay.onto(0.5 * ring + 0.25 * (np.roll(ring, 1, axis=0) + np.roll(ring, -1, axis=0)), steps=3)
        skin.append(ring)
    if edge is not None:
        rise = skin[-1] - margin
        skin.append(margin + rise * np.minimum(1.0, edge / np.linalg.norm(rise, axis=1, keepdims=True)))
    return [
        *skin,
        margin,
        eye.on_ball(1.07 * outline, inside),
        eye.on_ball((1 + pocket) / 2 * outline, inside),
        eye.on_ball(pocket * outline, inside),
    ]


def eyeball(part: str, eye: Eye, outlines: Sequence[NDArray], materials: Sequence[str], *, mirror: bool) -> Mesh:
    """Return an eyeball: rings at outlines (angles from the gaze, innermost first), then on to the back.

    materials: of the middle, of each band between outlines, and of the rest.
    """
    sheet = Sheet(part)
    count = len(outlines[0])
    edge = np.degrees(np.linalg.norm(outlines[-1], axis=1).max())
    back = [ellipse(count, a, a) for a in np.linspace(edge, 180, 6)[1:-1]]
    rings = [sheet.row(eye.on_ball(o)) for o in [*outlines, *back]]
    sheet.cap(rings[0], materials[0], eye.on_ball([[0.0, 0.0]]))
    names = [*materials[1 : len(outlines)], *[materials[-1]] * len(back)]
    for a, b, name in zip(rings[:-1], rings[1:], names, strict=True):
        sheet.band(a, b, name)
    sheet.cap(rings[-1], materials[-1], eye.on_ball([[0.0, np.pi]]))
    return mirror_image(sheet.mesh()) if mirror else sheet.mesh()

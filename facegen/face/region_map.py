"""Where the regions of a face lie on its smooth surface: the borders between them, and the triangles of each.

A region is what projects from the centre O onto the triangle of three feature points (Akimoto 1986, section 3.1). So a
border runs where rays from O through the line between two feature points meet the surface.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from facegen.face.face import Face

Array = NDArray[np.float64]

# Pieces of a border between two feature points: a bend of the cheek is followed to a third of a millimetre.
_PIECES = 6
# The level whose triangles rays are met with: a fourth as many as are drawn, a third of a millimetre below them.
_COARSE = 1
_AT_ONCE = 400          # rays, so that a search takes some tens of megabytes
_INSIDE = -1e-9         # barycentric weights down to this are inside

TINTS = 6
"""Colours that tell neighbours apart: four would do on any map, chosen one by one they may take more."""


@dataclass(frozen=True, eq=False)
class RegionMap:
    """``ends`` (2 s, n): weights of the vertices of ``mesh(detail)`` that place both ends of s pieces of borders;
    ``regions`` (m,): the region of each triangle, -1 for none, as on parts beside the skin; ``tints`` (r,): a small
    number for each region, another than its neighbours'."""

    ends: sparse.csr_array
    regions: NDArray[np.int64]
    tints: NDArray[np.int64]

    def borders(self, vertices: Array) -> Array:
        """Return the borders as segments (s, 2, 3), mm, on posed vertices (n, 3)."""
        return (self.ends @ vertices).reshape(-1, 2, 3)


def region_map(face: Face, detail: int = 2) -> RegionMap:
    """Return where a face's regions lie on ``mesh(detail)``."""
    names = list(face.feature_points)
    points = np.array(list(face.feature_points.values()))
    corners = np.array([[names.index(one) for one in region] for region in face.regions])
    return RegionMap(_ends(face, points, corners, detail), _regions(face, points, corners, detail), _tints(corners))


def _ends(face: Face, points: Array, corners: NDArray[np.int64], detail: int) -> sparse.csr_array:
    """Return the weights (2 s, n) of the ends of the pieces of every border."""
    sides = np.unique(np.sort(np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]])), axis=0)
    along = np.linspace(0.0, 1.0, _PIECES + 1)[:, None]
    through = (points[sides[:, 0], None] * (1 - along) + points[sides[:, 1], None] * along).reshape(-1, 3)
    # Vertices keep their index from level to level, so the triangles of the coarser one are met and those of the finer
    # one moved.
    coarse, fine = face.mesh(min(_COARSE, detail)), face.mesh(detail)
    skin = coarse.faces[_outside(coarse)]
    rows, weights = _met(through - face.centre, coarse.vertices[skin] - face.centre)
    found = (rows >= 0).reshape(len(sides), -1)
    whole = found[:, 1:] & found[:, :-1]                    # a piece of which both ends lie on the surface
    first = (np.arange(len(sides))[:, None] * (_PIECES + 1) + np.arange(_PIECES))[whole]
    picked = np.stack([first, first + 1], axis=1).ravel()
    return sparse.csr_array((weights[picked].ravel(), (np.repeat(np.arange(len(picked)), 3),
                                                       skin[rows[picked]].ravel())),
                            shape=(len(picked), len(fine.vertices)))


def _outside(mesh) -> NDArray[np.bool_]:
    """Return which triangles are skin that is seen: no parts, no lining of the mouth."""
    inner = [k for k, name in enumerate(mesh.materials) if name == "mouth"]
    return (mesh.face_parts == mesh.parts.index("skin")) & ~np.isin(mesh.face_materials, inner)


def _met(ways: Array, triangles: Array) -> tuple[NDArray[np.int64], Array]:
    """Return the triangle (r,) that each ray from the origin along ``ways`` (r, 3) meets, -1 for none, and the weights
    (r, 3) of its corners; of several the one nearest to the end of the way."""
    inverse = np.linalg.pinv(np.swapaxes(triangles, 1, 2), rcond=1e-9)
    rows, weights = np.full(len(ways), -1), np.zeros((len(ways), 3))
    for start in range(0, len(ways), _AT_ONCE):
        shares = np.einsum("tij,rj->rti", inverse, ways[start:start + _AT_ONCE])
        total = shares.sum(axis=2)
        inside = (total > 0.0) & (shares.min(axis=2) >= _INSIDE * np.maximum(total, 1e-12))
        depth = np.where(inside, np.abs(1.0 - 1.0 / np.where(inside, total, 1.0)), np.inf)
        best = depth.argmin(axis=1)
        ray = np.arange(len(best))
        hit = np.isfinite(depth[ray, best])
        rows[start:start + _AT_ONCE] = np.where(hit, best, -1)
        weights[start:start + _AT_ONCE] = shares[ray, best] / np.where(hit, total[ray, best], 1.0)[:, None]
    return rows, weights


def _regions(face: Face, points: Array, corners: NDArray[np.int64], detail: int) -> NDArray[np.int64]:
    """Return the region (m,) on which the middle of each triangle projects; -1 where there is none."""
    mesh = face.mesh(detail)
    skin = np.flatnonzero(_outside(mesh))
    rows, _ = _met(mesh.vertices[mesh.faces[skin]].mean(axis=1) - face.centre, points[corners] - face.centre)
    found = np.full(len(mesh.faces), -1)
    found[skin] = rows
    return found


def _tints(corners: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return a number (r,) for each region, the least that no region with two of its feature points has."""
    across: dict[tuple[int, int], list[int]] = {}
    for row, three in enumerate(np.sort(corners, axis=1).tolist()):
        for side in ((three[0], three[1]), (three[1], three[2]), (three[0], three[2])):
            across.setdefault(side, []).append(row)
    beside: list[set[int]] = [set() for _ in corners]
    for rows in across.values():
        for row in rows:
            beside[row].update(rows)
    tints = np.full(len(corners), -1)
    for row, others in enumerate(beside):
        taken = {int(tints[other]) for other in others}
        tints[row] = next(k for k in range(len(corners)) if k not in taken)
    return tints

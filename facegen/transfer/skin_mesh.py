"""The skin as the transfer solves it: one triangle at a place, all looking out, none without an area.

Files of avatars list triangles twice, wind some the other way round, and close cracks with triangles that have no area.
None of this changes what the skin is. The file keeps what it has; only the solve sees the skin put in order.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from facegen.errors import InputError
from facegen.geometry.closest import ClosestPoints
from facegen.geometry.factor import Factor
from facegen.geometry.operators import Surface
from facegen.geometry.winding import winding

# Because float32 puts a vertex on an edge no better than this: a triangle as flat, as a share of its longest side,
# closes a crack and has no area.
_FLAT = 1e-4
# Millimetres: a triangle without a longer side is a place. Those that reducing programs leave in a seam are held by
# flat triangles alone, and would rest while all round them moves.
_PLACE = 1e-3
# The landmarks' triangles look ahead on every face that looks out, a horse's too; less than this tells nothing.
_LOOKS = 0.1
# Where flat triangles leave a corner undecided it keeps near the others: this firmly, so that it never outvotes them.
_LOOSE = 1e-6
# So many triangles are named.
_NAMED = 5


@dataclass(frozen=True, eq=False)
class SkinMesh:
    """``rows`` (n,): the vertices of the skin among all; ``surface`` over them. ``numbers`` (m,) of its triangles, and
    ``turned``, those that looked in. ``hanging`` (h,): vertices that only triangles without an area hold, and ``hang``
    (h, all): the weights of those they hang on. ``notes``: what was put in order, a sentence each."""

    rows: NDArray[np.int64]
    surface: Surface
    numbers: NDArray[np.int64]
    turned: NDArray[np.int64]
    hanging: NDArray[np.int64]
    hang: sparse.csr_array
    notes: tuple[str, ...]

    def wound(self, faces: NDArray) -> NDArray:
        """Return all triangles (m, 3) with those of the skin that looked in turned."""
        faces = faces.copy()
        faces[self.turned] = faces[self.turned][:, ::-1]
        return faces

    def carry(self, motion: Iterable[NDArray]) -> None:
        """Let what hangs on edges go with them: displacements (all, 3) of several shapes, in place."""
        for moved in motion if len(self.hanging) else ():
            moved[self.hanging] = self.hang @ moved


def skin_mesh(vertices: NDArray, faces: NDArray, numbers: NDArray, places: Mapping[str, NDArray]) -> SkinMesh:
    """Return the skin in order.

    vertices (all, 3) of the avatar, in the template's frame, mm; faces (m, 3) of its skin; numbers (m,): what the file
    calls them. places: landmarks. Raises InputError if no triangle has an area.
    """
    notes = []
    flat = _flat(vertices, faces)
    if flat.all():
        raise InputError(f"mesh: none of the skin's {len(faces)} triangles has an area (first: "
                         f"{_listed(numbers)}); expected a surface")
    solid, named = faces[~flat], numbers[~flat]
    _, first = np.unique(np.sort(solid, axis=1), axis=0, return_index=True)
    if len(first) < len(solid):
        again = np.setdiff1d(np.arange(len(solid)), first)
        notes.append(f"the skin has {_triangles(len(again))} twice or more (again: {_listed(named[again])}): shapes "
                     "are made as if each stood once")
        keep = np.sort(first)
        solid, named = solid[keep], named[keep]
    rows, local = np.unique(solid, return_inverse=True)
    surface = Surface(vertices[rows], local.reshape(-1, 3).astype(np.int32))
    turned, more = _inward(surface, named, places)
    if turned.any():
        local = surface.faces.copy()
        local[turned] = local[turned][:, ::-1]
        surface = Surface(surface.vertices, local)
    hanging, hang = _hanging(vertices, faces[flat], rows)
    return SkinMesh(rows, surface, named, named[turned], hanging, hang, (*notes, *more))


def _flat(vertices: NDArray, faces: NDArray) -> NDArray[np.bool_]:
    """Return which triangles have no area: two corners are one vertex, or all lie on a line or at one place."""
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    twice = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    longest = np.max([((p - q) ** 2).sum(axis=1) for p, q in ((a, b), (b, c), (c, a))], axis=0)
    return (twice <= _FLAT * longest) | (longest <= _PLACE**2) | (faces == np.roll(faces, 1, axis=1)).any(axis=1)


def _inward(surface: Surface, numbers: NDArray, places: Mapping[str, NDArray]) -> tuple[NDArray, list[str]]:
    """Return which triangles look in, and what is to be said of them.

    Of a patch of the skin most triangles are right, or all are wrong: then its landmarks look back. The template looks
    along +z.
    """
    found = winding(surface)
    notes = []
    if found.one_sided.any():
        rows = np.flatnonzero(found.one_sided[found.patch])
        notes.append(f"the skin has {_triangles(len(rows))} (first: {_listed(numbers[rows])}) of a surface with one "
                     "side only, a Moebius strip: nothing tells which way it looks, and shapes there may be wrong")
    if found.against.any():
        notes.append(f"the skin has {_triangles(int(found.against.sum()))} wound against their neighbours (first: "
                     f"{_listed(numbers[found.against])}): shapes are made as if they were turned")
    feet = ClosestPoints(surface)(np.array(list(places.values())))
    looks = surface.normals[feet.faces, 2] * np.where(found.against[feet.faces], -1.0, 1.0)
    ahead = float(looks.mean())
    backwards = np.zeros(len(found.one_sided), bool)
    if ahead < -_LOOKS:
        told = np.bincount(found.patch[feet.faces], looks, minlength=len(backwards))
        backwards = (told <= 0) & ~found.one_sided
        notes.append("the skin is wound inside out: its triangles run clockwise seen from outside; shapes are made as "
                     "if they were turned, but a renderer that draws front faces only shows the inside")
    return found.against ^ backwards[found.patch], notes


def _hanging(vertices: NDArray, flat: NDArray, held: NDArray) -> tuple[NDArray, sparse.csr_array]:
    """Return the vertices (h,) of flat triangles that no solid one holds, and what they hang on (h, all).

    In each such triangle the middle corner divides the way between the others: it does so in least squares when moved.
    """
    n = len(vertices)
    free, on = np.setdiff1d(flat, held), np.intersect1d(flat, held)
    if not len(free) or not len(on):
        return free[:0], sparse.csr_array((0, n))
    corners = vertices[flat]
    sides = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)      # from corner k to the next
    middle = (sides.argmax(axis=1) + 2) % 3
    m, p, q = (flat[np.arange(len(flat)), (middle + k) % 3] for k in range(3))
    way = vertices[q] - vertices[p]
    share = np.einsum("ti,ti->t", vertices[m] - vertices[p], way)
    share = np.clip(share / np.maximum(np.einsum("ti,ti->t", way, way), np.finfo(float).tiny), 0.0, 1.0)
    rows = np.arange(len(flat))
    divide = sparse.coo_array((np.concatenate([np.ones(len(flat)), share - 1, -share]),
                               (np.tile(rows, 3), np.concatenate([m, p, q]))), shape=(len(flat), n)).tocsr()
    a, b = np.concatenate([flat[:, [0, 1]], flat[:, [1, 2]], flat[:, [2, 0]]]).T
    every = np.arange(len(a))
    link = sparse.coo_array((np.repeat([1.0, -1.0], len(a)), (np.tile(every, 2), np.concatenate([a, b]))),
                            shape=(len(a), n)).tocsr()
    energy = (divide.T @ divide + _LOOSE * (link.T @ link)).tocsr()
    own = energy[free][:, free] + _LOOSE**2 * sparse.identity(len(free))        # what hangs on nothing rests
    weights = Factor(own, what="the skin's triangles without an area").solve(-energy[free][:, on].toarray())
    rows, columns = np.nonzero(weights)
    return free, sparse.csr_array((weights[rows, columns], (rows, on[columns])), shape=(len(free), n))


def _triangles(count: int) -> str:
    return f"{count:,} triangle{'s' if count != 1 else ''}"


def _listed(numbers: NDArray) -> str:
    shown = ", ".join(str(int(one)) for one in numbers[:_NAMED])
    return shown + (", ..." if len(numbers) > _NAMED else "")

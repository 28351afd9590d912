"""Awkward copies of an avatar: what other people's files are like. Each knows where the plain one's vertices went."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from facegen.geometry.mesh import Mesh
from facegen.transfer.landmarks import Landmarks


@dataclass(frozen=True, eq=False)
class Copy:
    """``mesh``; ``rows`` (n,): where each vertex of the plain avatar is in it, -1 where it is gone; ``turn`` (3, 3):
    the plain one's displacements times this are the copy's."""

    mesh: Mesh
    rows: np.ndarray
    turn: np.ndarray

    def landmarks(self, plain: Landmarks) -> Landmarks:
        """The plain avatar's landmarks on the copy; those whose triangle is gone are left out."""
        corners = self.rows[plain.corners]
        keep = (corners >= 0).all(axis=1)
        same = np.sort(self.mesh.faces, axis=1)[:, None] == np.sort(corners[keep], axis=1)[None]
        faces = same.all(axis=2).argmax(axis=0)
        names = tuple(name for name, kept in zip(plain.names, keep, strict=True) if kept)
        return Landmarks(names, faces, corners[keep], plain.barycentric[keep])

    def back(self, moved: np.ndarray) -> np.ndarray:
        """Displacements of the copy as displacements of the plain avatar's vertices; NaN for those that are gone."""
        there = self.rows >= 0
        result = np.full((len(self.rows), 3), np.nan)
        result[there] = moved[self.rows[there]] @ np.linalg.inv(self.turn)
        return result


def same(mesh: Mesh) -> Copy:
    return Copy(mesh, np.arange(len(mesh.vertices)), np.eye(3))


def moved(turn, offset=(0.0, 0.0, 0.0)) -> Callable[[Mesh], Copy]:
    """Vertices times ``turn`` plus ``offset``."""
    turn = np.asarray(turn, float)
    return lambda mesh: replace(same(mesh.with_vertices(mesh.vertices @ turn + offset)), turn=turn)


def shuffled(mesh: Mesh) -> Copy:
    """Vertices, triangles and the corners of these in another order, and so the pieces too."""
    some = np.random.default_rng(0)
    order, faces = some.permutation(len(mesh.vertices)), some.permutation(len(mesh.faces))
    rows = np.argsort(order)
    corners = (np.arange(3) + some.integers(0, 3, len(faces))[:, None]) % 3
    return Copy(replace(mesh, vertices=mesh.vertices[order],
                        faces=np.take_along_axis(rows[mesh.faces[faces]], corners, axis=1),
                        face_parts=mesh.face_parts[faces], face_materials=mesh.face_materials[faces]), rows, np.eye(3))


def wound(mesh: Mesh, rows) -> Copy:
    """Some triangles the other way round."""
    faces = mesh.faces.copy()
    faces[rows] = faces[rows][:, ::-1]
    return same(replace(mesh, faces=faces))


def plus(copy: Copy, vertices, faces, *, part: str = "", like: str = "skin") -> Copy:
    """More vertices, and triangles over all of them, in a part of their own or in that of the skin."""
    mesh = copy.mesh
    vertices, faces = np.asarray(vertices, float).reshape(-1, 3), np.asarray(faces).reshape(-1, 3)
    parts = mesh.parts if not part or part in mesh.parts else (*mesh.parts, part)
    row = mesh.face_parts == mesh.parts.index(like)
    material = mesh.face_materials[row][0]
    return replace(copy, mesh=Mesh(
        np.concatenate([mesh.vertices, vertices]), np.concatenate([mesh.faces, faces]), mesh.materials,
        np.concatenate([mesh.face_materials, np.full(len(faces), material)]), parts,
        np.concatenate([mesh.face_parts, np.full(len(faces), parts.index(part or like))])))


def only(mesh: Mesh, keep) -> Copy:
    """Some of the triangles, and the vertices that they use."""
    faces = mesh.faces[keep]
    used = np.unique(faces)
    rows = np.full(len(mesh.vertices), -1)
    rows[used] = np.arange(len(used))
    return Copy(Mesh(mesh.vertices[used], rows[faces], mesh.materials, mesh.face_materials[keep], mesh.parts,
                     mesh.face_parts[keep]), rows, np.eye(3))


def of_part(mesh: Mesh, *names: str) -> np.ndarray:
    """Which triangles belong to parts whose names start so."""
    return np.array([part.startswith(names) for part in mesh.parts])[mesh.face_parts]


def soup(mesh: Mesh) -> Copy:
    """Three vertices for each triangle, as STL and many exporters have it."""
    rows = np.full(len(mesh.vertices), -1)
    rows[mesh.faces.ravel()[::-1]] = np.arange(mesh.faces.size)[::-1]
    return Copy(replace(mesh, vertices=mesh.vertices[mesh.faces.ravel()],
                        faces=np.arange(mesh.faces.size).reshape(-1, 3)), rows, np.eye(3))


def loose(mesh: Mesh, *names: str) -> Copy:
    """Each pair of triangles of some parts a piece of its own, a hair's breadth from its neighbours."""
    which = np.flatnonzero(of_part(mesh, *names))
    middle = mesh.vertices[np.unique(mesh.faces[which])].mean(axis=0)
    faces, vertices, rows = mesh.faces.copy(), [mesh.vertices], np.arange(len(mesh.vertices))
    count = len(mesh.vertices)
    for pair in np.split(which, np.arange(2, len(which), 2)):
        used, local = np.unique(mesh.faces[pair], return_inverse=True)
        own = mesh.vertices[used]
        vertices.append(own + 1e-4 * (own.mean(axis=0) - middle))
        faces[pair] = count + local.reshape(-1, 3)
        rows[used] = count + np.arange(len(used))
        count += len(used)
    copy = replace(same(mesh), mesh=replace(mesh, vertices=np.concatenate(vertices), faces=faces))
    tight = only(copy.mesh, np.ones(len(faces), bool))
    return replace(tight, rows=tight.rows[rows])


def rim(mesh: Mesh, below: float) -> np.ndarray:
    """The vertices of the skin's open border under a height, in their order round it."""
    faces = mesh.faces[of_part(mesh, "skin")]
    sides = {(int(a), int(b)) for face in faces for a, b in zip(face, np.roll(face, -1), strict=True)}
    after = {b: a for a, b in sides if (b, a) not in sides and mesh.vertices[a, 1] < below}
    chain = [max(after)]
    while after[chain[-1]] != chain[0]:
        chain.append(after[chain[-1]])
    return np.array(chain)


def with_torso(mesh: Mesh, below: float) -> Copy:
    """The neck's border drawn out to a torso of eight rings: one piece with the head."""
    chain = rim(mesh, below)
    ring, count = mesh.vertices[chain], len(mesh.vertices)
    middle, high = ring.mean(axis=0), np.ptp(mesh.vertices[:, 1])
    rings = [middle + (ring - middle) * np.array([wide, 1, 1 + 0.3 * (wide - 1)]) - [0, down * high, 0]
             for wide, down in zip((1.2, 2.0, 2.6, 2.8, 2.7, 2.5, 2.4, 2.4), np.arange(0.1, 2.5, 0.3), strict=True)]
    faces, last = [], chain
    for k in range(len(rings)):
        here = count + k * len(chain) + np.arange(len(chain))
        a, b, c, d = last, np.roll(last, -1), np.roll(here, -1), here
        faces += [np.stack([a, b, c], 1), np.stack([a, c, d], 1)]
        last = here
    return plus(same(mesh), np.concatenate(rings), np.concatenate(faces))


def with_body(mesh: Mesh) -> Copy:
    """A body of its own below the head: a ball."""
    u, v = np.meshgrid(np.arange(12), np.arange(9))
    angle, height = u * np.pi / 6, v * np.pi / 8
    size = np.ptp(mesh.vertices, axis=0).max()
    ball = np.stack([np.sin(height) * np.sin(angle), np.cos(height), np.sin(height) * np.cos(angle)], -1)
    places = mesh.vertices.mean(axis=0) + size * (1.2 * ball - [0, 1.9, 0])
    a, b = (12 * v + u)[:-1], (12 * v + (u + 1) % 12)[:-1]
    faces = np.concatenate([np.stack([a, a + 12, b], -1), np.stack([b, a + 12, b + 12], -1)]).reshape(-1, 3)
    return plus(same(mesh), places.reshape(-1, 3), faces + len(mesh.vertices), part="body")


def mirrored(mesh: Mesh) -> Copy:
    """The mirror image, its triangles wound so that they still look out."""
    turn = np.diag([-1.0, 1.0, 1.0])
    return Copy(replace(mesh, vertices=mesh.vertices @ turn, faces=mesh.faces[:, ::-1]), np.arange(len(mesh.vertices)),
                turn)


def welded(mesh: Mesh, pairs) -> Copy:
    """Pairs of vertices (p, 2) made one, between them."""
    pairs = np.asarray(pairs)
    vertices, rows = mesh.vertices.copy(), np.arange(len(mesh.vertices))
    vertices[pairs[:, 0]] = vertices[pairs].mean(axis=1)
    rows[pairs[:, 1]] = pairs[:, 0]
    faces = rows[mesh.faces]
    copy = only(replace(mesh, vertices=vertices, faces=faces), (faces != np.roll(faces, 1, axis=1)).all(axis=1))
    return replace(copy, rows=copy.rows[rows])

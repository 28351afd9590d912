"""Avatars for the tests of pieces: the base face, cut, renamed, and with things put on it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from facegen.face.face import load_face
from facegen.geometry.mesh import Mesh
from facegen.transfer.pieces import Piece, face_names, find_pieces
from facegen.transfer.weld import weld


@dataclass(frozen=True, eq=False)
class Avatar:
    vertices: np.ndarray
    faces: np.ndarray
    names: list[str]
    points: dict[str, np.ndarray]

    def plus(self, name: str, vertices, faces) -> Avatar:
        """The same with one more part."""
        return replace(self, vertices=np.concatenate([self.vertices, vertices]),
                       faces=np.concatenate([self.faces, np.asarray(faces) + len(self.vertices)]),
                       names=self.names + [name] * len(faces))

    def without(self, *parts: str) -> Avatar:
        keep = np.array([not set(name.split("|")) & set(parts) for name in self.names])
        return replace(self, faces=self.faces[keep], names=[n for n, k in zip(self.names, keep, strict=True) if k])

    def pieces(self, named=True, explicit=None) -> tuple[Piece, ...]:
        return find_pieces(self.vertices, self.faces, self.points, names=self.names if named else None,
                           explicit=explicit)

    def kinds(self, named=True, explicit=None) -> dict[str, set[str]]:
        """Part -> the kinds of its components."""
        found: dict[str, set[str]] = {}
        for piece in self.pieces(named, explicit):
            for name in {self.names[row] for row in piece.faces}:
                found.setdefault(name.split("|")[0], set()).add(piece.kind)
        return found


@cache
def template() -> tuple[Mesh, dict[str, np.ndarray]]:
    face = load_face()
    mesh = face.mesh(1)
    return mesh, face.landmark_points(mesh.vertices, detail=1)


@cache
def head() -> Avatar:
    mesh, points = template()
    vertices, inverse = weld(mesh.vertices, mesh.faces)
    return Avatar(vertices, inverse[mesh.faces], face_names(mesh), points)


def grid(at, *, closed=False):
    """Vertices and triangles of a grid of places (r, c, 3); closed: its last column joins the first."""
    at = np.asarray(at, float)
    r, c = at.shape[:2]
    number = np.arange(r * c).reshape(r, c)
    number = np.concatenate([number, number[:, :1]], axis=1) if closed else number
    a, b, d, e = number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]
    return at.reshape(-1, 3), np.concatenate([np.stack([a, b, d], -1), np.stack([a, d, e], -1)], 1).reshape(-1, 3)


def ball(centre, radius, *, rings=12, around=16, part=np.pi):
    """A sphere (or ellipsoid) with its pole at +z; part: the angle from the pole to its rim, pi for a whole one."""
    polar, turn = np.meshgrid(np.linspace(0.02, part - 0.02, rings), np.arange(around) * 2 * np.pi / around,
                              indexing="ij")
    at = np.stack([np.sin(polar) * np.cos(turn), np.sin(polar) * np.sin(turn), np.cos(polar)], -1)
    return grid(np.asarray(centre) + np.asarray(radius) * at, closed=True)


def disc(centre, radius, *, around=16):
    vertices, faces = ball(centre, [radius, radius, 0.0], rings=3, around=around, part=np.pi / 2)
    return vertices, faces


def tube(path, radius, *, around=8):
    path = np.asarray(path, float)
    turn = np.arange(around) * 2 * np.pi / around
    ways = np.gradient(path, axis=0)
    at = []
    for place, way in zip(path, ways, strict=True):
        across = np.linalg.svd(way[None])[2][1:]
        at.append(place + radius * (np.cos(turn)[:, None] * across[0] + np.sin(turn)[:, None] * across[1]))
    return grid(at, closed=True)


def lashes(points, s="L", length=8.0):
    """A strip of hair along the upper lid."""
    names = ("eye_inner", "eye_upper_inner", "eye_upper", "eye_upper_outer", "eye_outer")
    root = np.array([points[f"{name}_{s}"] for name in names])
    root = np.array([[np.interp(t, range(5), root[:, i]) for i in range(3)] for t in np.linspace(0.3, 3.7, 15)])
    return grid([root + np.array([0, 0.15 * t * length, t * length + 0.4]) for t in np.linspace(0, 1, 4)])


def moustache(points, thick=4.0):
    """A bar over the upper lip, that thick."""
    top = points["mouth_top"]
    path = [[x, top[1] + 5 - 0.006 * x * x, top[2] + 0.45 * thick - 0.012 * x * x] for x in np.linspace(-22, 22, 25)]
    return tube(path, thick)


def cap(points):
    """A shell over the head, down to above the brows."""
    at, faces = ball([0, 0, 0], [1, 1, 1], rings=14, around=28, part=np.pi / 2)
    middle = points["head_top"] * [1, 0, 1] + [0, 35, 0]
    return at[:, [0, 2, 1]] * [86, 78, 100] + middle, faces[:, ::-1]


def glasses(points):
    """Two rims, a bridge, and temples back to the ears, in one piece of four components."""
    parts = []
    for s, side in (("L", 1), ("R", -1)):
        eye = (points[f"eye_inner_{s}"] + points[f"eye_outer_{s}"]) / 2 + [0, -3, 18]
        turn = np.linspace(0, 2 * np.pi, 25)
        parts.append(tube(eye + np.stack([24 * np.cos(turn), 18 * np.sin(turn), 0 * turn], -1), 1.5))
        parts.append(tube([eye + np.array([side * 24, 4, -t]) for t in np.linspace(0, 95, 12)], 1.5))
    return together(parts)


def together(parts):
    vertices, faces, start = [], [], 0
    for v, f in parts:
        vertices.append(v)
        faces.append(f + start)
        start += len(v)
    return np.concatenate(vertices), np.concatenate(faces)


def dressed() -> Avatar:
    """The head with everything on it that avatars wear."""
    avatar = head()
    p = avatar.points
    for s, x in (("L", 28.9), ("R", -28.9)):
        avatar = avatar.plus(f"cornea_{s}", *ball([x, 0, 10.2], 6.6, part=1.0))
        avatar = avatar.plus(f"spot_{s}", *disc([x + 2, 2.5, 16.6], 1.0))
        avatar = avatar.plus(f"lashes_{s}", *lashes(p, s))
    avatar = avatar.plus("moustache", *moustache(p)).plus("cap", *cap(p)).plus("glasses", *glasses(p))
    return avatar.plus("trunk", *ball([0, -420, -60], [190, 250, 110]))


def with_body() -> Avatar:
    """The head on a body in the same component, by way of the neck's open border."""
    avatar = head()
    skin = avatar.faces[[name.startswith("skin|") for name in avatar.names]]
    sides = skin[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    key = {tuple(side) for side in sides.tolist()}
    after = {a: b for a, b in sides.tolist() if (b, a) not in key and avatar.vertices[a, 1] < -100}
    loop = [next(iter(after))]
    while after[loop[-1]] != loop[0]:
        loop.append(after[loop[-1]])
    ring = avatar.vertices[loop]
    middle = ring.mean(axis=0)
    rows = [middle + (ring - middle) * [grow, 0, grow] + [0, -down, 0]
            for grow, down in ((1.2, 30), (2.6, 60), (3.0, 300), (2.4, 900), (0.1, 905))]
    new, faces = grid([ring, *rows], closed=True)
    number = np.concatenate([loop, len(avatar.vertices) + np.arange(len(new) - len(ring))])
    return replace(avatar, vertices=np.concatenate([avatar.vertices, new[len(ring):]]),
                   faces=np.concatenate([avatar.faces, number[faces]]), names=avatar.names + ["body"] * len(faces))

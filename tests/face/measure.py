"""Measures of what a picture of the base face must and must not show, on the level-2 surface."""

from __future__ import annotations

from functools import cached_property
from itertools import pairwise

import numpy as np

from facegen.face.face import Face


class Measure:
    """Curves and pieces of a face at one level of detail."""

    def __init__(self, face: Face, detail: int = 2) -> None:
        self.face, self.detail = face, detail
        self.mesh = face.mesh(detail)
        data = face._data
        self.margins = []
        n_cage = len(face.deformer.neutral)
        neighbours = self._crease_graph(n_cage)
        for lid in face.deformer.lids:
            up, low = lid.columns[:, 0], lid.columns[:, 1]
            ends = [self._corner(neighbours, up[0], low[0]), self._corner(neighbours, up[-1], low[-1])]
            self.margins.append((self._chain([ends[0], *up, ends[1]]), self._chain([ends[0], *low, ends[1]])))
        at = data.point_index
        row = {name: int(np.flatnonzero((face.deformer.neutral == face.deformer.points[i]).all(axis=1))[0])
               for name, i in at.items() if name.startswith("mouth_corner")}
        upper = self._path(neighbours, row["mouth_corner_L"], row["mouth_corner_R"], data, "lip_upper")
        lower = self._path(neighbours, row["mouth_corner_L"], row["mouth_corner_R"], data, "lip_lower")
        self.seam = (self._chain(upper), self._chain(lower))

    def _crease_graph(self, n):
        graph: dict[int, set[int]] = {i: set() for i in range(n)}
        for a, b in self.face._data.creases:
            graph[int(a)].add(int(b))
            graph[int(b)].add(int(a))
        return graph

    @staticmethod
    def _corner(graph, a, b):
        return next(iter(graph[int(a)] & graph[int(b)]))

    def _path(self, graph, start, end, data, prefix):
        """Follow the lip crease from corner to corner through one lip's feature points."""
        own = {int(v) for n, i in data.point_index.items() if n.startswith(prefix)
               for v in self._vertices_of_point(i)}
        path = [start]
        while path[-1] != end:
            step = [v for v in graph[path[-1]] if v not in path and (v in own or (v == end and len(path) > 2))]
            path.append(step[0])
        return path

    def _vertices_of_point(self, i):
        weights = self.face.deformer.weights.tocsc()[:, [i]].toarray().reshape(-1)
        return np.flatnonzero(weights > 0.999)

    def _chain(self, cage_path):
        """Return the fine vertices along a polyline of cage edges: the midpoints that subdivision put between."""
        chain = [int(v) for v in cage_path]
        for sub in self.face._subdivisions[: self.detail]:
            matrix = sub.matrix.tocsr()
            n = matrix.shape[1]
            middle = {}
            for r in range(n, matrix.shape[0]):
                cols = matrix.indices[matrix.indptr[r]: matrix.indptr[r + 1]]
                vals = matrix.data[matrix.indptr[r]: matrix.indptr[r + 1]]
                ends = cols[vals > 0.3]
                middle[frozenset(ends.tolist())] = r
            out = [chain[0]]
            for a, b in pairwise(chain):
                out += [middle[frozenset((a, b))], b]
            chain = out
        return np.array(chain)

    @cached_property
    def neutral_opening(self) -> list[float]:
        return self.lid_opening(self.mesh.vertices)

    def lid_opening(self, vertices) -> list[float]:
        """Return for each eye the largest distance between facing margins, mm."""
        return [float(np.linalg.norm(vertices[u] - vertices[low], axis=1).max()) for u, low in self.margins]

    def lip_gap(self, vertices) -> float:
        """Return the largest distance between the lips' seams, mm."""
        return float(np.linalg.norm(vertices[self.seam[0]] - vertices[self.seam[1]], axis=1).max())

    def lip_opening(self, vertices) -> float:
        """Return how far the upper seam stands above the lower one, mm: lips that slide past each other are shut."""
        up, low = vertices[self.seam[0]], vertices[self.seam[1]]
        order = np.argsort(low[:, 0])
        return float((up[:, 1] - np.interp(up[:, 0], low[order, 0], low[order, 1])).max())

    def shows_through(self, vertices, parts, rings, *, turn=0.0, tolerance=0.35) -> int:
        """Count vertices of parts that the skin should hide and does not, seen from the front turned by degrees.

        A vertex in front of all skin along the line of sight must lie inside one of the openings ``rings``.
        """
        c, s = np.cos(np.radians(turn)), np.sin(np.radians(turn))
        v = vertices @ np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]).T
        mesh = self.mesh
        skin = mesh.faces[mesh.face_parts == mesh.parts.index("skin")]
        count = 0
        for part in parts:
            p = v[mesh.part_vertices(part)]
            lo, hi = p[:, :2].min(0) - 1, p[:, :2].max(0) + 1
            tri = v[skin]
            beside = ((tri[..., :2].max(1) > lo) & (tri[..., :2].min(1) < hi)).all(1)
            near = beside & (tri[..., 2].max(1) > p[:, 2].min())
            depth = _depth_at(p[:, :2], tri[near])
            seen = p[:, 2] > depth + 0.02
            inside = np.zeros(len(p), bool)
            for ring in rings:
                inside |= _in_polygon(p[:, :2], v[ring][:, :2], tolerance)
            count += int((seen & ~inside).sum())
        return count

    @cached_property
    def eye_rings(self):
        return [np.concatenate([u, low[::-1][1:-1]]) for u, low in self.margins]

    @cached_property
    def mouth_ring(self):
        return np.concatenate([self.seam[0], self.seam[1][::-1][1:-1]])


def _depth_at(points, triangles):
    """Return the greatest z of triangles over each 2D point (-inf where there is none)."""
    a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
    d = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (c[:, 0] - a[:, 0]) * (b[:, 1] - a[:, 1])
    keep = np.abs(d) > 1e-12
    a, b, c, d = a[keep], b[keep], c[keep], d[keep]
    px, py = points[:, 0, None], points[:, 1, None]
    u = ((px - a[:, 0]) * (c[:, 1] - a[:, 1]) - (c[:, 0] - a[:, 0]) * (py - a[:, 1])) / d
    w = ((b[:, 0] - a[:, 0]) * (py - a[:, 1]) - (px - a[:, 0]) * (b[:, 1] - a[:, 1])) / d
    inside = (u >= 0) & (w >= 0) & (u + w <= 1)
    z = a[:, 2] + u * (b[:, 2] - a[:, 2]) + w * (c[:, 2] - a[:, 2])
    return np.where(inside, z, -np.inf).max(axis=1, initial=-np.inf)


def _in_polygon(points, ring, tolerance):
    """Return which 2D points lie inside a closed polygon or within ``tolerance`` of its edge."""
    a, b = ring, np.roll(ring, -1, axis=0)
    x, y = points[:, 0, None], points[:, 1, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        crossing = (b[:, 0] - a[:, 0]) * (y - a[:, 1]) / (b[:, 1] - a[:, 1]) + a[:, 0]
        hit = ((a[:, 1] > y) != (b[:, 1] > y)) & (x < crossing)
    e = b - a
    t = np.clip(((x - a[:, 0]) * e[:, 0] + (y - a[:, 1]) * e[:, 1]) / np.maximum((e**2).sum(1), 1e-12), 0, 1)
    distance = np.hypot(x - a[:, 0] - t * e[:, 0], y - a[:, 1] - t * e[:, 1]).min(axis=1)
    return (hit.sum(axis=1) % 2 == 1) | (distance < tolerance)

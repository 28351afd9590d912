"""Connected components of a triangle list, with what is asked of each, computed for all at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Components:
    """``count`` components, numbered by their first triangle.

    ``vertices`` (n, 3), ``faces`` (m, 3); ``of_face`` (m,) and ``of_vertex`` (n,): component numbers, -1 for a vertex
    without triangles. ``names`` and ``name_share`` (count, len(names)): which share of a component bears a name.
    """

    vertices: Array
    faces: NDArray[np.int64]
    count: int
    of_face: NDArray[np.int64]
    of_vertex: NDArray[np.int64]
    names: tuple[str, ...]
    name_share: Array

    @classmethod
    def of(cls, vertices: Array, faces: NDArray[np.int64], labels: NDArray, names: Sequence[str] | None) -> Components:
        """Return the components for labels (n,) of the vertices and names of the triangles."""
        raw = labels[faces[:, 0]]
        _, first, inverse = np.unique(raw, return_index=True, return_inverse=True)
        rank = np.empty(len(first), np.int64)
        rank[np.argsort(first)] = np.arange(len(first))
        of_face = rank[inverse.reshape(-1)]
        of_vertex = np.full(len(vertices), -1, np.int64)
        of_vertex[faces.ravel()] = np.repeat(of_face, 3)
        codes: dict[str, int] = {}
        of_name = np.array([codes.setdefault(str(name), len(codes)) for name in names], np.int64) \
            if names is not None else np.zeros(len(faces), np.int64)
        known = tuple(codes) or ("",)
        count = len(first)
        share = np.bincount(of_face * len(known) + of_name, minlength=count * len(known)).reshape(count, -1)
        return cls(vertices, faces, count, of_face, of_vertex, known, share / share.sum(axis=1, keepdims=True))

    def name(self, c: int) -> str:
        """Return the name that most of a component bears; one word where part and material agree."""
        return "|".join(dict.fromkeys(self.names[int(self.name_share[c].argmax())].split("|")))

    @cached_property
    def _face_rows(self) -> list[NDArray[np.int64]]:
        return np.split(np.argsort(self.of_face, kind="stable"),
                        np.cumsum(np.bincount(self.of_face, minlength=self.count))[:-1])

    @cached_property
    def _vertex_rows(self) -> list[NDArray[np.int64]]:
        used = np.flatnonzero(self.of_vertex >= 0)
        own = self.of_vertex[used]
        return np.split(used[np.argsort(own, kind="stable")],
                        np.cumsum(np.bincount(own, minlength=self.count))[:-1])

    def faces_of(self, c: int) -> NDArray[np.int64]:
        """Return the rows of a component's triangles."""
        return self._face_rows[c]

    def vertices_of(self, c: int) -> NDArray[np.int64]:
        """Return a component's vertices, sorted."""
        return self._vertex_rows[c]

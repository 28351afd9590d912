"""What the skin of half a head is made of, before it is covered with triangles: loops round its features, the middle
line, the edges of colours, and free points between them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from chart import Chart
from clay import Clay
from cover import cover, directions, inside, scatter, walk
from numpy.typing import NDArray

# Steps of an edge that are longer than so many spacings are gaps in it.
_GAP = 1.7
# Places nearer than this are one.
_SAME = 1e-6
# Farther than the skin is from the middle of any neck.
_NECK = 6.0


def neck_loop(clay: Clay, at: NDArray, normal: NDArray, count: int) -> NDArray:
    """Return half of the neck's edge (count, 3), from the throat to the nape: where a plane through a place (3,) on
    x = 0 cuts the clay. normal (3,): the plane's, down the neck."""
    back = np.cross([1.0, 0, 0], normal / np.linalg.norm(normal))
    turn = np.linspace(0, np.pi, count)
    row = clay.shoot(at, np.sin(turn)[:, None] * np.array([1.0, 0, 0]) - np.cos(turn)[:, None] * back, _NECK)
    row[[0, -1], 0] = 0.0
    return row


class Plan:
    """The loops, lines and points of the half x >= 0.

    spacing: returns the length of edges at points (n, 3). loops: name -> places (k, 3) in order; a loop that crosses
    the middle is its half, from one place on x = 0 to the other.
    """

    def __init__(self, clay: Clay, chart: Chart, reach: float, spacing: Callable[[NDArray], NDArray],
                 loops: dict[str, NDArray]) -> None:
        self.clay, self.chart, self.reach, self.spacing = clay, chart, reach, spacing
        self.fixed = np.concatenate(list(loops.values()))
        ends = np.cumsum([0] + [len(x) for x in loops.values()])
        self.rows = {name: np.arange(a, b) for name, a, b in zip(loops, ends[:-1], ends[1:], strict=True)}
        self.lines: list[tuple[int, int]] = []

    def outside(self, points: NDArray) -> NDArray[np.bool_]:
        """Return which points (n, 3) lie in none of the loops."""
        d = self.chart.directions(points)
        out = np.ones(len(points), bool)
        for row in self.rows.values():
            loop = self.chart.directions(self.fixed[row])
            if np.abs(self.fixed[row[0], 0]) < 1e-9:
                loop = np.concatenate([loop, loop[::-1] * (-1, 1, 1)])
            out &= ~inside(loop, d)
        return out

    def add_points(self, points: NDArray) -> None:
        """Add places (n, 3) on the clay that must be vertices."""
        self.fixed = np.concatenate([self.fixed, points])

    def add_middle(self, start: float, stop: float) -> None:
        """Add points along x = 0 between two angles in degrees, from the front upwards."""
        turn = np.radians(np.linspace(start, stop, 1500))
        line = self.chart.shoot(self.clay, np.stack([0 * turn, np.sin(turn), np.cos(turn)], axis=1), self.reach)
        line[:, 0] = 0.0
        self.add_points(walk(line[self.outside(line)], self.spacing, self.fixed))

    def add_edge(self, line: NDArray) -> None:
        """Add points of a dense line (n, 3) on the clay and wish for edges between them.

        A line that ends at a vertex is joined to it.
        """
        ends = [np.flatnonzero(np.linalg.norm(self.fixed - place, axis=1) < _SAME) for place in line[[0, -1]]]
        line = line[self.outside(line)]
        line = line[line[:, 0] > 0.5 * self.spacing(line)]
        edge = walk(line, self.spacing, self.fixed)
        first = len(self.fixed)
        near = np.linalg.norm(np.diff(edge, axis=0), axis=1) < _GAP * self.spacing(edge[:-1])
        self.lines += [(first + i, first + i + 1) for i in np.flatnonzero(near)]
        for end, row in zip(ends, (first, first + len(edge) - 1), strict=True):
            self.lines += [(row, int(i)) for i in end]
        self.add_points(edge)

    def covered(self, candidates: int) -> tuple[NDArray, NDArray]:
        """Return (vertices, faces), the loops' vertices first; free points are chosen from so many candidates."""
        d = directions(candidates)
        free = self.chart.shoot(self.clay, d[d[:, 0] > 0], self.reach)
        free = scatter(free[self.outside(free)], self.spacing, self.fixed)
        return cover(self.clay, self.chart, self.fixed, free, list(self.rows.values()), self.lines)

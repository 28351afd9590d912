"""Cover a model with triangles: loops and lines stay where they are put, free points spread out between them.

The points, seen from inside by a chart, are triangulated on the sphere (their convex hull is the Delaunay
triangulation), then edges are flipped until the triangles are Delaunay on the surface itself, and free points are
moved to the middle of their neighbours. One half is covered; the other mirrors it.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Sequence

import numpy as np
from chart import Chart
from clay import Clay, mirrored
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, cKDTree

# Free points keep this share of the local spacing away from loops and lines, or slivers appear.
_CLEAR = 0.72
_ROUNDS = 12
# Edges are flipped only where both triangles lie about in one plane: a flip over a ridge would cut it off.
_FLAT = 0.5


def inside(loop: NDArray, directions: NDArray) -> NDArray[np.bool_]:
    """Return which directions (n, 3) pass through a loop of directions (k, 3): even-odd rule, seen from the middle."""
    axis = loop.mean(axis=0)
    axis /= np.linalg.norm(axis)
    u = np.cross(axis, [0.3, 1.0, 0.2])
    u /= np.linalg.norm(u)
    frame = np.stack([u, np.cross(axis, u)], axis=1)
    ahead = directions @ axis
    polygon = (loop @ frame) / (loop @ axis)[:, None]
    flat = (directions @ frame) / np.where(ahead > 0.05, ahead, 1.0)[:, None]
    return (ahead > 0.05) & in_polygon(polygon, flat)


def in_polygon(polygon: NDArray, points: NDArray) -> NDArray[np.bool_]:
    """Return which points (n, 2) lie inside a closed polygon (k, 2)."""
    odd = np.zeros(len(points), bool)
    for (ax, ay), (bx, by) in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        crosses = (ay > points[:, 1]) != (by > points[:, 1])
        with np.errstate(divide="ignore", invalid="ignore"):
            odd ^= crosses & (points[:, 0] < (bx - ax) * (points[:, 1] - ay) / (by - ay) + ax)
    return odd


def walk(points: NDArray, spacing: Callable[[NDArray], NDArray], taken: NDArray) -> NDArray:
    """Return the points of a dense line that are about one spacing apart and clear of the taken ones."""
    h = spacing(points)
    free = cKDTree(taken).query(points)[0] > _CLEAR * h
    chosen: list[int] = []
    for i in np.flatnonzero(free):
        if not chosen or min(np.linalg.norm(points[i] - points[chosen], axis=1)) >= h[i]:
            chosen.append(i)
    return points[chosen]


def scatter(candidates: NDArray, spacing: Callable[[NDArray], NDArray], taken: NDArray) -> NDArray:
    """Return candidates thinned by dart throwing (in their order) to the spacing, clear of the taken points."""
    h = spacing(candidates)
    alive = cKDTree(taken).query(candidates)[0] > _CLEAR * h
    alive &= candidates[:, 0] > 0.5 * h  # clear of the middle, where the mirrored half begins
    tree = cKDTree(candidates)
    chosen = []
    for i in range(len(candidates)):
        if alive[i]:
            chosen.append(i)
            alive[tree.query_ball_point(candidates[i], h[i])] = False
    return candidates[chosen]


def directions(count: int) -> NDArray:
    """Return directions (count, 3) spread evenly, in an order that fills the sphere evenly from the start."""
    i = np.arange(count)
    z = 1 - (2 * i + 1) / count
    turn = np.pi * (1 + 5**0.5) * i
    r = np.sqrt(1 - z * z)
    spread = np.random.default_rng(4).permutation(count)
    return np.stack([r * np.cos(turn), r * np.sin(turn), z], axis=1)[spread]


def cover(
    clay: Clay,
    chart: Chart,
    fixed: NDArray,
    free: NDArray,
    holes: Sequence[NDArray],
    lines: Sequence[tuple[int, int]],
) -> tuple[NDArray, NDArray]:
    """Return (vertices (n, 3), faces (m, 3)) of the half x >= 0: ``fixed`` points first, then the ``free`` ones, moved.

    holes: loops, each the rows of ``fixed`` on it in order (if it crosses the middle, its half). lines: edges between
    fixed points that are wished for, as far as they cross nothing.
    """
    points = np.concatenate([fixed, free])
    right = np.flatnonzero(points[:, 0] > 0)
    all_points = np.concatenate([points, mirrored(points[right])])
    d = chart.directions(all_points)
    edges = set(_middle_edges(d[: len(fixed)], holes))
    for hole in holes:
        ahead = hole[1:] if (points[hole, 0] <= 0).any() else np.roll(hole, -1)
        edges |= {frozenset((int(a), int(b))) for a, b in zip(hole, ahead, strict=False)}
    faces = recover(d, _outward(ConvexHull(d).simplices, d), edges)
    wished = {frozenset(e) for e in lines}
    faces = recover(d, faces, wished, required=False)
    edges |= wished
    middles = d[faces].mean(axis=1)
    on_right = (faces < len(points)).all(axis=1)
    astride = (middles[:, 0] > 1e-9) & ~on_right
    twin = np.full(len(points), -1)
    twin[right] = np.arange(len(right)) + len(points)
    dropped = np.zeros(len(faces), bool)
    for hole in holes:
        loop = (
            np.concatenate([hole, [twin[i] if twin[i] >= 0 else i for i in hole[::-1]]])
            if (points[hole, 0] <= 0).any()
            else hole
        )
        dropped |= np.isin(faces, loop).all(axis=1) & inside(d[loop], middles)
    if (astride & ~dropped).any():
        raise ValueError(f"triangles astride the middle near {all_points[faces[astride & ~dropped][0]].round(2)}")
    faces = faces[on_right & ~dropped]
    for round_number in range(_ROUNDS):
        faces = flip(points, faces, edges)
        points = _relax(clay, points, faces, len(fixed), last=round_number == _ROUNDS - 1)
    return points, flip(points, faces, edges)


def _middle_edges(points: NDArray, holes: Sequence[NDArray]) -> list[frozenset]:
    """Return the edges of the line x = 0, over all fixed points on it, without those that span a hole."""
    rows = np.flatnonzero(np.abs(points[:, 0]) < 1e-9)
    rows = rows[np.argsort(np.arctan2(points[rows, 1], points[rows, 2]))]
    hole_of = {int(i): n for n, hole in enumerate(holes) for i in hole}
    return [
        frozenset((int(a), int(b)))
        for a, b in zip(rows, np.roll(rows, -1), strict=True)
        if hole_of.get(int(a), -1) != hole_of.get(int(b), -2)
    ]


def recover(d: NDArray, faces: NDArray, edges: set[frozenset], *, required: bool = True) -> NDArray:
    """Return the triangles on directions (n, 3) after flips that bring back edges which other triangles cut.

    required: ValueError for an edge that cannot be made. After S. W. Sloan,
    "A fast algorithm for generating constrained Delaunay triangulations", 1993.
    """
    faces = [tuple(int(i) for i in f) for f in faces]
    beside = _beside(faces)

    def side(a: int, b: int, p: int) -> float:
        return float(np.cross(d[a], d[b]) @ d[p])

    def cutting(a: int, b: int) -> list[frozenset]:
        """Return the edges that cross the one from a to b."""
        inner = [e for e, sides in beside.items() if len(sides) == 2]
        p, q = np.array([tuple(e) for e in inner]).T
        across = np.cross(d[a], d[b])
        likely = ((d[p] @ across) * (d[q] @ across) < 0) & (d[p] @ d[a] > 0.5) & ~np.isin((p, q), (a, b)).any(axis=0)
        return [e for e in (inner[i] for i in np.flatnonzero(likely)) if side(*e, a) * side(*e, b) < 0]

    for a, b in (sorted(e) for e in edges if not beside.get(e)):
        for _ in range(200):
            crossing = cutting(a, b)
            if not crossing:
                break
            for edge in crossing:
                p, q = edge
                first, second = beside[edge]
                c, e = (next(i for i in faces[n] if i not in edge) for n in (first, second))
                if side(c, e, p) * side(c, e, q) < 0:  # convex: the other diagonal lies inside
                    _swap(faces, beside, edge)
                    break
        if required and not beside.get(frozenset((a, b))):
            raise ValueError(
                f"the edge {a}-{b} of a loop cannot be made: another point lies on it, or it crosses another"
            )
    return np.array(faces)


def _beside(faces: list[tuple[int, ...]]) -> dict[frozenset, set[int]]:
    """Return edge -> numbers of its triangles."""
    beside: dict[frozenset, set[int]] = defaultdict(set)
    for number, f in enumerate(faces):
        for i in range(3):
            beside[frozenset((f[i], f[i - 1]))].add(number)
    return beside


def _swap(faces: list[tuple[int, ...]], beside: dict[frozenset, set[int]], edge: frozenset) -> None:
    """Put the other diagonal into the two triangles beside an edge."""
    first, second = beside[edge]
    c, a, b = _from_apex(faces[first], edge)
    d = _from_apex(faces[second], edge)[0]
    for number in (first, second):
        g = faces[number]
        for i in range(3):
            beside[frozenset((g[i], g[i - 1]))].discard(number)
    faces[first], faces[second] = (c, a, d), (c, d, b)
    for number in (first, second):
        g = faces[number]
        for i in range(3):
            beside[frozenset((g[i], g[i - 1]))].add(number)


def _from_apex(face: tuple[int, ...], edge: frozenset) -> tuple[int, int, int]:
    """Return a triangle's corners beginning with the one off the edge."""
    at = next(i for i in range(3) if face[i] not in edge)
    return face[at], face[(at + 1) % 3], face[(at + 2) % 3]


def _outward(faces: NDArray, d: NDArray) -> NDArray:
    a, b, c = (d[faces[:, i]] for i in range(3))
    wrong = np.einsum("ij,ij->i", np.cross(b - a, c - a), a + b + c) < 0
    return np.where(wrong[:, None], faces[:, ::-1], faces)


def _relax(clay: Clay, points: NDArray, faces: NDArray, fixed: int, *, last: bool) -> NDArray:
    """Return the points with the free ones half way towards the middle of their triangles, weighted by area."""
    a, b, c = (points[faces[:, i]] for i in range(3))
    # The root of the area lets small triangles stay small: the spacing is meant to vary.
    weight = np.sqrt(np.linalg.norm(np.cross(b - a, c - a), axis=1))
    total, amount = np.zeros_like(points), np.zeros(len(points))
    for corner in range(3):
        np.add.at(total, faces[:, corner], weight[:, None] * (a + b + c) / 3)
        np.add.at(amount, faces[:, corner], weight)
    moved = points.copy()
    free = slice(fixed, None)
    moved[free] += 0.5 * (total[free] / amount[free, None] - points[free])
    moved[free] = clay.onto(moved[free], steps=8 if last else 2)
    return moved


def flip(points: NDArray, faces: NDArray, keep: set[frozenset]) -> NDArray:
    """Return the faces after edge flips: the angles opposite to an edge add up to 180 degrees at most."""
    faces = [tuple(int(i) for i in f) for f in faces]
    beside = _beside(faces)
    queue = list(beside)
    budget = 20 * len(queue)
    while queue and budget:
        budget -= 1
        edge = queue.pop()
        if edge in keep or len(beside[edge]) != 2:
            continue
        first, second = beside[edge]
        c, a, b = _from_apex(faces[first], edge)
        d = _from_apex(faces[second], edge)[0]
        if beside.get(frozenset((c, d))) or not _wants_flip(points, a, b, c, d):
            continue
        _swap(faces, beside, edge)
        queue += [frozenset(e) for e in ((a, c), (c, b), (a, d), (d, b))]
    return np.array(faces)


def _wants_flip(points: NDArray, a: int, b: int, c: int, d: int) -> bool:
    pa, pb, pc, pd = points[a], points[b], points[c], points[d]
    if _angle(pa - pc, pb - pc) + _angle(pa - pd, pb - pd) <= np.pi + 1e-6:
        return False
    old = [np.cross(pa - pc, pb - pc), np.cross(pb - pd, pa - pd)]
    new = [np.cross(pa - pc, pd - pc), np.cross(pd - pc, pb - pc)]
    mean = sum(n / max(np.linalg.norm(n), 1e-12) for n in old)
    mean /= max(np.linalg.norm(mean), 1e-12)
    return all(n @ mean > _FLAT * np.linalg.norm(n) > 0 for n in new)


def _angle(u: NDArray, v: NDArray) -> float:
    return float(np.arctan2(np.linalg.norm(np.cross(u, v)), u @ v))

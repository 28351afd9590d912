from collections import defaultdict

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import Delaunay

from facegen.geometry.subdivision import identity, loop_levels, loop_once

OCTAHEDRON = (np.array([[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], float),
              np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4],
                        [1, 0, 5], [2, 1, 5], [3, 2, 5], [0, 3, 5]]))
EQUATOR = [[0, 1], [1, 2], [2, 3], [3, 0]]
NOTHING = np.empty((0, 2), int)


def edges_of(faces):
    return {tuple(sorted(e)) for a, b, c in np.asarray(faces).tolist() for e in ((a, b), (b, c), (c, a))}


@st.composite
def sheets(draw):
    """A flat triangulation, perhaps with holes and loose vertices, some sharp edges and some corners."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    points = rng.uniform(0, 10, (draw(st.integers(4, 14)), 2))
    faces = Delaunay(points).simplices.astype(np.int32)
    u, v = points[faces[:, 1]] - points[faces[:, 0]], points[faces[:, 2]] - points[faces[:, 0]]
    clockwise = u[:, 0] * v[:, 1] < u[:, 1] * v[:, 0]
    faces[clockwise] = faces[clockwise][:, ::-1]
    keep = rng.random(len(faces)) >= draw(st.sampled_from([0.0, 0.3]))
    faces = faces[keep] if keep.any() else faces
    edges = np.array(sorted(edges_of(faces)))
    creases = edges[rng.random(len(edges)) < draw(st.sampled_from([0.0, 0.2, 0.6]))]
    corners = np.flatnonzero(rng.random(len(points)) < draw(st.sampled_from([0.0, 0.2])))
    flipped = rng.random(len(creases)) < 0.5
    creases[flipped] = creases[flipped][:, ::-1]
    return np.column_stack([points, np.zeros(len(points))]), faces, creases, corners


def by_hand(n, faces, creases, corners):
    """Return {vertex: weight} of each old vertex, and by edge of each new one: Loop's rule one at a time."""
    faces, creases = np.asarray(faces).tolist(), {frozenset(map(int, e)) for e in creases}
    third, neighbours, sharp_neighbours = defaultdict(list), defaultdict(set), defaultdict(set)
    for a, b, c in faces:
        for p, q, r in ((a, b, c), (b, c, a), (c, a, b)):
            third[frozenset((p, q))].append(r)
            neighbours[p] |= {q, r}
    edges = {}
    for edge, opposite in third.items():
        p, q = edge
        if edge in creases or len(opposite) != 2:
            edges[edge] = {p: 0.5, q: 0.5}
            sharp_neighbours[p].add(q)
            sharp_neighbours[q].add(p)
        else:
            edges[edge] = {p: 0.375, q: 0.375, opposite[0]: 0.125, opposite[1]: 0.125}
    olds = []
    for v in range(n):
        around, sharp = neighbours[v], sharp_neighbours[v]
        if v in set(corners) or len(sharp) > 2 or not around:
            olds.append({v: 1.0})
        elif len(sharp) == 2:
            olds.append({v: 0.75, **dict.fromkeys(sharp, 0.125)})
        else:
            k = len(around)
            beta = (5 / 8 - (3 / 8 + np.cos(2 * np.pi / k) / 4) ** 2) / k
            olds.append({v: 1.0 - k * beta, **dict.fromkeys(around, beta)})
    return olds, edges


def row(weights, n):
    return np.array([weights.get(v, 0.0) for v in range(n)])


def new_vertices(faces, sub):
    """Return {edge: fine vertex}, checking that each triangle became the four it should, turned as it was."""
    found = {}
    for f, corners in enumerate(np.asarray(faces).tolist()):
        four = {tuple(np.roll(t, -int(np.argmin(t)))) for t in sub.faces[sub.parent_face == f].tolist()}
        assert len(four) == 4
        middle = []
        for i, a in enumerate(corners):
            (own,) = (t for t in four if t[0] == a)             # old indices are the lowest
            for edge, vertex in ((frozenset((a, corners[(i + 1) % 3])), own[1]),
                                 (frozenset((a, corners[(i + 2) % 3])), own[2])):
                assert found.setdefault(edge, vertex) == vertex
            middle.append(own[1])
        assert tuple(np.roll(middle, -int(np.argmin(middle)))) in four
    assert len(set(found.values())) == len(found)
    return found


@settings(deadline=None, max_examples=80)
@given(sheets())
def test_agrees_with_the_rule_by_hand(sheet):
    points, faces, creases, corners = sheet
    n = len(points)
    sub = loop_once(n, faces, creases, corners=corners)
    olds, edges = by_hand(n, faces, creases, corners)
    matrix = sub.matrix.toarray()
    assert matrix.shape == (n + len(edges), n)
    np.testing.assert_allclose(matrix[:n], [row(w, n) for w in olds], atol=1e-14)
    new = new_vertices(faces, sub)
    assert new.keys() == edges.keys()
    for edge, weights in edges.items():
        np.testing.assert_allclose(matrix[new[edge]], row(weights, n), atol=1e-14)
    halves = {frozenset((v, new[e])) for e in map(frozenset, creases.tolist()) for v in e
              if sum(set(e) <= set(f) for f in faces.tolist()) == 2}
    assert {frozenset(e) for e in sub.creases.tolist()} == halves


@settings(deadline=None, max_examples=30)
@given(sheets(), st.integers(0, 3))
def test_rows_sum_to_one_and_are_convex(sheet, level):
    points, faces, creases, corners = sheet
    sub = loop_levels(len(points), faces, creases, level, corners=corners)[-1]
    np.testing.assert_allclose(sub.matrix.sum(axis=1), 1.0, atol=1e-13)
    assert sub.matrix.toarray().min() >= 0.0
    assert len(sub.faces) == len(sub.parent_face) == 4**level * len(faces)


@settings(deadline=None, max_examples=20)
@given(sheets(), st.integers(0, 2**32 - 1))
def test_affine_maps_may_be_applied_before_or_after(sheet, seed):
    points, faces, creases, corners = sheet
    rng = np.random.default_rng(seed)
    points = points + rng.normal(0, 1, points.shape)
    a, t = rng.normal(0, 1, (3, 3)), rng.normal(0, 10, 3)
    s = loop_levels(len(points), faces, creases, 2, corners=corners)[2].matrix
    np.testing.assert_allclose(s @ (points @ a + t), (s @ points) @ a + t, atol=1e-11)


@settings(deadline=None, max_examples=20)
@given(sheets())
def test_a_flat_mesh_stays_in_its_plane(sheet):
    points, faces, creases, corners = sheet
    points = points + np.array([0.3, -0.7, 1.0]) * (2.0 - points[:, :1] + 3.0 * points[:, 1:2])
    normal = np.cross(*np.linalg.svd(points - points.mean(axis=0))[2][:2])
    level = normal @ points[0]
    fine = loop_levels(len(points), faces, creases, 3, corners=corners)[3].matrix @ points
    np.testing.assert_allclose(fine @ normal, level, atol=1e-11)


@settings(deadline=None, max_examples=20)
@given(sheets(), st.integers(1, 3))
def test_fine_triangles_lie_on_their_parent_turned_as_it_is(sheet, level):
    points, faces, creases, corners = sheet
    sub = loop_levels(len(points), faces, creases, level, corners=corners)[level]
    fine, coarse = points, faces                       # split without smoothing: new vertices amid edges
    for _ in range(level):
        once = loop_once(len(fine), coarse, NOTHING)
        new = new_vertices(coarse, once)
        fine = np.concatenate([fine, np.empty((len(new), 3))])
        for edge, v in new.items():
            fine[v] = fine[list(edge)].mean(axis=0)
        coarse = once.faces
    np.testing.assert_array_equal(coarse, sub.faces)

    def area(a, b, c):
        u, v = b - a, c - a
        return u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]

    a, b, c = (points[faces[sub.parent_face, i]] for i in range(3))
    whole = area(a, b, c)
    np.testing.assert_allclose(area(*(fine[sub.faces[:, i]] for i in range(3))), whole / 4**level, atol=1e-9)
    at = fine[sub.faces].mean(axis=1)
    for p, q in ((a, b), (b, c), (c, a)):              # inside: on the left of every side
        assert (area(p, q, at) / whole > 0.3 / 2**level).all()
    assert np.bincount(sub.parent_face).tolist() == [4**level] * len(faces)


def test_the_regular_lattice_stays_put_inside():
    k = 7
    i, j = (g.reshape(-1) for g in np.meshgrid(np.arange(k), np.arange(k), indexing="ij"))
    points = np.column_stack([i + j / 2, j * np.sqrt(3) / 2, np.zeros(k * k)])
    at = (i * k + j).reshape(k, k)
    faces = np.concatenate([np.stack([at[:-1, :-1], at[1:, :-1], at[:-1, 1:]], -1).reshape(-1, 3),
                            np.stack([at[1:, :-1], at[1:, 1:], at[:-1, 1:]], -1).reshape(-1, 3)])
    sub = loop_once(k * k, faces, NOTHING)
    fine = sub.matrix @ points
    inner = at[1:-1, 1:-1].reshape(-1)
    np.testing.assert_allclose(fine[inner], points[inner], atol=1e-12)
    for edge, v in new_vertices(faces, sub).items():
        if set(edge) & set(inner.tolist()):
            np.testing.assert_allclose(fine[v], points[list(edge)].mean(axis=0), atol=1e-12)


def test_a_closed_mesh_stays_closed_and_keeps_its_symmetry():
    points, faces = OCTAHEDRON
    for level, sub in enumerate(loop_levels(6, faces, NOTHING, 3)):
        assert len(sub.faces) == 8 * 4**level
        directed = sub.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2).tolist()
        assert len(set(map(tuple, directed))) == len(directed)            # neighbours are turned alike,
        assert {(b, a) for a, b in directed} == set(map(tuple, directed))  # and nothing is open
        assert sub.matrix.shape[0] - len(edges_of(sub.faces)) + len(sub.faces) == 2
        fine = sub.matrix @ points
        a, b, c = (fine[sub.faces[:, i]] for i in range(3))
        assert (np.einsum("ni,ni->n", np.cross(b - a, c - a), a + b + c) > 0).all()
        np.testing.assert_allclose(fine.sum(axis=0), 0.0, atol=1e-12)
        np.testing.assert_allclose(np.linalg.norm(fine[:6], axis=1), np.linalg.norm(fine[0]))


def test_a_sharp_curve_depends_on_itself_alone():
    points, faces = OCTAHEDRON
    smooth, sharp = (loop_levels(6, faces, creases, 3) for creases in (NOTHING, EQUATOR))
    for level in (1, 2, 3):
        sub = sharp[level]
        on_curve = np.unique(sub.creases)
        assert len(sub.creases) == len(on_curve) == 4 * 2**level
        assert edges_of(sub.faces) >= {tuple(sorted(e)) for e in sub.creases.tolist()}
        assert sub.matrix[on_curve][:, [4, 5]].max() == 0
        assert smooth[level].matrix[on_curve][:, [4, 5]].max() > 0.01
        rest = np.setdiff1d(np.arange(sub.matrix.shape[0]), on_curve)
        assert (sub.matrix[rest][:, [4, 5]].max(axis=1).toarray() > 0).all()
    # A cubic B-spline: its vertex nears 2/3 of itself and 1/6 of each neighbour by a factor 4 a level.
    np.testing.assert_allclose((sharp[3].matrix @ points)[0], [2 / 3 + 1 / 3 / 4**3, 0, 0], atol=1e-12)


def test_a_border_is_a_sharp_curve():
    points, faces = OCTAHEDRON
    half = faces[:4]                                                       # z >= 0
    sub = loop_levels(6, half, NOTHING, 2)[2]
    fine = sub.matrix @ points
    closed = loop_levels(6, faces, EQUATOR, 2)[2]
    rim = closed.matrix @ points
    rim = rim[np.unique(closed.creases)]
    count = defaultdict(int)
    for e in np.sort(sub.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1).tolist():
        count[tuple(e)] += 1
    border = np.unique([e for e, c in count.items() if c == 1])
    np.testing.assert_allclose(sorted(fine[border].round(9).tolist()), sorted(rim.round(9).tolist()))
    np.testing.assert_array_equal(fine[5], points[5])                      # used by no triangle


def test_corners_and_meeting_creases_stay():
    points, faces = OCTAHEDRON
    levels = loop_levels(6, faces, [*EQUATOR, [0, 4]], 3, corners=[4])
    for sub in levels:
        fine = sub.matrix @ points
        np.testing.assert_array_equal(fine[[0, 4]], points[[0, 4]])        # 3 creases meet at 0; 4 is listed
    assert np.linalg.norm(fine[[1, 5]] - points[[1, 5]], axis=1).min() > 0.1


def test_an_edge_of_three_triangles_is_sharp():
    faces = np.array([[0, 1, 2], [1, 0, 3], [0, 1, 4]])
    sub = loop_once(5, faces, NOTHING)
    new = new_vertices(faces, sub)
    np.testing.assert_array_equal(sub.matrix.toarray()[new[frozenset((0, 1))]], [0.5, 0.5, 0, 0, 0])


@pytest.mark.parametrize("corners", [(), (0, 2)])
def test_two_refinements_as_one(corners):
    points, faces = OCTAHEDRON
    first = loop_once(6, faces, EQUATOR, corners=corners)
    second = loop_once(first.matrix.shape[0], first.faces, first.creases, corners=corners)
    both = first.then(second)
    np.testing.assert_allclose(both.matrix @ points, second.matrix @ (first.matrix @ points), atol=1e-14)
    np.testing.assert_array_equal(both.faces, second.faces)
    np.testing.assert_array_equal(both.creases, second.creases)
    np.testing.assert_array_equal(both.parent_face, np.repeat(np.arange(8), 16))
    third = loop_once(second.matrix.shape[0], second.faces, second.creases, corners=corners)
    left, right = first.then(second).then(third), first.then(second.then(third))
    np.testing.assert_allclose(left.matrix.toarray(), right.matrix.toarray(), atol=1e-14)
    np.testing.assert_array_equal(left.parent_face, right.parent_face)
    levels = loop_levels(6, faces, EQUATOR, 3, corners=corners)
    assert len(levels) == 4
    np.testing.assert_allclose(levels[3].matrix.toarray(), left.matrix.toarray(), atol=1e-14)
    np.testing.assert_array_equal(levels[3].faces, left.faces)


def test_level_zero_is_the_mesh_itself():
    points, faces = OCTAHEDRON
    for sub in (identity(6, faces, NOTHING), loop_levels(6, faces, NOTHING, 0)[0]):
        np.testing.assert_array_equal(sub.matrix @ points, points)
        np.testing.assert_array_equal(sub.faces, faces)
        np.testing.assert_array_equal(sub.parent_face, np.arange(8))

"""Which way round the triangles of a mesh are wound, and which of them disagree with their neighbours.

Two triangles that share an edge look to the same side if they run along it in opposite directions. Followed from edge
to edge this orders a whole patch; only a one-sided surface, such as a Moebius strip, allows no order.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse import csgraph

from facegen.geometry.operators import Surface


@dataclass(frozen=True, eq=False)
class Winding:
    """``patch`` (m,): triangles with one number hang together by edges of exactly two. ``against`` (m,): wound against
    most of their patch, by area. ``one_sided`` (p,): patches that no order fits; nothing of them is against."""

    patch: NDArray[np.int64]
    against: NDArray[np.bool_]
    one_sided: NDArray[np.bool_]


def winding(surface: Surface) -> Winding:
    """Return how the triangles of a surface are wound.

    Every triangle stands twice in a graph, as it is and turned; an edge joins what looks to the same side. A patch
    falls apart into its two sides there, or hangs together if it has but one.
    """
    m = len(surface.faces)
    edges, of_side = surface.edges
    order = np.argsort(of_side, kind="stable")
    first = np.cumsum(np.bincount(of_side, minlength=len(edges)))
    two = np.flatnonzero(np.bincount(of_side, minlength=len(edges)) == 2)
    a, b = order[first[two] - 2], order[first[two] - 1]
    along = (surface.faces < np.roll(surface.faces, -1, axis=1)).ravel()        # side k runs to the higher vertex
    turn = np.where(along[a] == along[b], m, 0)
    a, b = a // 3, b // 3
    rows, columns = np.concatenate([a, a + m]), np.concatenate([b + turn, b + m - turn])
    graph = sparse.coo_array((np.ones(len(rows), np.int8), (rows, columns)), shape=(2 * m, 2 * m))
    _, label = csgraph.connected_components(graph.tocsr(), directed=False)
    label, turned = label[:m], label[m:]
    _, patch = np.unique(np.minimum(label, turned), return_inverse=True)
    patch = patch.reshape(-1).astype(np.int64)
    one_sided = np.zeros(patch.max(initial=-1) + 1, bool)
    one_sided[patch[label == turned]] = True
    minor = label > turned
    area = np.maximum(surface.areas, np.finfo(float).tiny)
    of_minor = np.bincount(patch, area * minor, minlength=len(one_sided))
    of_all = np.bincount(patch, area, minlength=len(one_sided))
    against = minor ^ (of_minor > of_all / 2)[patch]
    return Winding(patch, against & ~one_sided[patch], one_sided)

"""Which triangles lie over a place, against trying all."""

import numpy as np
import pytest

from facegen.geometry.ahead import _over


@pytest.mark.parametrize("largest", [0.1, 1.0, 500.0])
def test_cells_find_the_triangles_over_a_place_that_trying_all_finds(largest):
    rng = np.random.default_rng(7)
    sizes = rng.uniform(0.01, 0.1, (400, 1, 1))
    sizes[0] = largest
    corners = rng.uniform(0, 5, (400, 1, 2)) + sizes * rng.normal(size=(400, 3, 2))
    places = np.concatenate([rng.uniform(-1, 6, (300, 2)), corners[5]])         # some beside all, some on corners
    p, t = _over(places, corners)
    low, high = corners.min(axis=1), corners.max(axis=1)
    slow = ((places[:, None] >= low) & (places[:, None] <= high)).all(axis=2)
    assert sorted(zip(p.tolist(), t.tolist(), strict=True)) == [tuple(pair) for pair in np.argwhere(slow).tolist()]
    assert all(len(rows) == 0 for rows in _over(places + 1e4, corners))

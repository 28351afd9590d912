"""An avatar of any size and axes stands on the stage like the base face."""

import itertools

import numpy as np
import pytest

from facegen.face.face import load_face
from facegen.fileio.avatar import load_avatar
from facegen.studio.placement import AXES, across, axes, box_placement, head_box
from facegen.transfer.rig import avatar_files

STANDING = [pair for pair in itertools.product(AXES, AXES) if across(*pair)]


def vertices(name):
    """An avatar's vertices, standing upright in its file."""
    mesh = load_avatar(avatar_files(name, None)[0]).mesh
    return mesh.vertices[np.unique(mesh.faces)]


def test_there_are_as_many_ways_to_stand_as_a_cube_has_turns():
    turns = {tuple(np.round(axes(*pair)).ravel()) for pair in STANDING}
    assert len(turns) == 24
    for pair in STANDING:
        assert np.linalg.det(axes(*pair)) == pytest.approx(1.0)


@pytest.mark.parametrize("pair", [("z", "-y"), ("y", "-z"), ("-x", "y")])
def test_a_file_in_other_axes_and_units_stands_the_same(pair):
    upright = vertices("cat")
    lying = 0.01 * upright @ axes(*pair)          # axes are orthonormal: this turns back
    assert box_placement(lying, *pair).apply(lying) == pytest.approx(box_placement(upright).apply(upright))


@pytest.mark.parametrize("name", ["cartoon", "cat", "human"])
def test_a_head_gets_the_size_of_the_base_face(name):
    own, base = vertices(name), load_face().mesh(0).vertices
    placed = box_placement(own).apply(own)
    assert np.linalg.norm(np.ptp(placed, axis=0)) / np.linalg.norm(np.ptp(base, axis=0)) == pytest.approx(1.0)
    assert (placed.min(axis=0) + placed.max(axis=0)) / 2 == pytest.approx((base.min(axis=0) + base.max(axis=0)) / 2)


@pytest.mark.parametrize("name", ["cartoon", "cat", "human"])
@pytest.mark.parametrize("arms", [True, False])
def test_a_head_on_a_body_is_found(name, arms):
    """A body six heads high, with arms stretched out or without: the head's box is the head's, by a third of it."""
    head = vertices(name)
    low, high = head.min(axis=0), head.max(axis=0)
    size = (high - low).max()
    rng = np.random.default_rng(1)
    middle = (low + high) / 2 * [1, 0, 1] + low * [0, 1, 0]
    body = [rng.uniform([-0.6, -6.0, -0.3], [0.6, -0.25, 0.3], (2000, 3)),
            rng.uniform([-0.2, -0.3, -0.2], [0.2, 0.05, 0.2], (500, 3))]
    body += [rng.uniform([-3.0, -0.9, -0.15], [3.0, -0.5, 0.15], (2000, 3))] if arms else []
    found = head_box(np.concatenate([head, *(middle + size * part for part in body)]))
    assert np.abs(np.array(found) - [low, high]).max() < size / 3

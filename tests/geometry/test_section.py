"""A head cut in half: what is left, and that the cut is filled."""

from __future__ import annotations

import numpy as np
import pytest

from facegen.face.face import load_face
from facegen.geometry.mesh import Mesh
from facegen.geometry.section import FLESH, _ears, half_of


def ball(turns=12, rings=8, at=(0.0, 0.0, 0.0)):
    """Return a closed ball of radius 10 whose vertices keep off x = 0."""
    phi = np.linspace(0, np.pi, rings + 1)[1:-1]
    theta = 2 * np.pi * (np.arange(turns) + 0.31) / turns
    ring = np.stack([np.outer(np.sin(phi), np.sin(theta)), np.outer(np.cos(phi), np.ones(turns)),
                     np.outer(np.sin(phi), np.cos(theta))], axis=-1).reshape(-1, 3)
    vertices = np.concatenate([ring, [[0.013, 1, 0], [0.013, -1, 0]]]) * 10 + np.array(at)
    faces, top, bottom = [], len(ring), len(ring) + 1
    for k in range(turns):
        n = (k + 1) % turns
        faces += [(top, k, n), (bottom, (rings - 2) * turns + n, (rings - 2) * turns + k)]
        for row in range(rings - 2):
            a, b, c, d = row * turns + k, row * turns + n, (row + 1) * turns + k, (row + 1) * turns + n
            faces += [(a, c, b), (b, c, d)]
    zeros = np.zeros(len(faces), int)
    return Mesh(vertices, np.array(faces), ("tongue",), zeros, ("tongue",), zeros)


def volume(mesh):
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    return float(np.einsum("ni,ni->n", a, np.cross(b, c)).sum() / 6)


def area(mesh, faces):
    a, b, c = (mesh.vertices[faces[:, k]] for k in range(3))
    return np.cross(b - a, c - a) / 2


def test_half_a_ball_is_closed_and_half_as_large():
    whole = ball()
    half = half_of(whole)
    made = half.posed(whole.vertices)
    assert made.vertices[np.unique(half.shell.faces), 0].max() < 1e-9
    mirrored = Mesh(whole.vertices * [-1, 1, 1], whole.faces[:, ::-1], whole.materials, whole.face_materials,
                    whole.parts, whole.face_parts)
    other = half_of(mirrored)
    proud = 0.3 * np.pi * 100 * 2                       # the fills stand a little before the plane
    assert volume(made) + volume(other.posed(mirrored.vertices)) == pytest.approx(volume(whole), abs=proud)
    assert volume(made) > 0.45 * volume(whole)
    fill = made.faces[len(half.shell.faces):]
    facing = area(made, fill)
    assert (facing[:, 0] > 0).all()                     # toward the half that went
    assert facing[:, 0].sum() == pytest.approx(np.pi * 100, rel=0.08)


def test_a_pose_of_the_whole_is_a_pose_of_the_half():
    whole = ball()
    half = half_of(whole)
    moved = whole.vertices * [1, 2, 0.5] + [0, 3, 1]
    made = half.posed(moved)
    straight = half.matrix @ whole.vertices * [1, 2, 0.5] + [0, 3, 1] + half.offset
    assert np.allclose(made.vertices, straight)


def test_what_lies_to_one_side():
    assert len(half_of(ball(at=(30, 0, 0))).shell.faces) == 0
    kept = half_of(ball(at=(-30, 0, 0)))
    assert len(kept.shell.faces) == len(ball().faces)
    assert kept.fills == ()


@pytest.mark.parametrize("pose", ["neutral", "25C+26C", "19E+25D+26D", "18E+22B"])
def test_a_face(pose):
    face = load_face()
    mesh = face.mesh(2)
    half = half_of(mesh)
    made = half.posed(face.pose(pose))
    assert FLESH in made.materials
    assert made.vertices[:, 0].max() <= 0.31
    assert sorted(made.materials[material] for _, material, _ in half.fills) == ["flesh", "tongue"]
    flesh = made.faces[made.face_materials == made.materials.index(FLESH)]
    facing = area(made, flesh)[:, 0]
    assert facing[facing > 0].sum() > 0.98 * np.abs(facing).sum()
    # the side of the head is as large as its outline says: nothing is filled twice or left out
    curve = made.vertices[list(half.fills[-1][0])][:, [2, 1]]
    shoelace = abs(np.sum(curve[:, 0] * np.roll(curve[:, 1], -1) - np.roll(curve[:, 0], -1) * curve[:, 1])) / 2
    assert facing.sum() == pytest.approx(shoelace, rel=1e-6)


@pytest.mark.parametrize("turn", [1, -1])
def test_ears_fill_a_star(turn):
    angle = turn * np.linspace(0, 2 * np.pi, 20, endpoint=False)
    star = np.stack([np.cos(angle), np.sin(angle)], axis=1) * np.where(np.arange(20) % 2, 0.4, 1.0)[:, None]
    made = np.array(_ears(star))
    assert len(made) == 18
    a, b, c = (star[made[:, k]] for k in range(3))
    each = ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]) / 2
    assert (each < 0).all()                             # (z, y) seen from +x turns the other way
    whole = 20 * 0.5 * 0.4 * np.sin(2 * np.pi / 20)
    assert -each.sum() == pytest.approx(whole)


def test_ears_of_a_curve_that_crosses_itself_end():
    bow = np.array([[0.0, 0], [1, 1], [1, 0], [0, 1]])
    assert len(_ears(bow)) == 2

from dataclasses import FrozenInstanceError

import numpy as np
import pytest

from facegen.errors import InputError
from facegen.geometry.mesh import Mesh, merge

SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
TWO = np.array([[0, 1, 2], [0, 2, 3]])


def mesh(**changes):
    values = {"vertices": SQUARE, "faces": TWO, "materials": ("skin", "lips"), "face_materials": [0, 1],
              "parts": ("a", "b"), "face_parts": [1, 0]}
    return Mesh(**{**values, **changes})


def test_arrays_take_their_types_and_lie_row_by_row():
    m = mesh(vertices=np.asfortranarray(SQUARE.astype(np.float32)), faces=TWO.tolist())
    assert (m.vertices.dtype, m.faces.dtype) == (np.float64, np.int32)
    assert (m.face_materials.dtype, m.face_parts.dtype) == (np.int32, np.int32)
    assert m.vertices.flags.c_contiguous
    np.testing.assert_array_equal(m.vertices, SQUARE)


@pytest.mark.parametrize(("changes", "words"), [
    ({"vertices": SQUARE[:, :2]}, r"vertices: expected shape \(n, 3\), got \(4, 2\)"),
    ({"vertices": SQUARE[0]}, r"vertices: expected shape \(n, 3\), got \(3,\)"),
    ({"faces": [[0, 1, 2, 3]], "face_materials": [0], "face_parts": [0]}, "split polygons"),
    ({"faces": [0, 1, 2]}, r"faces: expected shape \(m, 3\), got \(3,\)"),
    ({"faces": [[0, 1, 4], [0, 2, 3]]}, r"faces: indices must lie in 0\.\.3, got 0\.\.4"),
    ({"faces": [[0, 1, -1], [0, 2, 3]]}, r"got -1\.\.3"),
    ({"face_materials": [0]}, r"expected shape \(2,\), one entry a triangle, got \(1,\) and \(2,\)"),
    ({"face_parts": [[0], [1]]}, r"got \(2,\) and \(2, 1\)"),
    ({"face_materials": [0, 2]}, r"face_materials: entries must index materials, 0\.\.1, got 0\.\.2"),
    ({"face_parts": [-1, 0]}, r"face_parts: entries must index parts, 0\.\.1, got -1\.\.0"),
])
def test_what_does_not_fit_is_refused(changes, words):
    with pytest.raises(InputError, match=words):
        mesh(**changes)


def test_a_mesh_of_no_triangles_is_allowed():
    m = Mesh.of(np.empty((0, 3)), [])
    assert m.faces.shape == (0, 3)
    assert m.part_vertices("skin").size == 0


def test_a_mesh_cannot_be_changed():
    m = mesh()
    for name in ("vertices", "faces", "face_materials", "face_parts"):
        with pytest.raises(ValueError, match="read-only"):
            getattr(m, name)[0] = 0
    with pytest.raises(FrozenInstanceError):
        m.parts = ()


def test_the_callers_arrays_stay_the_callers():
    vertices, faces = SQUARE.copy(), TWO.astype(np.int32)
    made = (Mesh.of(vertices, faces), mesh(vertices=vertices, faces=faces), mesh().with_vertices(vertices))
    vertices += 1.0
    faces[0] = 3
    for m in made:
        np.testing.assert_array_equal(m.vertices, SQUARE)
        np.testing.assert_array_equal(m.faces, TWO)


def test_of_gives_one_part_and_one_material():
    m = Mesh.of(SQUARE, TWO, material="teeth", part="teeth_upper")
    assert (m.materials, m.parts) == (("teeth",), ("teeth_upper",))
    assert m.face_materials.tolist() == m.face_parts.tolist() == [0, 0]


def test_with_vertices_changes_positions_only():
    m = mesh()
    moved = m.with_vertices(SQUARE + 1.0)
    np.testing.assert_array_equal(moved.vertices, SQUARE + 1.0)
    np.testing.assert_array_equal(m.vertices, SQUARE)
    for name in ("faces", "materials", "face_materials", "parts", "face_parts"):
        np.testing.assert_array_equal(getattr(moved, name), getattr(m, name))
    with pytest.raises(InputError, match=r"vertices: expected shape \(4, 3\), got \(3, 3\)"):
        m.with_vertices(SQUARE[:3])


def test_part_vertices_are_those_its_triangles_use():
    m = mesh(faces=[[3, 1, 2], [3, 1, 0]])
    assert m.part_vertices("a").tolist() == [0, 1, 3]
    assert m.part_vertices("b").tolist() == [1, 2, 3]
    with pytest.raises(InputError, match="part: expected one of a, b, got 'c'"):
        m.part_vertices("c")


def named(m):
    """Return each triangle as its corners' places, material and part."""
    return [(m.vertices[f].tolist(), m.materials[x], m.parts[p])
            for f, x, p in zip(m.faces, m.face_materials, m.face_parts, strict=True)]


def test_merge_keeps_every_triangle_and_joins_equal_names():
    first = mesh()
    second = mesh(vertices=SQUARE + 5.0, materials=("lips", "hair"), parts=("b", "c"))
    both = merge([first, second])
    assert named(both) == named(first) + named(second)
    assert both.materials == ("skin", "lips", "hair")
    assert both.parts == ("a", "b", "c")
    np.testing.assert_array_equal(both.vertices, np.concatenate([first.vertices, second.vertices]))
    assert both.part_vertices("b").tolist() == [0, 1, 2, 4, 6, 7]


def test_merge_of_one_is_that_one():
    m = mesh()
    alone = merge([m])
    assert named(alone) == named(m)
    assert (alone.materials, alone.parts) == (m.materials, m.parts)


def test_merge_does_not_mind_in_which_steps():
    meshes = [mesh(), Mesh.of(SQUARE * 2.0, TWO, part="c"), mesh(parts=("c", "a"))]
    once, steps = merge(meshes), merge([merge(meshes[:2]), meshes[2]])
    assert named(once) == named(steps)
    assert (once.materials, once.parts) == (steps.materials, steps.parts)

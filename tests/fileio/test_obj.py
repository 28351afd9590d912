import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from facegen.data import meshes_dir
from facegen.errors import FileError
from facegen.fileio.fans import fans
from facegen.fileio.obj import format_obj, load_obj, read_obj
from facegen.geometry.mesh import Mesh

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"


@pytest.fixture
def load(tmp_path):
    """A function that loads an OBJ file of the given text or bytes."""
    def load(content):
        path = tmp_path / "a.obj"
        path.write_bytes(content.encode() if isinstance(content, str) else content)
        return load_obj(path)
    return load


def named(mesh):
    """Return each triangle as its vertices, material and part."""
    return [(f, mesh.materials[m], mesh.parts[p]) for f, m, p in
            zip(mesh.faces.tolist(), mesh.face_materials, mesh.face_parts, strict=True)]


NAMES = st.text("abcXYZ_019.# é口-", min_size=1).map(str.strip).filter(bool)


@st.composite
def meshes(draw):
    n = draw(st.integers(3, 8))
    micrometre = st.integers(-10**7, 10**7)
    vertices = draw(st.lists(st.tuples(*[micrometre] * 3), min_size=n, max_size=n))
    faces = draw(st.lists(st.tuples(*[st.integers(0, n - 1)] * 3), min_size=1, max_size=12))
    materials = draw(st.lists(NAMES, min_size=1, max_size=3, unique=True))
    parts = draw(st.lists(NAMES, min_size=1, max_size=3, unique=True))

    def of(names):
        return draw(st.lists(st.integers(0, len(names) - 1), min_size=len(faces), max_size=len(faces)))

    return Mesh(np.array(vertices) / 1000.0, np.array(faces), tuple(materials), np.array(of(materials)),
                tuple(parts), np.array(of(parts)))


@settings(deadline=None, max_examples=60)
@given(meshes(), st.sampled_from(["", "one line", "two\nlines, v 1 2 3"]))
def test_what_is_written_comes_back_in_order(tmp_path_factory, mesh, comment):
    path = tmp_path_factory.mktemp("obj") / "a.obj"
    path.write_text(format_obj(mesh, comment=comment), encoding="utf-8")
    back = load_obj(path)
    np.testing.assert_array_equal(back.vertices, mesh.vertices)
    assert named(back) == named(mesh)
    assert format_obj(back, comment=comment) == path.read_text(encoding="utf-8")


def test_decimals_are_rounded_and_nothing_is_minus_zero():
    mesh = Mesh.of([[-0.0001, 1.23456, -2.0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    assert format_obj(mesh).splitlines()[0] == "v 0.000 1.235 -2.000"
    assert format_obj(mesh, decimals=1).splitlines()[0] == "v 0.0 1.2 -2.0"
    assert format_obj(mesh, comment="a\nb").splitlines()[:2] == ["# a", "# b"]


@pytest.mark.parametrize("name", ["cage", "parts", "soft"])
def test_shipped_meshes_come_back(tmp_path, name):
    mesh = load_obj(meshes_dir() / "akimoto" / f"{name}.obj")
    (tmp_path / "a.obj").write_text(format_obj(mesh))
    back = load_obj(tmp_path / "a.obj")
    np.testing.assert_array_equal(back.vertices, mesh.vertices)
    assert named(back) == named(mesh)


@pytest.mark.parametrize("face", [
    "f 1 2 3", "f 1/4 2/5 3/6", "f 1/4/7 2/5/8 3/6/9", "f 1//7 2//8 3//9", "f 1/ 2/ 3/", "f -4 -3 -2",
    "f 1 -3 3", "f -4/1 -3/-2 -2//-1", "  f\t1  2   3  ",
])
def test_forms_of_a_face(load, face):
    mesh = load(SQUARE + "vt 0 0\nvn 0 0 1\n" + face + "\n")
    assert mesh.faces.tolist() == [[0, 1, 2]]
    np.testing.assert_array_equal(mesh.vertices, [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])


def test_negative_indices_count_back_from_the_line_they_stand_on(load):
    mesh = load("v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\nv 9 9 9\nf -3 -2 -1\n")
    assert mesh.faces.tolist() == [[0, 1, 2], [1, 2, 3]]


def test_polygons_become_fans_that_keep_name_and_turn(load):
    mesh = load(SQUARE + "v -1 0.5 0\no a\nusemtl m\nf 1 2 3 4 5\no b\nf 4 3 2 1\n")
    assert named(mesh) == [([0, 1, 2], "m", "a"), ([0, 2, 3], "m", "a"), ([0, 3, 4], "m", "a"),
                           ([3, 2, 1], "m", "b"), ([3, 1, 0], "m", "b")]


def test_parts_and_materials_are_independent_and_ordered_by_first_use(load):
    mesh = load(SQUARE + "usemtl red\no unused\no x\nf 1 2 3\nusemtl blue\nf 1 2 4\n"
                "g y\nf 1 3 4\nusemtl red\no x\nf 2 3 4\n")
    assert named(mesh) == [([0, 1, 2], "red", "x"), ([0, 1, 3], "blue", "x"), ([0, 2, 3], "blue", "y"),
                           ([1, 2, 3], "red", "x")]
    assert (mesh.materials, mesh.parts) == (("red", "blue"), ("x", "y"))


def test_without_names_all_is_skin(load):
    assert named(load(SQUARE + "f 1 2 3")) == [([0, 1, 2], "skin", "skin")]


def test_what_other_programs_write(load):
    plain = load(SQUARE + "o a b\nf 1 2 3 4\n")
    assert plain.parts == ("a b",)
    coloured = SQUARE.replace("1 1 0", "1 1 0 1.0 0.5 0.5")
    text = ("# Scan \x0cv 5 5 5 \u2028v 6 6 6\nmtllib a.mtl\n\n" + coloured
            + "vt 0 0\nvn 0 0 1\no a b  \ns off\nusemtl skin\nl 1 2\nf 1 2 3 4\n")
    for same in (text, text.replace("\n", "\r\n"), text.replace("\n", "\r"), text.removesuffix("\n")):
        mesh = load(same)
        np.testing.assert_array_equal(mesh.vertices, plain.vertices)
        assert named(mesh) == named(plain)
    marked = load(b"\xef\xbb\xbf" + SQUARE.encode() + b"f 1 2 3 4\n")        # a byte order mark
    np.testing.assert_array_equal(marked.vertices, plain.vertices)


@pytest.mark.parametrize(("line", "words"), [
    ("v 1 2 x", "could not convert"),
    ("v 1 2", "expected three finite numbers"),
    ("v 1 2 nan", "expected three finite numbers"),
    ("v 1 -inf 0", "expected three finite numbers"),
    ("v 1 1e999 0", "expected three finite numbers"),
    ("f 1 2 5", "vertices that came before"),
    ("f 0 1 2", "vertices that came before"),
    ("f 1 2 -5", "vertices that came before"),
    ("f 1 2", "three or more"),
    ("f", "three or more"),
    ("f 1 2 x", "invalid literal"),
    ("f 1 2 3.0", "invalid literal"),
    ("f /1 /2 /3", "invalid literal"),
    ("f 1 2 3 \\", "invalid literal"),
    ("o", "expected a name"),
    ("usemtl ", "expected a name"),
])
@pytest.mark.parametrize("ending", ["\n", "\r\n"])
def test_a_line_that_makes_no_sense_is_named(load, line, words, ending):
    text = SQUARE + "# a comment with a form feed \x0c\nf 1 2 3\n" + line + "\nv 7 7 7\n"
    text = text.replace("\n", ending)
    with pytest.raises(FileError, match=words) as error:
        load(text)
    assert "a.obj, line 7: " in str(error.value)
    assert repr(line.rstrip("\\").strip())[:-1] in str(error.value)


def test_a_long_line_is_not_repeated_in_full(load):
    with pytest.raises(FileError) as error:
        load("v " + "x" * 5000)
    assert "line 1" in str(error.value)
    assert str(error.value).count("x") < 200


@pytest.mark.parametrize("content", ["", "# nothing\n", SQUARE, "{}"])
def test_a_file_without_faces_is_refused(load, content):
    with pytest.raises(FileError, match=r"a\.obj holds no faces"):
        load(content)


def test_a_file_that_cannot_be_read_is_named(tmp_path, load):
    with pytest.raises(FileError, match=r"missing\.obj"):
        load_obj(tmp_path / "missing.obj")
    with pytest.raises(FileError, match="cannot read"):
        load_obj(str(tmp_path))
    with pytest.raises(FileError, match="cannot read"):
        load_obj("a\x00.obj")


def test_names_in_latin_1(load):
    assert load(SQUARE.encode() + b"o M\xfcnze\nf 1 2 3\n").parts == ("Münze",)
    assert load(SQUARE.encode() + "o Münze\nf 1 2 3\n".encode()).parts == ("Münze",)


@pytest.mark.parametrize("ending", ["\n", "\r\n", "\r"])
def test_a_line_goes_on_after_a_backslash(load, ending):
    text = "v 0 0 \\\n 0\nv 1 \\\n\\\n0 0\nv 1 1 0\nv 0 1 0\n# no \\\nf 1 2\\\n 3 4 \\\n\ng a \\\nb\nf 1 2 3\\"
    mesh = load(text.replace("\n", ending))
    np.testing.assert_array_equal(mesh.vertices, [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    assert named(mesh) == [([0, 1, 2], "skin", "skin"), ([0, 2, 3], "skin", "skin"), ([0, 1, 2], "skin", "a b")]


def test_a_concave_face_is_cut_so_that_nothing_turns_over(load):
    arrow = "v 0 0 0\nv 2 -1 0\nv 0 3 0\nv -2 -1 0\n"          # the first corner points inwards
    assert load(arrow + "f 1 2 3 4\n").faces.tolist() == [[0, 1, 2], [0, 2, 3]]
    assert load(arrow + "f 2 3 4 1\n").faces.tolist() == [[2, 3, 0], [2, 0, 1]]
    assert load(arrow + "f 1 4 3 2\nf 2 1 4 3\n").faces.tolist() == [[0, 3, 2], [0, 2, 1], [0, 3, 2], [0, 2, 1]]
    star = "v 0 0 0\nv 3 0 0\nv 3 3 0\nv 0 3 0\nv 1 1 0\n"
    assert load(star + "f 4 5 1 2 3\n").faces.tolist() == [[4, 0, 1], [4, 1, 2], [4, 2, 3]]


@settings(deadline=None, max_examples=60)
@given(st.integers(3, 7), st.integers(0, 10**6))
def test_triangles_of_a_polygon_keep_its_area(sides, seed):
    rng = np.random.default_rng(seed)
    angles = np.sort(rng.uniform(0, 2 * np.pi, sides))
    points = np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1)
    triangles, owner = fans(points, np.arange(sides), np.array([sides]))
    assert len(triangles) == sides - 2
    assert not owner.any()
    a, b, c = points[triangles].transpose(1, 0, 2)
    areas = np.cross(b - a, c - a)[:, 2]
    assert (areas >= -1e-12).all()
    after = np.roll(points, -1, axis=0)
    assert areas.sum() == pytest.approx(np.sum(points[:, 0] * after[:, 1] - points[:, 1] * after[:, 0]))


def test_colours_of_vertices(tmp_path):
    path = tmp_path / "a.obj"
    three = "v 0 0 0 {}\nv 1 0 0 {}\nv 0 1 0 {}\nf 1 2 3\n"
    for words, expected in (("1 0.5 0", [255, 127.5, 0]), ("200 100 0", [200, 100, 0]), ("1 1 0.5 0", [255, 127.5, 0])):
        path.write_text(three.format(words, words, words))
        np.testing.assert_allclose(read_obj(path).colours, [expected] * 3)
    for words in ("", "1 0.5", "x y z", "nan 0 0"):
        path.write_text(three.format("1 1 1", words, "0 0 0"))
        assert read_obj(path).colours is None


def test_50_000_vertices_are_read_quickly(tmp_path):
    n = 50_000
    numbers = np.arange(3 * n).reshape(n, 3) / 7
    corners = np.arange(n)[:, None] + [1, 2, 3]
    lines = [f"v {x:.4f} {y:.4f} {z:.4f}" for x, y, z in numbers] + ["vt 0 0"] * n
    lines += [f"f {a}/1 {b}/1 {c}/1" for a, b, c in np.minimum(corners, n)]
    (tmp_path / "a.obj").write_text("\n".join(lines))
    start = time.perf_counter()
    assert load_obj(tmp_path / "a.obj").faces.shape == (n, 3)
    assert time.perf_counter() - start < 5          # 0.3 s; this only catches something quadratic

"""Tables of unknown make: columns by name, oddities told by line, never a crash."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from facegen.errors import FacegenError, FileError
from facegen.fileio import table as module
from facegen.fileio.table import read_table


@pytest.fixture
def table(tmp_path):
    def read(content, **how):
        path = tmp_path / "t.csv"
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return read_table(path, **how)

    return read


@pytest.mark.parametrize("content", [
    b"time, AU01_r ,name\n0,1.5,x\n0.5,2.5,y\n",
    b"\xef\xbb\xbftime,AU01_r,name\r\n0,1.5,x\r\n0.5,2.5,y\r\n",
    b"time,AU01_r,name\r0,1.5,x\r0.5,2.5,y",
    b"\n\ntime;AU01_r;name\n0;1,5;x\n0,5;2,5;y\n",
    b"sep=;\ntime;AU01_r;name\n0;1,5;x\n0,5;2,5;y\n",
    b"time\tAU01_r\tname\n0\t1.5\tx\n0.5\t2.5\ty\n\n",
    b'"time","AU01_r","name"\n"0","1.5","x"\n0.5,2.5,"y"\n',
    b"time,AU01_r,name,\n0,1.5,x,\n0.5,2.5,y,\n",
    "time,AU01_r,name\n0,1.5,x\n0.5,2.5,y\n".encode("utf-16"),
    "time,AU01_r,name\n0,1.5,x\n0.5,2.5,y\n".encode("utf-16-le"),
    "time,AU01_r,name\n0,1.5,x\n0.5,2.5,y\n".encode("utf-16-be"),
])
def test_one_table_in_many_hands(table, content):
    found = table(content)
    assert found.columns == ("time", "AU01_r", "name")
    assert found.column("au01_R ").tolist() == [1.5, 2.5]
    assert found.column("TIME").tolist() == [0.0, 0.5]
    assert found.texts == {"name": ["x", "y"]}
    assert (found.warnings, found.cut) == ((), False)


def test_lines_are_where_an_editor_shows_them(table):
    assert table("\na,b\n1,2\n\n3,4\n").lines.tolist() == [3, 5]


def test_columns_that_differ_in_capitals_are_two(table):
    found = table("x_0,X_0\n1,2\n")
    assert (found.column("x_0")[0], found.column("X_0")[0]) == (1.0, 2.0)


def test_what_is_missing_is_nan_without_a_word(table):
    found = table("a,b\n1,\n,nan\nN/A,-nan(ind)\n4,null\n")
    np.testing.assert_array_equal(found.column("a"), [1, np.nan, np.nan, 4])
    assert np.isnan(found.column("b")).all()
    assert found.warnings == ()


@pytest.mark.parametrize(("content", "kept", "warning"), [
    ("a,b\n1,2\n3\n5,6\n", [1, 5], r"line 3 \(1\): left out, for they do not have the header's 2 fields"),
    ("a,b\n1,2\n3,4,5\n5,6\n", [1, 5], r"line 3 \(3\): left out"),
    ("a,b\n1,2\n3,4\n5", [1, 3], "line 4: the file stops in the middle of a line, which is left out"),
    ("a,b\n1,2\nx,4\n5,6\n", [1, np.nan, 5], "'x' in line 3, column 'a': no numbers, and counted as missing"),
    ("a,b\n1,2\n1_0,4\n5,6\n", [1, np.nan, 5], "'1_0' in line 3"),
    ("a,b\n1,2\ninf,4\n5,6\n", [1, np.nan, 5], "'inf' in line 3"),
    ("a,b\n1,2\n1e999,4\n5,6\n", [1, np.nan, 5], "'1e999' in line 3"),
    ('a,b\n1,2\n"3,4\n5,6\n', [1, 5], r"line 3 \(1\): left out"),
    ("a,a,b\n1,9,2\n", [1], "columns given twice, of which the first counts"),
    (b"a,b,name\n1,2,\xe9\n3,4,\xc3\xa9\n", [1, 3], "line 2: no UTF-8, and read as Latin-1"),
    ("a,b\n1,2\n" + "x\n" * 9, [1], r"lines 3 \(1\), 4 \(1\), 5 \(1\) and 6 more"),
])
def test_what_cannot_be_understood_is_left_out_and_told(table, content, kept, warning):
    found = table(content)
    np.testing.assert_array_equal(found.column("a"), kept)
    assert len(found.warnings) == 1
    with pytest.raises(AssertionError, match=warning):
        raise AssertionError(found.warnings[0])


def test_mixed_encodings_are_each_read_as_they_are(table):
    assert table(b"a,name\n1,\xe9\n3,\xc3\xa9\n").texts["name"] == ["é", "é"]


def test_a_short_row_can_be_whole(table):
    found = table("a,b,c\n1,0\n2,3,4\n", short=lambda cells: cells[1] == "0")
    np.testing.assert_array_equal(found.column("c"), [np.nan, 4.0])
    assert found.warnings == ()


def wide(count):
    return b",".join(b"%d" % k for k in range(count)) + b"\n"


@pytest.mark.parametrize(("content", "message"), [
    (b"", "is empty"),
    (b" \n\n ", "is empty"),
    (b"a,b\n", "no row can be read below the header in line 1"),
    (b"a,b\n1\n2\n", r"no row .*lines 2 \(1\), 3 \(1\): left out"),
    (b"0.1,0.2,0.3\n1,2,3\n", "line 1: expected the names of the columns, got numbers"),
    (b"\x89PNG\r\n\0\0\0\x01abcdefgh\0\xff\xfe", "is no text"),
    (wide(20_000), "line 1: 20,000 columns; expected at most 10,000"),
    (wide(2_000_000), "line 1: longer than 1,000,000 characters"),
    (b"a,b\n1," + b"2" * 2_000_000, "line 2: longer than 1,000,000 characters"),
])
def test_what_is_no_table_is_refused_in_words(table, content, message):
    with pytest.raises(FileError, match=message):
        table(content)


def test_ten_million_columns_cost_no_more_than_the_first_of_them(tmp_path, monkeypatch):
    """The file is read no further than the bound, whatever its size."""
    path = tmp_path / "wide.csv"
    with path.open("wb") as file:
        file.write(b"AU01_r,")
        for _ in range(10):
            file.write(b"c," * 1_000_000)
    import io

    read = []
    original = io.TextIOWrapper.readline
    assert original is not None

    class Counted(io.TextIOWrapper):
        def readline(self, size=-1, /):
            text = super().readline(size)
            read.append(len(text))
            return text

    def opened(self, *arguments, encoding=None, errors=None, newline=None, **rest):
        if "b" in (arguments[0] if arguments else ""):
            return io.open(self, *arguments, **rest)  # noqa: UP020 (the method is what is replaced)
        return Counted(io.open(self, "rb"), encoding=encoding, errors=errors, newline=newline)  # noqa: UP020

    monkeypatch.setattr(type(path), "open", opened)
    with pytest.raises(FileError, match="longer than 1,000,000 characters"):
        read_table(path)
    assert sum(read) <= module.LONGEST_LINE + 2


def test_too_many_numbers_are_refused_before_memory_is_full(table, monkeypatch):
    monkeypatch.setattr(module, "MOST_CELLS", 100)
    with pytest.raises(FileError, match="line 52: more than 100 numbers"):
        table("a,b\n" + "1,2\n" * 200)


@pytest.mark.parametrize(("path", "message"), [("nothing.csv", "there is no such file"), (".", "it is a folder"),
                                               ("a\0b", "cannot be read")])
def test_files_that_cannot_be_read(tmp_path, path, message):
    with pytest.raises(FileError, match=message):
        read_table(tmp_path / path)


def test_a_column_that_is_not_there_names_the_nearest(table):
    found = table("AU01_r,name\n1,x\n")
    with pytest.raises(FileError, match=r"no column 'AU01_s'; did you mean 'AU01_r'\?"):
        found.column("AU01_s")
    with pytest.raises(FileError, match="line 2: column 'name': expected numbers, got 'x'"):
        found.column("name")


CELL = st.one_of(st.floats(allow_nan=False, allow_infinity=False).map(repr), st.sampled_from(["", "nan", "x", '"', "1_0"]),
                 st.text(max_size=5))


@given(st.one_of(
    st.binary(max_size=300),
    st.lists(st.lists(CELL, min_size=1, max_size=5).map(",".join), max_size=8).map("\n".join).map(
        lambda text: text.encode("utf-8", "replace"))))
@settings(deadline=None, max_examples=300)
def test_no_file_crashes_it(tmp_path_factory, content):
    path = tmp_path_factory.getbasetemp() / "fuzz.csv"
    path.write_bytes(content)
    try:
        found = read_table(path)
    except FacegenError as error:
        assert str(path) in str(error)
        return
    assert len(found) == len(found.lines) > 0
    for column in found.numbers.values():
        assert column.shape == (len(found),)
        assert not np.isinf(column).any()
    assert all(len(column) == len(found) for column in found.texts.values())
    assert set(found.columns) == {*found.numbers, *found.texts}


@given(st.lists(st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=3, max_size=3), min_size=1, max_size=9))
@settings(deadline=None, max_examples=60)
def test_numbers_come_back_to_the_last_bit(tmp_path_factory, rows):
    path = tmp_path_factory.getbasetemp() / "numbers.csv"
    path.write_text("a,b,c\n" + "\n".join(",".join(map(repr, row)) for row in rows) + "\n")
    found = read_table(path)
    np.testing.assert_array_equal(np.column_stack([found.column(name) for name in "abc"]), np.array(rows))

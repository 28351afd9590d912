"""TextGrids in both forms and every encoding that Praat writes; hostile ones end in an error."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from facegen.errors import FileError
from facegen.fileio.textgrid import parse_textgrid, read_text


def quoted(text):
    return '"' + text.replace('"', '""') + '"'


def long_form(tiers, end=1.0):
    """Return a TextGrid as Praat's "Save as text file" lays it out."""
    lines = ['File type = "ooTextFile"', 'Object class = "TextGrid"', "", "xmin = 0 ", f"xmax = {end} ",
             "tiers? <exists> ", f"size = {len(tiers)} ", "item []: "]
    for k, (name, rows) in enumerate(tiers, 1):
        lines += [f"    item [{k}]:", '        class = "IntervalTier" ', f"        name = {quoted(name)} ",
                  "        xmin = 0 ", f"        xmax = {end} ", f"        intervals: size = {len(rows)} "]
        for n, (start, stop, label) in enumerate(rows, 1):
            lines += [f"        intervals [{n}]:", f"            xmin = {start} ", f"            xmax = {stop} ",
                      f"            text = {quoted(label)} "]
    return "\n".join(lines) + "\n"


def short_form(tiers, end=1.0):
    """Return a TextGrid as Praat's "Save as short text file" lays it out."""
    lines = ['File type = "ooTextFile"', 'Object class = "TextGrid"', "", "0", str(end), "<exists>", str(len(tiers))]
    for name, rows in tiers:
        lines += ['"IntervalTier"', quoted(name), "0", str(end), str(len(rows))]
        for start, stop, label in rows:
            lines += [str(start), str(stop), quoted(label)]
    return "\n".join(lines) + "\n"


TIERS = [("words", [(0, 1.0, 'say "hi"\nnow')]), ("phones", [(0, 0.25, ""), (0.25, 0.5, "ʃ"), (0.5, 1.0, "AA1")])]

labels = st.text(st.characters(exclude_categories=("Cs", "Cc")), max_size=8)
tiers = st.lists(st.tuples(labels, st.lists(st.tuples(st.integers(1, 500), labels), max_size=5)), max_size=3)


@pytest.mark.parametrize("form", [long_form, short_form])
@given(drawn=tiers)
def test_round_trip(form, drawn):
    given_tiers, end = [], 1.0
    for name, rows in drawn:
        t, made = 0.0, []
        for length, label in rows:
            made.append((t, t + length / 100, label))
            t += length / 100
        end = max(end, t)
        given_tiers.append((name, made))
    found = parse_textgrid(form(given_tiers, end), "a")
    assert [(one.name, list(one.intervals)) for one in found] == given_tiers


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-be", "utf-16-le"])
@pytest.mark.parametrize("form", [long_form, short_form])
@pytest.mark.parametrize("ends", ["\n", "\r\n", "\r"])
def test_encodings(tmp_path, form, encoding, ends):
    text = form(TIERS)
    mark = {"utf-16-be": b"\xfe\xff", "utf-16-le": b"\xff\xfe"}.get(encoding, b"")
    path = tmp_path / "a.TextGrid"
    path.write_bytes(mark + text.replace("\n", ends).encode(encoding))
    found = parse_textgrid(read_text(path), "a")
    assert [label for _, _, label in found[1].intervals] == ["", "ʃ", "AA1"]


def test_latin1(tmp_path):
    path = tmp_path / "a.TextGrid"
    path.write_bytes(long_form([("phones", [(0, 1, "é")])]).encode("latin-1"))
    assert parse_textgrid(read_text(path), "a")[0].intervals == ((0.0, 1.0, "é"),)


def test_points_and_remarks_are_passed_over():
    text = short_form(TIERS).replace("<exists>\n2", '<exists> ! two tiers\n3\n"TextTier" "marks" 0 1 1 0.5 "click"')
    assert [one.name for one in parse_textgrid(text, "a")] == ["words", "phones"]


@pytest.mark.parametrize(("change", "message"), [
    (lambda text: "", "a: line 1: the file ends where the file's type should stand"),
    (lambda text: text[:-30], "the file ends where"),
    (lambda text: text.replace('"TextGrid"', '"Sound"'), "line 2: expected a TextGrid, got 'Sound'"),
    (lambda text: text.replace("<exists>", "<absent>"), "the TextGrid has no tiers"),
    (lambda text: text.replace("<exists>", "1"), "expected <exists>"),
    (lambda text: text.replace("IntervalTier", "Tier"), "line 10: expected IntervalTier or TextTier, got 'Tier'"),
    (lambda text: text.replace("size = 3", "size = 3e9"), "a number of entries of tier 'phones' that"),
    (lambda text: text.replace("size = 3", "size = -3"), "a number of entries"),
    (lambda text: text.replace("xmin = 0.25", "xmin = 0.15"), "intervals in order of time, got 0.15 to 0.5 after 0.25"),
    (lambda text: text.replace("xmin = 0.25", "xmin = 1e999"), "an interval's start in seconds, got inf"),
    (lambda text: text.replace("xmin = 0.25", 'xmin = "x"'), r"line 31: expected an interval's start \(a number\)"),
    (lambda text: "ooBinaryFile\x08TextGrid", "a binary TextGrid; in Praat, save it as a text file"),
    (lambda text: '"Praat chronological TextGrid text file"', "a chronological TextGrid"),
])
def test_wrong_files_are_named_with_their_line(change, message):
    with pytest.raises(FileError, match=message):
        parse_textgrid(change(long_form(TIERS)), "a")


@given(st.data())
def test_damaged_files_are_read_or_refused(data):
    raw = list(data.draw(st.sampled_from([long_form(TIERS), short_form(TIERS)])))
    for _ in range(data.draw(st.integers(1, 6))):
        at = data.draw(st.integers(0, len(raw) - 1))
        raw[at: at + data.draw(st.integers(0, 8))] = data.draw(st.text('0".e9<>!\n -xA', max_size=4))
        raw = raw or ["x"]
    try:
        parse_textgrid("".join(raw), "a")
    except FileError:
        return


@given(st.text('"! \n0a', max_size=200))
def test_any_quotes_end(text):
    try:
        parse_textgrid('"ooTextFile" "TextGrid" ' + text, "a")
    except FileError:
        return


def test_unreadable(tmp_path):
    with pytest.raises(FileError, match="there is no such file"):
        read_text(tmp_path / "none")
    with pytest.raises(FileError, match="it is a folder"):
        read_text(tmp_path)
    path = tmp_path / "odd"
    path.write_bytes(b"\xff\xfea")
    with pytest.raises(FileError, match="not UTF-16 text as its mark says"):
        read_text(path)
    path.write_bytes(b"x" * 20)
    with pytest.raises(FileError, match="larger than"):
        read_text(path, most=10)

import pytest

from facegen.errors import FileError, TableError
from facegen.facs import yamlfile
from facegen.facs.yamlfile import parse_json, parse_yaml, read_data


def test_plain_values():
    text = "a: 1\nb: 1.5\nc: -.5e-3\nd: true\ne: null\nf: text\ng: '12'\nh: [1, [2.0, x]]\n12: {k: }\ni: ~\n"
    assert parse_yaml(text, "t") == {"a": 1, "b": 1.5, "c": -0.0005, "d": True, "e": None, "f": "text",
                                     "g": "12", "h": [1, [2.0, "x"]], "12": {"k": None}, "i": None}


@pytest.mark.parametrize("word", ["no", "yes", "on", "off", "1:30", "0x1F", "0o17", "1_000", "2026-01-01",
                                  "True", "=", "inf", "nan", "+-1", "1.2.3", "."])
def test_what_looks_like_text_stays_text(word):
    assert parse_yaml(f"a: {word}", "t") == {"a": word}


def test_infinity_and_huge_numbers_become_numbers_that_validation_refuses():
    data = parse_yaml("a: [.inf, -.inf, .nan, 1e999, 99999999999999999999999999]", "t")["a"]
    assert data[0] == data[3] == float("inf")
    assert data[2] != data[2]
    assert data[4] == 1e26


@pytest.mark.parametrize(("text", "words"), [
    ("a: 1\na: 2", r"t: line 2: the key 'a' is given twice"),
    ("a: {b: {c: 1, c: 2}}", r"t: line 1: a\.b: the key 'c' is given twice"),
    ("a: [{b: 1}, {b: 1, b: 2}]", r"a\.1: the key 'b' is given twice"),
    ("12: 1\n'12': 2", "the key '12' is given twice"),
    ("a: &x 1\nb: *x", "anchors"),
    ("a: &x [1]", "anchors"),
    ("a: *x", "aliases"),
    ("a: !!python/object/apply:os.system ['echo']", "tags"),
    ("a: !!str 1", "tags"),
    ("!!map {a: 1}", "tags"),
    ("? [1, 2]\n: 3", "a key must be plain text"),
    ("? {a: 1}\n: 3", "a key must be plain text"),
    ("a: 1\n---\nb: 2", "one document"),
    ("a: [1, 2", "not valid YAML"),
    ("a: b: c", "not valid YAML"),
    ("\ta: 1", "not valid YAML"),
    ("a: \x00", "not valid YAML"),
    ("a: \x07", "not valid YAML"),
    ("[" * 30 + "]" * 30, "nested deeper than 24"),
    ("[" * 100_000, "nested deeper"),
    ("{a: " * 30, "nested deeper"),
    ("%YAML 9.9\n---\na: 1", "not valid YAML"),
])
def test_bad_yaml_is_refused_with_its_place(text, words):
    with pytest.raises(TableError, match=words):
        parse_yaml(text, "t")


def test_laughing_aliases_cannot_blow_up():
    lines = ["a0: &a0 [x, x]"] + [f"a{i}: &a{i} [*a{i - 1}, *a{i - 1}]" for i in range(1, 60)]
    with pytest.raises(TableError, match="anchors"):
        parse_yaml("\n".join(lines), "t")


def test_pure_python_parser_agrees(monkeypatch):
    import yaml

    text = "a: {b: [1, 2.5, x], '12': null}\nc: |\n  long\n  text\n"
    expected = parse_yaml(text, "t")
    monkeypatch.delattr(yaml, "CSafeLoader", raising=False)
    assert parse_yaml(text, "t") == expected
    with pytest.raises(TableError, match="given twice"):
        parse_yaml("a: 1\na: 2", "t")
    with pytest.raises(TableError, match="not valid YAML"):
        parse_yaml("a: [", "t")


def test_merge_keys_are_plain_keys():
    assert parse_yaml("<<: 1", "t") == {"<<": 1}


@pytest.mark.parametrize(("text", "words"), [
    ('{"a": 1, "a": 2}', "'a' is given twice"),
    ('{"x": {"a": 1, "b": 1, "a": 2}}', "'a' is given twice"),
    ('{"a": 1,}', "line 1, column"),
    ("[" * 100_000, "nested too deeply"),
    ("1" * 5000, "too long"),
])
def test_bad_json_is_refused(text, words):
    with pytest.raises(TableError, match=words):
        parse_json(text, "t")


def test_files(tmp_path, monkeypatch):
    path = tmp_path / "a.yaml"
    path.write_bytes(b"\xef\xbb\xbfa: 1\r\nb: \xe7\xac\x91\r\n")
    assert read_data(path) == {"a": 1, "b": "笑"}
    (tmp_path / "a.JSON").write_text('{"a": [1, 2.0, true, null]}')
    assert read_data(str(tmp_path / "a.JSON")) == {"a": [1, 2.0, True, None]}
    path.write_bytes(b"")
    assert read_data(path) is None
    with pytest.raises(FileError, match="no such file"):
        read_data(tmp_path / "missing.yaml")
    with pytest.raises(FileError, match=r"cannot be read"):
        read_data(tmp_path)
    with pytest.raises(FileError, match="cannot be read"):
        read_data("a\x00b.yaml")
    path.write_bytes(b"a: \xff\xfe")
    with pytest.raises(FileError, match="not UTF-8"):
        read_data(path)
    monkeypatch.setattr(yamlfile, "MAX_BYTES", 1_000_000)
    path.write_bytes(b"a" * 1_000_001)
    with pytest.raises(FileError, match="larger than 1 MB"):
        read_data(path)

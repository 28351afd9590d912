"""facegen list and explain: complete, aligned, and as JSON."""

from __future__ import annotations

import json

import pytest

import facegen


@pytest.mark.parametrize(("topic", "names"), [
    ("expressions", {"neutral", "happiness", "pain"}),
    ("faces", {"akimoto", "akimoto-1986"}),
    ("people", {"bruno", "mika"}),
    ("presets", {f"akimoto-1986-figure-{n}" for n in (7, 8, 9)}),
])
def test_lists(run, topic, names):
    code, text, err = run("list", topic)
    assert (code, err) == (0, "")
    assert names <= {line.split()[0] for line in text.splitlines()}
    rows = json.loads(run("list", topic, "--json")[1])
    assert [row["name"] for row in rows] == [line.split()[0] for line in text.splitlines()]


def test_units(run):
    rows = json.loads(run("list", "units", "--json")[1])
    codes = [code for row in rows for code in row["codes"]]
    assert codes == list(facegen.load_units().catalogue.codes)
    assert len(run("list", "units")[1].splitlines()) == len(rows)


def test_lines_are_aligned(run):
    lines = run("list", "people")[1].splitlines()
    assert len({line.index("A ") if " A " in line else line.index("An ") for line in lines}) == 1


def test_expressions_of_a_person(run):
    text = run("list", "expressions", "--person", "mika", "--json")[1]
    rows = {row["name"]: row for row in json.loads(text)}
    assert rows["happiness"]["own"]
    assert not rows["pain"]["own"]
    assert "mika_doubt" in rows


def test_expressions_of_nobody(run):
    code, _, err = run("list", "expressions", "--person", "nobody")
    assert code == 2
    assert "nobody" in err


def test_explain_tells_the_chain(run):
    code, text, err = run("explain", "happiness")
    assert (code, err) == (0, "")
    words = ("happiness", "Action units", "Lip corner puller", "do not simply add", "Deformation data",
             "feature points move")
    order = [text.index(word) for word in words]
    assert order == sorted(order)


def test_explain_numbers_are_those_of_the_api(run):
    data = json.loads(run("explain", "L12C", "--json")[1])
    meaning = facegen.resolve("L12C")
    face = facegen.load_face()
    assert data["units"][0]["code"] == "L12"
    assert data["units"][0]["weight"] == dict(meaning.units)["L12"]
    assert facegen.resolve(data["deformation"]).deformation == meaning.deformation
    vector = face.controls(meaning.deformation).vectors[list(face.feature_points).index("mouth_corner_L")]
    assert data["millimetres"]["mouth_corner_L"] == pytest.approx(vector, abs=1e-3)


@pytest.mark.parametrize(("what", "words"), [
    ("26", "jaw  opens by"), ("63", "left eye"), ("53", "chin lifts by"), ("51", "to the subject's left"),
    ("43E", "left upper lid"), ("neutral", "nothing moves"), ("figure-7", "turns_with_jaw"),
    ("L30", "jaw  goes"),
])
def test_explain_in_words(run, what, words):
    text = run("explain", what)[1] + run("explain", what, "--json")[1]
    assert words in text


def test_explain_shows_the_largest_or_all(run):
    short, whole = (run("explain", "happiness", *more)[1] for more in ((), ("--all",)))
    count = len(json.loads(run("explain", "happiness", "--json")[1])["millimetres"])
    assert short.count(" mm") == 12
    assert whole.count(" mm") == count > 12


def test_explain_on_the_papers_face(run):
    data = json.loads(run("explain", "figure-9", "--face", "akimoto-1986", "--json")[1])
    assert set(data["millimetres"]) == {"mouth_corner_L", "mouth_corner_R"}
    x, y, z = data["millimetres"]["mouth_corner_L"]
    assert x > 0
    assert y > 0
    assert z < 0


def test_explain_warns(run):
    code, text, err = run("explain", "18+20", "--json")
    assert code == 0
    assert json.loads(text)["warnings"]
    assert "work against each other" in err
    assert run("explain", "18+20", "-q")[2] == ""


def test_explain_an_unknown_word(run):
    code, out, err = run("explain", "hapyness")
    assert (code, out) == (2, "")
    assert "did you mean 'happiness'" in err

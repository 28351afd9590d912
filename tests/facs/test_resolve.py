import dataclasses
import json
import math

import pytest

from facegen.errors import FileError, InputError, NotationError, TableError
from facegen.facs.deformation import Deformation, load_deformation
from facegen.facs.expressions import presets, resolve


def test_every_level_meets_in_one_deformation():
    name = resolve("happiness")
    script = resolve("6D+12E+25D")
    weights = resolve({"AU6": 0.8, "AU12": 1.0, "AU25": 0.8})
    assert name.deformation == script.deformation == weights.deformation
    assert (name.kind, script.kind, weights.kind) == ("expression", "units", "units")
    assert name.name == "happiness"
    assert script.name == weights.name == "6D+12E+25D"
    assert script.expression is None
    assert name.source
    raw = resolve(name.deformation)
    assert raw.kind == "deformation"
    assert raw.units == {}
    assert raw.deformation == name.deformation
    assert resolve(name.deformation.as_dict()).deformation == name.deformation
    with pytest.raises(dataclasses.FrozenInstanceError):
        name.kind = "x"


def test_intensity_scales_any_level():
    assert resolve("12D", intensity=0.5).units == {"12": 0.4}
    assert resolve({"jaw": {"open": 10}}, intensity=0.5).deformation.jaw == {"open": 5}
    assert resolve(Deformation(jaw={"open": 10}), intensity=0.25).deformation.jaw == {"open": 2.5}
    assert resolve("happiness", intensity=1).deformation == resolve("happiness").deformation


@pytest.mark.parametrize("intensity", [-0.1, 1.01, math.nan, math.inf, "1", None, True])
def test_wrong_intensity(intensity):
    with pytest.raises(InputError, match=r"intensity: expected a number in 0\.\.1"):
        resolve("happiness", intensity=intensity)


def test_files_of_raw_data(tmp_path, monkeypatch):
    path = tmp_path / "my.pose.yaml"
    path.write_text("source: mine\njaw: {open: 12}\n")
    for what in (path, str(path)):
        found = resolve(what, intensity=0.5)
        assert (found.kind, found.name, found.source) == ("deformation", "my.pose", "mine")
        assert found.deformation.jaw == {"open": 6}
    other = tmp_path / "happiness.json"
    other.write_text(json.dumps({"lids": {"upper_L": 1}}))
    monkeypatch.chdir(tmp_path)
    assert resolve("happiness.json").kind == "deformation"
    assert resolve("happiness").kind == "expression"
    assert resolve("./happiness.json").deformation.lids == {"upper_L": 1}
    (tmp_path / "12.yaml").write_text("jaw: {open: 1}\n")
    assert resolve("12.yaml").kind == "deformation"
    assert resolve("26/27").kind == "units"
    path.write_text("jaw: {opne: 12}\n")
    with pytest.raises(TableError, match="did you mean 'open'"):
        resolve(path)


def test_the_papers_figures():
    assert presets() == tuple(f"akimoto-1986-figure-{n}" for n in (7, 8, 9))
    seven, eight, nine = (resolve(name) for name in presets())
    assert seven.kind == "deformation"
    assert seven.name == "akimoto-1986-figure-7"
    assert "figure 7" in seven.source
    assert seven.deformation == Deformation(points={"F8": (0, -0.02, 0), "F9": (0, 0.02, 0)},
                                            jaw={"open": 10}, units="paper", with_jaw=("F3",))
    assert eight.deformation == Deformation(
        points={"F2": (0, 0.04, 0), "F3": (0, -0.04, 0), "F8": (-0.07, 0, -0.07), "F9": (0.07, 0, -0.07)},
        units="paper")
    assert nine.deformation == Deformation(points={"F8": (0.04, 0.04, 0.04), "F9": (-0.04, 0.04, 0.04)},
                                           units="paper")
    for symmetric in (eight, nine):
        assert symmetric.deformation == symmetric.deformation.mirrored()
    assert resolve("Akimoto 1986 figure 8").deformation == eight.deformation
    from facegen.data import tables_dir
    for name in presets():
        assert load_deformation(tables_dir() / "presets" / f"{name}.yaml") == resolve(name).deformation


@pytest.mark.parametrize(("what", "kind", "words"), [
    ("happines", InputError, "unknown expression 'happines'; did you mean 'happiness'"),
    ("Hapily Surprised", InputError, "did you mean 'happily_surprised'"),
    ("akimoto-1986-figure-6", InputError, "did you mean 'akimoto-1986-figure-"),
    ("fear2", InputError, "did you mean 'fear'"),
    ("qqqq", InputError, "unknown expression 'qqqq' "),
    ("happiness+12", InputError, r"do not mix; write the units of 'happiness', which are 6D\+12E"),
    ("12F", NotationError, "intensity is A-E"),
    ("AU99", NotationError, "no unit 99"),
    ("M59", NotationError, "movement"),
    ("", InputError, "empty text"),
    ("   ", InputError, "empty text"),
    (None, InputError, "got NoneType"),
    (12, InputError, "got int"),
    (["6", "12"], InputError, "got list"),
    ("none.yaml", FileError, "no such file"),
    ("dir/none", FileError, "no such file .a name or a FACS script has no slash"),
    ({"AU12": 2.0}, InputError, r"0\.\.1"),
    ({"smile": 1.0}, NotationError, "expected a unit"),
    ({"jaw": {"open": 1}, "AU12": 1.0}, TableError, "unknown key 'AU12'"),
])
def test_what_means_nothing_is_refused_helpfully(what, kind, words):
    with pytest.raises(kind, match=words):
        resolve(what)


def test_nothing_given_is_neutral():
    assert resolve({}).name == "0"
    assert not resolve({}).deformation
    assert resolve("neutral").name == "neutral"
    assert resolve("0").units == {}


def test_warnings_are_reported():
    found = resolve("5+43")
    assert len(found.warnings) == 1
    assert set(found.units) == {"5", "43"}


def test_neutral_is_in_the_tables_units():
    assert resolve("neutral").deformation == resolve("12E", intensity=0).deformation

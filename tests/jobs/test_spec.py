"""Jobs files: what they mean, and an error with file, key and nearest name for whatever they cannot."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import facegen
from facegen.errors import FileError, InputError, TableError
from facegen.jobs import spec
from facegen.jobs.naming import LONGEST, file_names
from facegen.jobs.spec import read_batch

EXAMPLE = Path(__file__).parents[2] / "examples" / "jobs.yaml"


def names(jobs):
    return file_names(read_batch(jobs).pictures)


def test_the_example():
    found = read_batch(EXAMPLE)
    assert len(found.pictures) == 48 + 20 + 1
    assert found.settings.masks
    assert len(set(file_names(found.pictures))) == 69
    assert read_batch(EXAMPLE) == found


def test_one_pose_is_enough():
    one, = read_batch({"poses": "happiness"}).pictures
    assert (one.face, one.person, one.size, one.view, one.light, one.background, one.intensity) == \
        ("akimoto", None, (512, 512), (0.0, 0.0), "portrait", "plain", 1.0)
    assert dict(one.units) == facegen.resolve("happiness").units
    assert names({"poses": "happiness"}) == ["happiness"]


@pytest.mark.parametrize(("key", "values", "attribute", "expected"), [
    ("views", ["10,5", [20, -5], 30], "view", [(10.0, 5.0), (20.0, -5.0), (30.0, 0.0)]),
    ("views", [10, 5], "view", [(10.0, 0.0), (5.0, 0.0)]),
    ("views", "10,5", "view", [(10.0, 5.0)]),
    ("sizes", [64, "80x60", [90, 70]], "size", [(64, 64), (80, 60), (90, 70)]),
    ("backgrounds", ["plain", "#102030", [1, 2, 3]], "background", ["plain", (16.0, 32.0, 48.0), (1.0, 2.0, 3.0)]),
    ("people", ["mika", None, "nobody"], "person", ["mika", None]),
    ("intensities", [0.5, 1], "intensity", [0.5, 1.0]),
    ("faces", ["akimoto", "akimoto-1986"], "face", ["akimoto", "akimoto-1986"]),
    ("lights", ["top", "dim"], "light", ["top", "dim"]),
])
def test_what_may_be_written(key, values, attribute, expected):
    found = read_batch({"poses": "happiness", key: values})
    assert [getattr(one, attribute) for one in found.pictures] == expected


def test_an_intensity_and_a_person_change_the_units():
    found = read_batch({"poses": "happiness", "intensities": 0.5, "people": "mika"}).pictures[0]
    assert dict(found.units) == facegen.resolve("happiness", person="mika", intensity=0.5).units


def test_products_share_what_stands_above_them():
    found = read_batch({"sizes": 64, "products": [{"poses": ["1", "2"], "views": [0, 30]},
                                                  {"poses": "anger", "sizes": [32, 48]}]})
    assert [(one.pose, one.size[0]) for one in found.pictures] == [
        ("1", 64), ("2", 64), ("1", 64), ("2", 64), ("anger", 32), ("anger", 48)]


def test_said_twice_is_drawn_once():
    assert names({"poses": ["6C+12D", "6C+12D", "anger"]}) == ["6C+12D", "anger"]


def test_paths_are_relative_to_the_jobs_file(tmp_path):
    (tmp_path / "open.yaml").write_text("jaw: {open: 12}\n")
    (tmp_path / "jobs.json").write_text(json.dumps({"poses": "open.yaml"}))
    one, = read_batch(tmp_path / "jobs.json").pictures
    assert one.kind == "deformation"
    assert names(tmp_path / "jobs.json") == ["open"]


def test_names_are_readable_unique_and_safe():
    jobs = {"poses": ["12D", {"jaw": {"open": 5}}, {"jaw": {"open": 6}}, {"12": 0.3}], "intensities": [0.5, 1],
            "views": ["0,0", "-30,10"], "backgrounds": ["#ff0000", "plain"]}
    found = names(jobs)
    assert len({name.casefold() for name in found}) == len(found) == 32
    assert "12D_i100_plain_y0p0" in found
    assert "pose_i50_bgff0000_y-30p+10" in found
    assert "pose-2_i50_bgff0000_y-30p+10" not in found      # the number comes last
    assert "pose_i50_bgff0000_y-30p+10-2" in found
    long = "+".join(f"{unit}=0.123" for unit in (1, 2, 4, 5, 6, 7, 9, 10, 12, 15, 17, 20, 23, 25, 26, 43))
    odd = ("../../etc", "CON", "a b/c:d", "Ärger", "...", "x" * 300, "nul.tar")
    own = [{"pose": "1", "name": name} for name in odd]
    found = names({"poses": [long, long + "+45"], "pictures": own})
    assert found[2:] == ["etc", "pose_CON", "a_b_c_d", "Arger", "pose", "x" * LONGEST, "pose_nul.tar"]
    assert all(len(name) <= LONGEST + 8 and name.isascii() and "/" not in name for name in found)
    assert len(set(found)) == len(found)


def test_two_pictures_of_one_name():
    jobs = {"pictures": [{"pose": "1", "name": "Wink"}, {"pose": "2", "name": "wink"}]}
    with pytest.raises(InputError, match="pictures: two have the name 'wink'"):
        file_names(read_batch(jobs).pictures)


DRAWN = {"count": 40, "seed": 3, "yaw": [-40, 40], "pitch": 5, "intensity": [0.5, 1], "lights": ["top", "left"],
         "units": {"6": [0, 1], "L12": [0.5, 1], "26": 0.4, "together": [1, 3]}}


def test_drawn_by_lot_the_same_every_time():
    found = read_batch({"random": DRAWN}).pictures
    assert found == read_batch({"random": dict(DRAWN)}).pictures
    assert found != read_batch({"random": {**DRAWN, "seed": 4}}).pictures
    assert len(found) == 40
    assert len({one.view for one in found}) > 30
    assert {one.light for one in found} == {"top", "left"}
    assert {len(one.units) for one in found} == {1, 2, 3}
    for one in found:
        assert -40 <= one.view[0] <= 40
        assert one.view[1] == 5
        assert 0.5 <= one.intensity <= 1
        assert set(dict(one.units)) <= {"6", "L12", "26"}
        assert dict(one.units).get("26", 0.4 * one.intensity) == pytest.approx(0.4 * one.intensity)
    # more pictures begin with the same ones
    assert read_batch({"random": {**DRAWN, "count": 50}}).pictures[:40] == found
    assert names({"random": DRAWN})[0].startswith("r000001_")


def test_drawn_from_poses():
    found = read_batch({"random": {"count": 30, "seed": 1, "poses": ["happiness", "anger"], "people": [None, "bruno"]}})
    assert {(one.pose, one.person) for one in found.pictures} == {
        (pose, person) for pose in ("happiness", "anger") for person in (None, "bruno")}


def test_warnings_are_handed_on():
    assert len(read_batch({"poses": ["5E+43B", "5E+43B+12C"], "views": [0, 30]}).warnings) == 1


@pytest.mark.parametrize(("jobs", "words"), [
    ({}, "no pictures: give poses"),
    ([], "expected a mapping"),
    ({"poses": []}, "poses: expected one member or more, got an empty list"),
    ({"poses": "1", "views": []}, "views: expected one member or more"),
    ({"pictures": []}, "no pictures"),
    ({"pose": "1"}, "unknown key 'pose'; did you mean 'poses'"),
    ({"views": [0]}, "'poses' is missing: views go with poses"),
    ({"views": [0], "pictures": [{"pose": "1"}]}, "'poses' is missing"),
    ({"products": [{"views": [0]}]}, "products.0: the key 'poses' is missing"),
    ({"poses": ["happiness", "hapiness"]}, r"poses\.1: .*did you mean 'happiness'"),
    ({"poses": ["12F"]}, r"poses\.0: AU12F: intensity is A-E"),
    ({"poses": [None]}, r"poses\.0: expected an expression"),
    ({"poses": [{"jaw": {"opn": 3}}]}, r"poses\.0: .*did you mean 'open'"),
    ({"poses": [{"points": {"chim": [0, 1, 0]}}]}, r"poses\.0: .*'chim' is no feature point.*did you mean 'chin'"),
    ({"poses": [{"points": {"glabella": [0, 1, 0]}}], "faces": "akimoto-1986"}, r"poses\.0: .*no feature point"),
    ({"poses": ["gone.yaml"]}, r"poses\.0: .*no such file"),
    ({"poses": "1", "views": ["left"]}, r"views\.0: view: expected YAW,PITCH"),
    ({"poses": "1", "views": ["0,120"]}, r"views\.0: view: .*90 degrees"),
    ({"poses": "1", "views": [[1, 2, 3]]}, r"views\.0: view: expected two angles"),
    ({"poses": "1", "views": [None]}, r"views\.0: view: expected"),
    ({"poses": "1", "faces": ["akimoti"]}, r"faces\.0: unknown face 'akimoti'; did you mean 'akimoto'"),
    ({"poses": "1", "people": ["mikka"]}, r"people\.0: .*did you mean 'mika'"),
    ({"poses": "1", "people": [3]}, r"people\.0: expected a text"),
    ({"poses": "1", "lights": ["topp"]}, r"lights\.0: unknown light 'topp'; did you mean 'top'"),
    ({"poses": "1", "sizes": ["big"]}, r"sizes\.0: size: expected pixels"),
    ({"poses": "1", "sizes": [5000]}, r"sizes\.0: size: .*4096"),
    ({"poses": "1", "backgrounds": ["blueish"]}, r"backgrounds\.0: background: expected"),
    ({"poses": "1", "backgrounds": [[1, 2, 300]]}, r"backgrounds\.0: background: .*0\.\.255"),
    ({"poses": "1", "intensities": [1.5]}, r"intensities\.0: expected a number in 0\.\.1"),
    ({"poses": "1", "format": "gif"}, r"format: unknown format 'gif'"),
    ({"poses": "1", "detail": 4}, r"detail: expected a subdivision level, 0\.\.3"),
    ({"poses": "1", "renderer": "sofd"}, r"renderer: unknown renderer 'sofd'; did you mean 'soft'"),
    ({"poses": "1", "masks": "yes"}, r"masks: expected true or false"),
    ({"pictures": [{"view": 0}]}, r"pictures\.0: the key 'pose' is missing"),
    ({"pictures": [{"pose": "1", "veiw": 0}]}, r"pictures\.0: unknown key 'veiw'; did you mean 'view'"),
    ({"pictures": [{"pose": "1"}, {"pose": "1", "person": "brno"}]}, r"pictures\.1\.person: .*did you mean 'bruno'"),
    ({"random": {"count": 5}}, "random: the key 'seed' is missing"),
    ({"random": {"count": 5, "seed": 1}}, "random: give either poses"),
    ({"random": {"count": -1, "seed": 1, "poses": "1"}}, "random.count: expected a number of pictures"),
    ({"random": {"count": 0, "seed": 1, "poses": "1"}}, "no pictures"),
    ({"random": {"count": 5, "seed": 1, "poses": "1", "yaw": [30, -30]}}, "random.yaw: expected a range"),
    ({"random": {"count": 5, "seed": 1, "poses": "1", "yaw": [1, 2, 3]}}, "random.yaw: expected one number or a range"),
    ({"random": {"count": 5, "seed": 1, "units": {"99": 1}}}, "random.units.99: .*99"),
    ({"random": {"count": 5, "seed": 1, "units": {"6": [0, 2]}}}, r"random.units.6.1: expected a number in 0\.\.1"),
    ({"random": {"count": 5, "seed": 1, "units": {"6": 1}}}, "random.units: 3 units are to be combined"),
    ({"random": {"count": 5, "seed": 1, "units": {"6": 1, "together": 1.5}}}, "together: expected a range .*whole"),
    ({"random": {"count": 5_000_000, "seed": 1, "poses": "1"}}, "5,000,000 pictures are more than one batch"),
    ({"poses": [f"12={i / 2000}" for i in range(1, 2000)], "views": list(range(300)), "intensities": [0.5, 1]},
     "1,199,400 pictures are more than one batch may have .*shorten a list"),
])
def test_wrong_jobs(tmp_path, jobs, words):
    page = tmp_path / "jobs.json"
    page.write_text(json.dumps(jobs))
    with pytest.raises(TableError, match=r"jobs\.json: .*" + words):
        read_batch(page)


def test_a_count_is_said_before_anything_is_understood(monkeypatch):
    monkeypatch.setattr(spec, "resolve", lambda *_, **__: pytest.fail("work began"))
    with pytest.raises(TableError, match="more than one batch"):
        read_batch({"random": {"count": 10**9, "seed": 1, "poses": "1"}})


def test_no_file_and_no_jobs(tmp_path):
    with pytest.raises(FileError, match="no such file"):
        read_batch(tmp_path / "jobs.yaml")
    with pytest.raises(InputError, match="jobs: expected a file or a mapping, got int"):
        read_batch(3)
    (tmp_path / "jobs.yaml").write_text("poses: [a")
    with pytest.raises(TableError, match="not valid YAML"):
        read_batch(tmp_path / "jobs.yaml")


def test_a_renderer_that_is_not_installed(monkeypatch):
    monkeypatch.setattr("facegen.render.backends.find_spec", lambda name: None)
    with pytest.raises(TableError, match=r"jobs: renderer: .*facegen\[fast\]"):
        read_batch({"poses": "1", "renderer": "fast"})
    assert read_batch({"poses": "1"}).settings.renderer == "auto"      # settled by the amount of work

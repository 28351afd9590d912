import copy
import json
import shutil
from functools import cache

import numpy as np
import pytest

from facegen.data import meshes_dir
from facegen.errors import FileError, InputError, TableError
from facegen.face import loader
from facegen.face.face import load_face
from facegen.face.loader import read_face
from facegen.face.named import face_names
from facegen.facs.yamlfile import read_data

AKIMOTO = meshes_dir() / "akimoto"
FOLD = {"along": [[-13, -84, 20], [0, -82, 24], [13, -84, 20]], "width": 2, "depth": 1, "ridge": 1,
        "toward": [0, 1, 0]}
TONGUE = {"at": [0, -70, 10], "part": "tongue", "role": "input", "scale": "mouth"}


def small_face():
    """Return the face of fifteen points as data, with a fold and a point at the tongue, without hair."""
    data = read_data(meshes_dir() / "akimoto-1986" / "face.yaml")
    data["cage"] = str(AKIMOTO / "cage.obj")
    data["parts"] = [{**p, "file": str(AKIMOTO / p["file"].rsplit("/", 1)[1])} for p in data["parts"]
                     if p["part"] in ("eye_L", "teeth_lower", "tongue", "mouth", "brows")]
    data["folds"] = {"chin": FOLD}
    del data["landmarks"]       # they need both eyes; test_landmarks.py has them
    data["points"]["tongue_tip"] = TONGUE
    return data


SMALL = small_face()
PARTS = {p["part"]: i for i, p in enumerate(SMALL["parts"])}
GONE = object()


def altered(path, value):
    """Return the small face with the value at a path of keys replaced, added or taken away."""
    data = box = copy.deepcopy(SMALL)
    *way, last = path.split(".")
    for key in way:
        box = box[int(key) if isinstance(box, list) else key]
    last = int(last) if isinstance(box, list) else last
    if value is GONE:
        del box[last]
    else:
        box[last] = value
    return data


read_mesh = cache(loader.load_obj)


@pytest.fixture
def read(tmp_path, monkeypatch):
    """A function that writes data as a ``face.yaml`` (JSON is YAML) and reads it as a face."""
    monkeypatch.setattr(loader, "load_obj", read_mesh)      # the meshes stay the same: read them once

    def read(data):
        path = tmp_path / "face.yaml"
        path.write_text(data if isinstance(data, str) else json.dumps(data))
        return read_face(path)
    return read


# -- what is read ---------------------------------------------------------------------------------------
def test_the_shipped_faces():
    assert face_names() == ("akimoto", "akimoto-1986")
    for name in face_names():
        assert load_face(name).name == name
    assert load_face().name == "akimoto"


def test_a_face_elsewhere_loads_by_folder_and_by_file(tmp_path):
    folder = tmp_path / "mine"
    shutil.copytree(AKIMOTO, folder)
    file = folder / "face.yaml"
    text = file.read_text(encoding="utf-8")
    file.write_text(text.replace("name: akimoto", "name: mine", 1), encoding="utf-8")
    face = load_face(folder)
    assert face.name == "mine"
    for path in (str(folder), file, str(file)):
        assert load_face(path).name == "mine"
    np.testing.assert_array_equal(face.pose("12B", detail=1), load_face("akimoto").pose("12B", detail=1))


@pytest.mark.parametrize(("name", "words"), [
    ("akimotto", "did you mean 'akimoto'"),
    ("Akimoto1986", "did you mean 'akimoto-1986'"),
    ("no/folder", "expected one of akimoto, akimoto-1986 or the path of a face.yaml .*, got 'no/folder'$"),
    ("", "expected one of"),
])
def test_an_unknown_face_is_named_with_the_nearest(name, words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match=words):
        load_face(name)


def test_a_folder_without_a_face_is_refused(tmp_path):
    with pytest.raises(InputError, match="face: expected one of"):
        load_face(tmp_path)


def test_the_small_face_is_as_it_says(read):
    face = read(SMALL)
    assert face.name == SMALL["name"]
    assert face.point_names == tuple(SMALL["points"])
    at = dict(zip(face.point_names, face.deformer.points.tolist(), strict=True))
    assert at["tongue_tip"] == [0, -70, 10]
    assert at["chin"] == face.deformer.neutral[SMALL["points"]["chin"]["vertex"]].tolist()
    assert face.point_names[face.point_index["F4"]] == "chin"
    measures = SMALL["measures"]
    assert face.scales["lid"].tolist() == [measures[k] for k in SMALL["scales"]["lid"]]
    assert [tuple(face.point_names[i] for i in r.points) for r in face.regions] == \
        [tuple(r["points"]) for r in SMALL["regions"]]
    assert [r.rigid for r in face.regions] == [r.get("rigid", False) for r in SMALL["regions"]]
    takes = {n for n, yes in zip(face.point_names, face.takes_input, strict=True) if yes}
    assert takes == {n for n, p in SMALL["points"].items() if p["role"] == "input"}      # rule: points
    assert [a.mesh.parts for a in face.attachments] == [(name,) for name in PARTS]
    assert face.creases.tolist() == SMALL["creases"]
    assert list(face.folds) == ["chin"]
    share = face.deformer.weights.sum(axis=1)
    np.testing.assert_allclose(share[face.deformer.neutral[:, 2] > SMALL["centre_O"][2]], 1.0, atol=1e-6)
    for vertex, sources in SMALL["followers"].items():
        follow = sum(share * face.deformer.weights[[int(v)]].toarray() for v, share in sources.items())
        np.testing.assert_allclose(face.deformer.weights[[int(vertex)]].toarray(), follow, atol=1e-7)
    high, low = (np.array([SMALL["head"][k]]) for k in ("moves_above", "rests_below"))
    assert face.head_weight(np.concatenate([high, low, (high + low) / 2])).tolist() == [[1.0], [0.0], [0.5]]


def test_each_part_has_its_carrier(read):
    face = read(SMALL)
    part = {a.mesh.parts[0]: a for a in face.attachments}
    assert part["eye_L"].eye == 0
    np.testing.assert_array_equal(part["eye_L"].centre, SMALL["eyes"]["L"])
    assert (part["teeth_lower"].jaw == 1).all()
    assert part["brows"].skin.shape == (len(part["brows"].mesh.vertices), len(face.deformer.neutral))
    top, bottom = SMALL["parts"][PARTS["mouth"]]["fades"]
    y, share = part["mouth"].mesh.vertices[:, 1], part["mouth"].jaw[:, 0]
    assert (share[y >= top] == 0).all()
    assert (share[y <= bottom] == 1).all()
    assert (np.diff(share[np.argsort(-y)]) >= 0).all()
    (row, weight), = part["tongue"].points
    assert face.point_names[row] == "tongue_tip"
    assert (np.diff(weight[np.argsort(part["tongue"].mesh.vertices[:, 2]), 0]) >= 0).all()
    assert weight.min() == 0
    assert weight.max() == 1


@pytest.mark.parametrize("key", ["eyes", "lids"])
def test_left_is_left_in_whatever_order_the_sides_are_given(read, key):
    data, expected = copy.deepcopy(SMALL), read(SMALL)
    data[key] = dict(reversed(data[key].items()))
    face = read(data)
    np.testing.assert_array_equal(face.eye_centres, expected.eye_centres)
    assert face.eye_centres[0, 0] > 0 > face.eye_centres[1, 0]
    for lid, other in zip(face.deformer.lids, expected.deformer.lids, strict=True):
        np.testing.assert_array_equal(lid.columns, other.columns)
        np.testing.assert_array_equal(lid.centre, other.centre)
    for rim, other in zip(face.lid_rims + face.lid_skin, expected.lid_rims + expected.lid_skin, strict=True):
        np.testing.assert_array_equal(rim, other)
    assert face.attachments[0].eye == 0


@pytest.mark.parametrize("key", ["sheets", "followers", "creases", "corners", "folds", "lid_follow",
                                 "head_half_height"])
def test_what_is_optional_may_be_missing(read, key):
    data = altered(key, GONE)
    for region in data["regions"]:
        if key == "sheets":
            region.pop("sheet", None)
    face = read(data)
    if key == "head_half_height":
        assert face.head_half_height == np.ptp(face.deformer.neutral[:, 1]) / 2
    elif key == "lid_follow":
        assert not face.lid_follow.any()


def test_a_face_may_have_no_parts(read):
    data = altered("parts", [])
    del data["points"]["tongue_tip"]
    assert read(data).attachments == ()


# -- what is refused: path of keys, value there, words of the message -----------------------------------
WRONG = [
    ("pionts", {}, "unknown key 'pionts'; did you mean 'points'"),
    ("points", GONE, "the key 'points' is missing"),
    ("name", 12, "name: expected a text, got 12"),
    ("source", "", "source: expected a text"),
    ("cage", ["cage.obj"], "cage: expected a text"),
    ("centre_O", [0, 0], r"centre_O: expected three numbers \[x, y, z\]"),
    ("centre_O", [0, 0, "front"], "centre_O.2: expected a number, got 'front'"),
    ("centre_O", [0, 0, float("inf")], "centre_O.2: expected a"),
    ("centre_O", [0, 0, 1e9], "centre_O.2: expected a number in"),
    ("measures", [1], r"measures: expected a mapping"),
    ("measures.eye_nose", 0, "measures.eye_nose: expected a number in"),
    ("measures.eye_nose", "wide", "measures.eye_nose: expected a number"),
    ("scales.mouth.1", "mouth_nos", "scales.mouth.1: unknown measure 'mouth_nos'; did you mean 'mouth_nose'"),
    ("scales.lid", ["eye_nose"], "scales.lid: expected three measures"),
    ("scales.lid", "eye_nose", "scales.lid: expected a list"),
    ("scales.mouth", GONE, "scales: the key 'mouth' is missing"),
    ("points", {}, "regions.0.points.0: unknown feature point"),
    ("points.chin", 113, "points.chin: expected a mapping"),
    ("points.chin.vertex", 99999, r"chin.vertex: expected a vertex of .*cage.obj, 0\.\.\d+, got 99999"),
    ("points.chin.vertex", -1, "points.chin.vertex: expected a vertex"),
    ("points.chin.vertex", 1.5, "points.chin.vertex: expected a vertex"),
    ("points.chin.vertex", "low", "points.chin.vertex: expected a number"),
    ("points.chin.vertex", True, "points.chin.vertex: expected a number"),
    ("points.chin.vertex", GONE, "points.chin: a feature point needs either vertex or at"),
    ("points.chin.at", [0, 0, 0], "points.chin: a feature point needs either vertex or at"),
    ("points.tongue_tip.at", [0, 0], "points.tongue_tip.at: expected three numbers"),
    ("points.chin.role", "jaws", "points.chin.role: unknown role 'jaws'; did you mean 'jaw'"),
    ("points.chin.role", GONE, "points.chin: the key 'role' is missing"),
    ("points.chin.rolle", "jaw", "points.chin: unknown key 'rolle'; did you mean 'role'"),
    ("points.chin.scale", "mouht", "points.chin.scale: unknown scale 'mouht'; did you mean 'mouth'"),
    ("points.chin.jaw", 1.5, r"points.chin.jaw: expected a number in 0\.\.1"),
    ("points.chin.paper", 4, "points.chin.paper: expected a text"),
    ("points.chin.paper", "F3", "points.chin.paper: 'F3' is given to two feature points"),
    ("points.chin.part", "tongue", "points.tongue_tip.part: 'tongue' is given to two feature points"),
    ("points.chin.reach", 20, "points.chin.reach: only the pull on a part has a reach; give part"),
    ("points.tongue_tip.reach", 0, "points.tongue_tip.reach: expected a number"),
    ("points.tongue_tip.part", "tonge", "tongue_tip.part: unknown part 'tonge'; did you mean 'tongue'"),
    ("regions", [], "regions: expected one region or more"),
    ("regions", {}, "regions: expected a list"),
    ("regions.0", ["chin", "neck"], "regions.0: expected a mapping"),
    ("regions.0.points.1", "neckk", "regions.0.points.1: unknown feature point 'neckk'; did you mean 'neck'"),
    ("regions.0.points.1", "chin", "regions.0: a region is bounded by exactly three"),
    ("regions.0.points", ["chin", "neck"], "regions.0: a region is bounded by exactly three"),
    ("regions.0.points", ["chin", "neck", "cheek_L", "cheek_R"], "regions.0: a region is bounded by exactly"),
    ("regions.0.rigid", "yes", "regions.0.rigid: expected true or false"),
    ("regions.0.number", "one", "regions.0.number: expected a number"),
    ("regions.1.sheet", "mouth_uper", "1.sheet: unknown sheet 'mouth_uper'; did you mean 'mouth_upper'"),
    ("regions.0.name", "chin", "regions.0: unknown key 'name'"),
    ("sheets.mouth_upper", 30, "sheets.mouth_upper: expected a list"),
    ("sheets.mouth_upper.0", 99999, "sheets.mouth_upper.0: expected a vertex"),
    ("sheets.mouth_lower.0", 30, "sheets.mouth_lower: vertex 30 is already of the sheet 'mouth_upper'"),
    ("followers.lip", {"0": 1.0}, "followers.lip: expected a number, got 'lip'"),
    ("followers.99999", {"0": 1.0}, "followers.99999: expected a vertex"),
    ("followers.²", {"0": 1.0}, "followers.²: expected a number"),
    ("followers." + "9" * 500, {"0": 1.0}, "expected a number, got '999"),
    ("followers.160", {"x": 1.0}, "followers.160.x: expected a number, got 'x'"),
    ("followers.160", {"0": 2.0}, r"followers.160.0: expected a number in 0\.\.1"),
    ("followers.160", {}, "followers.160: expected shares that sum to one"),
    ("followers.160", {"0": 0.5, "3": 0.4}, "followers.160: expected shares that sum to one"),
    ("followers.160", [0], "followers.160: expected a mapping"),
    ("creases.0", [0, 3, 6], "creases.0: expected two vertices"),
    ("creases.0", 3, "creases.0: expected a list"),
    ("creases.0", [0, 99999], "creases.0.1: expected a vertex"),
    ("creases.1", [0, 300], "creases.1: expected two vertices that share an edge of the cage"),
    ("creases.1", [3, 3], "creases.1: expected two vertices that share an edge of the cage"),
    ("corners", 3, "corners: expected a list"),
    ("corners.0", -1, "corners.0: expected a vertex"),
    ("jaw.rule", "point", "jaw.rule: unknown rule 'point'; did you mean 'points'"),
    ("jaw.hinge", None, r"jaw.hinge: expected three numbers \[x, y, z\], got nothing"),
    ("jaw.glide", GONE, "jaw: the key 'glide' is missing"),
    ("jaw.open", 3, "jaw: unknown key 'open'"),
    ("eyes.L", GONE, "eyes: the key 'L' is missing"),
    ("eyes.M", [0, 0, 0], "eyes: unknown key 'M'"),
    ("eyes.L", [28.9], "eyes.L: expected three numbers"),
    ("lids.R", GONE, "lids: the key 'R' is missing"),
    ("lids.L.rims", GONE, "lids.L: the key 'rims' is missing"),
    ("lids.L.colums", [], "lids.L: unknown key 'colums'; did you mean 'columns'"),
    ("lids.L.columns", [], "lids.L.columns: expected one column or more"),
    ("lids.L.columns.1", [6], r"lids.L.columns.1: expected two vertices \[upper, lower\]"),
    ("lids.L.columns.1", [6, 24, 9], "lids.L.columns.1: expected two vertices"),
    ("lids.L.columns.1", [6, 99999], "lids.L.columns.1.1: expected a vertex"),
    ("lids.L.movers", [], "lids.L.movers: expected one mover or more"),
    ("lids.L.movers.2", [4, 0, "upper"], r"movers.2: expected \[vertex, column, upper or lower, share\]"),
    ("lids.L.movers.2", [4, 0, "uper", 1], "lids.L.movers.2.2: unknown lid 'uper'; did you mean 'upper'"),
    ("lids.L.movers.2", [4, 0, "upper", 1, 2], "lids.L.movers.2: expected"),
    ("lids.L.movers.2", [99999, 0, "upper", 1], "lids.L.movers.2.0: expected a vertex"),
    ("lids.L.movers.2", [4, 99, "upper", 1], r"movers.2.1: expected a column of the lid, 0\.\.\d, got 99"),
    ("lids.L.movers.2", [4, 0.5, "upper", 1], "lids.L.movers.2.1: expected a column of the lid"),
    ("lids.L.movers.2", [4, 0, "upper", 2], r"lids.L.movers.2.3: expected a number in -1\.\.1"),
    ("lids.L.rims.0", "x", "lids.L.rims.0: expected a number"),
    ("lids.L.skin", 7, "lids.L.skin: expected a list"),
    ("lid_follow.down", 0.1, "lid_follow.down: expected a list"),
    ("lid_follow.down", [0.1], "lid_follow.down: expected two numbers"),
    ("lid_follow.up", ["a", 0], "lid_follow.up.0: expected a number"),
    ("lid_follow.up", GONE, "lid_follow: the key 'up' is missing"),
    ("head.pivot", [0, 0, 0, 0], "head.pivot: expected three numbers"),
    ("head.moves_above", GONE, "head: the key 'moves_above' is missing"),
    ("head.rests_below", SMALL["head"]["moves_above"], "head.rests_below: expected another place than"),
    ("head_half_height", 0, "head_half_height: expected a number in"),
    ("head_half_height", "tall", "head_half_height: expected a number"),
    ("parts", {}, "parts: expected a list"),
    ("parts.0", "eye_L", "parts.0: expected a mapping"),
    ("parts.0.file", GONE, "parts.0: the key 'file' is missing"),
    ("parts.0.part", "eye_l", "parts.0.part: unknown object of .*parts.obj 'eye_l'; did you mean 'eye_L'"),
    ("parts.0.eye", "M", "parts.0.eye: unknown eye 'M'"),
    ("parts.0.eye", GONE, "parts.0: a part carried by an eye needs eye: L or R"),
    ("parts.0.carried_by", "skul", "parts.0.carried_by: unknown carrier 'skul'; did you mean 'skull'"),
    ("parts.0.colour", "red", "parts.0: unknown key 'colour'"),
    (f"parts.{PARTS['mouth']}.fades", GONE, "a part carried by the mouth needs fades"),
    (f"parts.{PARTS['mouth']}.fades", [-52], "fades: expected two heights"),
    (f"parts.{PARTS['mouth']}.fades", [-52, -52], "fades: expected two heights .top, bottom., the top first"),
    (f"parts.{PARTS['mouth']}.fades", [-80, -52], "fades: expected two heights .top, bottom., the top first"),
    (f"parts.{PARTS['mouth']}.fades", ["a", "b"], "fades.0: expected a number"),
    ("folds", [], "folds: expected a mapping"),
    ("folds.chin.widht", 2, "folds.chin: unknown key 'widht'; did you mean 'width'"),
    ("folds.chin.toward", GONE, "folds.chin: the key 'toward' is missing"),
    ("folds.chin.along", [[0, 0, 0]], "folds.chin.along: expected two places or more"),
    ("folds.chin.along", [], "folds.chin.along: expected two places or more"),
    ("folds.chin.along", [[0, 0, 0], [0, 0, 0], [1, 0, 0]], "folds.chin.along: expected .*, each other than"),
    ("folds.chin.along.1", [0, 0], "folds.chin.along.1: expected three numbers"),
    ("folds.chin.width", 0, "folds.chin.width: expected a number in"),
    ("folds.chin.depth", "deep", "folds.chin.depth: expected a number"),
    ("folds.chin.toward", "up", "folds.chin.toward: expected three numbers"),
]


@pytest.mark.parametrize(("path", "value", "words"), WRONG, ids=[w[0][:40] for w in WRONG])
def test_what_is_wrong_is_named_with_file_and_key(read, path, value, words):
    with pytest.raises(TableError, match=r"face\.yaml: .*" + words):
        read(altered(path, value))


INNER = ["jaw.hinge", "lids.L", "lids.L.movers", "lids.L.movers.0", "points.chin", "regions.0",
         "regions.0.points", "parts.0", "folds.chin", "folds.chin.along",
         "scales.mouth", "followers.160", "head.pivot"]


@pytest.mark.parametrize("path", [*SMALL, *INNER])
@pytest.mark.parametrize("value", [None, True, -3.5, "text", [None], {"a": 1}], ids=repr)
def test_no_value_of_another_kind_gets_through_as_a_raw_error(read, path, value):
    if path in ("name", "source") and value == "text":
        return
    with pytest.raises((TableError, FileError), match=r"face\.yaml: |^mesh: "):
        read(altered(path, value))


@pytest.mark.parametrize(("text", "words"), [
    ("", "expected a mapping .key: value., got nothing"),
    ("- a\n- b", "expected a mapping"),
    ("name: [a", "not valid YAML"),
    ("name: a\nname: b", "the key 'name' is given twice"),
    ("name: a", "the key 'source' is missing"),
])
def test_a_file_that_is_no_face(read, text, words):
    with pytest.raises(TableError, match=r"face\.yaml: .*" + words):
        read(text)


@pytest.mark.parametrize(("path", "file"), [("cage", "cagge.obj"), ("parts.0.file", "prats.obj"),
                                            ("cage", ".")])
def test_a_mesh_that_is_missing_is_named(read, path, file):
    with pytest.raises(FileError, match=file):
        read(altered(path, file))


def test_a_mesh_that_is_broken_is_named_with_its_line(read, tmp_path):
    (tmp_path / "broken.obj").write_text("v 0 0 0\nf 1 2 3\n")
    for path in ("cage", "parts.0.file"):
        with pytest.raises(FileError, match=r"broken\.obj, line 2"):
            read(altered(path, "broken.obj"))


def test_a_face_yaml_that_is_missing_is_named(tmp_path):
    with pytest.raises(FileError, match=r"face\.yaml: there is no such file"):
        read_face(tmp_path / "face.yaml")

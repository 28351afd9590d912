"""Scripts: what they mean, and an error that names the place for each wrong one."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import facegen
from facegen.animation.script import load_clip
from facegen.animation.timing import load_timing, read_timing
from facegen.data import tables_dir
from facegen.facs.yamlfile import read_data

SAMPLE = Path(__file__).parents[2] / "examples" / "greeting.yaml"


def test_the_sample(tmp_path):
    clip = load_clip(SAMPLE)
    assert clip.duration == 4
    assert clip.idle.seed == 7
    assert not clip.idle.glances                        # the script moves the eyes
    assert clip.warnings == ()
    assert clip.units_at(2.2)["12"] == 0.8
    assert clip.units_at(0.375 + 0.01)["45"] == 1
    assert clip.units_at(0.0)["54"] == pytest.approx(0.6, abs=0.05)
    same = tmp_path / "same.json"
    same.write_text(json.dumps(read_data(SAMPLE)))
    assert load_clip(same) == clip == load_clip(read_data(SAMPLE)) == load_clip(str(SAMPLE))


def test_defaults_come_from_the_timing_table():
    kinds = load_timing().kinds
    clip = load_clip({"events": [{"at": 0, "pose": "happiness"}, {"at": 0, "pose": "joy"}, {"at": 0, "pose": "fear"},
                                 {"at": 0, "pose": "surprise"}, {"at": 0, "pose": "12C"}, {"at": 0, "kind": "blink"},
                                 {"at": 0, "pose": "fear", "kind": "micro"},
                                 {"at": 0, "kind": "polite_smile", "apex": 2, "ease": "linear"},
                                 {"at": 0, "kind": "nod", "head": {"yaw": 3}}]})
    events = clip.tracks[0].events
    names = ("spontaneous_smile", "spontaneous_smile", "expression", "surprise", "expression", "blink", "micro")
    for event, name in zip(events, names, strict=False):
        kind = kinds[name]
        assert (event.onset, event.apex, event.offset) == (kind.onset, kind.apex, kind.offset), name
        assert event.offset_ease == kind.offset_ease
    assert events[5].pose.atoms == {"L45": 1.0, "R45": 1.0}
    assert (events[7].onset, events[7].apex, events[7].onset_ease) == (0.3, 2, "linear")
    assert events[8].pose.atoms == {"51": 0.1}          # what is written goes before the kind's own pose
    assert kinds["spontaneous_smile"].onset > kinds["posed_smile"].onset
    assert kinds["blink"].onset < kinds["blink"].offset
    assert kinds["micro"].onset + kinds["micro"].apex + kinds["micro"].offset <= 0.5


def test_people_intensity_and_files(tmp_path):
    (tmp_path / "raw.yaml").write_text("jaw: {open: 10}\n")
    (tmp_path / "me.yaml").write_text("about: me\nsource: invented\nadds: {hm: {units: '14C', about: Hm.}}\n")
    script = tmp_path / "clip.yaml"
    script.write_text("person: me.yaml\nintensity: 0.5\nkeyframes:\n  - {t: 0, pose: hm}\n  - {t: 1, pose: raw.yaml}\n"
                      "  - {t: 2, pose: smile, intensity: 0.5}\n  - {t: 3, pose: {AU12: 0.4}}\n  - {t: 4, pose: 12}\n")
    clip = load_clip(script)
    assert clip.units_at(0) == {"14": 0.25}
    assert clip.at(1).deformation == facegen.Deformation(jaw={"open": 5})
    assert clip.units_at(2) == facegen.resolve("smile", intensity=0.25).units
    assert clip.units_at(3) == {"12": 0.2}
    assert clip.units_at(4) == {"12": 0.4}
    assert load_clip({"keyframes": [{"t": 1, "pose": "smile"}], "person": "bruno"}, person="mika").units_at(1) \
        == facegen.resolve("smile", person="mika").units


def test_idle():
    one = {"keyframes": [{"t": 1, "pose": "smile"}]}
    assert load_clip(one).idle is None
    assert load_clip({**one, "idle": 3}).idle.seed == 3
    assert load_clip({**one, "idle": {"seed": 3, "gaze": False}}, idle=5).idle.seed == 5
    assert not load_clip({**one, "idle": {"seed": 3, "gaze": False}}).idle.gaze
    assert load_clip({**one, "idle": 3}).idle.glances
    assert load_clip({"idle": 1, "duration": 2}).tracks == ()


def test_warnings_are_kept():
    assert "work against each other" in load_clip({"keyframes": [{"t": 1, "pose": "18+20"}]}).warnings[0]


KEYS = [{"t": 0, "pose": "0"}, {"t": 1, "pose": "12"}]


@pytest.mark.parametrize(("script", "place", "words"), [
    ({}, "clip:", "nothing happens"),
    ([], "", "script: expected"),
    ({"keyframe": KEYS}, "clip:", "did you mean 'keyframes'"),
    ({"keyframes": []}, "keyframes:", "something in it"),
    ({"keyframes": 3}, "keyframes:", "a list"),
    ({"keyframes": [{"t": 0, "pose": "0"}]}, "clip:", "a clip of 0 seconds"),
    ({"keyframes": KEYS[::-1]}, "keyframes.1.t:", "order of time"),
    ({"keyframes": [KEYS[1], KEYS[1]]}, "keyframes.1.t:", "ease: step"),
    ({"keyframes": [{"t": -1, "pose": "0"}]}, "keyframes.0.t:", "0..86400"),
    ({"keyframes": [{"t": float("nan"), "pose": "0"}]}, "keyframes.0.t:", "finite"),
    ({"keyframes": [{"t": "soon", "pose": "0"}]}, "keyframes.0.t:", "a number"),
    ({"keyframes": [{"pose": "0"}]}, "keyframes.0:", "'t' is missing"),
    ({"keyframes": [{"t": 1}]}, "keyframes.0:", "nothing to show"),
    ({"keyframes": [{"t": 1, "pose": "hapiness"}]}, "keyframes.0.pose:", "did you mean 'happiness'"),
    ({"keyframes": [{"t": 1, "pose": "12F"}]}, "keyframes.0.pose:", "A-E"),
    ({"keyframes": [{"t": 1, "pose": "nowhere.yaml"}]}, "keyframes.0.pose:", "no such file"),
    ({"keyframes": [{"t": 1, "pose": None}]}, "keyframes.0.pose:", "got NoneType"),
    ({"keyframes": [{"t": 1, "pose": "12", "ease": "min_jrek"}]}, "keyframes.0.ease:", "did you mean 'min_jerk'"),
    ({"keyframes": [{"t": 1, "pose": "12", "intensity": 2}]}, "keyframes.0.intensity:", "0..1"),
    ({"keyframes": [{"t": 1, "head": {"yaw": 2}, "intensity": 1}]}, "keyframes.0.intensity:", "degrees"),
    ({"keyframes": [{"t": 1, "head": {"yaw": 80}}]}, "keyframes.0.head:", "-30..30"),
    ({"keyframes": [{"t": 1, "eyes": {"jaw": 8}}]}, "keyframes.0.eyes:", "did you mean 'yaw'"),
    ({"keyframes": [{"t": 1, "pose": "51A", "head": {"yaw": 9}}]}, "keyframes.0:", "given twice"),
    ({"events": [{"pose": "12"}]}, "events.0:", "'at' is missing"),
    ({"events": [{"at": 0}]}, "events.0:", "nothing to show"),
    ({"events": [{"at": 0, "kind": "blnik"}]}, "events.0.kind:", "did you mean 'blink'"),
    ({"events": [{"at": 0, "pose": "12", "onset": -0.1}]}, "events.0.onset:", "0..86400"),
    ({"events": [{"at": 0, "pose": "12", "apex": float("inf")}]}, "events.0.apex:", "finite"),
    ({"events": [{"at": 0, "pose": "12", "onset": 0, "apex": 0, "offset": 0}]}, "events.0:", "takes time"),
    ({"tracks": [{"keyframes": KEYS, "events": []}]}, "tracks.0:", "either keyframes or events"),
    ({"tracks": [{"name": "x"}]}, "tracks.0:", "either keyframes or events"),
    ({"tracks": [{"keyframes": KEYS, "replace": "everything"}]}, "tracks.0.replace:", "24+25+26"),
    ({"tracks": [{"keyframes": KEYS, "replace": "0"}]}, "tracks.0.replace:", "24+25+26"),
    ({"keyframes": KEYS, "duration": 0}, "duration:", "above 0"),
    ({"keyframes": KEYS, "duration": -2}, "duration:", "0..86400"),
    ({"keyframes": KEYS, "duration": 0.5}, "duration:", "begins at 1 s"),
    ({"keyframes": KEYS, "duration": 1e9}, "duration:", "0..86400"),
    ({"keyframes": KEYS, "person": "mikka"}, "person:", "did you mean 'mika'"),
    ({"keyframes": KEYS, "idle": "yes"}, "idle:", "a number"),
    ({"keyframes": KEYS, "idle": 1.5}, "idle:", "whole number"),
    ({"keyframes": KEYS, "idle": {"seed": 1, "blinks": True}}, "idle:", "did you mean 'blink'"),
    ({"idle": 1}, "clip:", "0 seconds"),
])
def test_wrong_scripts(script, place, words):
    with pytest.raises(facegen.InputError) as caught:
        load_clip(script)
    assert place in str(caught.value)
    assert words in str(caught.value)


def test_a_wrong_file_is_named(tmp_path):
    path = tmp_path / "clip.yaml"
    path.write_text("keyframes:\n  - {t: 1, pose: hapiness}\n")
    with pytest.raises(facegen.TableError, match=r"clip\.yaml: keyframes\.0\.pose: unknown expression 'hapiness'"):
        load_clip(path)
    with pytest.raises(facegen.FileError, match="no such file"):
        load_clip(tmp_path / "none.yaml")
    path.write_text("keyframes: [\n")
    with pytest.raises(facegen.TableError, match="not valid YAML"):
        load_clip(path)


KEY = st.sampled_from(["about", "duration", "person", "intensity", "idle", "keyframes", "events", "tracks", "t", "at",
                       "pose", "head", "eyes", "ease", "kind", "onset", "apex", "offset", "replace", "name", "yaw",
                       "seed", "blink", "jaw", "open", "12", "x"])
LEAF = st.one_of(st.none(), st.booleans(), st.integers(-3, 9), st.floats(), st.text(max_size=6), st.sampled_from(
    ["12", "6C+12D", "happiness", "0", "all", "blink", "min_jerk", "mika", "a.yaml", "51E", "45"]))
NODE = st.recursive(LEAF, lambda inner: st.one_of(st.lists(inner, max_size=4), st.dictionaries(KEY, inner, max_size=5)),
                    max_leaves=25)
KEYFRAME = st.fixed_dictionaries({"t": st.one_of(st.floats(0, 5), LEAF)}, optional={
    "pose": NODE, "ease": LEAF, "head": NODE, "eyes": NODE, "intensity": LEAF})
EVENT = st.fixed_dictionaries({"at": st.one_of(st.floats(0, 5), LEAF)}, optional={
    "pose": NODE, "kind": LEAF, "onset": LEAF, "apex": LEAF, "offset": LEAF, "ease": LEAF, "head": NODE})
TRACK = st.fixed_dictionaries({}, optional={"keyframes": st.lists(KEYFRAME, max_size=3), "replace": LEAF, "name": LEAF,
                                            "events": st.lists(EVENT, max_size=3)})
SCRIPT = st.one_of(st.dictionaries(KEY, NODE, max_size=6), st.fixed_dictionaries({}, optional={
    "keyframes": st.lists(KEYFRAME, max_size=3), "events": st.lists(EVENT, max_size=3), "duration": LEAF,
    "tracks": st.lists(TRACK, max_size=2), "idle": LEAF, "person": LEAF, "intensity": LEAF}))


@settings(max_examples=400, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(SCRIPT)
def test_any_data_make_a_clip_or_an_error_of_ours(script):
    try:
        clip = load_clip(script)
    except facegen.FacegenError:
        return
    for t in (0.0, clip.duration / 3, clip.duration):
        assert all(0 < weight <= 1 for weight in clip.at(t).units.values())


def _table(tmp_path, change):
    data = read_data(tables_dir() / "timing.yaml")
    change(data)
    path = tmp_path / "timing.json"
    path.write_text(json.dumps(data))
    return path


@pytest.mark.parametrize(("change", "words"), [
    (lambda d: d["kinds"].pop("expression"), "kinds: the kind 'expression' is missing"),
    (lambda d: d["kinds"]["nod"].update(onset=-1), "kinds.nod.onset"),
    (lambda d: d["kinds"]["nod"].update(onset=0, offset=0), "kinds.nod: expected an event that takes time"),
    (lambda d: d["kinds"]["nod"].update(pose="noddd"), "kinds.nod.pose: what: unknown expression"),
    (lambda d: d["kinds"]["nod"].update({"for": ["hapiness"]}), "did you mean 'happiness'"),
    (lambda d: d["kinds"]["nod"].update(source="me"), "kinds.nod.source"),
    (lambda d: d["kinds"]["nod"].update(onset_ease="slow"), "kinds.nod.onset_ease"),
    (lambda d: d["idle"]["gaze"].update(hold=[2, 1]), "idle.gaze.hold: expected a range"),
    (lambda d: d["idle"].pop("head"), "idle: the key 'head' is missing"),
])
def test_wrong_tables(tmp_path, change, words):
    with pytest.raises(facegen.TableError) as caught:
        read_timing(_table(tmp_path, change))
    assert words in str(caught.value)


RAW = {"jaw": {"open": 10.0}}


def test_raw_movements_lie_on_top_of_a_pose():
    clip = load_clip({"keyframes": [{"t": 0, "pose": "0"}, {"t": 1, "pose": "12D", "raw": RAW, "intensity": 0.5}]})
    face = facegen.load_face()
    units = facegen.resolve("12D", intensity=0.5)
    expected = face.pose(dataclasses.replace(units, more=(facegen.Deformation(jaw={"open": 5.0}),)))
    assert face.pose(clip.at(1.0)) == pytest.approx(expected)
    alone = load_clip({"events": [{"at": 0, "raw": RAW, "onset": 0.1, "apex": 1}]})
    assert face.pose(alone.at(0.5)) == pytest.approx(face.pose({"jaw": {"open": 10.0}}))
    with pytest.raises(facegen.TableError, match=r"keyframes.1.raw: the pose is raw data already"):
        load_clip({"keyframes": [{"t": 0, "pose": "0"}, {"t": 1, "pose": RAW, "raw": RAW}]})
    with pytest.raises(facegen.TableError, match=r"raw.jaw: unknown key 'opn'; did you mean 'open'"):
        load_clip({"keyframes": [{"t": 0, "pose": "0"}, {"t": 1, "raw": {"jaw": {"opn": 1}}}]})


@pytest.mark.parametrize(("script", "place"), [
    ({"keyframes": [{"t": 1, "pose": "face.yaml"}]}, "keyframes.0.pose"),
    ({"keyframes": [{"t": 1, "pose": "0"}], "person": "me.yaml"}, "person"),
    ({"keyframes": [{"t": 1, "pose": "0"}], "speech": "said.TextGrid"}, "speech"),
    ({"speech": {"timing": "said.tsv"}}, "speech.timing"),
    ({"speech": {"phonemes": "AA1", "sound": "said.wav"}}, "speech.sound"),
    ({"tracks": [{"replace": "face.yaml", "events": [{"at": 0, "kind": "blink"}]}]}, "tracks.0.replace")])
def test_a_strangers_script_opens_no_file(tmp_path, script, place):
    (tmp_path / "face.yaml").write_text("jaw: {open: 10}")
    path = tmp_path / "clip.json"
    path.write_text(json.dumps(script))
    with pytest.raises(facegen.TableError, match=rf"{place}: .*this script may name no files"):
        load_clip(path, files=False)

"""Edits of a clip's script: each gives a script that can be played, and leaves what it was given."""

import copy

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from facegen.animation.script import load_clip
from facegen.errors import InputError, TableError
from facegen.studio import script_text, timeline
from facegen.studio.timeline import NEW, NEW_LENGTH

SMILE = {"pose": "6C+12D"}


def keyed(*times):
    script = {}
    for t in times:
        script, _, _ = timeline.set_key(script, t, SMILE)
    return script


def times(script, track="keyframes"):
    found, = (one for one in timeline.tracks(script) if one.place == track)
    return [timeline.time_of(item) for item in found.items]


def test_a_clip_that_begins_with_one_key_lasts_some_seconds():
    script, track, index = timeline.set_key({}, 0.0, SMILE)
    assert (track, index) == ("keyframes", 0)
    assert timeline.read(script).duration == NEW_LENGTH


def test_a_key_beyond_the_end_makes_the_clip_longer():
    assert timeline.read(keyed(0.0, 7.25)).duration == 7.25


def test_a_key_at_the_time_of_another_takes_its_place_and_keeps_its_ease():
    script = timeline.change(keyed(0.0, 1.0), "keyframes", 1, ease="step")
    script, _, index = timeline.set_key(script, 1.0, {"pose": "anger"})
    assert script["keyframes"][1] == {"t": 1.0, "pose": "anger", "ease": "step"}
    assert index == 1


def test_a_moved_key_changes_places():
    script, _, index = timeline.move(keyed(0.0, 1.0, 2.0), "keyframes", 0, 1.5)
    assert index == 1
    assert times(script) == [1.0, 1.5, 2.0]


@pytest.mark.parametrize("edit", [timeline.move, timeline.duplicate])
def test_no_key_goes_where_another_stands(edit):
    with pytest.raises(InputError, match=r"another key stands at 1 s"):
        edit(keyed(0.0, 1.0), "keyframes", 0, 1.0)


def test_events_may_begin_together():
    script, _, _ = timeline.add_event(keyed(0.0), 1.0, {"kind": "blink"})
    script, _, index = timeline.add_event(script, 1.0, {"kind": "nod"})
    assert index == 1
    assert [one["kind"] for one in script["events"]] == ["blink", "nod"]


def test_events_last_as_long_as_the_clip_says():
    event = {"at": 1.0, "pose": "happiness", "apex": 0.5}
    _, onset, apex, end = timeline.event_times(event)
    clip = load_clip({"events": [event]})
    assert clip.duration == pytest.approx(end)
    made, = clip.tracks[0].events
    assert (made.at + made.onset, made.at + made.onset + made.apex) == pytest.approx((onset, apex))


def test_with_the_last_key_everything_goes():
    script = timeline.delete(keyed(1.0), "keyframes", 0)
    assert script == {}
    assert timeline.tracks(script) == ()


def test_a_new_track_comes_with_its_first_key_and_goes_with_its_last():
    script, track, _ = timeline.set_key(keyed(0.0, 1.0), 0.5, {"pose": "43E"}, NEW, name="lids")
    assert track == "tracks.0"
    assert [one.label for one in timeline.tracks(script)] == ["Keyframes", "lids"]
    script = timeline.set_track(script, track, name="eyes", replaces="45")
    assert script["tracks"] == [{"name": "eyes", "replace": "45", "keyframes": [{"t": 0.5, "pose": "43E"}]}]
    script = timeline.set_track(script, track, replaces="")
    assert "replace" not in script["tracks"][0]
    assert timeline.delete(script, track, 0) == keyed(0.0, 1.0)
    assert timeline.delete_track(script, track) == keyed(0.0, 1.0)


@pytest.mark.parametrize(("edit", "says"), [
    (lambda s: timeline.move(s, "keyframes", 9, 0.0), "there is no number 10"),
    (lambda s: timeline.delete(s, "tracks.3", 0), "there is no 'tracks.3'"),
    (lambda s: timeline.add_event(s, 0.0, {"kind": "blink"}, "keyframes"), "holds keyframes, no events"),
    (lambda s: timeline.set_track(s, "keyframes", name="x"), "no name of its own"),
    (lambda s: timeline.change({"speech": "hello"}, "speech", 0, pose="1D"), "speech has no keys"),
    (lambda s: timeline.set_key(s, -1.0, SMILE), "0..86400"),
    (lambda s: timeline.set_key(s, float("nan"), SMILE), "t: expected"),
    (lambda s: timeline.change(s, "keyframes", 0, kind="blink"), "unknown key 'kind'"),
    (lambda s: timeline.set_top(s, duration=-1.0), "0..86400"),
])
def test_what_cannot_be_is_told_and_nothing_changes(edit, says):
    script = keyed(0.0, 1.0)
    before = copy.deepcopy(script)
    with pytest.raises(InputError, match=says):
        edit(script)
    assert script == before


@pytest.mark.parametrize("script", [
    {"keyframes": [{"t": 1.0, "pose": "/etc/passwd.yaml"}]},
    {"keyframes": [{"t": 1.0, "pose": "../other/face.yaml"}]},
    {"tracks": [{"replace": "../x.yaml", "events": [{"at": 0.0, "kind": "blink"}]}]},
    {"person": "../ada.yaml", "idle": 1, "duration": 1},
    {"speech": "talk.TextGrid"},
    {"speech": {"timing": "/etc/passwd"}},
    {"speech": {"phonemes": "HH AH0", "sound": "/dev/zero"}},
])
def test_no_file_that_a_script_names_is_opened(script):
    with pytest.raises(TableError, match="may name no files"):
        timeline.read(script)


# -- laws -------------------------------------------------------------------------------------------------------
moments = st.integers(0, 20_000).map(lambda k: k / 1000)
poses = st.sampled_from(["0", "6C+12D", "happiness", "L1+R14A", "12=0.37"])
edits = st.lists(st.one_of(
    st.tuples(st.just("key"), moments, poses), st.tuples(st.just("new"), moments, poses),
    st.tuples(st.just("event"), moments, st.sampled_from(["blink", "nod", "wink"])),
    st.tuples(st.just("move"), st.integers(0, 9), moments), st.tuples(st.just("copy"), st.integers(0, 9), moments),
    st.tuples(st.just("delete"), st.integers(0, 9), st.none()),
    st.tuples(st.just("ease"), st.integers(0, 9), st.sampled_from(["linear", "step", None]))), max_size=12)


def edited(script, name, first, second):
    """One edit of a person; which key is meant is taken round."""
    if name in ("key", "new"):
        return timeline.set_key(script, first, {"pose": second}, NEW if name == "new" else "keyframes")[0]
    if name == "event":
        return timeline.add_event(script, first, {"kind": second})[0]
    found = [(one.place, k) for one in timeline.tracks(script) for k in range(len(one.items))]
    if not found:
        return script
    track, index = found[first % len(found)]
    if name == "delete":
        return timeline.delete(script, track, index)
    if name == "ease":
        return timeline.change(script, track, index, ease=second)
    return {"move": timeline.move, "copy": timeline.duplicate}[name](script, track, index, second)[0]


@settings(deadline=None, max_examples=40)
@given(edits)
def test_whatever_is_done_the_script_plays_and_its_text_is_the_same_script(steps):
    script = {}
    for step in steps:
        was, before = script, copy.deepcopy(script)
        try:
            script = edited(script, *step)
        except InputError as error:
            if "another key stands" not in str(error):
                raise
        else:
            assert was == before
        assert script_text.read(script_text.write(script)) == script
        if script:
            clip = timeline.read(script)
            for one in timeline.tracks(script):
                assert [timeline.time_of(item) for item in one.items] == sorted(map(timeline.time_of, one.items))
            assert clip.duration >= max(timeline.time_of(item) for one in timeline.tracks(script)
                                        for item in one.items) - 1e-9


@settings(deadline=None, max_examples=40)
@given(st.lists(moments, min_size=1, max_size=6, unique=True), poses)
def test_a_key_shows_what_was_keyed(ts, pose):
    script = {}
    for t in ts:
        script, _, _ = timeline.set_key(script, t, {"pose": pose})
    clip, expected = timeline.read(script), load_clip({"keyframes": [{"t": 1.0, "pose": pose}]}).units_at(1.0)
    for t in ts:
        assert clip.units_at(t) == pytest.approx(expected)


@settings(deadline=None, max_examples=60)
@given(st.recursive(st.none() | st.booleans() | st.floats(allow_nan=False) | st.text(max_size=5),
                    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(
                        st.sampled_from(["t", "at", "keyframes", "events", "tracks", "name", "duration", "x"]), inner,
                        max_size=4), max_leaves=12))
def test_no_data_at_all_are_more_than_refused(data):
    try:
        timeline.check_form(data)
    except TableError:
        return
    for one in timeline.tracks(data):                       # what passes can be listed and edited
        for item in one.items if one.kind != "speech" else ():
            assert timeline.time_of(item) >= 0.0


@pytest.mark.parametrize(("text", "says"), [("keyframes: [", "not valid YAML"), ("- 1", "expected a mapping"),
                                            ("a: &x 1", "anchors"), ("t: !!python/object:os.system 1", "tags")])
def test_a_text_that_is_no_script_says_why(text, says):
    with pytest.raises(TableError, match=says):
        script_text.read(text)


def test_more_keys_than_a_page_can_bear_are_refused_before_they_are_read(monkeypatch):
    """Seven thousand take five seconds, again with every change."""
    from facegen.studio.limits import Limits

    many = {"keyframes": [{"t": k, "pose": "12"} for k in range(3)],
            "tracks": [{"events": [{"at": k, "kind": "blink"} for k in range(2)]}]}
    monkeypatch.setattr(timeline, "LIMITS", Limits(items=5))
    timeline.check_form(many)
    monkeypatch.setattr(timeline, "LIMITS", Limits(items=4))
    with pytest.raises(TableError, match="has 5 keys and events, the timeline takes up to 4"):
        timeline.check_form(many)

"""What a clip shows at a time: keyframes, events, tracks over each other."""

from __future__ import annotations

import math
import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import facegen
from facegen.animation.clip import Clip, Event, Keyframe, Pose, Track
from facegen.animation.easing import EASES, eased
from facegen.animation.motion import MOST_FRAMES

SMILE = {"t": 1, "pose": "6C+12D"}
WEIGHTS = st.dictionaries(st.sampled_from(["1", "L2", "4", "12", "R14", "25", "43", "51", "61", "T23"]),
                          st.floats(0, 1), max_size=5)
SIDED = {"L2": "R2", "R14": "L14", "51": "52", "61": "62"}


def keyed(*weights, ease="min_jerk"):
    return {"keyframes": [{"t": k, "pose": dict(one), "ease": ease} if one else {"t": k, "pose": "0", "ease": ease}
                          for k, one in enumerate(weights)]}


def test_keyframes_are_hit_exactly_and_held_at_the_ends():
    clip = facegen.load_clip({"keyframes": [{"t": 0.5, "pose": "6C"}, SMILE, {"t": 3, "pose": "anger"}]})
    assert clip.duration == 3
    assert clip.units_at(0) == clip.units_at(0.5) == {"6": 0.5}
    assert clip.units_at(1) == facegen.parse("6C+12D")
    assert clip.units_at(3) == clip.units_at(99) == facegen.resolve("anger").units
    assert clip.at(3).deformation == facegen.resolve("anger").deformation


@given(st.lists(WEIGHTS, min_size=2, max_size=4), st.sampled_from(sorted(EASES)), st.floats(0, 3))
def test_weights_lie_between_those_of_the_keyframes(poses, ease, t):
    clip = facegen.load_clip(keyed(*poses, ease=ease))
    atoms = clip._mixed(t)[0]
    for atom, weight in atoms.items():
        around = [key.pose.atoms.get(atom, 0.0) for key in clip.tracks[0].keyframes]
        assert min(around) - 1e-12 <= weight <= min(1.0, max(around) + 1e-12)


@given(st.lists(WEIGHTS, min_size=2, max_size=3), st.floats(0, 2))
def test_a_mirrored_clip_gives_mirrored_weights(poses, t):
    clip = facegen.load_clip(keyed(*poses))
    swapped = [{SIDED.get(code, code): weight for code, weight in pose.items()} for pose in poses]
    assert clip.mirrored().units_at(t) == facegen.load_clip(keyed(*swapped)).units_at(t)
    assert clip.mirrored().mirrored() == clip


@pytest.mark.parametrize("ease", sorted(set(EASES) - {"step", "hold"}))
def test_nothing_jumps(ease):
    clip = facegen.load_clip({
        "keyframes": [{"t": 0, "pose": "0"}, {"t": 0.5, "pose": "happiness", "ease": ease}],
        "tracks": [{"replace": "all", "events": [{"at": 0.3, "pose": "surprise", "ease": ease}]},
                   {"replace": "25+26", "events": [{"at": 0.2 * k, "pose": "24D", "kind": "sound"} for k in range(4)]}],
        "idle": {"seed": 2, "gaze": False}, "duration": 2})
    rows = [clip._mixed(t)[0] for t in np.linspace(0, 2, 2001)]
    for atom in {atom for row in rows for atom in row}:
        steps = np.abs(np.diff([row.get(atom, 0.0) for row in rows]))
        assert steps.max() < 0.04, atom             # 1 ms; a blink's lids move 0.025


def test_tracks_add_and_end_at_one():
    clip = facegen.load_clip({"keyframes": [{"t": 0, "pose": {"12": 0.7}}, {"t": 1, "pose": {"12": 0.7}}],
                              "tracks": [{"keyframes": [{"t": 0, "pose": {"12": 0.2, "25": 0.5}},
                                                        {"t": 1, "pose": {"12": 1.0}}]}]})
    assert clip.units_at(0) == {"12": pytest.approx(0.9), "25": 0.5}
    assert clip.units_at(1) == {"12": 1.0}


def test_replace_all_and_replace_some():
    script = {"keyframes": [{"t": 0, "pose": "6C+12D+25D"}, {"t": 2, "pose": "6C+12D+25D"}]}
    event = {"at": 0.5, "pose": "24C", "onset": 0.5, "apex": 0.2, "offset": 0.3}
    whole = facegen.load_clip({**script, "tracks": [{"replace": "all", "events": [event]}]})
    some = facegen.load_clip({**script, "tracks": [{"replace": "25+26", "events": [event]}]})
    added = facegen.load_clip({**script, "events": [event]})
    for t in (1.0, 1.2):
        assert whole.units_at(t) == facegen.parse("24C")
        assert some.units_at(t) == facegen.parse("6C+12D+24C")
        assert added.units_at(t) == facegen.parse("6C+12D+24C+25D")
    for clip in (whole, some, added):
        assert clip.units_at(0.5) == clip.units_at(1.5 + 1e-9) == facegen.parse("6C+12D+25D")
    half = eased("min_jerk", 0.5)
    assert some.units_at(0.75)["25"] == pytest.approx(0.8 * (1 - half))
    assert some.units_at(0.75)["24"] == pytest.approx(0.5 * half)


def test_overlapping_events_hand_over():
    one, two = Event(0, Pose({"17": 1.0}), 0.2, 0.4, 0.2), Event(0.2, Pose({"17": 1.0}), 0.2, 0.4, 0.2)
    track = Track("sounds", events=(one, two))
    assert track.shares(0.4) == [(1.0, one.pose), (1.0, two.pose)]
    assert Clip((track,), 1.0).units_at(0.4) == {"17": 1.0}
    assert track.shares(2.0) == []


def test_a_blink_closes_over_a_smile_and_leaves_it_alone():
    smile = Event(0, Pose({"L12": 0.8, "R12": 0.8}), 0.2, 1.0, 0.2)
    blink, less = (Event(0.5, pose, 0.05, 0.05, 0.1) for pose in (Pose({"L45": 1.0, "R45": 1.0}), Pose({"L12": 0.4})))
    assert Clip((Track("one", events=(smile, blink)),), 2.0).units_at(0.57) == {"12": 0.8, "45": 1.0}
    assert Clip((Track("one", events=(smile, less)),), 2.0).units_at(0.57) == pytest.approx({"L12": 0.6, "R12": 0.8})


def test_the_example_blinks_and_nods_without_losing_its_smile():
    from pathlib import Path

    clip = facegen.load_clip(Path(__file__).parents[2] / "examples" / "greeting.yaml")
    frames = [clip.units_at(2.0 + k / 100) for k in range(130)]
    assert max(units.get("45", 0.0) for units in frames) == 1.0
    assert min(units.get("12", 0.0) for units in frames) == pytest.approx(max(units["12"] for units in frames))


def test_event_times():
    event = Event(1.0, Pose({"17": 1.0}), 0.5, 0.25, 1.0)
    assert event.end == 2.75
    assert [event.strength(t) for t in (0.99, 1.0, 1.5, 1.6, 1.75, 2.75, 3)] == [0, 0, 1, 1, 1, 0, 0]
    assert 0 < event.strength(1.25) < 1
    assert 0 < event.strength(2.0) < 1
    jump = Event(1.0, Pose({"17": 1.0}), 0.0, 0.5, 0.0)
    assert [jump.strength(t) for t in (0.99, 1.0, 1.5, 1.51)] == [0, 1, 1, 0]


def test_angles_are_units_and_opposite_turns_cancel():
    clip = facegen.load_clip({"keyframes": [{"t": 0, "head": {"yaw": 15, "pitch": -10}, "eyes": {"yaw": -5}},
                                            {"t": 1, "head": {"yaw": -15, "roll": 5}, "eyes": {"pitch": 10}}]})
    assert clip.units_at(0) == {"51": 0.5, "54": 0.5, "62": 0.2}
    assert clip.units_at(1) == {"52": 0.5, "55": 0.25, "63": 0.5}
    assert "51" not in clip.units_at(0.5)
    assert clip.at(0).deformation.head == {"yaw": 15, "pitch": -10}


def test_samples_agree_where_rates_meet():
    clip = facegen.load_clip({"keyframes": [{"t": 0, "pose": "0"}, SMILE], "idle": 4, "duration": 3})
    slow, fast = list(clip.sample(25)), list(clip.sample(50))
    assert (len(slow), len(fast)) == (75, 150)
    for one, other in zip(slow, fast[::2], strict=True):
        assert one.units == other.units
        assert one.deformation == other.deformation


def test_a_frame_goes_wherever_a_pose_goes():
    face = facegen.load_face("akimoto-1986")
    clip = facegen.load_clip({"keyframes": [{"t": 0, "pose": "0"}, {"t": 1, "pose": "happiness"}]})
    np.testing.assert_array_equal(face.pose(clip.at(1), detail=0), face.pose("happiness", detail=0))
    pixels = facegen.Renderer(face, size=32, detail=0).draw(clip.at(1))
    np.testing.assert_array_equal(pixels, facegen.Renderer(face, size=32, detail=0).draw("happiness"))


def test_raw_data_and_units_of_every_length_mix():
    face = facegen.load_face()
    clip = facegen.morph("happiness", "akimoto-1986-figure-8", {"units": "millimetre", "points": {"chin": [0, -2, 0]}},
                         {"jaw": {"open": 5}}, hold=0)
    for t, what in enumerate(("happiness", "akimoto-1986-figure-8",
                              {"units": "millimetre", "points": {"chin": [0, -2, 0]}}, {"jaw": {"open": 5}})):
        np.testing.assert_allclose(face.pose(clip.at(t), detail=0), face.pose(what, detail=0), atol=1e-12)
    rest = face.pose(detail=0)
    far = np.abs(face.pose("akimoto-1986-figure-8", detail=0) - rest).max()
    middle = face.pose(clip.at(1.5), detail=0)                  # paper's units and millimetres together
    assert 0.3 * far < np.abs(middle - rest).max() < far
    halves = {"points": {"chin": [0, -1, 0]}, "units": "millimetre"}
    together = facegen.Resolution("a", "deformation", "a", None, {}, facegen.resolve("akimoto-1986-figure-8",
                                  intensity=0.5).deformation, more=(facegen.resolve(halves).deformation,))
    np.testing.assert_allclose(middle, face.pose(together, detail=0), atol=1e-9)


def test_a_clip_travels():
    clip = facegen.load_clip({"keyframes": [SMILE, {"t": 2, "pose": {"jaw": {"open": 3}}}], "idle": 1})
    again = pickle.loads(pickle.dumps(clip))
    assert again == clip
    assert again.units_at(1.37) == clip.units_at(1.37)


def test_number_of_frames():
    clip = facegen.load_clip({"keyframes": [SMILE], "duration": 1.5})
    assert clip.frames(25) == 38
    assert clip.frames(30) == 45
    assert clip.frames(0.1) == 1
    assert clip.times(4) == [0, 0.25, 0.5, 0.75, 1.0, 1.25]


@pytest.mark.parametrize("fps", [0, -1, 0.05, 1001, math.nan, math.inf, "25", None, True])
def test_wrong_rates(fps):
    with pytest.raises(facegen.InputError, match=r"^fps: expected"):
        facegen.load_clip({"keyframes": [SMILE]}).frames(fps)


def test_too_many_frames_are_refused_with_the_limit():
    with pytest.raises(facegen.InputError, match=str(MOST_FRAMES)):
        facegen.load_clip({"keyframes": [SMILE], "duration": 80_000}).frames(1000)
    with pytest.raises(facegen.InputError, match="duration"):
        Clip((), 1e9)


@pytest.mark.parametrize("t", [math.nan, math.inf, "1", None, True])
def test_wrong_times(t):
    with pytest.raises(facegen.InputError, match=r"^t: expected a time"):
        facegen.load_clip({"keyframes": [SMILE]}).at(t)


@pytest.mark.parametrize("make", [
    lambda: Clip((), 0), lambda: Clip((), math.nan), lambda: Clip((), -1), lambda: Clip((), True),
    lambda: Keyframe(-1, Pose()), lambda: Keyframe(math.nan, Pose()), lambda: Keyframe(0, Pose(), "esae_in"),
    lambda: Event(0, Pose(), -1, 0, 0), lambda: Event(0, Pose(), 0, 0, 0), lambda: Event(0, Pose(), 1, 0, 0, "x"),
    lambda: Track("a"), lambda: Track("a", (Keyframe(0, Pose()),), (Event(0, Pose(), 1, 1, 1),)),
    lambda: Track("a", (Keyframe(1, Pose()), Keyframe(1, Pose()))),
])
def test_wrong_parts(make):
    with pytest.raises(facegen.InputError):
        make()


def test_morph_stops_at_its_poses():
    clip = facegen.morph("happiness", "anger", seconds=2, hold=1)
    assert clip.duration == 4
    for t, name in ((0, "happiness"), (1, "happiness"), (3, "anger"), (4, "anger")):
        assert clip.units_at(t) == facegen.resolve(name).units
    back = facegen.morph("happiness", "anger", seconds=2, hold=1, back=True)
    assert back.duration == 6
    assert back.units_at(6) == back.units_at(0)
    assert facegen.morph("smile", "0", person="mika").units_at(0) == facegen.resolve("smile", person="mika").units


@pytest.mark.parametrize(("poses", "options", "words"), [
    (["happiness"], {}, "two or more"),
    (["happiness", "angre"], {}, "did you mean 'angr"),
    (["0", "12"], {"seconds": 0}, "^seconds"),
    (["0", "12"], {"seconds": math.nan}, "^seconds"),
    (["0", "12"], {"hold": -1}, "^hold"),
    (["0", "12"], {"ease": "liner"}, "did you mean 'linear'"),
    (["0", "12"], {"idle": -1}, "^idle"),
    (["0", "12"], {"idle": 1.5}, "^idle"),
])
def test_wrong_morphs(poses, options, words):
    with pytest.raises(facegen.InputError, match=words):
        facegen.morph(*poses, **options)


@settings(max_examples=30)
@given(st.floats(0, 20), st.integers(0, 50))
def test_weights_of_all_layers_lie_in_range(t, seed):
    clip = facegen.load_clip({"duration": 20, "idle": seed, "events": [
        {"at": k, "pose": name} for k, name in enumerate(("fear", "surprise", "wink", "blink", "64E+51E+43E"))]})
    assert all(0 < weight <= 1 for weight in clip.units_at(t).values())

"""Laws of speech on the mouth: what must close closes, nothing opens beyond its target, nothing jumps."""

from __future__ import annotations

import math
import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from facegen.animation.clip import Clip, Event, Pose, Track
from facegen.animation.coarticulation import CHANNELS, JAW, SpeechTrack, performance_of
from facegen.animation.phonemes import Sound
from facegen.animation.speech import Speech, TimedSound, parts_of, speech_of
from facegen.animation.speech_table import load_speech_table
from facegen.blendshapes.recipes import shape_set
from facegen.errors import InputError
from facegen.face.face import load_face
from facegen.facs.expression_table import load_expressions
from facegen.facs.tables import load_units

TABLE = load_speech_table()
NAMES = tuple(shape_set("visemes"))
PHONES = sorted(TABLE.phonemes)
LIPS = ("", "_inner_L", "_side_L", "_inner_R", "_side_R")


def track(text, **options):
    return SpeechTrack("speech", speech_of(text), **options)


def middle(one):
    return (one.start + one.end) / 2


def gap(face, pose):
    """Return how far the lips are apart (k,), mm, at five places."""
    points = face.feature_point_places(face.pose(pose, detail=1), detail=1)
    return np.array([points[f"lip_upper{at}"][1] - points[f"lip_lower{at}"][1] for at in LIPS])


@pytest.fixture(scope="module")
def face():
    return load_face()


phrases = st.lists(st.tuples(st.sampled_from(PHONES), st.sampled_from([None, "primary", "none"]),
                             st.floats(0.03, 0.4)), min_size=1, max_size=8)


def phrase(drawn):
    """Return drawn sounds one after the other."""
    t, made = 0.3, []
    for name, stress, seconds in drawn:
        made.append(TimedSound(t, t + seconds, name, TABLE.phonemes[name], stress))
        t += seconds
    return Speech(tuple(made), t + 0.3)


@settings(deadline=None, max_examples=40)
@given(phrases)
def test_shares_are_a_mean_and_what_must_be_is_there(drawn):
    speech = phrase(drawn)
    one = SpeechTrack("s", speech)
    times = np.linspace(0, speech.duration, 40)
    for channel in CHANNELS:
        for t in times:
            _, shares = one._scores.near(CHANNELS.index(channel), t)
            assert (shares >= 0).all()
            assert math.isclose(shares.sum(), 1.0, abs_tol=1e-9)
    for k, sound in enumerate(speech.sounds):
        part, neighbours = TABLE.visemes[sound.phoneme.visemes[0]], speech.sounds[max(0, k - 1): k] + \
            speech.sounds[k + 1: k + 2]
        if "lips" in part.must and len(sound.phoneme.visemes) == 1 \
                and all(n.end - n.start > 0.06 for n in (sound, *neighbours)):
            t = (sound.start + sound.end) / 2
            assert math.isclose(one.weights([t])[1][0, NAMES.index(sound.phoneme.visemes[0])],
                                sound.phoneme.amount, abs_tol=1e-6)


@settings(deadline=None, max_examples=30)
@given(phrases, st.floats(0.0, 2.0))
def test_the_jaw_never_passes_what_its_sounds_ask(drawn, effort):
    speech = phrase(drawn)
    widest = max(shape_set("visemes")[name].weights.get(JAW, 0.0) * min(1.0, one.phoneme.amount * max(1.0, effort))
                 for one in speech.sounds for name in one.phoneme.visemes)
    clip = Clip((SpeechTrack("s", speech, effort),), speech.duration)
    for t in np.linspace(0, speech.duration, 30):
        units = clip.units_at(float(t))
        assert 0.0 <= units.get(JAW, 0.0) <= widest + 1e-12
        assert all(0.0 <= weight <= 1.0 for weight in units.values())


@settings(deadline=None, max_examples=8)
@given(st.lists(phrases.flatmap(lambda rows: st.sampled_from(rows)), min_size=2, max_size=4))
def test_nothing_jumps(drawn):
    """Within 2 ms no share changes by more than a quarter: a movement takes some hundredths of a second."""
    speech = phrase(drawn)
    one, times = SpeechTrack("s", speech), np.arange(0.2, speech.duration - 0.1, 0.002)
    for channel in ("lips", "jaw"):
        assert np.abs(np.diff(one.weights(times, channel)[1], axis=0)).max() < 0.25


@pytest.mark.parametrize("sound", ["p", "b", "m"])
@pytest.mark.parametrize("vowel", ["ɑ", "æ", "i", "u", "ɔ"])
def test_lips_close_between_open_vowels(face, sound, vowel):
    speech = speech_of(f"ˈ{vowel} {sound} ˈ{vowel}")
    clip = Clip((SpeechTrack("s", speech),), speech.duration)
    at_rest = gap(face, "neutral")
    assert np.allclose(gap(face, clip.at(middle(speech.sounds[1]))), at_rest, atol=1e-6)
    assert gap(face, clip.at(middle(speech.sounds[0]))).max() > 2.0
    # and one frame in 25 a second shows it, wherever the frames fall
    for shift in np.arange(0, 0.04, 0.005):
        frames = [clip.units_at(float(t)) for t in np.arange(shift, speech.duration, 0.04)]
        assert any(JAW not in units and "25" not in units and units["24"] == 0.5 for units in frames[5:-10])


def test_lips_close_over_every_expression(face):
    speech = speech_of("AA1 M AA1")
    at_rest = gap(face, "neutral")
    catalogue = load_units().catalogue
    for name, one in load_expressions().expressions.items():
        below = Track("e", events=(Event(0.0, Pose(catalogue.expand(one.units)), 0.0, speech.duration, 0.1),))
        clip = Clip((below, SpeechTrack("s", speech)), speech.duration)
        apart = gap(face, clip.at(middle(speech.sounds[1]))) - at_rest
        assert apart.max() < 0.02, name


def test_teeth_meet_the_lip_at_f(face):
    """Between open vowels f is what its viseme is: the lower lip at the upper teeth."""
    speech = speech_of("AA1 F AA1")
    clip = Clip((SpeechTrack("s", speech),), speech.duration)
    wanted = {code: weight for code, weight in shape_set("visemes")["viseme_FF"].weights.items() if weight}
    assert clip.units_at(middle(speech.sounds[1])) == pytest.approx(wanted, abs=1e-9)
    posed = face.pose(clip.at(middle(speech.sounds[1])), detail=2)
    mesh = face.mesh(2)
    teeth = posed[mesh.part_vertices("teeth_upper")]
    edge = teeth[(np.abs(teeth[:, 0]) < 3) & (teeth[:, 1] < teeth[:, 1].min() + 6)]
    lip = face.feature_point_places(posed)["lip_lower"]
    assert np.linalg.norm(edge - lip, axis=1).min() < 6.0          # at rest, and at aa, it is farther
    opened = face.feature_point_places(face.pose(clip.at(middle(speech.sounds[0]))))["lip_lower"]
    assert np.linalg.norm(edge - opened, axis=1).min() > 8.0


def test_teeth_nearly_meet_at_s():
    one = track("AA1 S AA1")
    jaw = one.weights([middle(one.speech.sounds[1])], "jaw")[1][0]
    assert jaw[NAMES.index("viseme_SS")] == pytest.approx(1.0)


def test_rounding_is_felt_before_the_vowel():
    """"stew" against "stee": at the s the lips are rounded already."""
    names, round_ = track("S T UW1").weights([middle(track("S T UW1").speech.sounds[0])])
    _, wide = track("S T IY1").weights([middle(track("S T IY1").speech.sounds[0])])
    assert round_[0, names.index("viseme_U")] > 3 * wide[0, names.index("viseme_I")] > 0
    # the tongue does not wait: the t closes at its middle in both
    one = track("S T UW1")
    _, shares = one._scores.near(2, middle(one.speech.sounds[1]))
    assert shares.max() == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize("text", ["AH1 M F AH1", "AA1 P F AA1", "IY1 V B IY1", "AA1 M P AA1"])
def test_neighbours_that_both_must_do_both(text):
    one = track(text)
    for sound in one.speech.sounds[1:3]:
        at = NAMES.index(sound.phoneme.visemes[0])
        assert one.weights([middle(sound)])[1][0, at] == pytest.approx(1.0, abs=1e-6)


def test_rest_before_after_and_in_a_long_pause():
    speech = speech_of("AA1 , , , , UW1")
    clip = Clip((SpeechTrack("s", speech),), speech.duration)
    pause = (speech.sounds[1].start + speech.sounds[4].end) / 2
    for t in (0.0, pause, speech.duration):
        assert max(clip.units_at(t).values(), default=0.0) < 0.02


def test_held_sounds_are_held():
    """Said slowly every sound reaches its target."""
    fast, slow = (SpeechTrack("s", speech) for speech in (speech_of("S T ER1"), speech_of("S T ER1").slower(6)))
    for k, name in enumerate(("viseme_SS", "viseme_DD", "viseme_RR")):
        here, there = (one.weights([middle(one.speech.sounds[k])])[1][0, NAMES.index(name)] for one in (fast, slow))
        assert here < there
        assert there > 0.9


@settings(deadline=None, max_examples=20)
@given(phrases, st.floats(0.0, 5.0))
def test_time_does_not_matter(drawn, shift):
    speech = phrase(drawn)
    times = np.linspace(0.1, speech.duration, 15)
    here, there = SpeechTrack("s", speech), SpeechTrack("s", speech.later(shift))
    assert np.allclose(here.weights(times)[1], there.weights(times + shift)[1], atol=1e-6)


def test_both_sides_speak_alike(face):
    clip = Clip((track("S UW1 P ER0"),), 1.0)
    assert clip.mirrored() == clip
    for t in (0.3, 0.45, 0.6):
        pose = clip.at(t)
        assert pose.deformation == pose.deformation.mirrored()
        assert all(not code.startswith(("L", "R")) for code in pose.units)


def test_effort_opens_the_mouth_and_closes_it_all_the_same():
    calm, loud = track("AH1 M AH1"), track("AH1 M AH1", effort=1.4)
    vowel, closed = middle(calm.speech.sounds[0]), middle(calm.speech.sounds[1])
    at = NAMES.index("viseme_aa")
    assert loud.weights([vowel])[1][0, at] == pytest.approx(1.4 * calm.weights([vowel])[1][0, at])
    assert np.array_equal(loud.weights([closed])[1], calm.weights([closed])[1])
    with pytest.raises(InputError, match=r"effort: expected a factor in 0\.\.2, got 3"):
        track("AA", effort=3)


def slow_shares(speech, t, channel):
    """The mean of Cohen and Massaro as the module's head has it, sound by sound, for sounds of one part."""
    times = [(one.start, one.end, one.phoneme.visemes[0], one.phoneme) for one in speech.sounds]
    times = [(times[0][0] - 1e3, times[0][0], "viseme_sil", TABLE.pause), *times,
             (times[-1][1], times[-1][1] + 1e3, "viseme_sil", TABLE.pause)]
    total: dict[str, float] = {}
    for start, end, viseme, phoneme in times:
        hold, margin = TABLE.visemes[viseme], min(0.35 * (end - start), 0.05)
        alpha = getattr(hold, channel) if phoneme.dominance is None else phoneme.dominance
        before, after = max(0.0, start + margin - t), max(0.0, t - end + margin)
        away = sum((math.hypot(tau, 0.01) - 0.01) / theta for tau, theta in ((before, hold.lead), (after, hold.lag)))
        total[viseme] = total.get(viseme, 0.0) + alpha * math.exp(-away)
    return {name: value / sum(total.values()) for name, value in total.items()}


@pytest.mark.parametrize("channel", ["lips", "jaw"])
def test_the_mean_is_cohen_and_massaros(channel):
    """Sounds that must do nothing: the shares are the plain mean."""
    speech = speech_of("T AA1 K IY0 N UH1 L")
    one = SpeechTrack("s", speech)
    for t in np.linspace(0, speech.duration, 60):
        slow = slow_shares(speech, t, channel)
        rows, shares = one._scores.near(CHANNELS.index(channel), float(t))
        fast: dict[str, float] = {}
        for k, share in zip(rows, shares, strict=True):
            fast[one._scores.visemes[k]] = fast.get(one._scores.visemes[k], 0.0) + share
        assert fast == pytest.approx({name: slow.get(name, 0.0) for name in fast}, abs=1e-6)


def test_h_takes_the_mouth_of_its_neighbours():
    one = track("AA1 HH AA1")
    t = middle(one.speech.sounds[1])
    assert one.weights([t])[1][0, NAMES.index("viseme_aa")] > 0.9
    assert SpeechTrack("s", speech_of("HH")).weights([0.25])[1].max() <= 1.0      # alone it moves nothing


def test_a_diphthong_has_two_mouths():
    one = track("AY1")
    (a, b, _), (c, d, _) = parts_of(one.speech.sounds[0])
    assert b == c
    assert [row[3] for row in one.speech.visemes] == ["viseme_aa", "viseme_I"]
    weights = one.weights([(a + b) / 2, (c + d) / 2])[1]
    assert weights[0, NAMES.index("viseme_aa")] > weights[1, NAMES.index("viseme_aa")]
    assert weights[1, NAMES.index("viseme_I")] > weights[0, NAMES.index("viseme_I")]


def test_performance():
    one = track("HH AH0 L OW1")
    made = performance_of(one, fps=50)
    assert made.vocabulary == "visemes"
    assert made.names == NAMES
    assert len(made) == round(one.end * 50)
    assert made.weights.min() >= 0
    assert made.weights.max() <= 1
    assert made.weights.sum(axis=1).max() <= 1 + 1e-9
    assert made.column("viseme_O").max() > 0.3


def test_pickle_and_poses():
    one = track("HH AH0 L OW1")
    again = pickle.loads(pickle.dumps(one))
    assert again == one
    assert again.shares(0.4) == one.shares(0.4)
    assert len(one.poses) < 40
    assert one.begins < one.end


@pytest.mark.parametrize(("sounds", "duration", "message"), [
    ((), 1.0, "nothing is said"),
    ((TimedSound(0, 1, "sil", TABLE.pause),), 1.0, "nothing is said"),
    ((TimedSound(0.5, 0.4, "a", TABLE.phonemes["a"]),), 1.0, r"sound 1 \('a'\) goes from 0.5 to 0.4"),
    ((TimedSound(-1, 0.4, "a", TABLE.phonemes["a"]),), 1.0, "times in order from 0 s"),
    ((TimedSound(0, math.nan, "a", TABLE.phonemes["a"]),), 1.0, "times in order"),
    ((TimedSound(0, 2, "a", TABLE.phonemes["a"]),), 1.0, "duration: expected seconds from 2"),
])
def test_wrong_speech(sounds, duration, message):
    with pytest.raises(InputError, match=message):
        Speech(sounds, duration)


def test_wrong_numbers():
    with pytest.raises(InputError, match="slow: expected a factor"):
        speech_of("AA").slower(0)
    with pytest.raises(InputError, match="speed: expected a factor"):
        speech_of("AA", speed=math.nan)
    with pytest.raises(InputError, match="expected one sound or more"):
        speech_of("  ")
    assert speech_of([Sound(TABLE.phonemes["a"], "a")]).duration == speech_of("a").duration

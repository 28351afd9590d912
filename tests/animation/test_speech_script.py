"""Speech in scripts of clips: where it lies, what it adds to, what is wrong with it."""

from __future__ import annotations

import numpy as np
import pytest

import facegen
from facegen.animation.coarticulation import SpeechTrack
from facegen.animation.speech import speech_of
from facegen.animation.speech_script import say, speech_clip
from facegen.errors import TableError
from facegen.fileio.sound import Sound, save_wav

PHONES = "M AA1 M AA0"


def test_speech_adds_to_a_smile_and_closes_the_lips_it_parts():
    clip = facegen.load_clip({"events": [{"at": 0, "pose": "6C+12C+25C", "onset": 0.1, "apex": 3, "offset": 0.1}],
                              "speech": {"phonemes": PHONES, "at": 0.5}})
    speech = clip.tracks[-1].speech
    first, vowel = speech.sounds[:2]
    assert first.start == pytest.approx(0.75)               # the rest before, and `at`
    closed, opened = (clip.units_at((one.start + one.end) / 2) for one in (first, vowel))
    assert "25" not in closed
    assert closed["24"] == 0.5
    assert closed["12"] == opened["12"] == 0.5              # the smile stays
    assert opened["27"] > 0.25
    before = clip.units_at(0.3)
    assert before["25"] == pytest.approx(0.5, abs=0.02)     # nothing is said yet


def test_a_track_of_speech_may_replace_otherwise():
    script = {"keyframes": [{"t": 0, "pose": "12D+26C"}, {"t": 2, "pose": "12D+26C"}],
              "tracks": [{"name": "voice", "speech": {"phonemes": PHONES}, "replace": "all"}]}
    clip = facegen.load_clip(script)
    one = clip.tracks[-1]
    assert isinstance(one, SpeechTrack)
    assert (one.name, one.replaces) == ("voice", "all")
    middle = (one.speech.sounds[1].start + one.speech.sounds[1].end) / 2
    assert clip.units_at(middle).get("12", 0.0) < 0.05
    assert clip.duration == max(2.0, one.end)


def test_files_lie_beside_the_script_and_sounds_are_mixed(tmp_path):
    (tmp_path / "a.tsv").write_text("0.0\tX\n0.2\tA\n0.5\tD\n0.8\tX\n")
    save_wav(Sound(np.full(8000, 1000, np.int16), 8000), tmp_path / "a.wav")
    script = tmp_path / "a.yaml"
    script.write_text("speech: a.tsv\n")
    assert facegen.load_clip(script).sound is None
    script.write_text("tracks:\n  - speech: {timing: a.tsv, sound: a.wav, at: 1}\n"
                      "  - speech: {timing: a.tsv, sound: a.wav, at: 3}\n")
    clip = facegen.load_clip(script)
    assert clip.duration == pytest.approx(3.8)
    assert clip.sound.duration == pytest.approx(4.0)
    assert clip.shown.sound is None                         # workers that draw need not have it
    assert clip.shown.tracks == clip.tracks
    heard = clip.sound.samples[[4000, 12_000, 20_000, 28_000]]
    assert heard.tolist() == [0, 1000, 0, 1000]


def test_an_expression_meanwhile():
    clip = speech_clip(say(phonemes=PHONES), expression=facegen.resolve("happiness"))
    assert clip.units_at(clip.duration / 2)["12"] > 0.9
    assert max(clip.units_at(0.0).values()) < 0.01          # a breath of the first sound
    assert max(clip.units_at(clip.duration).values(), default=0.0) < 0.02


def test_a_face_without_a_tongue_speaks():
    face = facegen.load_face("akimoto-1986")
    clip = speech_clip(say(phonemes="K T HH IY1"))
    for t in clip.times(25):
        assert np.isfinite(face.pose(clip.at(t), detail=0)).all()
    assert clip.raw == ()


def test_the_tongue_of_a_clip_moves():
    face = facegen.load_face()
    speech = speech_of("AA1 K AA1")
    clip = facegen.Clip((SpeechTrack("s", speech),), speech.duration)
    rows = face.mesh(0).part_vertices("tongue")
    back = [face.pose(clip.at((one.start + one.end) / 2), detail=0)[rows] for one in speech.sounds]
    behind = (back[0][:, 2] < -25) & (back[0][:, 2] > -45)
    assert back[1][behind, 1].max() > back[0][behind, 1].max() + 8.0


@pytest.mark.parametrize(("entry", "message"), [
    ({}, "clip: speech: give one of text, phonemes, timing"),
    ({"text": "a", "phonemes": "AA"}, "speech: give one of text, phonemes, timing"),
    ({"phonemes": "AA QQ"}, "speech: phonemes: position 4: 'QQ' is no code of ARPAbet; did you mean 'Q'"),
    ({"phonemes": "AA", "language": "de"}, "speech.language: language belongs to text"),
    ({"phonemes": "AA", "tier": "a"}, "speech.tier: tier belongs to timing"),
    ({"phonemes": "AA", "speed": 20}, r"speech.speed: expected a number in 0\.1\.\.10"),
    ({"phonemes": "AA", "effort": -1}, r"speech.effort: expected a number in 0\.\.2"),
    ({"phonemes": "AA", "at": "soon"}, "speech.at: expected a number, got 'soon'"),
    ({"phonemes": "AA", "alphabet": "sampa"}, "speech.alphabet: unknown alphabet 'sampa'; did you mean 'xsampa'"),
    ({"phonemes": "AA", "phonems": 1}, "unknown key 'phonems'; did you mean 'phonemes'"),
    ({"timing": "none.tsv"}, "speech: none.tsv: there is no such file"),
    ({"phonemes": "AA", "sound": "none.wav"}, "speech: none.wav: there is no such file"),
    (7, "speech: expected a text, got 7"),
])
def test_wrong_entries(entry, message):
    with pytest.raises(TableError, match=message):
        facegen.load_clip({"speech": entry})


def test_a_track_is_one_thing():
    with pytest.raises(TableError, match=r"tracks\.0: a track has either keyframes or events or speech"):
        facegen.load_clip({"tracks": [{"speech": {"phonemes": "AA"}, "events": []}]})
    with pytest.raises(TableError, match=r"duration: the clip ends at 0\.3 s, but in speech something begins at"):
        facegen.load_clip({"duration": 0.3, "speech": {"phonemes": PHONES}})

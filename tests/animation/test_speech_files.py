"""When sounds are said, from the files of others."""

from __future__ import annotations

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from facegen.animation.speech_files import read_speech
from facegen.errors import FileError, InputError
from tests.fileio.test_textgrid import long_form, short_form

RHUBARB = {"metadata": {"soundFile": "a.wav", "duration": 0.9},
           "mouthCues": [{"start": 0.0, "end": 0.1, "value": "X"}, {"start": 0.1, "end": 0.25, "value": "A"},
                         {"start": 0.25, "end": 0.6, "value": "D"}, {"start": 0.6, "end": 0.9, "value": "X"}]}
XML = """<?xml version="1.0" encoding="utf-8"?>
<rhubarbResult><metadata><soundFile>a.wav</soundFile></metadata><mouthCues>
<mouthCue start="0.00" end="0.10">X</mouthCue>
<mouthCue start="0.10" end="0.25">A</mouthCue>
<mouthCue start="0.25" end="0.60">D</mouthCue>
<mouthCue start="0.60" end="0.90">X</mouthCue>
</mouthCues></rhubarbResult>"""
TSV = "0.00\tX\n0.10\tA\n0.25\tD\n0.60\tX\n0.90\tX\n"
MFA = [("words", [(0, 0.5, "hello")]),
       ("phones", [(0, 0.08, "HH"), (0.08, 0.14, "AH0"), (0.14, 0.2, "L"), (0.2, 0.5, "OW1")])]


def rows(speech):
    return [(round(one.start, 4), round(one.end, 4), one.label) for one in speech.sounds]


def save(tmp_path, name, text):
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize(("name", "text"), [("a.json", json.dumps(RHUBARB)), ("a.xml", XML), ("a.tsv", TSV),
                                            ("a.txt", TSV.replace("\n", "\r\n"))])
def test_rhubarb(tmp_path, name, text):
    speech = read_speech(save(tmp_path, name, text))
    assert rows(speech) == [(0, 0.1, "X"), (0.1, 0.25, "A"), (0.25, 0.6, "D"), (0.6, 0.9, "X")]
    assert speech.duration == 0.9
    assert speech.visemes == [(0.1, 0.25, "A", "viseme_PP"), (0.25, 0.6, "D", "viseme_aa")]


@pytest.mark.parametrize("form", [long_form, short_form])
def test_textgrid_of_an_aligner(tmp_path, form):
    speech = read_speech(save(tmp_path, "a.TextGrid", form(MFA)))
    assert rows(speech) == [(0, 0.08, "HH"), (0.08, 0.14, "AH0"), (0.14, 0.2, "L"), (0.2, 0.5, "OW1")]
    assert [one.stress for one in speech.sounds] == [None, "none", None, "primary"]
    assert read_speech(save(tmp_path, "b.TextGrid", form([("mine", MFA[1][1]), MFA[0]])), tier="mine") \
        .sounds == speech.sounds


def test_textgrid_in_other_alphabets(tmp_path):
    ipa = save(tmp_path, "ipa.TextGrid", long_form([("phones", [(0, 0.1, "ʃ"), (0.1, 0.3, "øː"), (0.3, 0.4, "")])]))
    assert [one.phoneme.symbol for one in read_speech(ipa).sounds[:2]] == ["ʃ", "ø"]
    sampa = save(tmp_path, "mau.TextGrid", long_form([("MAU", [(0, 0.1, "S"), (0.1, 0.3, "2:"), (0.3, 0.4, "<p:>")])]))
    found = read_speech(sampa, alphabet="xsampa").sounds
    assert [one.phoneme.symbol for one in found] == ["ʃ", "ø", "X"]
    with pytest.raises(FileError, match=r"tier 'MAU', 0\.1 s: position 1: '2' is no"):
        read_speech(save(tmp_path, "m.TextGrid", long_form([("MAU", [(0.1, 0.3, "2")])])), alphabet="arpabet")


def test_noise_is_said(tmp_path):
    speech = read_speech(save(tmp_path, "a.TextGrid", long_form([("phones", [(0, 0.2, "spn"), (0.2, 0.4, "AA1")])])))
    assert speech.sounds[0].is_pause
    assert speech.warnings == ("1 stretches 'spn', noise that the aligner could not read, are shown as silence",)


def test_labels_as_lines(tmp_path):
    wanted = [(0.1, 0.18, "HH"), (0.18, 0.3, "AH0"), (0.3, 0.5, "OW1")]
    for text in ("0.10 0.18 HH\n0.18 0.30 AH0\n\n0.30 0.50 OW1\n", "0.1\t0.18\tHH\n0.18\t0.3\tAH0\n0.3\t0.5\tOW1",
                 "# a remark\nstart,end,sound\n0.1,0.18,HH\n0.18,0.3,AH0\n0.3,0.5,OW1\n",
                 "Begin,End,Label,Type,Speaker\n0.0,0.5,hello,words,a\n0.1,0.18,HH,phones,a\n0.18,0.3,AH0,phones,a\n"
                 "0.3,0.5,OW1,phones,a\n"):
        assert rows(read_speech(save(tmp_path, "a.txt", text))) == wanted
    # several sounds in one stretch share it
    speech = read_speech(save(tmp_path, "b.txt", "0.5 1.0 AA1 M\n"))
    assert [one.label for one in speech.sounds] == ["AA1", "M"]
    assert speech.sounds[0].start == 0.5
    assert speech.sounds[1].end == 1.0


def test_own_json_is_read_again(tmp_path):
    from facegen.animation.speech import speech_of
    from facegen.cli.speak import speech_data

    speech = speech_of("HH AH0 L OW1 , ʃ".replace(" , ʃ", " , SH"))
    again = read_speech(save(tmp_path, "a.json", json.dumps(speech_data(speech))))
    assert [(one.label, one.phoneme, one.stress) for one in again.sounds] == \
        [(one.label, one.phoneme, one.stress) for one in speech.sounds]
    assert [one.start for one in again.sounds] == pytest.approx([one.start for one in speech.sounds], abs=1e-4)


def changed(**cue):
    made = json.loads(json.dumps(RHUBARB))
    made["mouthCues"][1] |= cue
    return json.dumps(made)


@pytest.mark.parametrize(("name", "text", "message"), [
    ("a.json", changed(value="Q"), "mouthCues.1: 'Q' is no mouth shape of Rhubarb"),
    ("a.json", changed(start="soon"), "mouthCues.1.start: expected a number, got 'soon'"),
    ("a.json", changed(end=0.05), "mouthCues.1: ends at 0.05 s, before it starts at 0.1 s"),
    ("a.json", changed(end=0.4), "sound 3 .'D'. goes from 0.25 to 0.6 after 0.4"),
    ("a.json", changed(end=1e9), "mouthCues.1.end: expected a number in 0..86400"),
    ("a.json", "{}", r"expected Rhubarb's JSON \(mouthCues\) or that of facegen speak \(sounds\)"),
    ("a.json", '{"sounds": [{"start": 0, "end": 1, "sound": "tt"}]}', "sounds.0.sound: unknown sound 'tt'; did you"),
    ("a.json", '{"mouthCues": ', "line 1, column 15"),
    ("a.xml", "<rhubarbResult/>", "no <mouthCue start=... end=...> in it"),
    ("a.xml", XML.replace('"0.10"', '"x"'), "line 3: expected a time in seconds"),
    ("a.tsv", TSV.replace("0.25\tD", "0.05\tD"), "line 2: ends at 0.05 s, before it starts at 0.1 s"),
    ("a.txt", "0.1 0.2 HH\n0.15 0.3 AH\n", "line 2: expected times in order, got 0.15 to 0.3 after 0.2"),
    ("a.txt", "0.1 0.2 HH\n0.2 x AH\n", "line 2: expected a time in seconds, 0 to 86400, got 'x'"),
    ("a.txt", "0.1 nan HH\n", "line 1: expected a time in seconds"),
    ("a.txt", "0.1 0.2 HH\n0.2 0.3 QQ\n", "line 2: position 1: 'QQ' is no code of ARPAbet; did you mean 'Q'"),
    ("a.txt", "0.1\n", "line 1: expected start, end and sound"),
    ("a.txt", "", "no line of start, end and sound in it"),
    ("a.txt", "0 1 sil\n", "nothing is said"),
    ("a.TextGrid", "hello", "the file ends where"),
    ("a.TextGrid", long_form([("phones", [(0, 1, "QQ")])]), "tier 'phones', 0 s: position 1: 'QQ' is no code"),
])
def test_wrong_files(tmp_path, name, text, message):
    path = save(tmp_path, name, text)
    with pytest.raises(InputError, match=message) as caught:
        read_speech(path)
    assert str(caught.value).startswith(str(path))


def test_wrong_tiers(tmp_path):
    two = save(tmp_path, "a.TextGrid", long_form([("one", MFA[0][1]), ("two", MFA[1][1])]))
    with pytest.raises(InputError, match="has 2 tiers of intervals that could hold the sounds; say which: one, two"):
        read_speech(two)
    with pytest.raises(InputError, match=r"has no tier of intervals 'tow'; did you mean 'two'\? \(it has one, two\)"):
        read_speech(two, tier="tow")
    with pytest.raises(InputError, match="has no tiers of intervals"):
        read_speech(save(tmp_path, "b.TextGrid", long_form([])))
    with pytest.raises(InputError, match="is no TextGrid and has no tiers"):
        read_speech(save(tmp_path, "b.tsv", TSV), tier="two")
    with pytest.raises(FileError, match="there is no such file"):
        read_speech(tmp_path / "none.txt")


@given(st.binary(max_size=200), st.sampled_from(["a.json", "a.tsv", "a.xml", "a.txt", "a.TextGrid"]),
       st.sampled_from([b"", b"{", b"<mouthCue ", b"0.1 0.2 ", b"File type", b"\xff\xfe", b'{"mouthCues": ']))
def test_any_bytes_are_read_or_refused(tmp_path_factory, raw, name, head):
    path = tmp_path_factory.getbasetemp() / name
    path.write_bytes(head + raw)
    try:
        assert read_speech(path).sounds
    except InputError:
        return

"""Sounds are read from what people and programs write, and what is none is named with its place."""

from __future__ import annotations

import unicodedata

import pytest
from hypothesis import given
from hypothesis import strategies as st

from facegen.animation.phonemes import guess_alphabet, read_sounds
from facegen.animation.speech_table import load_speech_table, read_speech_table
from facegen.blendshapes.recipes import shape_set
from facegen.data import tables_dir
from facegen.errors import InputError, NotationError, TableError

TABLE = load_speech_table()
CMU = "AA AE AH AO AW AY B CH D DH EH ER EY F G HH IH IY JH K L M N NG OW OY P R S SH T TH UH UW V W Y Z ZH"
TIMIT = ("b d g p t k dx q jh ch s sh z zh f th v dh m n ng em en eng nx l r w y hh hv el iy ih eh ey ae aa aw ay ah "
         "ao oy ow uh uw ux er ax ix axr ax-h bcl dcl gcl pcl tcl kcl")
# The International Phonetic Association's chart of 2020: pulmonic and other consonants, vowels.
CHART = ("pbtdʈɖcɟkɡqɢʔmɱnɳɲŋɴʙrʀⱱɾɽɸβfvθðszʃʒʂʐçʝxɣχʁħʕhɦɬɮʋɹɻjɰlɭʎʟʘǀǃǂǁɓɗʄɠʛʍwɥʜʢʡɕʑɺɧ"
         "iyɨʉɯuɪʏʊeøɘɵɤoəɛœɜɞʌɔæɐaɶɑɒ")


def symbols(text, alphabet="auto"):
    return [one.phoneme.symbol for one in read_sounds(text, alphabet)]


def test_every_sound_of_cmu_and_timit():
    assert len(symbols(CMU)) == 39
    assert len(symbols(TIMIT)) == len(TIMIT.split()) == 61 - 3
    assert guess_alphabet(CMU.split()) == guess_alphabet(TIMIT.split()) == "arpabet"


def test_every_sound_of_the_chart():
    assert len(CHART) == len(set(CHART))
    for sign in CHART:
        assert len(symbols(sign, "ipa")) == 1, sign


def test_the_same_word_in_three_alphabets():
    wanted = ["h", "ə", "l", "oʊ"]
    assert symbols("HH AH0 L OW1") == symbols("hh ah0 l ow1") == symbols("həˈloʊ") == symbols("/həˈlo͡ʊ/") == wanted
    assert symbols('h@"loU', "xsampa") == wanted
    assert symbols("aI 2: S t@n 6", "xsampa") == ["aɪ", "ø", "ʃ", "t", "ə", "n", "ɐ"]


@pytest.mark.parametrize(("text", "wanted"), [
    ("t͡svˈa͡ɪ p͡fˈeːɾdə", "ts v aɪ pf e ɾ d ə"),                       # espeak-ng --ipa --tie
    ("b_ɔ̃_ʒ_ˈu_ʁ", "b ɔ ʒ u ʁ"),                                      # espeak-ng --ipa --sep=_
    ("(en)_tʃ_ˈaɪ_(ja)_l_e̞", "tʃ aɪ l e"),                            # a change of language
    ("ʃøːn̩ ˈkʰæt̚ aɪ̯", "ʃ ø n k æ t aɪ"),                              # marks of all kinds
    ("ma˥˩ ni3", "m a n i"), ("c\u0327", "ç"), ("a_ɪ", "a ɪ"), ("tʲ dˠ", "t d"),
])
def test_ipa(text, wanted):
    assert symbols(text) == wanted.split()


def test_stress_and_length():
    one, two = (one for one in read_sounds("ˈaːta") if one.phoneme.is_vowel)
    assert (one.stress, two.stress) == ("primary", "none")
    assert one.seconds > 1.5 * two.seconds
    assert [one.stress for one in read_sounds("AA1 T AA0 AA2 AA")] == ["primary", None, "none", "secondary", None]
    assert [one.stress for one in read_sounds("ata")] == [None, None, None]     # nothing was said of stress


def test_pauses():
    assert [one.phoneme.kind for one in read_sounds("AA , AA sil AA")].count("pause") == 2
    assert [one.phoneme.kind for one in read_sounds("a, a")] == ["vowel", "pause", "vowel"]


@pytest.mark.parametrize(("text", "position", "message"), [
    ("HH AH QQ", 6, "position 7: 'QQ' is no code of ARPAbet; did you mean 'Q'"),
    ("HH AX3", 3, "position 4: 'AX3' is no code"),
    ("hə$", 2, "position 3: '[$]' is no sound of the IPA"),
    ("hEl", 1, "position 2: 'E' is no sound of the IPA; did you mean 'e'.; for X-SAMPA say alphabet xsampa"),
    ("аb", 0, "position 1: 'а' is no sound"),                           # a Cyrillic letter
])
def test_what_is_no_sound_is_named_with_its_place(text, position, message):
    with pytest.raises(NotationError, match=message) as caught:
        read_sounds(text)
    assert caught.value.position == position


def test_bad_arguments():
    with pytest.raises(InputError, match="phonemes: expected a text"):
        read_sounds(["AA"])
    with pytest.raises(InputError, match="alphabet: expected auto, arpabet, ipa, xsampa, got 'arpa'; did you mean"):
        read_sounds("AA", "arpa")
    with pytest.raises(InputError, match="100000 characters at most, got 100001"):
        read_sounds("a" * 100_001)


@given(st.text(max_size=30), st.sampled_from(["auto", "arpabet", "ipa", "xsampa"]))
def test_any_text_is_read_or_refused(text, alphabet):
    try:
        found = read_sounds(text, alphabet)
    except NotationError as caught:
        error = caught
    else:
        assert all(one.seconds > 0 for one in found)
        return
    assert 0 <= error.position <= len(unicodedata.normalize("NFC", text))


@given(st.lists(st.sampled_from(sorted(TABLE.phonemes)), min_size=1, max_size=12))
def test_symbols_apart_are_read_as_they_are(names):
    assert symbols(" ".join(names), "ipa") == names


def test_the_table_is_whole():
    visemes = set(shape_set("visemes"))
    assert {name for one in TABLE.phonemes.values() for name in one.visemes} == visemes
    assert set(TABLE.visemes) == visemes
    for one in TABLE.phonemes.values():
        assert one.about
        assert all(tongue is None or tongue in TABLE.tongues for tongue in one.tongues)


@pytest.mark.parametrize(("old", "new", "message"), [
    ("p: {viseme: PP, kind: stop,", "p: {viseme: PPP, kind: stop,", "phonemes.p.viseme: unknown viseme 'PPP'"),
    ("p: {viseme: PP, kind: stop,", "p: {viseme: PP, kind: stopp,", "phonemes.p.kind: unknown kind of sound 'stopp'"),
    ("p: {viseme: PP, kind: stop,", "p: {viseme: [PP, FF, PP], kind: stop,", "phonemes.p.viseme: expected one name or"),
    ("arpabet: [P]", "arpabet: [B]", "phonemes: 'B' is both p and b"),
    ("must: [lips, jaw]", "must: [nose]", "must.0: unknown channel 'nose'"),
    ('closing: "10"', 'closing: "ten"', "mixing.closing: "),
    ("tongue: dental", "tongue: dentall", "unknown tongue 'dentall'; did you mean 'dental'"),
])
def test_a_wrong_table_is_named(tmp_path, old, new, message):
    text = (tables_dir() / "speech.yaml").read_text(encoding="utf-8")
    assert old in text
    path = tmp_path / "speech.yaml"
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(TableError, match=message):
        read_speech_table(path)

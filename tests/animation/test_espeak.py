"""Text by espeak-ng: its own sounds at the times of its own voice. Skipped without it, except where all is tested."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import numpy as np
import pytest

from facegen.animation import espeak, espeak_library
from facegen.animation.speech_script import say
from facegen.errors import InputError

TEXTS = {"en-us": "My baby may be happy now.", "en-gb": "The bird is in the church, you know.",
         "de": "Zwei schöne Pferde, ich höre.", "fr": "Un bon vin blanc, peut-être huit.",
         "es": "El perro llega mañana.", "it": "Gli gnocchi e la pizza.", "ja": "こんにちは、ふじさん",
         "pl": "Dzień dobry"}


@pytest.fixture(scope="module")
def there():
    if not espeak.installed():
        if os.environ.get("FACEGEN_CI"):
            pytest.fail("espeak-ng: must be installed where FACEGEN_CI is set")
        pytest.skip("espeak-ng is not installed")


@pytest.mark.usefixtures("there")
@pytest.mark.parametrize("language", TEXTS)
def test_languages(language):
    made = espeak.speak(TEXTS[language], language=language)
    assert made.speech.warnings == ()
    assert len(made.speech.visemes) > 6
    assert abs(made.sound.duration - made.speech.sounds[-1].end) < 0.2
    assert made.speech.about["language"] == language


@pytest.mark.usefixtures("there")
def test_times_are_those_of_the_voice():
    """While the lips of a p are closed, nothing is heard; in the middle of an a much is."""
    made = espeak.speak("papa papa", language="it")
    heard = np.abs(made.sound.samples.astype(float))

    def loud(start, end):
        return float(np.sqrt((heard[round(start * made.sound.rate): round(end * made.sound.rate)] ** 2).mean()))

    vowels = [loud(one.start, one.end) for one in made.speech.sounds if one.phoneme.symbol == "a"]
    stops = [loud(one.start, one.start + 0.4 * (one.end - one.start)) for one in made.speech.sounds
             if one.phoneme.symbol == "p"]
    assert len(vowels) == len(stops) == 4
    assert max(stops) < 0.02 * min(vowels)


@pytest.mark.usefixtures("there")
def test_the_same_text_is_said_alike_and_faster():
    one, again, quick = (espeak.speak("hello there", speed=speed) for speed in (1, 1, 2))
    assert one.speech == again.speech
    assert np.array_equal(one.sound.samples, again.sound.samples)
    assert quick.speech.duration < 0.8 * one.speech.duration


@pytest.mark.usefixtures("there")
def test_without_the_library_times_are_estimated_and_that_is_said(monkeypatch):
    exact = espeak.speak("hello there, my friend")
    monkeypatch.setattr(espeak, "_libraries", lambda: [])
    made = espeak.speak("hello there, my friend")
    assert "the times of the sounds are estimated" in made.speech.warnings[0]
    assert abs(made.speech.sounds[-1].end - made.sound.duration) < 0.01
    assert [one.phoneme.visemes for one in made.speech.sounds if not one.is_pause][:4] == \
        [one.phoneme.visemes for one in exact.speech.sounds if not one.is_pause][:4]


@pytest.mark.usefixtures("there")
def test_wrong_languages_and_texts():
    with pytest.raises(InputError, match="language: espeak-ng has no 'xx'"):
        espeak.speak("hello", language="xx")
    with pytest.raises(InputError, match=r"espeak-ng finds nothing to say in '\.\.\.' as en-us"):
        espeak.speak("...")
    assert espeak.speak("日本", language="ja").speech.warnings[0].startswith("espeak-ng reads Japanese in kana only")
    assert "de" in espeak.languages()


@pytest.mark.usefixtures("there")
def test_a_library_without_the_program(monkeypatch):
    monkeypatch.setattr(espeak, "_program", lambda: None)
    if not espeak._libraries():
        pytest.skip("the library of espeak-ng is not installed")
    assert espeak.speak("hallo", language="de").speech.visemes
    with pytest.raises(InputError, match="language: espeak-ng has no 'xx'"):
        espeak.speak("hello", language="xx")


def test_without_espeak_the_message_says_how_to_get_it(monkeypatch):
    monkeypatch.setattr(espeak, "_program", lambda: None)
    monkeypatch.setattr(espeak, "_libraries", lambda: [])
    for call in (lambda: espeak.speak("hello"), lambda: say(text="hello"), espeak.languages):
        with pytest.raises(InputError, match="is not installed: apt-get install espeak-ng"):
            call()
    assert not espeak.installed()


def test_a_library_that_fails_ends_only_its_own_process(monkeypatch, tmp_path):
    monkeypatch.setattr(espeak, "_program", lambda: None)
    monkeypatch.setattr(espeak, "_libraries", lambda: [str(tmp_path / "none.so")])
    with pytest.raises(InputError, match="is not installed"):
        espeak.speak("hello")


@pytest.mark.parametrize("text", ["", "  ", None, "a\0b", "x" * 20_001])
def test_wrong_texts(text):
    with pytest.raises(InputError, match="text: "):
        espeak.speak(text)


def test_programs_that_hang_or_are_none():
    with pytest.raises(InputError, match=r"did not answer within 0\.2 s"):
        espeak._run([sys.executable, "-c", "import time; time.sleep(9)"], "", 0.2)
    with pytest.raises(InputError, match="cannot be run"):
        espeak._run(["/no/such/program"], "")


def test_the_child_imports_nothing_of_ours():
    text = Path(espeak_library.__file__).read_text(encoding="utf-8")
    assert "import facegen" not in text
    assert "from facegen" not in text


def test_events_become_sounds_without_gaps():
    marks = [(0, "m"), (1000, "aɪ"), (3000, ""), (3100, "t\u0361ʃ"), (4000, ""), (9000, ""), (12000, "☃"), (12500, "a")]
    sounds, odd = espeak._timed(marks, 10_000, 20_000)
    assert [(one.label, round(one.start, 4), round(one.end, 4)) for one in sounds] == [
        ("m", 0, 0.1), ("aɪ", 0.1, 0.31), ("t\u0361ʃ", 0.31, 0.4), ("sil", 0.4, 1.2), ("a", 1.25, 2.0)]
    assert "☃" in odd[0]


def test_one_way_of_saying():
    with pytest.raises(InputError, match="expected one of text, phonemes and timing, got 2"):
        say(text="a", phonemes="AA")
    with pytest.raises(InputError, match="sound: a text is spoken by espeak-ng"):
        say(text="a", sound="a.wav")

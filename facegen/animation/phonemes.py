"""Sounds as people and programs write them: ARPAbet, IPA, X-SAMPA.

``HH AH0 L OW1`` is ARPAbet (CMU's codes and TIMIT's); ``həˈloʊ`` is IPA, with or without slashes, stress, length, tie
bars, diacritics, tones, and the separators and language switches of espeak-ng. Diacritics change a sound less than a
mouth can show, so they are taken off: n and the breathy, long or nasal n are one mouth.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable
from dataclasses import dataclass

from facegen.animation.speech_table import PAUSE, Phoneme, SpeechTable, load_speech_table
from facegen.errors import InputError, NotationError, nearest

ALPHABETS = ("auto", "arpabet", "ipa", "xsampa")
MAX_LENGTH = 100_000
"""Characters of one text of sounds: hours of speech."""

SILENCES = frozenset({"", "sil", "sp", "spn", "pau", "h#", "#", "#h", "epi", "<eps>", "<sil>", "<p:>", "_", "-", "<p>",
                      "viseme_sil"})
"""What aligners call a pause, in small letters; "spn" is noise that they could not read."""

_CODE = re.compile(r"([A-Za-z#\-]+?)([0-2])?", re.ASCII)
_SWITCH = re.compile(r"\([a-z]{2,3}(?:-[a-z0-9]+)*\)")          # espeak-ng changes the language: (en)
_TIES = "\u0361\u035c\u200d"
_LONG = "ː"
_STRESS = {"ˈ": "primary", "'": "primary", "ˌ": "secondary"}
# What says nothing about the mouth: brackets, syllables, half length, tones, links, release and colour of a sound.
_SILENT = frozenset("/[]{}.‿|‖ˑ˥˦˧˨˩↗↘ꜛꜜ0123456789_-ʼ˞˔˕˖˗ᵝʰʱʲʷˠˤⁿˡ\u200c*^!?\"")
_PAUSES = frozenset(",;:…–—")


@dataclass(frozen=True)
class Sound:
    """A sound that was read. phoneme: what the table says of it. label: as written.

    stress: "primary", "secondary" or "none" as written, or None where nothing was said. length: a factor.
    """

    phoneme: Phoneme
    label: str
    stress: str | None = None
    length: float = 1.0

    @property
    def seconds(self) -> float:
        """How long it lasts by itself."""
        table = load_speech_table()
        seconds = table.kinds[self.phoneme.kind] * self.length
        return seconds * (table.stress[self.stress] if self.phoneme.is_vowel and self.stress else 1.0)


def read_sounds(text: str, alphabet: str = "auto") -> list[Sound]:
    """Return the sounds of a text. "auto" takes capitals of one or two letters for ARPAbet, anything else for IPA.

    Raises NotationError, which names the place, what stands there and the nearest sound there is. ::

        read_sounds("HH AH0 L OW1")
        read_sounds("ˈʃøːnə")
    """
    if not isinstance(text, str):
        raise InputError(f"phonemes: expected a text such as 'HH AH0 L OW1', got {type(text).__name__}")
    if len(text) > MAX_LENGTH:
        raise InputError(f"phonemes: expected {MAX_LENGTH} characters at most, got {len(text)}")
    check_alphabet(alphabet)
    if alphabet == "auto":
        alphabet = guess_alphabet(text.split())
    return {"arpabet": _arpabet, "ipa": _ipa, "xsampa": _xsampa}[alphabet](text, load_speech_table())


def check_alphabet(alphabet: str) -> None:
    """Raise InputError for an alphabet that there is not."""
    if alphabet not in ALPHABETS:
        raise InputError(f"alphabet: expected {', '.join(ALPHABETS)}, got {alphabet!r}"
                         f"{nearest(str(alphabet), ALPHABETS)}")


def guess_alphabet(labels: Iterable[str]) -> str:
    """Return "arpabet" for labels in capitals, or for its codes in small letters, some of two; else "ipa"."""
    codes = load_speech_table().arpabet
    heads = [label.rstrip("012") for label in labels if not is_silence(label) and any(map(str.isalpha, label))]
    if not heads:
        return "ipa"
    if all(head.isascii() and head.isupper() for head in heads):
        return "arpabet"
    small = all(head.islower() and head.upper() in codes for head in heads)
    return "arpabet" if small and any(len(head) > 1 for head in heads) else "ipa"


def is_silence(label: str) -> bool:
    """Return whether a label means a pause."""
    return label.strip().casefold() in SILENCES


def _pause(table: SpeechTable) -> Sound:
    return Sound(table.pause, PAUSE)


def _arpabet(text: str, table: SpeechTable) -> list[Sound]:
    made = []
    for found in re.finditer(r"\S+", text):
        label = found[0]
        if is_silence(label) or label in (",", ".", ";"):
            made.append(_pause(table))
            continue
        code = _CODE.fullmatch(label)
        if code is None or code[1].upper() not in table.arpabet:
            raise _unknown(text, found.start(), label, "code of ARPAbet", table.arpabet)
        stress = {"0": "none", "1": "primary", "2": "secondary"}.get(code[2])
        symbol = table.arpabet.get(label.upper(), table.arpabet[code[1].upper()])       # AH0 is not AH1
        made.append(Sound(table.phonemes[symbol], label, stress))
    return made


def _xsampa(text: str, table: SpeechTable) -> list[Sound]:
    made: list[Sound] = []
    for word in re.finditer(r"\S+", text):
        if is_silence(word[0]):
            made.append(_pause(table))
            continue
        signs = re.sub(r"_[^\s_]", "", word[0]).replace("`", "").replace("\\", "")
        made += _ipa("".join(table.xsampa.get(sign, sign) for sign in signs), table, word.start())
    return made


def _ipa(text: str, table: SpeechTable, base: int = 0) -> list[Sound]:
    """Return sounds; ``base`` is where the text stands in a longer one."""
    # Each base sign with the place where it stands; marks go with the sign before them.
    whole = unicodedata.normalize("NFC", text)
    decomposed = [(sign, place) for place, letter in enumerate(whole)
                  for sign in (letter if letter in table.spellings else unicodedata.normalize("NFD", letter))]
    switches = {place for found in _SWITCH.finditer(whole) for place in range(*found.span())}
    signs = [(sign, place) for sign, place in decomposed if place not in switches]
    longest = max(map(len, table.spellings))
    made: list[Sound] = []
    stress: str | None = None
    said = any(sign in _STRESS for sign, _ in signs)
    k = 0
    while k < len(signs):
        sign, place = signs[k]
        if sign in _STRESS:
            stress, k = _STRESS[sign], k + 1
        elif sign.isspace() or sign in _SILENT or sign in _TIES or unicodedata.combining(sign):
            k += 1
        elif sign == _LONG:
            if made:
                made[-1] = Sound(made[-1].phoneme, made[-1].label + sign, made[-1].stress, table.stress["long"])
            k += 1
        elif sign in _PAUSES:
            made.append(_pause(table))
            k += 1
        else:
            symbol, used = _match(signs, k, table, longest)
            if symbol is None:
                raise _unknown(whole, place, sign, "sound of the IPA", table.spellings, base)
            phoneme, label = table.phonemes[symbol], whole[place:signs[k + used - 1][1] + 1]
            mine = None
            if phoneme.is_vowel:
                mine, stress = stress or ("none" if said else None), None
            made.append(Sound(phoneme, label, mine))
            k += used
    return made


def _match(signs: list[tuple[str, int]], k: int, table: SpeechTable, longest: int) -> tuple[str | None, int]:
    """Return the symbol of the longest spelling that begins at sign k, marks passed over, and how many it takes."""
    letters, best, n = "", (None, 1), k
    while n < len(signs) and len(letters) < longest:
        sign = signs[n][0]
        if unicodedata.combining(sign) or sign in _TIES:
            n += 1
            continue
        if sign.isspace() or sign in _STRESS or sign in _PAUSES or (sign in _SILENT and not sign.isalpha()):
            break
        letters, n = letters + sign, n + 1
        if letters in table.spellings:
            best = (table.spellings[letters], n - k)
    return best


def _unknown(text: str, place: int, got: str, what: str, valid: Iterable[str], base: int = 0) -> NotationError:
    valid = list(valid)
    near = nearest(got, valid) or nearest(unicodedata.normalize("NFKD", got)[:1].casefold(), valid)
    hint = "; for X-SAMPA say alphabet xsampa" if got in load_speech_table().xsampa else ""
    return NotationError(f"phonemes: position {base + place + 1}: '{got}' is no {what}{near}{hint}", text=text,
                         position=base + place)

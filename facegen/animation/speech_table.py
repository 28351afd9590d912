"""The table of speech, ``tables/speech.yaml``: sounds, how long they last, and how they hold the mouth."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from facegen.blendshapes.recipes import shape_set
from facegen.data import tables_dir
from facegen.errors import InputError
from facegen.facs.deformation import Deformation, deformation_from_entry
from facegen.facs.notation import parse
from facegen.facs.tables import load_units
from facegen.facs.validate import Entry
from facegen.facs.yamlfile import read_data

CHANNELS = ("lips", "jaw", "tongue")
SILENCE = "viseme_sil"
PAUSE = "sil"
"""The label of silence."""

_LONGEST = 5.0      # seconds of one sound by itself, and of what it is felt before and after


@dataclass(frozen=True)
class Phoneme:
    """One sound. visemes, tongues: one, or two that follow each other; a tongue of None is free.

    amount: share of the visemes, 0..1. kind: what sets its duration. dominance: instead of the visemes' own.
    """

    symbol: str
    visemes: tuple[str, ...]
    kind: str
    about: str
    amount: float = 1.0
    tongues: tuple[str | None, ...] = (None,)
    dominance: float | None = None
    arpabet: tuple[str, ...] = ()
    also: tuple[str, ...] = ()

    @property
    def is_vowel(self) -> bool:
        """Whether it carries a syllable's stress."""
        return self.kind in ("vowel", "diphthong")


@dataclass(frozen=True)
class Hold:
    """How a viseme holds its place: dominance of lips and jaw 0..1, seconds felt before and after, what must be."""

    lips: float
    jaw: float
    lead: float
    lag: float
    must: tuple[str, ...] = ()


@dataclass(frozen=True)
class Tongue:
    """Where the tongue goes, how strongly (0..1), and whether it has to arrive."""

    hold: float
    deformation: Deformation
    must: bool = False


@dataclass(frozen=True)
class SpeechTable:
    """The whole table. spellings: IPA -> symbol; arpabet: code -> symbol; xsampa: sign -> IPA.

    replaces, closing: atoms of an expression that fade while the mouth speaks, and while the lips must meet.
    """

    phonemes: Mapping[str, Phoneme]
    rhubarb: Mapping[str, Phoneme]
    kinds: Mapping[str, float]
    stress: Mapping[str, float]
    visemes: Mapping[str, Hold]
    tongues: Mapping[str, Tongue]
    spellings: Mapping[str, str]
    arpabet: Mapping[str, str]
    xsampa: Mapping[str, str]
    replaces: frozenset[str]
    closing: frozenset[str]

    @property
    def pause(self) -> Phoneme:
        """Silence."""
        return self.rhubarb["X"]


@cache
def load_speech_table() -> SpeechTable:
    """Return the shipped table, read once."""
    return read_speech_table(tables_dir() / "speech.yaml")


def read_speech_table(path: Path) -> SpeechTable:
    """Return the table of a file; TableError names what is wrong in it."""
    top = Entry(read_data(path), str(path)).fields(required=(
        "sources", "kinds", "stress", "visemes", "tongues", "phonemes", "xsampa", "rhubarb", "mixing"))
    for entry in dict(top["sources"].items()).values():
        entry.text()
    known = {name.removeprefix("viseme_"): name for name in shape_set("visemes")}
    kinds = {name: entry.number(0.01, _LONGEST) for name, entry in top["kinds"].items()}
    stress = {name: entry.number(0.1, 10.0)
              for name, entry in top["stress"].fields(required=("primary", "secondary", "none", "long")).items()}
    visemes = {known[name]: _hold(entry) for name, entry in top["visemes"].fields(required=tuple(known)).items()}
    tongues = {name: _tongue(entry) for name, entry in top["tongues"].items()}
    phonemes = {name: _phoneme(name, entry, kinds, known, tongues) for name, entry in top["phonemes"].items()}
    rhubarb = {name: _phoneme(name, entry, kinds, known, tongues)
               for name, entry in top["rhubarb"].fields(required=tuple("ABCDEFGHX")).items()}
    mixing = top["mixing"].fields(required=("replaces", "closing"))
    return SpeechTable(phonemes, rhubarb, kinds, stress, visemes, tongues,
                       _index(top["phonemes"], phonemes, lambda one: (one.symbol, *one.also)),
                       _index(top["phonemes"], phonemes, lambda one: one.arpabet),
                       {sign: entry.text() for sign, entry in top["xsampa"].items()},
                       _atoms(mixing["replaces"]), _atoms(mixing["closing"]))


def _hold(entry: Entry) -> Hold:
    fields = entry.fields(required=("lips", "jaw", "lead", "lag"), optional=("must",))
    must = tuple(one.choice(("lips", "jaw"), "channel") for one in fields["must"].each()) if "must" in fields else ()
    return Hold(fields["lips"].number(0.0, 1.0), fields["jaw"].number(0.0, 1.0),
                fields["lead"].number(0.01, _LONGEST), fields["lag"].number(0.01, _LONGEST), must)


def _tongue(entry: Entry) -> Tongue:
    fields = entry.fields(required=("hold",), optional=("points", "must"))
    raw = Deformation()
    if "points" in fields:
        raw = deformation_from_entry(Entry({"points": fields["points"].value}, entry.source, entry.path))
    return Tongue(fields["hold"].number(0.0, 1.0), raw, "must" in fields and fields["must"].flag())


def _phoneme(name: str, entry: Entry, kinds: Mapping[str, float], visemes: Mapping[str, str],
             tongues: Mapping[str, Tongue]) -> Phoneme:
    fields = entry.fields(required=("viseme", "kind", "about"),
                          optional=("amount", "tongue", "dominance", "arpabet", "also"))

    def several(key: str, valid: Mapping[str, object]) -> tuple[str, ...]:
        value = fields[key]
        found = tuple(one.choice(valid, key) for one in (value.each() if isinstance(value.value, list) else (value,)))
        if not 1 <= len(found) <= 2:
            raise value.wrong("one name or two")
        return found

    return Phoneme(name, tuple(visemes[one] for one in several("viseme", visemes)),
                   fields["kind"].choice(kinds, "kind of sound"), fields["about"].text(),
                   fields["amount"].number(0.0, 1.0) if "amount" in fields else 1.0,
                   several("tongue", tongues) if "tongue" in fields else (None,),
                   fields["dominance"].number(0.0, 1.0) if "dominance" in fields else None,
                   fields["arpabet"].texts() if "arpabet" in fields else (),
                   fields["also"].texts() if "also" in fields else ())


def _index(entry: Entry, phonemes: Mapping[str, Phoneme], spellings) -> dict[str, str]:
    found: dict[str, str] = {}
    for name, one in phonemes.items():
        for spelling in spellings(one):
            if found.setdefault(spelling, name) != name:
                raise entry.fail(f"'{spelling}' is both {found[spelling]} and {name}")
    return found


def _atoms(entry: Entry) -> frozenset[str]:
    try:
        return frozenset(load_units().catalogue.expand(parse(entry.text())))
    except InputError as error:
        raise entry.fail(str(error)) from error
